# Copyright 2026 ride_estimation contributors
"""Measure the online estimator in scenes of a working day: loads that come on, obstacles, idling, braking, warm mounts.

``python benchmarks/estimator_scenes.py 3580 3581 3582`` prints one table over these worlds (truth from test/worlds);
``--only payload idle`` takes some of the scenes. The table of nominal driving is printed by ``estimator_targets.py``.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys
from collections.abc import Callable, Sequence

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test"), str(ROOT / "benchmarks")]

from judging import Scored, make_measurement, payload_step, run_pipeline, scored_forces, true_parameters  # noqa: E402
from worlds.adapters import believed_vehicle  # noqa: E402
from worlds.cab import AXES, CabVehicle, Measurement  # noqa: E402
from worlds.roads import Road  # noqa: E402
from worlds.vehicle_text import Belief  # noqa: E402

from ride_estimation.estimation.common.estimate import Estimate, Status  # noqa: E402
from ride_estimation.sensors.sensor import Sensor  # noqa: E402
from ride_estimation.vehicles.vehicle import ForceReference, Vehicle  # noqa: E402

#: the load, as a share of the mass, when it comes on and how long the estimator has to follow it [s]
LOAD, COMES_ON, FOLLOWED = 0.2, 20.0, 15.0
#: error of the file's mass where something anchors it
MASS_OFF = 0.1
ANCHORS = ("known_stiffness", "load_cell", "air_spring_pressure", "known_added_mass")
GROUPS = ("stiffness vertical", "damping vertical", "stiffness horizontal", "damping horizontal")

Figures = dict[str, list[float]]


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the table; ``reached`` whether the figure meets its target, None where there is none."""

    scene: str
    quantity: str
    target: str
    measured: str
    reached: bool | None


def group_of(name: str) -> str:
    """Return which of ``GROUPS`` a parameter belongs to."""
    _, axis, quantity = name.split(".")
    return f"{quantity} {'vertical' if axis == 'z' else 'horizontal'}"


def add_errors(figures: Figures, estimates: Sequence[Estimate], true: dict[str, float], label: str = "") -> None:
    """Add the relative error and the coverage of every stiffness and damping."""
    for e in estimates:
        if e.name in true and e.name.count(".") == 2:
            figures.setdefault(f"{group_of(e.name)}{label}", []).append(abs(e.value / true[e.name] - 1.0))
            figures.setdefault(f"parameters inside{label}", []).append(float(abs(e.value - true[e.name]) <= 2.0 * e.std))


def add_forces(figures: Figures, scored: Scored, label: str = "") -> None:
    """Add force errors and coverage per mount and axis."""
    for axis, own in (("vertical", slice(2, 3)), ("horizontal", slice(0, 2))):
        figures.setdefault(f"force {axis}{label}", []).extend(scored.nrmse[:, own].ravel())
        figures.setdefault(f"force {axis} inside{label}", []).extend(scored.coverage[:, own].ravel())


def at(snapshots: list[tuple[float, tuple[Estimate, ...]]], when: float) -> tuple[Estimate, ...]:
    """Return the newest estimates at a time [s]."""
    return next(e for t, e in reversed(snapshots) if t <= when + 1e-6)


# -- a load that comes on ------------------------------------------------------------------------------------------------------


