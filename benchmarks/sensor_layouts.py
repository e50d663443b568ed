# Copyright 2026 ride_estimation contributors
"""What the estimator makes of incomplete sensor layouts: single-axis accelerometers, two or three base sensors of four.

Run ``python benchmarks/sensor_layouts.py --seeds 6``. The worlds are those of ``estimator_targets.py --installed``, each with
every layout. Printed per layout, pooled over worlds: error of the live forces over the standard deviation of the true force and
share within two standard deviations, at mounts with and without a base sensor; ``valid`` stiffness and damping values within two
standard deviations, all of them, and the median error of the vertical stiffness.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable

import numpy as np
from estimator_targets import START, world
from worlds.adapters import START_NS, believed_vehicle
from worlds.cab import Measurement
from worlds.vehicle_text import Belief

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.frames import AXES
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: forces are judged from here on [s]
FROM = START + 10.0


def axes_of(axes: dict[str, str]) -> Callable[[Vehicle], Vehicle]:
    """Return what lets the named sensors measure some axes only; a name ends in ``*`` for all that begin with it."""

    def change(vehicle: Vehicle) -> Vehicle:
        sensors = dict(vehicle.sensors)
        for pattern, chosen in axes.items():
            for name, sensor in vehicle.sensors.items():
                if name == pattern or (pattern.endswith("*") and name.startswith(pattern[:-1])):
                    sensors[name] = dataclasses.replace(sensor, axes=tuple(chosen))
        return dataclasses.replace(vehicle, sensors=sensors)

    return change


def without(*names: str) -> Callable[[Vehicle], Vehicle]:
    """Return what takes the base sensors of mounts away."""

    def change(vehicle: Vehicle) -> Vehicle:
        left = {n: s for n, s in vehicle.sensors.items() if n not in {f"chassis_{name}" for name in names}}
        return dataclasses.replace(vehicle, sensors=left)

    return change


LAYOUTS: dict[str, Callable[[Vehicle], Vehicle]] = {
    "all axes": axes_of({}),
    "body: seven channels": axes_of(
        {"cab_front_left": "xyz", "cab_front_right": "xz", "cab_rear_left": "z", "cab_rear_right": "z"}
    ),
    "body: nine channels": axes_of(
        {"cab_front_left": "xyz", "cab_front_right": "xz", "cab_rear_left": "yz", "cab_rear_right": "yz"}
    ),
    "bases: z only": axes_of({"chassis_*": "z"}),
    "bases: one triaxial, others z": axes_of({"chassis_*": "z", "chassis_front_left": "xyz"}),
    "three bases": without("rear_right"),
    "two bases, diagonal": without("front_right", "rear_left"),
    "two bases, front": without("rear_left", "rear_right"),
}


def recording_of(data: Measurement, vehicle: Vehicle) -> Recording:
    """Return the samples of the sensors of a vehicle."""
    channels = {}
    for name, sensor in vehicle.sensors.items():
        stamps = START_NS + np.round(data.stamps[name] * 1e9).astype(np.int64)
        channels[name] = Channel(name, stamps, sensor.only_measured(np.asarray(data.data[name])), stamps)
    return Recording("world", channels)


def judge(seed: int, duration: float, layout: Callable[[Vehicle], Vehicle]) -> dict[str, list[float]]:
    """Return the figures of one world by kind."""
    cab, data = world(seed, duration, 0.01, 0.0, real=True)
    vehicle = layout(believed_vehicle(data, Belief(), seed))
    run = run_offline(recording_of(data, vehicle), Pipeline(vehicle), smoothing=False)
    seconds = (run.stamp_ns - START_NS) * 1e-9
    keep = run.valid & (seconds > FROM) & (seconds < data.time[-1] - 0.5)
    force, std = run.signals["mount_force"][keep], run.signals["mount_force_std"][keep]
    found: dict[str, list[float]] = {}
    seen = {s.mount for s in vehicle.sensors.values() if s.name.startswith("chassis")}
    for m, mount in enumerate(run.mount_names):
        for a in range(3):
            right = np.interp(seconds[keep], data.time, data.truth["mount_force"][:, m, a])
            error = force[:, m, a] - right
            key = ("vertical" if a == 2 else "sideways") + (" seen" if mount in seen else " unseen")
            found.setdefault(f"error {key}", []).append(float(np.sqrt(np.mean(error**2)) / right.std()))
            found.setdefault(f"inside {key}", []).append(float(np.mean(np.abs(error) <= 2.0 * std[:, m, a])))
            found.setdefault(f"ratio {key}", []).append(float(np.sqrt(np.mean(std[:, m, a] ** 2) / np.mean(error**2))))
    true = {
        f"{n}.{axis}.{role}": float(table[i, a])
        for role, table in (("stiffness", cab.stiffness), ("damping", cab.damping))
        for i, n in enumerate(cab.mount_names) for a, axis in enumerate(AXES)
    }  # fmt: skip
    for e in run.parameters:
        if e.name not in true:
            continue
        mount, axis, role = e.name.split(".")
        kind = "seen" if mount in seen else "unseen"
        found.setdefault(f"count {kind}", []).append(1.0)
        if e.status is Status.VALID:
            found.setdefault(f"valid {kind}", []).append(float(abs(e.value - true[e.name]) <= 2.0 * e.std))
        if axis == "z" and role == "stiffness":
            found.setdefault(f"k_z {kind}", []).append(abs(e.value / true[e.name] - 1.0))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first", type=int, default=8100)
    parser.add_argument("--duration", type=float, default=25.0)
    parser.add_argument("--only", nargs="*", default=[], help="names of layouts")
    given = parser.parse_args()
    for name, layout in LAYOUTS.items():
        if given.only and name not in given.only:
            continue
        pooled: dict[str, list[float]] = {}
        for seed in range(given.first, given.first + given.seeds):
            for key, values in judge(seed, given.duration, layout).items():
                pooled.setdefault(key, []).extend(values)
        print(f"{name}:", flush=True)
        for kind in ("seen", "unseen"):
            if f"error vertical {kind}" not in pooled:
                continue
            parts = []
            for axis in ("vertical", "sideways"):
                error, inside = pooled[f"error {axis} {kind}"], pooled[f"inside {axis} {kind}"]
                ratio = np.median(pooled[f"ratio {axis} {kind}"])
                parts.append(
                    f"{axis} {np.median(error):.1%} (largest {max(error):.1%}), inside 2 std {np.mean(inside):.1%} (lowest "
                    f"{min(inside):.0%}), std over error {ratio:.1f}"
                )
            good = pooled.get(f"valid {kind}", [])
            parts.append(f"valid k, c inside 2 std {sum(good):.0f} of {len(good)} (of {len(pooled[f'count {kind}'])})")
            if f"k_z {kind}" in pooled:
                parts.append(f"k_z error median {np.median(pooled[f'k_z {kind}']):.2%}")
            print(f"  {'with' if kind == 'seen' else 'without'} base sensor: " + "; ".join(parts), flush=True)


if __name__ == "__main__":
    main()
