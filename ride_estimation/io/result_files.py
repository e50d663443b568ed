# Copyright 2026 ride_estimation contributors
"""Finished replays read back from their folders."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.results import RESULT_SCHEMA

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class FinishedReplay:
    """``result.json`` and the arrays of ``signals.npz`` of one folder."""

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
    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        with np.load(folder / "signals.npz", allow_pickle=False) as signals:
            arrays = {name: signals[name] for name in ("time_s", "valid", "cg_accel", "mount_force", "mount_names")}
    except (OSError, ValueError, KeyError) as error:
        raise InputDataError(f"{folder}: no results of a replay (result.json and signals.npz): {error}") from error
    if not isinstance(result, dict) or result.get("schema") != RESULT_SCHEMA:
        raise InputDataError(f"{folder}/result.json: schema is not {RESULT_SCHEMA}")
    return FinishedReplay(
        folder.name, result, tuple(str(n) for n in arrays["mount_names"]), arrays["time_s"], arrays["valid"], arrays["cg_accel"],
        arrays["mount_force"],
    )  # fmt: skip