def anchored(data: Measurement, seed: int, anchor: str, from_s: float) -> tuple[Vehicle, dict[str, np.ndarray]]:
    """Return the vehicle whose mass is 10 % high and anchored so, and the samples of the load cell."""
    cab = data.run.vehicle
    lines = {
        "known_stiffness": "{kind: known_stiffness, mount: front_left, axis: z, relative_std: 0.01}",
        "air_spring_pressure": f"{{kind: air_spring_pressure, mount: front_left, axis: z, area_m2: 0.01, force_std_n: 20, "
        f"pressure_pa: {cab.static_force[0][2] / 0.01:.9g}}}",
        "known_added_mass": f"{{kind: known_added_mass, body: cab, mass_kg: {LOAD * cab.mass:.9g}, from_s: {from_s}}}",
    }
    belief = Belief(
        mass_off=MASS_OFF, mass_std=0.2, inertia_std=0.2, force_references=tuple(lines[a] for a in (anchor,) if a in lines)
    )
    vehicle = believed_vehicle(data, belief, seed)
    if anchor == "known_stiffness":
        element = vehicle.mounts["front_left"].elements["z"].replace(stiffness=float(cab.stiffness[0, 2]))
        vehicle = vehicle.replace_elements({("front_left", "z"): element})
    if anchor != "load_cell":
        return vehicle, {}
    force = data.truth["mount_force"][:, 0]
    noise = 0.01 * force[:, 2].std()
    cell = force + 150.0 + np.random.default_rng(seed).normal(0.0, noise, force.shape)
    sensor = Sensor(name="cell", kind="force", topic="/cell", body="chassis", mount="front_left", noise_std=noise)
    reference = ForceReference("load_cell", mount="front_left", sensor="cell", details={"relative_std": 0.01})
    return dataclasses.replace(vehicle, sensors={**vehicle.sensors, "cell": sensor}, force_references=(reference,)), {
        "cell": cell
    }


def with_channels(data: Measurement, channels: dict[str, np.ndarray]) -> Measurement:
    """Return a measurement with further channels on its own time base."""
    stamps = {**data.stamps, **{name: data.time for name in channels}}
    return dataclasses.replace(data, stamps=stamps, data={**data.data, **channels})


def payload(seed: int, anchor: str | None, over_s: float, off_centre: bool, figures: Figures) -> str:
    """A fifth of the mass comes on at 20 s within so many seconds; return what the estimator says about it."""
    judged = COMES_ON + over_s + FOLLOWED
    arm = np.random.default_rng([seed, 9]).uniform(-0.35, 0.35, 3) if off_centre else np.zeros(3)
    change = payload_step(LOAD, COMES_ON, over_s, arm)
    data = make_measurement(seed, duration=judged + 5.0, rate_hz=100.0, change=change)
    cab = data.run.vehicle
    if anchor is None:
        vehicle, cells = believed_vehicle(data, Belief(force_references=()), seed), {}
    else:
        vehicle, cells = anchored(data, seed, anchor, COMES_ON)
    out, snapshots, _, pipeline = run_pipeline(with_channels(data, cells), vehicle)
    estimates, present = at(snapshots, judged), cab.mass * (1.0 + LOAD)
    true = true_parameters(cab)
    if anchor is None:
        # only ratios to the mass are there to be told: for the declared mass every true stiffness has fallen by a sixth
        true = {name: value / (1.0 + LOAD) for name, value in true.items()}
    else:
        figures.setdefault("mass", []).append(abs(estimates[0].value / present - 1.0))
    add_errors(figures, estimates, true)
    figures.setdefault("mass inside", []).append(float(abs(estimates[0].value - present) <= 2.0 * estimates[0].std))
    figures.setdefault("not_identifiable", []).append(float(estimates[0].status is Status.NOT_IDENTIFIABLE))
    add_forces(figures, scored_forces(out, data, 12.0, COMES_ON), " before")
    add_forces(figures, scored_forces(out, data, judged, judged + 5.0))
    said = [m for m in pipeline.health().messages if "mass" in m or "load" in m]
    figures.setdefault("named", []).append(float(any("together" in m for m in said)))
    return "; ".join(said)


