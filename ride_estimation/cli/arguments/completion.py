# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation completion``."""

from __future__ import annotations

import argparse

HELP = "print the completion of this command for a shell: verbs, options and files by the tab key"
SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """\
  eval "$(ride-estimation completion bash)"                                            for this terminal
  ride-estimation completion bash > ~/.local/share/bash-completion/completions/ride-estimation     for good
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("shell", choices=SHELLS, help="which shell")
