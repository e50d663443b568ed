# Copyright 2026 ride_estimation contributors
"""Measure the online estimator against the targets of the project, truth from test/worlds (own equations and integrator).

Run ``python benchmarks/estimator_targets.py --seeds 20``; prints one table; loads, idling and the rest of a working day are in
``estimator_scenes.py``. A run is a random cab (air or rubber mounts) over a
random road, 500 Hz, noise 1 % of the signal; parameters are judged 10 s after excitation starts, forces from then on.

Horizontal forces between brackets follow from how the frame deforms between them, and nothing but its twice integrated
acceleration tells that: beside the measured error stands the least that any estimate leaves which knows noise and spectrum of
the deformation exactly and how the brackets tilt, at once and with all that comes after. ``--installed`` mounts every sensor as
badly as the estimator has to reckon with; without, they are perfect, and intervals that contain such errors are too wide. The
same holds for the vehicle file: with ``--drawn`` its mass, inertia and static loads err by what it states, else they are exact.
``--calibrated``: before, ``calibrate --drive`` reads the sensors' errors from another road, 60 s long.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys
import time

import numpy as np
from scipy import signal

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from worlds.adapters import START_NS, arrivals, believed_vehicle, recording  # noqa: E402
from worlds.cab import CabSensor, CabVehicle, Measurement, drive, measure, random_sensors, random_vehicle, simulate  # noqa: E402
from worlds.drawn import drawn_belief, drawn_split  # noqa: E402
from worlds.installation import installed as with_errors  # noqa: E402
from worlds.roads import Road, base_motion  # noqa: E402
from worlds.vehicle_text import Belief  # noqa: E402

from ride_estimation.estimation import offline  # noqa: E402
from ride_estimation.estimation.kinematics.deformation_filter import FilterBank  # noqa: E402
from ride_estimation.estimation.model.drive_calibration import calibrate_drive  # noqa: E402
from ride_estimation.estimation.model.smoothed_forces import Anomalies, SmoothedForces, smoothed_forces  # noqa: E402
from ride_estimation.estimation.output import OutputBlock  # noqa: E402
from ride_estimation.estimation.pipeline import Pipeline  # noqa: E402
from ride_estimation.sensors.installation import USUAL  # noqa: E402
from ride_estimation.vehicles.vehicle import Vehicle  # noqa: E402

RATE = 500.0
START = 1.0  # seconds at rest before the ramp


def through(pipeline: Pipeline, data: Measurement, until: float = np.inf) -> tuple[list[OutputBlock], list]:
    """Feed a measurement and return the blocks and the parameters at ``until`` seconds."""
    blocks, at = [], None
    for stamp, name, values in [(s, n, v.tolist()) for s, n, v in arrivals(data)]:
        if at is None and stamp - START_NS > until * 1e9:
            at = pipeline.parameters()
        blocks += pipeline.observe(name, stamp, values)
    blocks += pipeline.finish()
    return blocks, list(at if at is not None else pipeline.parameters())


def joined(blocks: list[OutputBlock], name: str) -> np.ndarray:
    return np.concatenate([getattr(b, name) for b in blocks])


def smoothed(pipeline: Pipeline, blocks: list[OutputBlock], data: Measurement) -> SmoothedForces:
    """Return the smoothed forces of a finished run, as ``replay`` computes them, else the live ones."""
    signals = {name: joined(blocks, name) for name in ("stamp_ns", "mount_force", "mount_force_std", "mount_deflection")}
    model = offline.run_forces(recording(data), pipeline.geometry.vehicle)
    found = smoothed_forces(signals, Anomalies.of(blocks), model, pipeline.parameters(), pipeline.amplitude_std())
    if isinstance(found, str):
        return SmoothedForces(signals["mount_force"], signals["mount_force_std"], signals["mount_deflection"], 0.0)
    return found


def ticks_of(blocks: list[OutputBlock], data: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Return which rows of the blocks have a truth sample and which sample."""
    row = np.round((joined(blocks, "stamp_ns") - START_NS) * 1e-9 * data.rate_hz).astype(int)
    good = (row >= 0) & (row < len(data.time))
    return good, row[good]


