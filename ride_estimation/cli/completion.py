# Copyright 2026 ride_estimation contributors
"""``ride-estimation completion``: completion of verbs and options for a shell."""

from __future__ import annotations

import argparse

from ride_estimation.cli import main as command
from ride_estimation.errors import InputDataError


def run(options: argparse.Namespace) -> int:
    """Print the script."""
    try:
        import shtab
    except ImportError as error:
        raise InputDataError("completion needs the extra 'completion': pip install 'ride_estimation[completion]'") from error
    print(shtab.complete(command.build_parser(), shell=options.shell))
    return 0
