# Copyright 2026 ride_estimation contributors
"""Estimates of a run, taken back through a relation, and how far they moved in units of their standard deviation."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
from relations import Relation, between
from scipy.interpolate import CubicSpline

from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: quantity -> how many of its three components in a row are polar and axial vectors, and whether it grows with the mass
SIGNALS = {"cg_accel": False, "inertial_load": True, "mount_force": True}


@dataclasses.dataclass(frozen=True)
class Estimates:
    """Estimates in names, axes and units of the original vehicle: (value, std) by quantity and by parameter."""

    stamp_ns: np.ndarray
    signals: dict[str, tuple[np.ndarray, np.ndarray]]
    parameters: dict[str, tuple[float, float, str]]


def estimates(run: OfflineRun, original: Vehicle, relation: Relation | None = None) -> Estimates:
    """Return what a run of the changed vehicle says about the original one."""
    relation = relation or Relation("none", True)
    places = [run.mount_names.index(new) for new in map(relation.mounts, original.mounts) if new in run.mount_names]
    signals = {}
    for name, grows in SIGNALS.items():
        value, std = run.signals[name], run.signals[f"{name}_std"]
        if name == "mount_force":
            value, std = relation.vectors_back(value[:, places]), relation.spreads_back(std[:, places])
        else:
            halves = [relation.vectors_back(value[:, :3]), relation.vectors_back(value[:, 3:], axial=True)]
            value = np.hstack(halves)
            std = np.hstack([relation.spreads_back(std[:, :3]), relation.spreads_back(std[:, 3:])])
        factor = relation.scale if grows else 1.0
        signals[name] = value / factor, std / factor
    back = {relation.parameter(name): name for name in _names(run, original)}
    found = {}
    for e in run.parameters:
        # a CG moves with the axes and not with the mass; everything else that is estimated is proportional to the mass
        found[back.get(e.name, e.name)] = e.value / relation.scale, e.std / relation.scale, e.status.value
    return Estimates(run.stamp_ns - relation.shift_ns, signals, found)


def _names(run: OfflineRun, original: Vehicle) -> list[str]:
    quantities = {e.name.rpartition(".")[2] for e in run.parameters}
    return [f"{m}.{a}.{q}" for m in original.mounts for a in ("x", "y", "z") for q in sorted(quantities)]


def changed_run(vehicle: Vehicle, run: Recording, relation: Relation) -> Estimates:
    """Return the estimates of the changed run in terms of the original."""
    found = run_offline(relation.recording(vehicle, run), Pipeline(relation.vehicle(vehicle)), smoothing=False)
    return estimates(found, vehicle, relation)


def continued_run(vehicle: Vehicle, run: Recording, share: float = 0.5) -> Estimates:
    """Return the estimates of the rest of a run by an estimator that begins with the saved state of the part before."""
    first = min(int(c.stamp_ns.min()) for c in run.channels.values())
    last = max(int(c.stamp_ns.max()) for c in run.channels.values())
    cut = first + int(share * (last - first))
    before, after = Pipeline(vehicle), Pipeline(vehicle)
    run_offline(between(run, first, cut), before, smoothing=False)
    after.load_state(json.loads(json.dumps(before.save_state())))
    return estimates(run_offline(between(run, cut, last + 1), after, smoothing=False), vehicle)


@dataclasses.dataclass(frozen=True)
class Movement:
    """How far estimates moved, in standard deviations: largest and rms over signals, largest over parameters; largest relative
    change of a stated standard deviation; parameters whose status changed."""

    largest: float
    rms: float
    parameters: float
    spread: float
    statuses: int


def movement(before: Estimates, after: Estimates, from_s: float = 0.0) -> Movement:
    """Compare estimates on the stamps of ``after``, from so many seconds after its start."""
    start = max(int(before.stamp_ns[0]), int(after.stamp_ns[0])) + round(from_s * 1e9)
    inside = (after.stamp_ns >= start) & (after.stamp_ns <= before.stamp_ns[-1])
    moved, spread = [], [0.0]
    for name, (value, std) in before.signals.items():
        other, other_std = (v[inside] for v in after.signals[name])
        then, then_std = (_at(before.stamp_ns, v, after.stamp_ns[inside]) for v in (value, std))
        moved.append(((other - then) / then_std).ravel())
        spread.append(float(np.abs(other_std / then_std - 1.0).max()))
    pairs = [(before.parameters[name], after.parameters[name]) for name in before.parameters]
    steps = [abs(b[0] - a[0]) / a[1] for a, b in pairs if a[1] > 0.0]
    spread += [abs(b[1] / a[1] - 1.0) for a, b in pairs if a[1] > 0.0]
    every = np.concatenate(moved)
    return Movement(
        float(np.abs(every).max()), float(np.sqrt(np.mean(every**2))), max(steps, default=0.0), max(spread),
        sum(a[2] != b[2] for a, b in pairs),
    )  # fmt: skip


def _at(stamp_ns: np.ndarray, values: np.ndarray, wanted_ns: np.ndarray) -> np.ndarray:
    if np.array_equal(stamp_ns, wanted_ns):
        return values
    origin = int(stamp_ns[0])
    return np.asarray(CubicSpline((stamp_ns - origin) * 1e-9, values, axis=0)((wanted_ns - origin) * 1e-9))