def installed(sensors: tuple[CabSensor, ...], seed: int) -> tuple[CabSensor, ...]:
    """Return sensors with errors of every kind drawn from the usual installation: what the estimator has to reckon with."""
    stds = {kind: getattr(USUAL, kind) for kind in ("bias", "gain", "misalignment", "position", "delay")}
    return with_errors(sensors, seed, **stds)


def world(
    seed: int, duration: float, noise: float, anti_alias: float, real: bool = False
) -> tuple[CabVehicle, Measurement]:
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air" if seed % 2 == 0 else "rubber")
    sensors = random_sensors(cab, rng)
    if real:
        sensors = installed(sensors, seed)
    # nobody knows how the brackets of a frame tilt when it twists
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    run = drive(cab, dataclasses.replace(Road.random(rng), follow=follow), duration, seed)
    return cab, measure(run, sensors, RATE, seed, noise_share=noise, anti_alias=anti_alias)


def least_error(cab: CabVehicle, data: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Return the NRMSE of the horizontal forces, (M, 2), that deformation of the frame leaves at least: causal, smoothed.

    The brackets of the worlds move on their own, as a process of known form and of density S, and sensors add white noise N.
    Acceleration integrated twice leaves ``int S N / (S + N) / omega^4 df`` of it if the future is known (Wiener 1949), and
    what the best causal filter of the bank leaves if not. Mounts turn it into forces; equilibrium takes out the rest.
    """
    count, dt = len(cab.mounts), 1.0 / data.rate_hz
    shape = np.vstack([np.hstack([np.eye(3), np.cross(arm, np.eye(3))]) for arm in cab.mounts - cab.cg])
    deforming = np.eye(3 * count) - shape @ np.linalg.pinv(shape)
    stiffness = cab.stiffness.ravel()
    shared = stiffness[:, None] * shape @ np.linalg.inv(shape.T @ (stiffness[:, None] * shape)) @ shape.T
    frequency = np.geomspace(0.02, 100.0, 3000)
    width = np.gradient(frequency)
    bank = FilterBank(frequency, width, 25.0)
    form = 1.0 / (1.0 + (1.5 / frequency) ** 8) / (1.0 + (frequency / 25.0) ** 8)
    moving = data.time > START + 2.0
    rates = data.truth["deflection_rate"][moving].reshape(-1, 3 * count) @ deforming
    own, power = signal.welch(np.gradient(rates, dt, axis=0), data.rate_hz, nperseg=1024, axis=0)
    inside = (own > 3.0) & (own < 20.0)
    white = 2.0 * dt * float(np.mean([s.noise_std**2 for s in data.sensors if s.place != "cab"]))
    found = np.zeros((2, 3))
    for axis in range(2):
        freedom = np.trace(deforming[axis::3, axis::3])
        density = form * np.median(power[inside, axis::3].sum(axis=1)) / freedom
        found[0, axis] = bank.errors(density, 0.0 * density, white, data.time[-1])[0].min()
        found[1, axis] = np.sum(density * white / (density + white) / (2.0 * np.pi * frequency) ** 4 * width)
    size = np.std(data.truth["mount_force"][data.time > 8.0], axis=0)
    to_force = (np.eye(3 * count) - shared) @ (stiffness[:, None] * deforming)
    least = [np.sqrt(to_force**2 @ np.tile(variance, count)).reshape(count, 3) / size for variance in found]
    return least[0][:, :2], least[1][:, :2]


def parameter_errors(cab: CabVehicle, estimates: list, drawn: bool = False) -> list[tuple[str, float, float]]:
    """Return (class, relative error, error over std) of every stiffness and damping; ``drawn`` where the mass is not exact."""
    found = []
    mass = estimates[0]
    for e in estimates:
        parts = e.name.split(".")
        if len(parts) != 3:
            continue
        mount, axis, parameter = parts
        table = cab.stiffness if parameter == "stiffness" else cab.damping
        true = table[cab.mount_names.index(mount), "xyz".index(axis)]
        group = f"{'k' if parameter == 'stiffness' else 'c'} {'vertical' if axis == 'z' else 'horizontal'}"
        # where worlds have exactly the mass of the file: judge the part of the standard deviation that is not the mass's
        own = e.std if drawn else max(e.std**2 - (e.value * mass.std / mass.value) ** 2, 1e-30) ** 0.5
        found.append((group, abs(e.value / true - 1.0), abs(e.value - true) / own))
    return found


def calibrated(cab: CabVehicle, sensors: tuple[CabSensor, ...], vehicle: Vehicle, seed: int, noise: float) -> Vehicle:
    """Return a vehicle with its sensors as another drive calibrates them, as it was where that drive is refused."""
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    road = dataclasses.replace(Road.random(np.random.default_rng([seed, 2])), follow=follow)
    data = measure(drive(cab, road, 60.0, seed + 1), sensors, 200.0, seed + 1, noise_share=noise, anti_alias=0.0)
    found = calibrate_drive(recording(data), vehicle)
    if not found.usable:
        print(f"  seed {seed}: the calibration is refused", file=sys.stderr)
    return found.vehicle(vehicle) if found.usable else vehicle


def judge_drive(
    rows: dict[str, list], seed: int, noise: float, anti_alias: float, real: bool, drawn: bool = False, calibrate: bool = False,
    seconds: float = 15.0,
) -> tuple[CabVehicle, Measurement]:
    """Add errors, coverage and consistency of the drive of a world to figures; return the world."""
    cab, data = world(seed, seconds, noise, anti_alias, real)
    vehicle = believed_vehicle(data, drawn_belief(Belief(), seed) if drawn else None, seed=seed)
    if calibrate:
        vehicle = calibrated(cab, data.sensors, vehicle, seed, noise)
    pipeline = Pipeline(vehicle)
    blocks, estimates = through(pipeline, data, START + 10.0)
    for group, error, ratio in parameter_errors(cab, estimates, drawn):
        rows.setdefault(group, []).append(error)
        rows.setdefault(f"{group} ratio", []).append(ratio)
    good, row = ticks_of(blocks, data)
    late = data.time[row] > 8.0
    force, std = joined(blocks, "mount_force")[good][late], joined(blocks, "mount_force_std")[good][late]
    true = data.truth["mount_force"][row][late] + (drawn_split(cab, seed) if drawn else 0.0)
    score = np.sqrt(np.mean((force - true) ** 2, axis=0)) / np.std(true, axis=0)
    inside = np.mean(np.abs(force - true) < 2.0 * std, axis=0)
    # as for the parameters: the part that is not the mass's, which is right here
    relative = estimates[0].std / estimates[0].value
    own = std**2 - relative**2 * (cab.static_force**2 + np.var(true, axis=0))
    apart = np.mean((force - true) ** 2 < 4.0 * np.maximum(own, 0.0), axis=0)
    rows.setdefault("apart horizontal", []).extend(apart[:, :2].ravel())
    rows.setdefault("apart vertical", []).extend(apart[:, 2])
    rows.setdefault("force horizontal", []).extend(score[:, :2].ravel())
    rows.setdefault("force vertical", []).extend(score[:, 2])
    later = smoothed(pipeline, blocks, data)
    rows.setdefault("model share", []).append(later.share)
    error = later.force[good][late] - true
    later_score = np.sqrt(np.mean(error**2, axis=0)) / np.std(true, axis=0)
    held = np.mean(np.abs(error) < 2.0 * later.std[good][late], axis=0)
    for axis, part in (("horizontal", slice(0, 2)), ("vertical", slice(2, 3))):
        rows.setdefault(f"later {axis}", []).extend(later_score[:, part].ravel())
        rows.setdefault(f"later inside {axis}", []).extend(held[:, part].ravel())
        for path, own_error, own_std in (("live", force - true, std), ("later", error, later.std[good][late])):
            ratio = np.sqrt(np.mean(own_std[..., part] ** 2, axis=0) / np.mean(own_error[..., part] ** 2, axis=0))
            rows.setdefault(f"{path} {axis} std over error", []).extend(ratio.ravel())
    rows.setdefault("inside horizontal", []).extend(inside[:, :2].ravel())
    rows.setdefault("inside vertical", []).extend(inside[:, 2])
    covariance = np.concatenate([np.tile(b.cg_accel_covariance, (len(b.stamp_ns), 1, 1)) for b in blocks])[good][late]
    error = joined(blocks, "cg_accel")[good][late] - data.truth["cg_accel"][row][late]
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error)
    rows.setdefault("nees", []).append(float(np.mean(nees)))
    part = np.einsum("ki,kij,kj->k", error[:, 2:], np.linalg.inv(covariance[:, 2:, 2:]), error[:, 2:])
    rows.setdefault("nees z and rotation", []).append(float(np.mean(part)))
    return cab, data


def nominal(
    seeds: range, noise: float, anti_alias: float, real: bool = False, drawn: bool = False, calibrate: bool = False,
    seconds: float = 15.0,
) -> dict[str, list]:
    rows: dict[str, list] = {}
    for seed in seeds:
        cab, data = judge_drive(rows, seed, noise, anti_alias, real, drawn, calibrate, seconds)
        for when, least in zip(("causal", "smoothed"), least_error(cab, data)):
            rows.setdefault(f"least {when}", []).extend(least.ravel())
        stiffness, force = (100 * max(rows[f"{what} vertical"][-4:]) for what in ("k", "force"))
        mounts = 4
        sideways, upright = (
            100 * np.mean(rows[f"later {axis}"][-count * mounts :]) for axis, count in (("horizontal", 2), ("vertical", 1))
        )
        print(
            f"  seed {seed}: kz {stiffness:.2f} %, force z {force:.1f} %; smoothed sideways {sideways:.1f} %, "
            f"vertical {upright:.1f} %", file=sys.stderr,
        )  # fmt: skip
    return rows


def masses(seeds: range, noise: float) -> dict[str, list]:
    rows: dict[str, list] = {}
    for seed in seeds:
        cab, data = world(seed, 13.0, noise, 0.0)
        k = cab.stiffness[0, 2]
        belief = Belief(
            mass_off=0.15,
            inertia_off=0.15,
            mass_std=0.2,
            inertia_std=0.2,
            force_references=("{kind: known_stiffness, mount: front_left, axis: z, relative_std: 0.01}",),
        )
        vehicle = believed_vehicle(data, belief, seed=seed)
        old = vehicle.mounts["front_left"].elements["z"]
        # the reference is the element as the file states it: make the file right for this one stiffness
        vehicle = vehicle.replace_elements({("front_left", "z"): old.replace(stiffness=float(k))})
        body = vehicle.bodies["cab"]
        # in every other world the inertia is off with the mass, in the rest it is right
        body = dataclasses.replace(body, inertia=cab.inertia * (1.15 if seed % 2 else 1.0))
        vehicle = dataclasses.replace(vehicle, bodies={"cab": body})
        pipeline = Pipeline(vehicle)
        through(pipeline, data)
        rows.setdefault("anchored", []).append(abs(pipeline.parameters()[0].value / cab.mass - 1.0))
        bare = Pipeline(dataclasses.replace(vehicle, force_references=()))
        through(bare, data)
        rows.setdefault("not identifiable", []).append(bare.parameters()[0].status.value == "not_identifiable")
    return rows


def changes(seeds: range, noise: float) -> list[float]:
    """Return the relative error of every vertical stiffness 15 s after one mount became 20 % softer within a second."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        cab = random_vehicle(rng, "air")
        sensors = random_sensors(cab, rng)
        drift = np.zeros((4, 3, 4))
        drift[:, :, 1:3] = [12.0, 13.0]
        drift[0, 2, 0] = -0.2
        changed = dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, drift=drift))
        run = simulate(changed, base_motion(Road.random(rng), cab.mounts, 29.0, 5e-4, seed))
        data = measure(run, sensors, 250.0, seed, noise_share=noise, anti_alias=0.0)
        pipeline = Pipeline(believed_vehicle(data, seed=seed))
        _, estimates = through(pipeline, data, 28.0)
        true = {m: cab.stiffness[i, 2] * (0.8 if i == 0 else 1.0) for i, m in enumerate(cab.mount_names)}
        found += [abs(e.value / true[e.name.split(".")[0]] - 1.0) for e in estimates if e.name.endswith("z.stiffness")]
    return found