def payload_rows(seeds: Sequence[int]) -> list[Row]:
    """Return the rows of loads that come on."""
    rows: list[Row] = []
    cases = [
        ("20 % load at once, no anchor", None, 0.0, False), ("20 % load at once, off the centre, no anchor", None, 0.0, True),
        ("20 % load over 20 s, no anchor", None, 20.0, False),
        *((f"20 % load at once, {a}", a, 0.0, False) for a in ANCHORS),
        ("20 % load over 20 s, load_cell", "load_cell", 20.0, False),
    ]  # fmt: skip
    for title, anchor, over_s, off_centre in cases:
        figures: Figures = {}
        for seed in seeds:
            print(f"  {title}, {seed}: {payload(seed, anchor, over_s, off_centre, figures)}", file=sys.stderr)
        if anchor is None:
            rows.append(error_row(title, "k/m vertical 15 s later", figures["stiffness vertical"], 0.03))
            rows.append(error_row(title, "k/m horizontal 15 s later", figures["stiffness horizontal"], 0.03))
            rows.append(share_row(title, "mass not_identifiable", figures["not_identifiable"], (1.0, 1.0)))
            rows.append(share_row(title, "named in a sentence", figures["named"], (1.0, 1.0)))
        else:
            rows.append(error_row(title, "mass 15 s later", figures["mass"], 0.03))
            rows.append(share_row(title, "mass inside 2 sigma", figures["mass inside"], (0.92, 1.0)))
        rows += coverage_rows(title, figures)
    return rows


# -- single obstacles ----------------------------------------------------------------------------------------------------------


def obstacles(kind: str, seed: int) -> Road:
    """Return a road with single obstacles every five seconds from the twelfth on."""
    rng = np.random.default_rng([seed, 11])
    if kind in ("bumps", "cobbles"):
        return Road.random(rng, kind)
    road = Road.random(rng, "any")
    times = np.arange(4.0, 60.0, 5.0)
    sides = [str(s) for s in rng.choice(["left", "right", "both"], len(times))]
    if kind == "potholes":
        holes = [(float(t), -float(rng.uniform(0.04, 0.09)), float(rng.uniform(0.4, 0.9)), s) for t, s in zip(times, sides)]
        return dataclasses.replace(road, bumps=tuple(holes), speed=float(rng.uniform(5.0, 12.0)))
    kerbs = [(float(t), float(rng.uniform(0.08, 0.14)), 3.0, s) for t, s in zip(times, sides)]
    return dataclasses.replace(road, kerbs=tuple(kerbs), speed=float(rng.uniform(1.2, 2.5)))


def obstacle_rows(seeds: Sequence[int]) -> list[Row]:
    """Return the rows of single obstacles."""
    rows: list[Row] = []
    for kind in ("bumps", "potholes", "cobbles", "kerbs"):
        figures: Figures = {}
        for seed in seeds:
            drive_once(seed, figures, road=obstacles(kind, seed))
        rows += force_rows(kind, figures) + parameter_rows(kind, figures)
    return rows


def drive_once(seed: int, figures: Figures, road: Road, duration: float = 30.0, cut_s: float = 0.0) -> None:
    """Add errors and coverage of one drive, without its first seconds: parameters 10 s after its start, forces from then on."""
    data = make_measurement(seed, duration=duration + cut_s, rate_hz=200.0, road=road)
    data = without_start(data, cut_s)
    begin = 12.0 if cut_s == 0.0 else 10.0
    out, snapshots, _, _ = run_pipeline(data, believed_vehicle(data, None, seed))
    add_errors(figures, at(snapshots, begin), true_parameters(data.run.vehicle))
    add_forces(figures, scored_forces(out, data, begin, duration))


def without_start(data: Measurement, seconds: float) -> Measurement:
    """Return a measurement that begins so much later: the first sample is already in motion."""
    first = round(seconds * data.rate_hz)
    if not first:
        return data
    return dataclasses.replace(
        data, time=data.time[first:] - seconds, stamps={n: s[first:] - seconds for n, s in data.stamps.items()},
        data={n: v[first:] for n, v in data.data.items()}, truth={n: v[first:] for n, v in data.truth.items()},
    )  # fmt: skip


