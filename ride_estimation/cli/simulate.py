# Copyright 2026 ride_estimation contributors
"""``ride-estimation simulate``: a scenario file to a bag and its truth."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.api.simulating import simulate
from ride_estimation.cli.progress import Progress
from ride_estimation.io.results import require_folder

HELP = "simulate a field run from a scenario file: writes a bag and its truth"
EXAMPLES = """\
  ride-estimation simulate bags/standing/recipe.yaml --out out/standing

The bag is read by every other command; truth.json and truth.npz beside it hold what the estimates should find.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "scenario", type=Path, metavar="SCENARIO.yaml", help="scenario file; config/scenarios/every_key.yaml explains all keys"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for bag, recipe and truth")
    parser.add_argument(
        "--vehicle", metavar="V.yaml", help="vehicle file, or the name of a bundled one, instead of the one the scenario names"
    )


def run(options: argparse.Namespace) -> int:
    """Simulate and write; print what was written."""
    require_folder(options.out)
    progress = Progress(1.2, f"simulate {options.scenario.stem}")
    found = simulate(options.scenario, options.vehicle, progress=progress.update)
    bag = found.save(options.out)
    progress.update(0.2)
    progress.close()
    recording = found.field_run.recording
    messages = sum(len(c.stamp_ns) for c in recording.channels.values())
    print(f"{bag}: {messages} samples of {len(recording.channels)} sensors, {found.scenario.duration:g} s")
    print(f"{options.out / 'truth.npz'}: {', '.join(found.field_run.truth.signals)}")
    return 0