def table(rows: dict[str, list], mass: dict[str, list], change: list[float]) -> None:
    def line(what: str, target: str, value: str) -> None:
        print(f"| {what} | {target} | {value} |")

    print("| quantity | target | measured |\n|---|---|---|")
    n = len(rows["nees"])
    line(
        "CG acceleration, mean normalised error squared / 6",
        f"band {np.round(band(6 * n), 2)}",
        f"{np.mean(rows['nees']) / 6:.2f}",
    )
    line(
        "the same, vertical and rotations only / 4",
        f"band {np.round(band(4 * n), 2)}",
        f"{np.mean(rows['nees z and rotation']) / 4:.2f}",
    )
    for group, target in (("k vertical", 1), ("c vertical", 2), ("k horizontal", 3), ("c horizontal", 6)):
        p95, median = (100 * np.percentile(rows[group], q) for q in (95, 50))
        line(f"{group}, 95th percentile (median)", f"{target} %", f"{p95:.2f} % ({median:.2f} %)")
        line(f"{group}, inside 2 sigma", "92 to 98 %", f"{100 * np.mean(np.array(rows[group + ' ratio']) < 2.0):.1f} %")
    for axis, target in (("vertical", 4), ("horizontal", 8)):
        scores = 100 * np.array(rows[f"force {axis}"])
        line(
            f"force NRMSE {axis}, median (95th percentile)",
            f"{target} %",
            f"{np.median(scores):.1f} % ({np.percentile(scores, 95):.1f} %)",
        )
        if axis == "horizontal":
            for when in ("causal", "smoothed"):
                least = 100 * np.array(rows[f"least {when}"])
                value = f"{np.median(least):.1f} % ({np.percentile(least, 95):.1f} %)"
                line(f"least that any estimate of these leaves {when}, median (95th percentile)", "-", value)
        line(f"force {axis}, inside 2 sigma", "92 to 98 %", f"{100 * np.mean(rows[f'inside {axis}']):.1f} %")
        line("the same without the doubt about the mass", "92 to 98 %", f"{100 * np.mean(rows[f'apart {axis}']):.1f} %")
        scores = 100 * np.array(rows[f"later {axis}"])
        line(
            f"force NRMSE {axis} of a replay, smoothed, median (95th percentile)",
            f"{target} %",
            f"{np.median(scores):.1f} % ({np.percentile(scores, 95):.1f} %)",
        )
        line(f"force {axis} smoothed, inside 2 sigma", "92 to 98 %", f"{100 * np.mean(rows[f'later inside {axis}']):.1f} %")
        for path, name in (("live", "live"), ("later", "smoothed")):
            line(f"force {axis} {name}, std over error", "1 to 1.3", f"{np.median(rows[f'{path} {axis} std over error']):.2f}")
    line("share of the model of the whole run", "-", f"{100 * np.mean(rows['model share']):.0f} %")
    worst = f"{100 * max(mass['anchored']):.2f} %"
    line("mass with known stiffness (file mass 15 % high, with and without the inertia), worst", "3 %", worst)
    line(
        "mass without anchor: not_identifiable",
        "every run",
        f"{sum(mass['not identifiable'])} of {len(mass['not identifiable'])}",
    )
    line("20 % softer mount, error of kz 15 s later, 95th percentile", "3 %", f"{100 * np.percentile(change, 95):.2f} %")