def motion_rows(seeds: Sequence[int]) -> list[Row]:
    """Return the rows of runs whose first sample is on a rough road at speed."""
    figures: Figures = {}
    for seed in seeds:
        drive_once(seed, figures, road=Road.random(np.random.default_rng([seed, 12]), "rough"), duration=25.0, cut_s=8.0)
    return force_rows("start in motion", figures) + parameter_rows("start in motion", figures)


# -- idling --------------------------------------------------------------------------------------------------------------------


def idle(seed: int, engine: tuple[float, float], minutes: float, figures: Figures) -> None:
    """Drive 25 s, idle so many minutes, drive on: the largest move of a parameter, what is known 12 s after going on."""

    def scene(road: Road, duration: float, noise: float = 0.01) -> Measurement:
        return make_measurement(seed, duration=duration, rate_hz=100.0, phases=False, road=road, noise=noise)

    rng = np.random.default_rng([seed, 13])
    drive, on = scene(Road.random(rng), 25.0), scene(Road.random(rng), 25.0)
    cycle = one_cycle(scene(Road.standing(*engine), 40.0, 0.0))
    noise = {s.name: s.noise_std for s in drive.sensors}
    pieces = [drive]
    for _ in range(round(minutes * 60.0 / cycle.time[-1])):
        # the same motion every time, as of an engine, with noise of its own
        pieces.append(dataclasses.replace(cycle, data={n: v + rng.normal(0.0, noise[n], v.shape) for n, v in cycle.data.items()}))
    whole, begin = joined([*pieces, on])
    out, snapshots, _, _ = run_pipeline(whole, believed_vehicle(drive, None, seed), every_s=5.0)
    stop, go = begin[1], begin[-1]
    first = {e.name: e.value for e in at(snapshots, stop)}
    for when, estimates in snapshots:
        if stop < when < go:
            figures.setdefault("moved", []).append(max(abs(e.value / first[e.name] - 1.0) for e in estimates))
    # the second drive begins with its own second at rest
    add_forces(figures, scored_forces(out, dataclasses.replace(on, time=on.time + go), go + 3.0, go + 13.0))
    add_errors(figures, at(snapshots, go + 13.0), true_parameters(drive.run.vehicle))


