# Copyright 2026 ride_estimation contributors
"""Writing a simulated field run: bag, recipe, truth.json, truth.npz."""

from __future__ import annotations

import hashlib
import shutil
from importlib import metadata
from pathlib import Path

import numpy as np

import ride_estimation
from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import replacing
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.json_file import write_json
from ride_estimation.simulation.field_run import FieldRun
from ride_estimation.simulation.scenario import Scenario
from ride_estimation.vehicles.vehicle import Vehicle

TRUTH_SCHEMA = "ride_estimation/truth/1"


def write_field_run(directory: str | Path, run: FieldRun, scenario: Scenario, vehicle: Vehicle, recipe: str | Path) -> Path:
    """Write ``bag/``, ``recipe.yaml``, ``truth.json`` and ``truth.npz``; return the bag's folder.

    Parameters
    ----------
    directory
        Is created; a bag that is already there is not overwritten.
    vehicle
        The loaded vehicle file.
    recipe
        The scenario file, copied beside the bag.

    Raises
    ------
    InputDataError
        The directory holds a run already.
    """
    directory, recipe = Path(directory), Path(recipe)
    bag = directory / "bag"
    if bag.exists():
        raise InputDataError(f"{directory}: holds a bag already; choose another --out or remove it first")
    directory.mkdir(parents=True, exist_ok=True)
    if recipe.resolve() != (directory / "recipe.yaml").resolve():
        shutil.copyfile(recipe, directory / "recipe.yaml")
    write_bag(bag, run.recording, vehicle.sensors)
    truth = {
        "schema": TRUTH_SCHEMA,
        "scenario": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "duration_s": scenario.duration,
        "start_stamp_ns": scenario.start_ns,
        "vehicle": {"name": vehicle.name, "file": scenario.vehicle_file, "checksum": vehicle.checksum},
        "recipe_sha256": hashlib.sha256(recipe.read_bytes()).hexdigest(),
        "software": {
            "ride_estimation": ride_estimation.__version__,
            **{name: metadata.version(name) for name in ("numpy", "scipy")},
        },
        "signals": {name: {"shape": list(a.shape), "dtype": str(a.dtype)} for name, a in run.truth.signals.items()},
        "parameters": run.truth.parameters,
        "faults": [
            {
                "sensor": f.sensor, "kind": f.kind, "from_s": f.begin, "to_s": None if np.isinf(f.end) else f.end,
                "size": f.size, "axis": f.axis,
            }
            for f in scenario.faults
        ],
    }
    with replacing(directory / "truth.npz") as new:
        np.savez_compressed(new, **run.truth.signals)  # type: ignore[arg-type]
    write_json(directory / "truth.json", truth)
    return bag
