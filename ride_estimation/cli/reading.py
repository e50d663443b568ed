# Copyright 2026 ride_estimation contributors
"""How columns and units of a bench record are found, as a command line says it."""

from __future__ import annotations

import argparse

from ride_estimation.io.bench_records import ReadOptions


def reading_options(options: argparse.Namespace) -> ReadOptions:
    """Return the reading options of the command line."""
    return ReadOptions(
        time=options.time,
        displacement=options.displacement,
        force=options.force,
        time_unit=options.time_unit,
        displacement_unit=options.displacement_unit,
        force_unit=options.force_unit,
        rate_hz=options.rate,
        zero=options.zero,
        sign=options.sign,
        mount=options.mount,
        axis=options.axis,
        accept_stiffness=options.accept_stiffness,
    )