def one_cycle(shaken: Measurement) -> Measurement:
    """Return a stretch of a periodic measurement that goes on into itself."""
    compared = 50
    late = without_start(shaken, 10.0)
    signal = np.hstack([late.data[n] for n in sorted(late.data)])
    ends = range(len(signal) // 2, len(signal) - compared)
    length = min(ends, key=lambda n: float(np.sum((signal[n : n + compared] - signal[:compared]) ** 2)))
    return dataclasses.replace(
        late, time=late.time[: length + 1], stamps={n: s[:length] for n, s in late.stamps.items()},
        data={n: v[:length] for n, v in late.data.items()},
    )  # fmt: skip


#: frequency [Hz] and acceleration [m/s^2] of the frame: nothing, first order of 650 rpm, third order
IDLING = (
    ("still", (0.0, 0.0)), ("650 rpm, 0.05 m/s^2", (650 / 60, 0.05)), ("650 rpm, 0.3 m/s^2", (650 / 60, 0.3)),
    ("650 rpm third order, 0.3 m/s^2", (650 / 20, 0.3)),
)  # fmt: skip


def idle_rows(seeds: Sequence[int], minutes: float = 30.0) -> list[Row]:
    """Return the rows of a vehicle that stands: dead still, and with an engine at 650 rpm (first and third order)."""
    rows: list[Row] = []
    for title, engine in IDLING:
        figures: Figures = {}
        for seed in seeds:
            idle(seed, engine, minutes, figures)
            print(f"  idle {title}, {seed}: moved {100 * max(figures['moved']):.2f} %", file=sys.stderr)
        moved = max(figures["moved"])
        name = f"{minutes:g} min idle, {title}"
        rows.append(Row(name, "largest move of a parameter", "0.5 %", f"{100 * moved:.2f} %", moved <= 0.005))
        rows += force_rows(name + ", then on", figures)
    return rows


def joined(pieces: list[Measurement]) -> tuple[Measurement, list[float]]:
    """Return measurements one after the other and where each begins [s]."""
    begin, stamps, data = [0.0], [], []
    for piece in pieces:
        name = next(iter(piece.data))
        begin.append(begin[-1] + len(piece.data[name]) / piece.rate_hz)
    names = pieces[0].data.keys()
    stamps = {n: np.concatenate([p.stamps[n][: len(p.data[n])] + b for p, b in zip(pieces, begin)]) for n in names}
    data = {n: np.concatenate([p.data[n] for p in pieces]) for n in names}
    return dataclasses.replace(pieces[0], stamps=stamps, data=data), begin[:-1]


# -- lasting accelerations -----------------------------------------------------------------------------------------------------


def course_rows(seeds: Sequence[int]) -> list[Row]:
    """Return the rows of braking, bends and slopes that last for seconds; nothing else differs from a drive."""
    rows: list[Row] = []
    for kind in ("brake", "bend", "slope"):
        figures: Figures = {}
        for seed in seeds:
            drive_once(seed, figures, road=lasting(kind, seed), duration=40.0)
        rows += force_rows(kind, figures) + parameter_rows(kind, figures)
    return rows


def lasting(kind: str, seed: int) -> Road:
    """Return a road with braking and going on, bends one way and the other, or slopes down and up, 2 to 6 s each."""
    rng = np.random.default_rng([seed, 15])
    road = dataclasses.replace(Road.random(rng), speed=float(rng.uniform(12.0, 16.0)))
    course: list[tuple[str, float, float, float]] = []
    for begin in (5.0, 18.0, 28.0):
        length = float(rng.uniform(2.0, 4.0))
        size = {"brake": -rng.uniform(1.5, 3.0), "bend": rng.uniform(1.5, 4.0), "slope": rng.uniform(0.03, 0.12)}[kind]
        size = float(size * (1.0 if kind == "brake" else rng.choice([-1.0, 1.0])))
        course += [(kind, begin, length, size), (kind, begin + length + 1.0, length, -size)]
    return dataclasses.replace(road, course=tuple(course))


# -- warming -------------------------------------------------------------------------------------------------------------------


def warming_rows(seeds: Sequence[int]) -> list[Row]:
    """Return the rows of mounts that lose a fifth of their stiffness within a minute, one of them or all."""
    rows: list[Row] = []
    for title, alone in (("all mounts 20 % softer in a minute", False), ("one mount 20 % softer in a minute", True)):
        figures: Figures = {}
        for seed in seeds:
            warm(seed, alone, figures)
        rows.append(error_row(title, "k vertical during the change", figures["stiffness vertical during"], 0.03))
        rows.append(error_row(title, "k vertical at its end", figures["stiffness vertical"], 0.03))
        rows.append(
            share_row(title, "parameters inside 2 sigma during the change", figures["parameters inside during"], (0.92, 0.98))
        )
        rows += force_rows(title, figures)
    return rows


def warm(seed: int, alone: bool, figures: Figures) -> None:
    """Drive 90 s; stiffness falls from 18 s to 78 s, damping by a share of that which differs from world to world."""
    begin, end = 18.0, 78.0
    drift = np.zeros((4, 3, 4))
    drift[0 if alone else slice(None)] = (-0.2, begin, end, float(np.random.default_rng([seed, 16]).uniform(0.5, 2.0)))

    def change(cab: CabVehicle, duration: float) -> CabVehicle:
        return dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, drift=drift))

    data = make_measurement(seed, duration=90.0, rate_hz=100.0, change=change)
    out, snapshots, _, _ = run_pipeline(data, believed_vehicle(data, None, seed))
    for when in np.arange(begin + 5.0, end + 1.0, 5.0):
        label = " during" if when < end - 1.0 else ""
        add_errors(figures, at(snapshots, when), warmed(data.run.vehicle, float(when)), label)
    add_forces(figures, scored_forces(out, data, begin, end))


