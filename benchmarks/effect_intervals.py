# Copyright 2026 ride_estimation contributors
"""Judge the intervals of live and smoothed forces in worlds with one effect that the vehicle file does not know.

    python benchmarks/effect_intervals.py --seeds 9001 9002 [--only base_gain load_with_travel] [--drawn]

Truth from test/worlds: a drawn cab on a drawn road for 40 s at 100 Hz, sensors installed as usual, a file whose stiffness is off
by 5 %; with ``--drawn`` one whose mass, CG, inertia, stiffness, damping and static loads are all off by what it states (a drive
is judged with 40 draws of the static split, which no accelerometer sees). In
``base_lost`` and ``base_wrong`` a base sensor is silent or reads 1.6 times the specific force from 15 s on. Printed per effect
and seed, for live and smoothed, vertical and horizontal forces: error over the standard deviation of the true force (median over
the mounts), share within two standard deviations (median and lowest), and stated standard deviation over the error, rms values
(median): intervals are wrong where they are too narrow and where they are too wide. Then the same over all seeds, with the share
pooled over all mounts.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys
from collections.abc import Sequence

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test"), str(ROOT / "benchmarks")]

from estimator_targets import installed  # noqa: E402
from judging import payload_step  # noqa: E402
from sensor_layouts import recording_of  # noqa: E402
from worlds import effects  # noqa: E402
from worlds.adapters import START_NS, believed_vehicle  # noqa: E402
from worlds.cab import Measurement, drive, measure, random_sensors, random_vehicle  # noqa: E402
from worlds.drawn import drawn_belief, drawn_split  # noqa: E402
from worlds.roads import Road  # noqa: E402
from worlds.vehicle_text import Belief  # noqa: E402

from ride_estimation.estimation.offline import run_offline  # noqa: E402
from ride_estimation.estimation.pipeline import Pipeline  # noqa: E402
from ride_estimation.signals.recording import Channel, Recording  # noqa: E402

DURATION_S, RATE_HZ, FROM_S, END_S = 40.0, 100.0, 10.0, 0.5
#: draws of the static split per recording, with ``--drawn``
SPLITS = 40
#: cause of test/worlds/effects.py, whether at a base sensor, and its size
PLANTED = {
    "base_gain": ("sensor_gain", True, 0.5), "base_delay": ("sensor_delay", True, 0.5),
    "body_delay": ("sensor_delay", False, 0.8),
    "body_gain": ("sensor_gain", False, 0.9), "body_misalignment": ("sensor_misalignment", False, 1.0),
    "flexible_mode": ("flexible_mode", None, 1.0), "friction": ("coulomb_friction", None, 1.0),
}  # fmt: skip
#: what a base sensor reads times the truth from :data:`BASE_FROM_S` on
BASE_FAULTS, BASE_FROM_S = {"base_lost": 0.0, "base_wrong": 1.6}, 15.0
CASES = ("none", *PLANTED, *BASE_FAULTS, "load", "load_with_travel")
BELIEF = Belief(
    stiffness_off=0.05, stiffness_std=0.1, damping_off=0.0625, damping_std=0.125, mass_std=0.005, cg_std=0.0075, inertia_std=0.04
)


def world(case: str, seed: int) -> Measurement:
    """Return the measurement of a world."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air" if seed % 2 == 0 else "rubber")
    travel = tuple((name, "z") for name in cab.mount_names) if case == "load_with_travel" else ()
    drawn = random_sensors(cab, rng, displacement=travel)
    exact = {s.name: s for s in drawn if s.kind == "displacement"}
    sensors = tuple(exact.get(s.name, s) for s in installed(drawn, seed))
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    road = dataclasses.replace(Road.random(rng), follow=follow)
    if case.startswith("load"):
        arm = (rng.uniform(-0.2, 0.3), rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.5), rng.uniform(0.0, 0.2))
        cab = payload_step(float(rng.uniform(0.1, 0.2)), 0.0, arm=arm)(cab, DURATION_S)
    run = drive(cab, road, DURATION_S, seed, step=1e-3)
    if case in PLANTED:
        cause, at_base, size = PLANTED[case]
        draw = np.random.default_rng([seed, 5])
        places = [s.name for s in sensors if (s.place != "cab") is at_base]
        sensor = str(draw.choice(places)) if places else None
        axis = str(draw.choice(["x", "y"])) if case == "base_gain" else None
        planted = effects.plant(cause, effects.Reference(cab, sensors, run), draw, sensor=sensor, axis=axis)
        changed, sensors, _ = planted.apply(size)
        run = run if changed is cab else drive(changed, road, DURATION_S, seed, step=1e-3)
    return measure(run, sensors, RATE_HZ, seed, noise_share=0.01)


