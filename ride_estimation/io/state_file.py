# Copyright 2026 ride_estimation contributors
"""What the estimator has learned, on disk: a state that continues after a restart and a vehicle file with the values."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.estimate import Status
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import save_vehicle
from ride_estimation.vehicles.identified import with_identified

#: estimates with one of these are written as values; the others stay what the vehicle file says
IDENTIFIED = (Status.VALID, Status.ESTIMATING)


def save_results(folder: str | Path, pipeline: Pipeline) -> tuple[Path, Path]:
    """Write ``<vehicle>_identified.yaml`` and ``<vehicle>_state.json``, each completely or not at all.

    Parameters
    ----------
    folder
        Created where it does not exist.
    pipeline
        The estimator.

    Returns
    -------
    tuple
        Path of the vehicle file and of the state.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    name = pipeline.vehicle.name or "vehicle"
    vehicle_file = folder / f"{name}_identified.yaml"
    state_file = folder / f"{name}_state.json"
    values = {
        e.name: (e.value, e.std)
        for e in pipeline.parameters()
        if e.status in IDENTIFIED and math.isfinite(e.value) and math.isfinite(e.std) and e.std > 0.0
    }
    temporary = vehicle_file.with_suffix(".tmp")
    save_vehicle(with_identified(pipeline.vehicle, values, "identified by ride_estimation"), temporary)
    os.replace(temporary, vehicle_file)
    temporary = state_file.with_suffix(".tmp")
    temporary.write_text(json.dumps(pipeline.save_state(), allow_nan=False, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, state_file)
    return vehicle_file, state_file


def load_state(path: str | Path) -> dict[str, Any]:
    """Read a state written by :func:`save_results`.

    Raises
    ------
    InputDataError
        The file is missing or not such a state; whether it fits the vehicle is checked by the pipeline.
    """
    path = Path(path)
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputDataError(f"{path}: saved state cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise InputDataError(f"{path}: not a saved state ({error}); delete it to start from the vehicle file") from error
    if not isinstance(state, dict) or "schema" not in state:
        raise InputDataError(f"{path}: not a saved state (no schema); delete it to start from the vehicle file")
    return state
