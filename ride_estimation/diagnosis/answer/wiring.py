# Copyright 2026 ride_estimation contributors
"""Mistakes of a recording that come before any model: exchanged topics, axes and signs, readings in g.

The accelerometers of one body show one rigid motion, those of a base that of a frame that may twist. Where they contradict each
other and one exchange explains that, see :mod:`~ride_estimation.sensors.consistency`, the readings are put right before the model
is calibrated: an inverted axis at a base bends every parameter, and no linearisation about a wrong model leads back to it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ride_estimation.diagnosis.answer.result import NamedCause
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.diagnosis.hypotheses.sensor_column import axis_name
from ride_estimation.frames import AXES
from ride_estimation.sensors.consistency import Mistake, contradiction
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.correction import Correction
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_MOST = 3  # mistakes looked for in one run


@dataclasses.dataclass(frozen=True)
class FoundMistake:
    """A mistake that one body shows, and the share of the contradiction between its accelerometers that is left without it."""

    mistake: Mistake
    left: float


def found_mistakes(vehicle: Vehicle, runs: Sequence[UniformRun]) -> tuple[tuple[FoundMistake, ...], tuple[str, ...]]:
    """Return the mistakes that all runs of a vehicle show, and words on contradictions that several mistakes would explain."""
    found: list[FoundMistake] = []
    doubtful: list[str] = []
    spoke = [
        s for s in vehicle.sensors.values()
        if s.kind in ("accelerometer", "imu") and s.coupling == "dc"
        and all(s.name in run.data and np.mean(run.valid[s.name]) > 0.5 for run in runs)
    ]
    for body in dict.fromkeys(s.body for s in spoke):
        own, others = ([s for s in spoke if (s.body == body) is same] for same in (True, False))
        rows = _rows(vehicle, body, own)
        for _ in range(_MOST):
            readings = np.vstack([_readings(put_right(run, found), [*own, *others]) for run in runs])
            shown = contradiction(readings, rows, own, others) if len(readings) else None
            if shown is None:
                break
            if shown.rivals:
                rest = "; ".join(r.words for r in shown.rivals)
                doubtful.append(f"{shown.mistake.words} would explain why the accelerometers of {body} contradict each other; "
                                f"so would: {rest}")
                break
            found.append(FoundMistake(shown.mistake, shown.left))
    return tuple(found), tuple(doubtful)


def _rows(vehicle: Vehicle, body: str, sensors: Sequence[Sensor]) -> Array:
    """Return the motions that contradict nothing, shape (3 S, r): a base twists, too, ``w = tau x y``."""
    if body in vehicle.bodies:
        return motion_rows(sensors, vehicle.bodies[body].cg)
    places = np.array([s.position for s in sensors])
    places = places - places.mean(axis=0)
    twist = [s.measured[:3] * (s.rotation.T @ [0.0, 0.0, x * y]) for s, (x, y, _) in zip(sensors, places)]
    return np.column_stack([motion_rows(sensors, np.mean([s.position for s in sensors], axis=0)), np.concatenate(twist)])


def _readings(run: UniformRun, sensors: Sequence[Sensor]) -> Array:
    """Return the accelerations of some sensors where all of them are valid, shape (N, 3 S)."""
    good = np.logical_and.reduce([run.valid[s.name] for s in sensors])
    return np.hstack([s.only_measured(np.asarray(run.data[s.name], dtype=float))[good, :3] for s in sensors])


def put_right(run: UniformRun, found: Sequence[FoundMistake]) -> UniformRun:
    """Return a run without its mistakes."""
    data, valid, clipped = dict(run.data), dict(run.valid), dict(run.clipped_at)
    for mistake in (f.mistake for f in found):
        if len(mistake.sensors) == 2:
            one, other = mistake.sensors
            data, valid, clipped = (_exchanged(table, one, other) for table in (data, valid, clipped))
            continue
        (name,) = mistake.sensors
        data[name] = _mapped(data[name], mistake)
        if name in clipped:
            clipped[name] = np.sort(_mapped(clipped[name], mistake), axis=0)
    return dataclasses.replace(run, data=data, valid=valid, clipped_at=clipped)


def _exchanged(table: dict[str, Any], one: str, other: str) -> dict[str, Any]:
    names = {one: other, other: one}
    return {names.get(name, name): value for name, value in table.items()}


def _mapped(values: Array, mistake: Mistake) -> Array:
    """Return true values of readings (N, C); the angular rates of an IMU turn with its housing and have no part in others."""
    out = np.array(values, dtype=float)
    triads = 2 if out.shape[1] == 6 and np.isclose(np.linalg.det(mistake.turn), 1.0) else 1
    for first in range(0, 3 * triads, 3):
        out[:, first : first + 3] = out[:, [first + i for i in mistake.order]] * np.array(mistake.factor)
    return out


def named_mistakes(vehicle: Vehicle, found: Sequence[FoundMistake]) -> tuple[NamedCause, ...]:
    """Return mistakes as causes, each as sure as it leaves little of the contradiction that it explains."""
    out: list[NamedCause] = []
    for f in found:
        for cause, sensor, axis, reported in _as_causes(vehicle, f.mistake):
            known = library()[cause]
            out.append(NamedCause(
                cause, sensor, axis, (reported,), 1.0 - f.left, (), known.WOULD_REFUTE, known.MEASURE_NEXT, known.QUESTION
            ))
    return tuple(out)


def _as_causes(vehicle: Vehicle, mistake: Mistake) -> list[tuple[str, str, str, Reported]]:
    """Return cause, sensor, axis and size of what is wrong with a sensor for the vehicle file."""
    names = mistake.sensors
    installed = vehicle.sensors[names[0]].stated_installation
    if len(names) == 2:
        apart = vehicle.sensors[names[1]].position - vehicle.sensors[names[0]].position
        far = int(np.argmax(np.abs(apart)))
        return [
            ("wrong_sensor_position", name, AXES[far], Reported("position error", shift, installed.position, "m"))
            for name, shift in zip(names, (float(apart[far]), -float(apart[far])))
        ]
    (name,) = names
    factor = np.array(mistake.factor)
    if mistake.order == (0, 1, 2) and not np.allclose(np.linalg.det(mistake.turn), 1.0):
        wrong = np.flatnonzero(factor != 1.0)
        axis = AXES[wrong[0]] if len(wrong) == 1 else ""
        return [("sensor_gain", name, axis, Reported("gain error", float(1.0 / factor[wrong[0]] - 1.0), installed.gain, "-"))]
    turn = Rotation.from_matrix(_proper_turn(mistake)).as_rotvec()
    angle = float(np.linalg.norm(turn))
    main = int(np.argmax(np.abs(turn)))
    alone = np.isclose(abs(turn[main]), angle)
    degrees = np.degrees(np.copysign(angle, turn[main]) if alone else angle)
    axis = axis_name(main, rotation=True) if alone else ""
    reported = Reported("angle", float(degrees), float(np.degrees(installed.misalignment)), "deg")
    return [("sensor_misalignment", name, axis, reported)]


def _proper_turn(mistake: Mistake) -> Array:
    """Return the rotation nearest to exchanged axes; of two that are exchanged and no rotation, that by a right angle."""
    turn = mistake.turn
    if np.linalg.det(turn) > 0.0:
        return turn
    # the rotation axis is the one that stays where it is; all inverted or one inverted is no exchange and a gain
    kept = next((i for i in range(3) if mistake.order[i] == i), 0)
    row = (kept + 1) % 3
    turn[row] = -turn[row]
    return turn


def without_mistakes(vehicle: Vehicle, found: Sequence[FoundMistake]) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle whose file reads the recording right, and what no vehicle file can hold."""
    sensors, remarks = dict(vehicle.sensors), []
    for mistake in (f.mistake for f in found):
        one, other = mistake.sensors[0], mistake.sensors[-1]
        if one != other:
            a, b = sensors[one], sensors[other]
            sensors |= {one: dataclasses.replace(a, topic=b.topic), other: dataclasses.replace(b, topic=a.topic)}
            remarks.append(f"the topics of {one} and {other} are exchanged")
        elif np.isclose(np.linalg.det(mistake.turn), 1.0):
            sensors[one] = dataclasses.replace(sensors[one], rotation=sensors[one].rotation @ mistake.turn)
            remarks.append(f"the {mistake.words}")
        elif mistake.order == (0, 1, 2) and min(mistake.factor) > 0.0:
            read = Correction(gain=tuple(1.0 / f for f in mistake.factor))
            old = sensors[one]
            sensors[one] = dataclasses.replace(old, correction=old.correction.and_then(read, len(mistake.factor)))
            remarks.append(f"the {mistake.words}")
        else:
            remarks.append(f"the {mistake.words}: a vehicle file cannot hold that, put it right where it is recorded")
    return dataclasses.replace(vehicle, sensors=sensors), tuple(remarks)