def band(freedom: int) -> np.ndarray:
    """Return the 95 % band of a mean normalised error squared with so many degrees of freedom."""
    from scipy import stats

    return np.array([stats.chi2.ppf(q, freedom) / freedom for q in (0.025, 0.975)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="number of worlds (default 20)")
    parser.add_argument("--first", type=int, default=100, help="first seed (default 100)")
    parser.add_argument("--noise", type=float, default=0.01, help="noise over signal rms (default 0.01)")
    parser.add_argument(
        "--anti-alias", type=float, default=0.0, help="corner of the sensors' filters over their rate, 0 none (default 0)"
    )
    parser.add_argument("--installed", action="store_true", help="sensors with all errors of a usual installation")
    parser.add_argument("--drawn", action="store_true", help="a vehicle file that errs by what it states")
    parser.add_argument("--calibrated", action="store_true", help="calibrate the sensors from another drive first")
    parser.add_argument("--seconds", type=float, default=15.0, help="length of a run (default 15)")
    given = parser.parse_args()
    start = time.perf_counter()
    seeds = range(given.first, given.first + given.seeds)
    few = range(given.first, given.first + max(given.seeds // 4, 1))
    rows = nominal(seeds, given.noise, given.anti_alias, given.installed, given.drawn, given.calibrated, given.seconds)
    table(rows, masses(few, given.noise), changes(few, given.noise))
    print(f"{given.seeds} worlds, {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