def with_base_fault(case: str, seed: int, run: Recording) -> Recording:
    """Return a recording in which a base sensor is lost or reads too much."""
    name = str(np.random.default_rng([seed, 3]).choice([n for n in run.channels if n.startswith("chassis")]))
    channel = run.channels[name]
    late = channel.stamp_ns > START_NS + BASE_FROM_S * 1e9
    if BASE_FAULTS[case]:
        changed = dataclasses.replace(channel, values=np.where(late[:, None], BASE_FAULTS[case], 1.0) * channel.values)
    else:
        changed = Channel(name, channel.stamp_ns[~late], channel.values[~late], channel.arrival_ns[~late])
    return Recording(run.name, {**run.channels, name: changed})


def judge(case: str, seed: int, drawn: bool = False) -> dict[str, tuple[float, float, float, float]]:
    """Return error, share inside (median, lowest) and std over error of live and smoothed, vertical and horizontal forces."""
    return {
        key: (float(np.median(error)), float(np.median(inside)), float(inside.min()), float(np.median(ratio)))
        for key, (error, inside, ratio) in by_axis(case, seed, drawn).items()
    }


def pooled(case: str, seeds: Sequence[int], drawn: bool) -> dict[str, float]:
    """Return the shares inside two standard deviations over all seeds, mounts and axes."""
    found = [by_axis(case, seed, drawn) for seed in seeds]
    return {key: float(np.mean([f[key][1].mean() for f in found])) for key in found[0]}


def by_axis(case: str, seed: int, drawn: bool) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return relative error, share inside and std over error of every mount axis, of :func:`judge`."""
    data = world(case, seed)
    vehicle = believed_vehicle(data, drawn_belief(BELIEF, seed) if drawn else BELIEF, seed)
    recording = recording_of(data, vehicle)
    run = run_offline(with_base_fault(case, seed, recording) if case in BASE_FAULTS else recording, Pipeline(vehicle))
    seconds = (run.stamp_ns - START_NS) * 1e-9
    keep = run.valid & (seconds > FROM_S) & (seconds < data.time[-1] - END_S)
    flat = data.truth["mount_force"].reshape(len(data.time), -1).T
    true = np.stack([np.interp(seconds[keep], data.time, row) for row in flat], axis=1).reshape(-1, len(run.mount_names), 3)
    # what no reading of the recording depends on is judged with many draws: one twist of static forces per world is a lottery
    splits = [drawn_split(data.run.vehicle, seed, draw) for draw in range(SPLITS)] if drawn else [np.zeros_like(true[0])]
    figures = {}
    live = (run.signals["mount_force"], run.signals["mount_force_std"])
    for path, (force, std) in (("live", live), ("smoothed", (run.force, run.force_std))):
        error = force[keep] - true - np.array(splits)[:, None]
        size, stated = np.sqrt(np.mean(error**2, axis=(0, 1))), np.sqrt(np.mean(std[keep] ** 2, axis=0))
        inside, relative = np.mean(np.abs(error) <= 2.0 * std[keep], axis=(0, 1)), size / true.std(axis=0)
        for kind, axes in (("vertical", slice(2, 3)), ("horizontal", slice(0, 2))):
            figures[f"{path} {kind}"] = (relative[:, axes], inside[:, axes], (stated / size)[:, axes])
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[9001, 9002, 9003, 9004])
    parser.add_argument("--only", nargs="*", choices=CASES, default=CASES)
    parser.add_argument("--drawn", action="store_true", help="a file that errs in everything by what it states")
    given = parser.parse_args()
    for case in given.only:
        rows: dict[str, list[tuple[np.ndarray, ...]]] = {}
        for seed in given.seeds:
            print(f"{case} {seed}")
            for key, row in by_axis(case, seed, given.drawn).items():
                rows.setdefault(key, []).append(row)
                show(key, row)
        print(f"{case}, all")
        for key, many in rows.items():
            show(key, tuple(np.concatenate(parts) for parts in zip(*many)))


def show(key: str, row: tuple[np.ndarray, ...]) -> None:
    error, inside, ratio = row
    shares = f"{np.median(inside):4.0%} (lowest {inside.min():4.0%}, pooled {inside.mean():6.1%})"
    print(f"  {key:19s} error {np.median(error):6.1%}, inside 2 std {shares}, std over error {np.median(ratio):.1f}", flush=True)


if __name__ == "__main__":
    main()