def warmed(cab: CabVehicle, when: float) -> dict[str, float]:
    """Return the true parameters at a time, by the law of the drift that the worlds state."""
    true = true_parameters(cab)
    for i, mount in enumerate(cab.mount_names):
        for a, axis in enumerate(AXES):
            size, begin, end, share = cab.hidden.drift[i, a]
            part = np.clip((when - begin) / max(end - begin, 1e-9), 0.0, 1.0)
            fallen = float(size * 0.5 * (1.0 - np.cos(np.pi * part)))
            true[f"{mount}.{axis}.stiffness"] *= 1.0 + fallen
            true[f"{mount}.{axis}.damping"] *= 1.0 + share * fallen
    return true


# -- the table -----------------------------------------------------------------------------------------------------------------


def error_row(scene: str, quantity: str, errors: Sequence[float], target: float) -> Row:
    """Return the 95th percentile of errors against a target."""
    p95, median = (float(np.percentile(errors, q)) for q in (95, 50))
    measured = f"{100 * p95:.2f} % ({100 * median:.2f} %)"
    return Row(scene, f"{quantity}, 95th percentile (median)", f"{100 * target:g} %", measured, p95 <= target)


def share_row(scene: str, quantity: str, shares: Sequence[float], band: tuple[float, float]) -> Row:
    """Return the mean of shares against a band."""
    mean = float(np.mean(shares))
    target = f"{100 * band[0]:g} to {100 * band[1]:g} %" if band[0] < band[1] else f"{100 * band[0]:g} %"
    return Row(scene, quantity, target, f"{100 * mean:.1f} %", band[0] <= mean <= band[1])


def coverage_rows(scene: str, figures: Figures) -> list[Row]:
    """Return how often the true forces lie within two standard deviations."""
    return [
        share_row(scene, f"force {a} inside 2 sigma", figures[f"force {a} inside"], (0.92, 0.98))
        for a in ("vertical", "horizontal")
    ]


def force_rows(scene: str, figures: Figures) -> list[Row]:
    """Return error (median) and coverage of the forces."""
    rows = []
    for axis, target in (("vertical", 0.04), ("horizontal", 0.08)):
        p95, median = (float(np.percentile(figures[f"force {axis}"], q)) for q in (95, 50))
        measured = f"{100 * median:.1f} % ({100 * p95:.1f} %)"
        rows.append(
            Row(scene, f"force NRMSE {axis}, median (95th percentile)", f"{100 * target:g} %", measured, median <= target)
        )
    return rows + coverage_rows(scene, figures)


def parameter_rows(scene: str, figures: Figures) -> list[Row]:
    """Return errors of stiffness and damping and their coverage."""
    targets = dict(zip(GROUPS, (0.01, 0.02, 0.03, 0.06)))
    rows = [error_row(scene, group, figures[group], target) for group, target in targets.items()]
    return [*rows, share_row(scene, "parameters inside 2 sigma", figures["parameters inside"], (0.92, 0.98))]


SCENES: dict[str, Callable[[Sequence[int]], list[Row]]] = {
    "payload": payload_rows, "obstacles": obstacle_rows, "motion": motion_rows, "idle": idle_rows, "course": course_rows,
    "warming": warming_rows,
}  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", type=int, nargs="+", help="worlds")
    parser.add_argument("--only", nargs="+", choices=SCENES, default=list(SCENES), help="scenes (default all)")
    given = parser.parse_args()
    print("| scene | quantity | target | measured | |\n|---|---|---|---|---|")
    for scene in given.only:
        for row in SCENES[scene](given.seeds):
            verdict = "" if row.reached is None else ("reached" if row.reached else "missed")
            print(f"| {row.scene} | {row.quantity} | {row.target} | {row.measured} | {verdict} |", flush=True)


if __name__ == "__main__":
    main()
