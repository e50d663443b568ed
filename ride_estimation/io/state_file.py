# Copyright 2026 ride_estimation contributors
"""What the estimator has learned, on disk: a state that continues after a restart and a vehicle file with the values.

A saved state says which vehicle and which version it is of and carries a checksum. It is used only if all of that is right, if it
has the form a state of this vehicle has, and if the parameters it leads to are numbers within their bounds.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

import ride_estimation
from ride_estimation.errors import InputDataError
from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.json_file import read_json
from ride_estimation.io.packed_arrays import pack, unpack
from ride_estimation.io.vehicle_file import vehicle_to_mapping
from ride_estimation.vehicles.identified import with_identified, with_seen
from ride_estimation.vehicles.vehicle import Vehicle

SAVED_SCHEMA = "ride_estimation/saved_state/2"
#: 1 is the same with every number written out
READ_SCHEMAS = (SAVED_SCHEMA, "ride_estimation/saved_state/1")
#: estimates with one of these are written as values; the others stay what the vehicle file says
IDENTIFIED = (Status.VALID, Status.ESTIMATING)
#: what a state that is not one may raise while it is taken up
_MISFITS = (KeyError, TypeError, ValueError, IndexError, AttributeError, ArithmeticError)
_LONGEST_NAME = 100


def save_results(folder: str | Path, pipeline: Pipeline) -> tuple[Path, Path]:
    """Write ``<vehicle>_identified.yaml`` and ``<vehicle>_state.json``, each completely or not at all.

    Parameters
    ----------
    folder
        Created where it does not exist; nothing is written elsewhere, whatever the vehicle is called.
    pipeline
        The estimator.

    Returns
    -------
    tuple
        Path of the vehicle file and of the state.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    name = file_name(pipeline.vehicle.name)
    vehicle_file = folder / f"{name}_identified.yaml"
    values = {
        e.name: (e.value, e.std)
        for e in pipeline.parameters()
        if e.status in IDENTIFIED and math.isfinite(e.value) and math.isfinite(e.std) and e.std > 0.0
    }
    vehicle = with_seen(with_identified(pipeline.vehicle, values, "identified by ride_estimation"), pipeline.seen())
    identified = vehicle_to_mapping(vehicle)
    write_atomically(vehicle_file, yaml.safe_dump(identified, sort_keys=False, allow_unicode=True, width=120))
    return vehicle_file, save_state(folder / f"{name}_state.json", pipeline)


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """What an estimator has learned at one moment; the estimator may go on while it is written.

    Attributes
    ----------
    vehicle
        Whose state it is.
    state
        Of ``Pipeline.save_state``: shares nothing with the estimator that changes.
    """

    vehicle: Vehicle
    state: Mapping[str, Any]

    @classmethod
    def of(cls, pipeline: Pipeline) -> Snapshot:
        """Return the state of an estimator as it is now."""
        return cls(pipeline.vehicle, pipeline.save_state())

    def write(self, path: str | Path) -> Path:
        """Write the state, completely or not at all; return the path.

        Parameters
        ----------
        path
            File; its folder is created where it does not exist.

        Raises
        ------
        OSError
            The file cannot be written.
        InputDataError
            A number of the state is not finite; such a state is never written.
        """
        path = Path(path)
        try:
            state = pack(self.state)
            document = {
                "schema": SAVED_SCHEMA,
                "software": ride_estimation.__version__,
                "vehicle": {"name": self.vehicle.name, "fingerprint": fingerprint(self.vehicle)},
                "sha256": hashlib.sha256(_text(state).encode()).hexdigest(),
                "state": state,
            }
            text = json.dumps(document, allow_nan=False)
        except (ValueError, InputDataError) as error:
            raise InputDataError(f"{path}: the state is not one that can be saved ({error})") from error
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text + "\n")
        return path


def save_state(path: str | Path, pipeline: Pipeline) -> Path:
    """Write the state of an estimator as it is now; see :meth:`Snapshot.write`."""
    return Snapshot.of(pipeline).write(path)


def load_state(path: str | Path) -> dict[str, Any]:
    """Read a state written by :func:`save_state`, by this version or one that wrote every number out.

    Raises
    ------
    InputDataError
        The file is missing, damaged, or not such a state; whether it fits the vehicle is checked by :func:`restore_state`.
    """
    path = Path(path)
    try:
        document = read_json(path)
    except InputDataError as error:
        raise InputDataError(f"saved state {error}; delete it to start from the vehicle file") from error
    if document.get("schema") not in READ_SCHEMAS or not isinstance(document.get("state"), dict):
        raise InputDataError(
            f"{path}: not a saved state (schema is {document.get('schema')!r}, not {SAVED_SCHEMA!r}); delete it to start from "
            "the vehicle file"
        )
    if document.get("sha256") != _digest(document["state"]):
        raise InputDataError(
            f"{path}: the saved state is damaged (its checksum is wrong); delete it to start from the vehicle file"
        )
    try:
        return {**document, "state": unpack(document["state"])}
    except InputDataError as error:
        raise InputDataError(f"{path}: the saved state is damaged ({error}); delete it to start from the vehicle file") from error


