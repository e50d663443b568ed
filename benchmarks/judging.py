# Copyright 2026 ride_estimation contributors
"""Judge the online estimator on the independent worlds: errors, coverage and consistency against planted truth.

``judge_cab(seed)`` draws a cab, a road and sensors, runs ``estimation.pipeline.Pipeline`` over the samples in the order of
their stamps and returns a :class:`CabJudgement`; ``summarise`` turns many into the figures of the table of targets. Run as a
script it prints that table: ``python benchmarks/judging.py --seeds 20 --duration 25``.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "test"))

from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import CabVehicle, Measurement, measure, random_sensors, random_vehicle, simulate
from worlds.effects import Effect
from worlds.roads import Road, base_motion
from worlds.vehicle_text import Belief

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.pipeline import Pipeline

AXES = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class ParameterTrace:
    """Estimates of one parameter over time: seconds, value, std, status; ``true`` value (at the end of the run)."""

    name: str
    true: float
    time: np.ndarray
    value: np.ndarray
    std: np.ndarray
    status: tuple[str, ...]

    def at(self, when: float) -> int:
        """Return the index of the newest estimate at a time [s]."""
        return int(np.searchsorted(self.time, when, side="right") - 1)

    def error(self, when: float) -> float:
        """Return the relative error at a time."""
        return float(self.value[self.at(when)] / self.true - 1.0)

    def score(self, when: float) -> float:
        """Return (value - true) / std at a time."""
        i = self.at(when)
        return float((self.value[i] - self.true) / max(self.std[i], 1e-300))


@dataclasses.dataclass(frozen=True)
class Scored:
    """Forces against their truth per mount and axis (M, 3): rms error over the standard deviation of the true force, the same
    with means removed from both (static share left out), and the share of samples within two standard deviations.
    """

    nrmse: np.ndarray
    moving_nrmse: np.ndarray
    coverage: np.ndarray


@dataclasses.dataclass(frozen=True)
class CabJudgement:
    """What one run showed.

    Attributes
    ----------
    traces
        By parameter name ``<mount>.<axis>.stiffness|damping`` and ``cab.mass``.
    force_nrmse, force_coverage
        Per mount and axis (M, 3) after ``from_s``: rms error over the standard deviation of the true force; share of samples
        within two standard deviations.
    force_moving_nrmse
        The same with means removed from both (static share left out).
    motion_nees, load_nees
        Normalised error squared per sample of specific force and support load, (N,), six degrees of freedom each.
    accel_nees
        The same of the CG acceleration without gravity.
    speed
        Seconds of signal per second of processor time of one core.
    """

    seed: int
    modes: np.ndarray
    traces: dict[str, ParameterTrace]
    force_nrmse: np.ndarray
    force_moving_nrmse: np.ndarray
    force_coverage: np.ndarray
    motion_nees: np.ndarray
    accel_nees: np.ndarray
    load_nees: np.ndarray
    speed: float
    messages: tuple[str, ...]


def run_pipeline(
    measurement: Measurement, vehicle: object, settings: PipelineSettings | None = None, every_s: float = 0.5
) -> tuple[dict[str, np.ndarray], list[tuple[float, tuple]], float, Pipeline]:
    """Return stacked outputs, parameter snapshots (time s, estimates), processor time [s] and the pipeline.

    Samples go in one by one in the order of their stamps, as from a bag.
    """
    pipeline = Pipeline(vehicle, settings)  # type: ignore[arg-type]
    samples = [(stamp, name, values.tolist()) for stamp, name, values in arrivals(measurement)]
    blocks, snapshots, next_snapshot = [], [], START_NS + round(every_s * 1e9)
    began = time.process_time()
    for stamp, name, values in samples:
        blocks += pipeline.observe(name, stamp, values)
        if stamp >= next_snapshot:
            snapshots.append(((stamp - START_NS) * 1e-9, pipeline.parameters()))
            next_snapshot += round(every_s * 1e9)
    blocks += pipeline.finish()
    elapsed = time.process_time() - began
    snapshots.append(((samples[-1][0] - START_NS) * 1e-9, pipeline.parameters()))
    keys = ("stamp_ns", "cg_accel", "cg_specific_force", "support_load", "mount_force", "mount_force_std", "mount_deflection")
    stacked = {key: np.concatenate([getattr(b, key) for b in blocks]) for key in keys}
    for key in ("cg_accel_covariance", "cg_specific_force_covariance", "load_covariance"):
        stacked[key] = np.concatenate([np.broadcast_to(getattr(b, key), (len(b.stamp_ns), 6, 6)) for b in blocks])
    return stacked, snapshots, elapsed, pipeline


def true_parameters(cab: CabVehicle) -> dict[str, float]:
    """Return the true stiffness and damping by the product's parameter names."""
    out = {"cab.mass": cab.mass}
    for i, mount in enumerate(cab.mount_names):
        for a, axis in enumerate(AXES):
            out[f"{mount}.{axis}.stiffness"] = float(cab.stiffness[i, a])
            out[f"{mount}.{axis}.damping"] = float(cab.damping[i, a])
    return out


