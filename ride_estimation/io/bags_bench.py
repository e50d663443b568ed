# Copyright 2026 ride_estimation contributors
"""Displacement (JointState) and force (WrenchStamped) of one mount axis from a bag, aligned by their stamps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.identification.bench.record import from_channels
from ride_estimation.io.bag_source import READER_ERRORS, open_bag

Array = NDArray[np.float64]


def read_bag_columns(path: Path, mount: str, axis: str) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return time, displacement and tension of one mount axis, and what was noticed.

    The wrench is the force ON the body BY the mount, so the tension is its negative. Both are aligned by their stamps as a
    replay aligns its sensors.

    Parameters
    ----------
    path
        Bag folder or file.
    mount
        Mount name, or empty where the bag has only one joint.
    axis
        ``x``, ``y`` or ``z``; empty: from the joint name, else ``z``.

    Raises
    ------
    InputDataError
        Unreadable bag, no such joint, no force, no overlap.
    """
    joints: dict[str, list[tuple[int, float]]] = {}
    wrenches: dict[str, list[tuple[int, float, float, float]]] = {}
    source = open_bag(path)
    wanted = [topic for topic, kind in source.types.items() if kind.endswith(("/JointState", "/WrenchStamped"))]
    try:
        for topic, _, raw in source.messages(wanted):
            _collect(topic, source.types[topic], source.deserialize(raw, source.types[topic]), joints, wrenches)
    except RideEstimationError:
        raise
    except READER_ERRORS as error:
        raise InputDataError(f"{path}: not a readable bag ({error or type(error).__name__})") from error
    joint = _choose(path, "JointState joint", joints, f"{mount}_{axis}" if mount and axis else mount)
    topic = _choose(path, "WrenchStamped topic", wrenches, f"/{mount}/" if mount else "")
    component = "xyz".index(axis or (joint[-1] if joint[-2:] in ("_x", "_y", "_z") else "z"))
    moves, loads = sorted(joints[joint]), sorted(wrenches[topic])
    if moves[0][0] >= loads[-1][0] or loads[0][0] >= moves[-1][0]:
        raise InputDataError(f"{path}: displacement and force do not overlap in time")
    record = from_channels(
        path.name,
        {
            "displacement": (np.array([m[0] for m in moves]), np.array([[m[1]] for m in moves])),
            "force": (np.array([w[0] for w in loads]), np.array([[-w[1 + component]] for w in loads])),
        },
    )
    return {"time_s": record.time_s, "displacement_m": record.displacement, "force_n": record.force}, record.warnings


def _collect(
    topic: str,
    kind: str,
    message: Any,
    joints: dict[str, list[tuple[int, float]]],
    wrenches: dict[str, list[tuple[int, float, float, float]]],
) -> None:
    stamp = int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
    if kind.endswith("/JointState"):
        for name, position in zip(message.name, message.position, strict=False):
            joints.setdefault(name, []).append((stamp, float(position)))
    else:
        f = message.wrench.force
        wrenches.setdefault(topic, []).append((stamp, float(f.x), float(f.y), float(f.z)))


def _choose(path: Path, what: str, found: dict[str, Any], wanted: str) -> str:
    names = [n for n in found if wanted in n]
    if len(names) != 1:
        raise InputDataError(
            f"{path}: {len(names)} candidates for the {what}{f' {wanted!r}' if wanted else ''}; "
            f"available: {', '.join(sorted(found)) or 'none'}; choose with --mount and --axis"
        )
    return names[0]
