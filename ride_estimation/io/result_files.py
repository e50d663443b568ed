# Copyright 2026 ride_estimation contributors
"""Finished replays read back from their folders."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.json_file import read_json
from ride_estimation.io.results import RESULT_SCHEMA, sha256_of

Array = NDArray[np.float64]

DIAGNOSIS_SCHEMA = "ride_estimation/diagnosis/1"


@dataclasses.dataclass(frozen=True)
class FinishedReplay:
    """``result.json`` and the arrays of ``signals.npz`` of one folder; ``mount_force`` smoothed where that was computed."""

    name: str
    result: Mapping[str, Any]
    mount_names: tuple[str, ...]
    time_s: Array
    valid: NDArray[np.bool_]
    cg_accel: Array
    mount_force: Array


def read_replay(folder: str | Path) -> FinishedReplay:
    """Read the results of one replay.

    Parameters
    ----------
    folder
        The ``--out`` folder of a replay.

    Raises
    ------
    InputDataError
        Missing, unreadable or foreign files.
    """
    folder = Path(folder)
    result, signals = read_result(folder), read_arrays(folder / "signals.npz")
    try:
        arrays = {name: signals[name] for name in ("time_s", "valid", "cg_accel", "mount_force", "mount_names")}
        arrays["mount_force"] = signals.get("mount_force_smoothed", signals.get("mount_force_hindsight", arrays["mount_force"]))
    except KeyError as error:
        raise InputDataError(f"{folder}/signals.npz: the array {error} is missing: no results of a replay") from error
    if result.get("schema") != RESULT_SCHEMA:
        raise InputDataError(f"{folder}/result.json: schema is not {RESULT_SCHEMA}")
    problems = [*_result_problems(result), *_signal_problems(arrays)]
    if problems:
        raise InputDataError(f"{folder}: not the results of a replay: {'; '.join(problems[:5])}")
    return FinishedReplay(
        folder.name, result, tuple(str(n) for n in arrays["mount_names"]), arrays["time_s"], arrays["valid"], arrays["cg_accel"],
        arrays["mount_force"],
    )  # fmt: skip


def read_result(folder: Path) -> dict[str, Any]:
    """Return ``result.json`` of a finished replay after a check that ``signals.npz`` beside it was written with it.

    Results of versions that did not write the digest of the signals are read as they are.

    Raises
    ------
    InputDataError
        The replay did not finish, or the files are of two replays.
    """
    if not (folder / "result.json").exists() and (folder / "signals.npz").exists():
        raise InputDataError(f"{folder}: signals.npz without result.json: the replay did not finish; repeat it")
    result = read_json(folder / "result.json")
    wanted = result.get("signals_sha256")
    try:
        fits = wanted is None or sha256_of(folder / "signals.npz") == wanted
    except OSError as error:
        raise InputDataError(f"{folder / 'signals.npz'}: cannot be read ({error.strerror or error})") from error
    if not fits:
        raise InputDataError(f"{folder}: signals.npz is not the file that result.json was written with; repeat the replay")
    return result


def _result_problems(result: Mapping[str, Any]) -> list[str]:
    """Return what a report could not use of ``result.json``."""
    wanted: dict[str, type | tuple[type, ...]] = {
        "run": dict, "vehicle": dict, "warnings": list, "parameters": list, "digest": str,
    }  # fmt: skip
    problems = [f"{key} is missing or of another type" for key, kind in wanted.items() if not isinstance(result.get(key), kind)]
    if problems:
        return problems
    for where, key, kind in (("run", "path", str), ("run", "duration_s", _NUMBER), ("vehicle", "name", str)):
        if not _is(result[where].get(key), kind):
            problems.append(f"{where}.{key} is missing or of another type")
    for number, parameter in enumerate(result["parameters"]):
        fields: dict[str, Any] = parameter if isinstance(parameter, dict) else {}
        texts = all(isinstance(fields.get(key), str) for key in ("name", "unit", "status"))
        if not (texts and _is(fields.get("value"), _NUMBER) and (fields.get("std") is None or _is(fields["std"], _NUMBER))):
            problems.append(f"parameters[{number}] is not a parameter with name, value, std, unit and status")
    return problems


_NUMBER = (int, float)


def _is(value: Any, kind: type | tuple[type, ...]) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool) and not (isinstance(value, float) and not np.isfinite(value))


def _signal_problems(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """Return which arrays have a shape or type that cannot be."""
    ticks, mounts = arrays["time_s"].shape[:1], arrays["mount_names"].shape[:1]
    wanted = {
        "time_s": (ticks, "f"), "valid": (ticks, "b"), "cg_accel": ((*ticks, 6), "f"), "mount_force": ((*ticks, *mounts, 3), "f"),
        "mount_names": (mounts, "U"),
    }  # fmt: skip
    return [
        f"{name} has shape {arrays[name].shape} and type {arrays[name].dtype}, or values that are not finite"
        for name, (shape, kind) in wanted.items()
        if arrays[name].shape != shape or arrays[name].dtype.kind != kind or not (kind == "U" or np.isfinite(arrays[name]).all())
    ]


def read_diagnosis(folder: str | Path) -> Mapping[str, Any]:
    """Read ``diagnosis.json`` of the output folder of a diagnosis.

    Raises
    ------
    InputDataError
        Missing, unreadable or foreign file.
    """
    path = Path(folder) / "diagnosis.json"
    document = read_json(path)
    if document.get("schema") != DIAGNOSIS_SCHEMA:
        raise InputDataError(f"{path}: no result of a diagnosis: schema is not {DIAGNOSIS_SCHEMA}")
    return document