def _truth_at_ticks(
    out: dict[str, np.ndarray], measurement: Measurement, from_s: float, to_s: float
) -> tuple[np.ndarray, Callable[[str], np.ndarray]]:
    """Return which ticks lie in a stretch and the truth there by key."""
    seconds = (out["stamp_ns"] - START_NS) * 1e-9
    keep = (seconds >= max(from_s, measurement.time[0])) & (seconds <= min(to_s, measurement.time[-1]))

    def truth(key: str) -> np.ndarray:
        # ticks fall between the samples of the truth: straight lines would be the largest error of the comparison
        return CubicSpline(measurement.time, measurement.truth[key], axis=0)(seconds[keep])

    return keep, truth


def scored_forces(out: dict[str, np.ndarray], measurement: Measurement, from_s: float, to_s: float = np.inf) -> Scored:
    """Return the forces of :func:`run_pipeline` against the truth of a stretch [s]."""
    keep, truth = _truth_at_ticks(out, measurement, from_s, to_s)
    force = truth("mount_force")
    error, spread = out["mount_force"][keep] - force, force.std(axis=0)
    moving = error - error.mean(axis=0)
    inside = np.abs(error) <= 2.0 * out["mount_force_std"][keep]
    return Scored(np.sqrt(np.mean(error**2, axis=0)) / spread, np.sqrt(np.mean(moving**2, axis=0)) / spread, inside.mean(axis=0))


def judge(
    measurement: Measurement,
    vehicle: object,
    seed: int,
    *,
    settings: PipelineSettings | None = None,
    from_s: float = 12.0,
    true: dict[str, float] | None = None,
) -> CabJudgement:
    """Run the pipeline over a measurement and compare with its truth after ``from_s`` seconds."""
    out, snapshots, elapsed, pipeline = run_pipeline(measurement, vehicle, settings)
    cab = measurement.run.vehicle
    true = true or true_parameters(cab)
    traces = {}
    for name, value in true.items():
        found = [(t, e) for t, estimates in snapshots for e in estimates if e.name == name]
        if found:
            traces[name] = ParameterTrace(
                name, value, np.array([t for t, _ in found]), np.array([e.value for _, e in found]),
                np.array([e.std for _, e in found]), tuple(e.status.value for _, e in found),
            )  # fmt: skip
    keep, truth = _truth_at_ticks(out, measurement, from_s, np.inf)
    scored = scored_forces(out, measurement, from_s)
    specific = np.hstack([truth("specific_force"), truth("cg_accel")[:, 3:]])
    return CabJudgement(
        seed=seed,
        modes=cab.modes(),
        traces=traces,
        force_nrmse=scored.nrmse,
        force_moving_nrmse=scored.moving_nrmse,
        force_coverage=scored.coverage,
        motion_nees=_nees(out["cg_specific_force"][keep] - specific, out["cg_specific_force_covariance"][keep]),
        accel_nees=_nees(out["cg_accel"][keep] - truth("cg_accel"), out["cg_accel_covariance"][keep]),
        load_nees=_nees(out["support_load"][keep] - truth("inertial_load"), out["load_covariance"][keep]),
        speed=float(measurement.time[-1] / elapsed),
        messages=tuple(pipeline.health().messages),
    )


def _nees(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])


def make_measurement(
    seed: int,
    *,
    duration: float = 25.0,
    rate_hz: float = 200.0,
    noise: float = 0.01,
    vehicle_kind: str = "any",
    road_kind: str = "any",
    displacement: tuple[tuple[str, str], ...] = (),
    chassis: bool = True,
    phases: bool = True,
    change: Callable[[CabVehicle, float], CabVehicle] | None = None,
    effect: Effect | None = None,
    road: Road | None = None,
    anti_alias: float = 0.0,
) -> Measurement:
    """Return a cab run for a seed; ``change(vehicle, duration)`` may plant a change (``payload_step``)."""
    rng = np.random.default_rng([seed, 2])
    cab = random_vehicle(rng, vehicle_kind)
    sensors = random_sensors(cab, rng, displacement=displacement, chassis=chassis)
    road = road or Road.random(rng, road_kind)
    base = base_motion(road, cab.mounts, duration, 1e-3, seed)
    if change is not None:
        cab = change(cab, duration)
    if effect is not None:
        cab, sensors, _ = effect.apply(1.0)
    options = {"jitter_s": 0.02 / rate_hz, "phases_s": 0.8 / rate_hz} if phases else {}
    share = noise if road.roughness > 0.0 or road.bumps or noise == 0.0 else None
    return measure(simulate(cab, base), sensors, rate_hz, seed, noise_share=share, anti_alias=anti_alias, **options)


