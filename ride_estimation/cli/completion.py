# Copyright 2026 ride_estimation contributors
"""``ride-estimation completion``: completion of verbs and options for a shell."""

from __future__ import annotations

import argparse

from ride_estimation.cli import main as command
from ride_estimation.errors import InputDataError

HELP = "print the completion of this command for a shell: verbs, options and files by the tab key"
SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """\
  eval "$(ride-estimation completion bash)"                                            for this terminal
  ride-estimation completion bash > ~/.local/share/bash-completion/completions/ride-estimation     for good
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("shell", choices=SHELLS, help="which shell")


def run(options: argparse.Namespace) -> int:
    """Print the script."""
    try:
        import shtab
    except ImportError as error:
        raise InputDataError("completion needs the extra 'completion': pip install 'ride_estimation[completion]'") from error
    print(shtab.complete(command.build_parser(), shell=options.shell))
    return 0
