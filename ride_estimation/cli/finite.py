# Copyright 2026 ride_estimation contributors
"""Numbers of the command line: ``nan`` and ``inf`` are numbers to Python and no input to anything here."""

from __future__ import annotations

import argparse
import math

from ride_estimation.errors import InputDataError


def require_finite(options: argparse.Namespace) -> None:
    """Refuse options that are not finite, all at once.

    Raises
    ------
    InputDataError
        Names every such option with its value.
    """
    wrong = []
    for name, value in vars(options).items():
        for number in value if isinstance(value, (list, tuple)) else [value]:
            if isinstance(number, float) and not math.isfinite(number):
                wrong.append(f"--{name.replace('_', '-')} {number:g}")
    if wrong:
        raise InputDataError(f"{', '.join(wrong)}: allowed are finite numbers")