def payload_step(
    relative: float, when_s: float, over_s: float = 0.0, arm: Sequence[float] = (0.0, 0.0, 0.0)
) -> Callable[[CabVehicle, float], CabVehicle]:
    """Return a change that adds a share of the mass, a box of half a metre, at ``arm`` from the CG, within ``over_s`` seconds."""

    def change(cab: CabVehicle, duration: float) -> CabVehicle:
        load, place = relative * cab.mass, np.asarray(arm, float)
        mass = cab.mass + load
        apart = cab.mass * load / mass * (place @ place * np.eye(3) - np.outer(place, place))
        inertia = cab.inertia + apart + load * 0.5**2 / 6.0 * np.eye(3)
        after = (when_s, mass, cab.cg + load / mass * place, inertia)
        return dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, mass_after=after, mass_over_s=over_s))

    return change


def judge_cab(
    seed: int, *, belief: Belief | None = None, settings: PipelineSettings | None = None, from_s: float = 12.0, **options: object
) -> CabJudgement:
    """Judge one seed; ``options`` go to :func:`make_measurement`."""
    measurement = make_measurement(seed, **options)  # type: ignore[arg-type]
    vehicle = believed_vehicle(measurement, belief, seed)
    return judge(measurement, vehicle, seed, settings=settings, from_s=from_s)


def summarise(judgements: Sequence[CabJudgement], when: float) -> dict[str, float]:
    """Return the figures of the table: 95th percentiles of |error|, coverage, NRMSE, consistency, speed."""
    figures: dict[str, float] = {"runs": len(judgements)}
    for quantity in ("stiffness", "damping"):
        for group, axes in (("vertical", "z"), ("horizontal", "xy")):
            chosen = [t for j in judgements for n, t in j.traces.items() if n.endswith(quantity) and n.split(".")[1] in axes]
            if not chosen:
                continue
            errors = np.abs([t.error(when) for t in chosen])
            figures[f"{quantity} {group}: error, median"] = float(np.median(errors))
            figures[f"{quantity} {group}: error, 95th percentile"] = float(np.quantile(errors, 0.95))
            figures[f"{quantity} {group}: share called valid"] = float(np.mean([t.status[t.at(when)] == "valid" for t in chosen]))
            figures[f"{quantity} {group}: 2-sigma coverage"] = float(np.mean([abs(t.score(when)) <= 2.0 for t in chosen]))
            figures[f"{quantity} {group}: rms of error/std"] = float(np.sqrt(np.mean([t.score(when) ** 2 for t in chosen])))
    for name, attribute in (("force", "force_nrmse"), ("force, moving part", "force_moving_nrmse")):
        values = np.array([getattr(j, attribute) for j in judgements])
        for group, pick in (("vertical", values[:, :, 2]), ("horizontal", values[:, :, :2])):
            figures[f"{name} {group}: NRMSE, median"] = float(np.median(pick))
            figures[f"{name} {group}: NRMSE, 95th percentile"] = float(np.quantile(pick, 0.95))
    coverage = np.array([j.force_coverage for j in judgements])
    figures["force vertical: 2-sigma coverage"] = float(coverage[:, :, 2].mean())
    figures["force horizontal: 2-sigma coverage"] = float(coverage[:, :, :2].mean())
    for key in ("motion_nees", "accel_nees", "load_nees"):
        values = np.array([getattr(j, key).mean() for j in judgements]) / 6.0
        figures[f"{key}: mean / 6, median over runs"] = float(np.median(values))
        figures[f"{key}: mean / 6, worst run"] = float(values[np.abs(np.log(values)).argmax()])
        inside = np.concatenate([getattr(j, key) for j in judgements]) <= chi2.ppf(0.95, 6)
        figures[f"{key}: share below the 95 % point"] = float(inside.mean())
    figures["speed, slowest run [x real time]"] = float(min(j.speed for j in judgements))
    return figures


def main() -> None:
    """Print the table of figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--duration", type=float, default=25.0)
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--vehicle", default="any")
    parser.add_argument("--road", default="any")
    parser.add_argument(
        "--when", type=float, default=12.0, help="seconds at which parameters are judged (excitation starts at 1-2)"
    )
    parser.add_argument("--no-chassis", action="store_true")
    arguments = parser.parse_args()
    judgements = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        judgements.append(
            judge_cab(
                seed, duration=arguments.duration, rate_hz=arguments.rate, noise=arguments.noise, vehicle_kind=arguments.vehicle,
                road_kind=arguments.road, chassis=not arguments.no_chassis, from_s=arguments.when,
            )
        )  # fmt: skip
        print(f"\r{seed + 1 - arguments.first}/{arguments.seeds}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for name, value in summarise(judgements, arguments.when).items():
        print(f"{name:55s} {value:10.4g}")


if __name__ == "__main__":
    main()
