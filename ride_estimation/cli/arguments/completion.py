# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation completion``."""

from __future__ import annotations

import argparse

HELP = "print tab completion of commands, options and files for a shell"
SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """\
  eval "$(ride-estimation completion bash)"                                            for this terminal
  ride-estimation completion bash > ~/.local/share/bash-completion/completions/ride-estimation     for good
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("shell", choices=SHELLS, help="which shell")
