# Copyright 2026 ride_estimation contributors
"""``ride-estimation simulate``: a scenario file to a bag and its truth."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.progress import Progress
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.field_run_files import write_field_run
from ride_estimation.io.results import require_folder
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.field_run import run_scenario

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


def find_vehicle(scenario: Path, named: str) -> Path:
    """Return the vehicle file a scenario names: relative to the scenario, to one of its parents, or to here.

    Raises
    ------
    ConfigurationError
        None of these exists; the message lists the places.
    """
    places = [folder / named for folder in (*scenario.resolve().parents, Path.cwd())]
    for place in places:
        if place.is_file():
            return place
    raise ConfigurationError(
        f"vehicle: {named!r} does not exist beside the scenario, in a folder above it or here; give --vehicle",
        where=str(scenario),
    )


def run(options: argparse.Namespace) -> int:
    """Simulate and write; print what was written."""
    scenario = load_scenario(options.scenario)
    require_folder(options.out)
    vehicle = load_vehicle(options.vehicle or find_vehicle(options.scenario, scenario.vehicle_file))
    progress = Progress(1.2, f"simulate {scenario.name}")
    result = run_scenario(scenario, vehicle, progress.update)
    bag = write_field_run(options.out, result, scenario, vehicle, options.scenario)
    progress.update(0.2)
    progress.close()
    messages = sum(len(c.stamp_ns) for c in result.recording.channels.values())
    print(f"{bag}: {messages} samples of {len(result.recording.channels)} sensors, {scenario.duration:g} s")
    print(f"{options.out / 'truth.npz'}: {', '.join(result.truth.signals)}")
    return 0