def restore_state(path: str | Path, pipeline: Pipeline) -> None:
    """Let an estimator continue from a saved state; where the state cannot be used, the estimator stays as it is.

    Parameters
    ----------
    path
        File written by :func:`save_state`.
    pipeline
        A fresh estimator.

    Raises
    ------
    InputDataError
        As :func:`load_state`; or the state is of another vehicle or version, or has numbers that cannot be.
    """
    path = Path(path)
    document = load_state(path)
    given, own = document.get("software"), ride_estimation.__version__
    if not isinstance(given, str) or given.split(".")[:2] != own.split(".")[:2]:
        raise InputDataError(
            f"{path}: the saved state is of version {given!r}, this is {own}; delete it to start from the vehicle file"
        )
    vehicle = document.get("vehicle")
    if not isinstance(vehicle, dict) or vehicle.get("fingerprint") != fingerprint(pipeline.vehicle):
        name = vehicle.get("name") if isinstance(vehicle, dict) else None
        raise InputDataError(
            f"{path}: the saved state is of the vehicle {name!r} as its file was then; {pipeline.vehicle.name!r} is another or "
            "its file has changed since. Delete the state to start from the vehicle file"
        )
    trial = Pipeline(pipeline.vehicle, pipeline.settings)
    try:
        trial.load_state(document["state"])
        problem = _problem(document["state"], trial)
    except InputDataError:
        raise
    except _MISFITS as error:
        problem = f"it has not the form of a state ({type(error).__name__}: {error})"
    if problem:
        raise InputDataError(f"{path}: the saved state cannot be used: {problem}; delete it to start from the vehicle file")
    pipeline.load_state(document["state"])


def fingerprint(vehicle: Vehicle) -> str:
    """Return the SHA-256 of what a vehicle file means: comments, order of keys and texts that describe do not count."""
    return hashlib.sha256(_text(_meaning(vehicle_to_mapping(vehicle))).encode()).hexdigest()


def file_name(text: str) -> str:
    """Return a name from outside as part of a file name: letters, digits, ``_``, ``-`` and inner dots, never a path.

    Parameters
    ----------
    text
        Name of a vehicle, a topic or a run.
    """
    return re.sub(r"[^\w.-]+", "_", text).strip(".")[:_LONGEST_NAME] or "vehicle"


def _meaning(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _meaning(v) for k, v in value.items() if k not in ("description", "source")}
    return [_meaning(v) for v in value] if isinstance(value, (list, tuple)) else value


def _text(value: Any) -> str:
    return json.dumps(value, allow_nan=False, sort_keys=True, separators=(",", ":"))


def _digest(state: Any) -> str:
    """Return the checksum of a state, empty where it holds what no state holds (NaN)."""
    try:
        return hashlib.sha256(_text(state).encode()).hexdigest()
    except (ValueError, RecursionError):
        return ""


def _problem(state: Mapping[str, Any], loaded: Pipeline) -> str:
    """Return what is wrong with the numbers of a state, empty where nothing is."""
    # the settings are those of the run that saved, and not taken up
    shape = _different({**loaded.save_state(), "settings": None}, {**state, "settings": None}, "state")
    if shape:
        return shape
    for e in loaded.parameters():
        if not (math.isfinite(e.value) and math.isfinite(e.std) and e.value > 0.0 and e.std >= 0.0):
            return f"{e.name} would be {e.value:g} with standard deviation {e.std:g}"
        if e.prior > 0.0 and not 1e-4 < e.value / e.prior < 1e4:
            return f"{e.name} would be {e.value:g}, the vehicle file says {e.prior:g}"
    return ""


def _different(back: Any, given: Any, where: str) -> str:
    """Return where what an estimator took up differs in form from what it was given, empty where it does not.

    Nothing and an empty list are the same: something that has not begun.
    """
    if back in (None, []) and given in (None, []):
        return ""
    if isinstance(back, Mapping):
        if not isinstance(given, Mapping) or {str(k) for k in back} != set(given):
            return f"{where} has other entries"
        return next((t for t in (_different(v, given[str(k)], f"{where}.{k}") for k, v in back.items()) if t), "")
    if isinstance(back, (list, tuple)):
        if not isinstance(given, list) or len(given) != len(back):
            return f"{where} has another length"
        return next((t for t in (_different(b, g, f"{where}[{i}]") for i, (b, g) in enumerate(zip(back, given))) if t), "")
    if isinstance(back, float) and not math.isfinite(back):
        return f"{where} is not finite"
    numbers = isinstance(back, (int, float)) and isinstance(given, (int, float))
    return "" if numbers or type(back) is type(given) else f"{where} is {given!r}"
