# Copyright 2026 ride_estimation contributors
"""Switch one mechanism of the online estimator off at a time and print what changes.

    python benchmarks/ablation.py                                          # every mechanism over every group of runs
    python benchmarks/ablation.py --without "sensor drift" "base noise" --groups scenes faults
    python benchmarks/ablation.py --foreign FOLDER --groups foreign        # runs as in benchmarks/foreign_estimation.py

Groups: ``nominal`` (cabs on random roads, sensors installed as usual), ``scenes`` (obstacles, braking, bends, slopes, start in
motion, idling, a load, a warming mount), ``losses`` (chains of gaps, late bursts and clock jumps), ``faults`` (drawn faults of
sensors on drawn layouts), ``slight`` (errors of sensors below what is refused), ``foreign`` (recordings of another program with
truth). A mechanism is switched off by replacing the one function or constant in which it acts, in a process of its own;
``--list`` says what each is for. A line gives the mean of a figure without the mechanism, with it in brackets; only figures
that move by more than ``--least`` of themselves (shares: so many percentage points) are printed. ``identical``: not one digit
of any figure of the group differs. What is identical in all groups is worth nothing there.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import multiprocessing
import os
import pathlib
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test"), str(ROOT / "benchmarks")]

import estimator_scenes as scenes  # noqa: E402
import estimator_targets as targets  # noqa: E402
import foreign_estimation as foreign  # noqa: E402
import random_faults  # noqa: E402
from judging import make_measurement  # noqa: E402
from replay import fault_run, loss_run  # noqa: E402
from replay.layout_faults import WITHIN  # noqa: E402
from worlds.adapters import believed_vehicle  # noqa: E402
from worlds.roads import Road  # noqa: E402

Figures = dict[str, list[float]]
#: figures that are shares
SHARES = ("inside", "named", "recovered", "finite", "identifiable")


# -- mechanisms ----------------------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Mechanism:
    """What is switched off: an attribute ``Class.name`` or ``NAME`` of a module of ``ride_estimation.estimation``.

    ``off`` is put in its place; what returns what the function was given is made by :func:`given`.
    """

    module: str
    attribute: str
    off: Any
    purpose: str

    def switch_off(self) -> None:
        """Replace the attribute."""
        owner: Any = importlib.import_module(f"ride_estimation.estimation.{self.module}")
        *classes, name = self.attribute.split(".")
        for c in classes:
            owner = getattr(owner, c)
        if not hasattr(owner, name):
            raise SystemExit(f"{self.module}.{self.attribute} does not exist")
        setattr(owner, name, self.off)


def returns(value: object) -> Callable[..., object]:
    """Return a function that returns a value whatever it is given."""
    return lambda *_, **__: value


def given(position: int) -> Callable[..., object]:
    """Return a method that returns the argument at a position, self not counted."""
    return lambda _self, *arguments, **__: arguments[position]


def _without_frame(original: Callable[..., None]) -> Callable[..., None]:
    def begin(self: Any, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        self._frame = None

    return begin


def _without_tilt(original: Callable[..., None]) -> Callable[..., None]:
    def begin(self: Any, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        self.learns = False

    return begin


def _mechanisms() -> dict[str, Mechanism]:
    from ride_estimation.estimation.forces.mount_forces import MountForceEstimator
    from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
    from ride_estimation.estimation.model.run_forces import RunForces
    from ride_estimation.estimation.model.segment_ends import Ends
    from ride_estimation.estimation.numerical_guard import NUMERICAL_FAULT

    zero6 = np.zeros((6, 6))
    no_frame_turn = lambda self, base, told, dt: (np.zeros((len(base), 3)), np.zeros((len(base), 3)))  # noqa: E731
    return {
        "nothing": Mechanism("numerical_guard", "NUMERICAL_FAULT", NUMERICAL_FAULT, ""),
        # motion of the body
        "residual covariance": Mechanism(
            "motion.cg_motion", "residual_covariance", returns((1.0, zero6)),
            "covariance of the motion from what the sensors leave",
        ),
        "disagreement": Mechanism(
            "motion.cg_motion", "CgMotionEstimator.disagreement", returns((1.0, zero6, zero6)),
            "all that residuals of body sensors add to the covariance of the motion",
        ),
        "sensor drift": Mechanism(
            "motion.cg_motion", "CgMotionEstimator._follow_drift", returns(zero6), "the motion that a drifting sensor makes"
        ),
        "error of one sensor": Mechanism(
            "motion.cg_motion", "error_of_one", returns((zero6, zero6)), "a sensor that contradicts the others widens the motion"
        ),
        "slow error": Mechanism(
            "motion.slow_error", "LastingAcceleration.error_variance", property(returns(0.0)),
            "accelerations that last turn wrong angles and gains into a slow angular acceleration",
        ),
        "rate from residuals": Mechanism(
            "motion.residual_rate", "ResidualRate.observe", returns(False),
            "angular rate from centripetal acceleration without a gyro",
        ),
        "centripetal covariance": Mechanism(
            "motion.cg_motion", "centripetal_covariance", returns(zero6), "uncertain rates in bends widen the motion"
        ),
        "coasting": Mechanism(
            "motion.cg_motion", "CgMotionEstimator._coast", returns(None), "attitude and rates decay while nothing measures them"
        ),
        "tests of sensor errors": Mechanism(
            "sensor_errors.sensor_faults", "FaultTest.judge", returns(None), "names gain, angle, place, delay of a body sensor"
        ),
        "late sensors": Mechanism(
            "faults.late_sensors", "LateSensors.find", returns(False), "puts readings back by a delay that the tests found"
        ),
        "model of the whole run": Mechanism(
            "offline", "run_forces", returns(RunForces(refused="switched off")),
            "smoothed forces by the model, with the sensors' errors estimated",
        ),
        "force beside a law": Mechanism(
            "model.joint", "JointEstimate._free_force", returns(False),
            "the model estimates the force of a mount whose law is not linear as an input",
        ),
        "deformation near the ends": Mechanism(
            "model.smoother", "ends_of", lambda lines, seen, power, noise, value, rate: Ends(*np.zeros((3, *value.shape))),
            "deformation of the base near the ends of a run from the record as it is, not from the transform",
        ),
        # deflections and forces
        "deformation of the base": Mechanism(
            "forces.mount_forces", "MountForceEstimator.__init__", _without_frame(MountForceEstimator.__init__),
            "filter bank for what the base deforms between the mounts",
        ),
        "bracket tilt": Mechanism(
            "kinematics.bracket_tilt", "BracketTilt.__init__", _without_tilt(BracketTilt.__init__),
            "learns how brackets tilt with the base",
        ),
        "rotation of a levelled frame": Mechanism(
            "kinematics.bracket_tilt", "BracketTilt.frame_turn", no_frame_turn, "rotation of a levelled base between its mounts"
        ),
        "equilibrium of deflections": Mechanism(
            "forces.mount_forces", "MountForceEstimator.equilibrium", returns(None), "slow deflections from the loads of the body"
        ),
        "contradicted deflections": Mechanism(
            "kinematics.deflection", "DeflectionEstimator._astray", returns(False),
            "deflections that equilibrium contradicts begin anew",
        ),
        "strain covariance": Mechanism(
            "forces.mount_forces", "MountForceEstimator._strain_covariance", returns(0.0), "finite rotations strain the mounts"
        ),
        "static covariance": Mechanism(
            "forces.mount_forces", "MountForceEstimator._static_variance", returns(0.0), "twist of the static loads is not known"
        ),
        "covariance of a placed load": Mechanism(
            "forces.mount_forces", "MountForceEstimator._placed_load", returns(zero6), "a load lies anywhere between the mounts"
        ),
        "covariance of a misread base": Mechanism(
            "parameters.parameter_estimator", "ParameterEstimator.misread_variance",
            property(lambda self: np.zeros((len(self.geometry.mounts), 3))), "forces where a base sensor reads too much",
        ),
        "widening without a base sensor (deflection)": Mechanism(
            "forces.base_fill", "BaseFill.widen", given(0), "deflections of a mount whose base motion is a guess"
        ),
        "widening without a base sensor (force)": Mechanism(
            "forces.base_fill", "BaseFill.widen_forces", given(0), "forces while a base sensor may be wrong"
        ),
        "frame begins anew": Mechanism(
            "kinematics.frame_deformation", "FrameDeformation.undeform", returns(None),
            "what a wrong base sensor made of the deformation of the frame is forgotten when it is left out",
        ),
        # parameters
        "installation errors in parameters": Mechanism(
            "sensor_errors.installed_errors", "InstalledErrors.std", property(lambda self: np.zeros(self.count)),
            "errors of the sensors in the std of k and c",
        ),
        "spurious deformation": Mechanism(
            "sensor_errors.spurious_deformation", "SpuriousDeformation.std", lambda self, prior: np.zeros_like(prior),
            "a split of stiffness that only noise and errors of the bases show",
        ),
        "lean of the body": Mechanism(
            "parameters.body_lean", "BodyLean.found", returns(None), "a load that soft mounts show by how far the body leans"
        ),
        "amplitude dependence": Mechanism(
            "parameters.amplitude", "AmplitudeDependence.std", property(lambda self: np.zeros(self._free_parameters)),
            "laws that are not linear widen k and c",
        ),
        "periodic excitation": Mechanism(
            "parameters.periodic_excitation", "PeriodicExcitation.observe", returns(False), "an engine that idles teaches nothing"
        ),
        "contradicting intervals": Mechanism(
            "parameters.parameter_filter", "ParameterFilter._follow", returns(None), "follows slow changes of parameters"
        ),
        "gate of innovations": Mechanism(
            "parameters.parameter_filter", "_SUSPECT_RATIO", np.inf, "innovations beyond the gate are refused, then a change"
        ),
        "weight by scatter": Mechanism(
            "parameters.parameter_filter", "ParameterFilter._reweigh", returns(None), "what was learned weighs as it scatters"
        ),
        "reviews": Mechanism(
            "parameters.parameter_estimator", "_REVIEWS", (), "the first seconds are estimated again as a whole"
        ),
        "share of rotation": Mechanism(
            "parameters.parameter_estimator", "FOLLOW_STD", 1e-6, "share of the brackets' rotation that the mounts follow"
        ),
        "unknown loads": Mechanism(
            "pipeline", "Pipeline._find_load", returns(None), "a load there from the start, by static travel and the CG"
        ),
        # checks of the input
        "check of bases against each other": Mechanism(
            "faults.base_check", "BaseCheck.judged", given(1), "a base sensor that leaves the plane of the others"
        ),
        "lasting errors of bases": Mechanism(
            "faults.base_faults", "BaseFaults.judged", given(1), "gain, angle, delay, offset of a base sensor against the others"
        ),
        "balance of bases": Mechanism(
            "faults.base_balance", "BaseBalance.judged", given(0), "errors of a base sensor against the balance of the body"
        ),
        "noise of bases": Mechanism("faults.base_noise", "BaseNoise.judged", given(0), "noise and hum of a base sensor"),
        "exchanged topics": Mechanism("faults.swapped_topics", "SwappedTopics.observe", returns(""), "two topics exchanged"),
        "check of gyros": Mechanism("faults.gyro_check", "GyroCheck.observe", returns(()), "unit, sign and axes of gyros"),
        "roll back": Mechanism(
            "pipeline", "Pipeline._take_back", returns(None), "what a faulty sensor taught before it was found is forgotten"
        ),
        "guard": Mechanism("numerical_guard", "NumericalGuard.accept", returns(True), "a load that cannot be ends in a restart"),
    }  # fmt: skip


# -- runs ----------------------------------------------------------------------------------------------------------------------


def nominal(seeds: Sequence[int]) -> Figures:
    """Return errors and coverage of parameters, live and smoothed forces, and the consistency of the CG motion."""
    figures: Figures = {}
    for seed in seeds:
        targets.judge_drive(figures, seed, 0.01, 0.0, real=True)
    return figures


def scene_runs(seeds: Sequence[int]) -> Figures:
    """Return the figures of the scenes of a working day, named by scene."""
    figures: Figures = {}
    for seed in seeds:
        for name, run in _scenes(seed).items():
            own: Figures = {}
            run(own)
            for key, values in own.items():
                figures.setdefault(f"{name}: {key}", []).extend(np.ravel(values).tolist())
    return figures


def _scenes(seed: int) -> dict[str, Callable[[Figures], object]]:
    """Return what runs every scene of a seed into figures."""

    def over(road: Road, cut_s: float = 0.0) -> Callable[[Figures], object]:
        return lambda own: scenes.drive_once(seed, own, road=road, duration=30.0 - cut_s, cut_s=cut_s)

    return {
        **{kind: over(scenes.lasting(kind, seed)) for kind in ("brake", "bend", "slope")},
        "potholes": over(scenes.obstacles("potholes", seed)),
        "start in motion": over(Road.random(np.random.default_rng([seed, 12]), "rough"), cut_s=8.0),
        "idle": lambda own: scenes.idle(seed, (650 / 60, 0.3), 2.0, own),
        "load": lambda own: scenes.payload(seed, None, 0.0, True, own),
        "load from the start": lambda own: _loaded_drive(seed, own),
        "warming mount": lambda own: scenes.warm(seed, True, own),
    }


def _loaded(cab: Any, duration: float) -> Any:
    del duration
    arm, load = np.array([0.3, 0.2, 0.1]), 0.2 * cab.mass
    apart = cab.mass * load / (cab.mass + load) * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    cg = cab.cg + load / (cab.mass + load) * arm
    after = (0.0, cab.mass + load, cg, cab.inertia + apart)
    return dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, mass_after=after, mass_over_s=0.0))


def _loaded_drive(seed: int, figures: Figures) -> None:
    data = make_measurement(seed, duration=30.0, rate_hz=100.0, change=_loaded)
    out, snapshots, _, _ = scenes.run_pipeline(data, believed_vehicle(data, None, seed))
    scenes.add_errors(figures, scenes.at(snapshots, 25.0), scenes.true_parameters(data.run.vehicle))
    scenes.add_forces(figures, scenes.scored_forces(out, data, 12.0))


def losses(seeds: Sequence[int]) -> Figures:
    """Return what chains of losses do to the forces, over all layouts."""
    figures: Figures = {}
    for seed in seeds:
        for name in loss_run.LAYOUTS:
            given = loss_run.course.__wrapped__(name, seed, 30.0)
            for v in loss_run.sequences(given, seed, 3, loss_run.undisturbed(given)):
                figures.setdefault("finite", []).append(float(v.finite))
                figures.setdefault("largest force over the true one", []).append(v.largest)
                figures.setdefault("error after the calm", []).append(float(np.max(v.error)))
                if np.all(v.ticks):
                    figures.setdefault("inside", []).append(float(np.mean(v.inside / v.ticks)))
    return figures


def faults(seeds: Sequence[int]) -> Figures:
    """Return how drawn sensor faults are named and what they do, eight per layout."""
    figures: Figures = {}
    for seed in seeds:
        key = (seed, "random")
        w, rng = fault_run.world(key), np.random.default_rng([seed, 7])
        usual = fault_run.clean(key)
        names = [s.name for s in w.measurement.sensors]
        figures.setdefault("sensors named in clean runs", []).append(
            float(sum(any(n in text for n in names) for text in usual.texts))
        )
        for _ in range(8):
            fault, start, name = random_faults.draw(w, rng)
            begin = fault_run.MOVING if start else fault_run.BEGIN
            messages = fault.plant(0.0 if start else fault_run.BEGIN)(w, list(w.messages), np.random.default_rng([seed, 99]))
            places = "|".join(n for n in (fault.victim, fault.partner) if n)
            expected = f"{places}|one of .*|no single sensor" if name.startswith("cab") else places
            shown = fault_run.behaviour(w.vehicle, messages, expected, begin, lambda t: t, fault_run.beginning(key))
            outcome = fault_run.judged(key, shown, begin, fault_run.LENGTH)
            figures.setdefault("named in time", []).append(float(outcome.to_flag_s <= WITHIN))
            figures.setdefault("inside", []).append(outcome.inside)
            figures.setdefault("largest error of a valid parameter [std]", []).append(min(outcome.wrong_stds, 100.0))
    return figures


def slight(seeds: Sequence[int]) -> Figures:
    """Return forces while a body sensor drifts, reads too much or is turned, and while a base sensor is missing."""
    figures: Figures = {}
    for seed in seeds:
        data = make_measurement(seed, duration=30.0, rate_hz=100.0, vehicle_kind="any", road_kind="random")
        body, base = ([s.name for s in data.sensors if (s.place == "cab") == on] for on in (True, False))
        values, late = data.data[body[1]], np.clip(np.arange(len(data.time)) / 100.0 - 15.0, 0.0, 10.0)
        lean = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.1), -np.sin(0.1)], [0.0, np.sin(0.1), np.cos(0.1)]])
        for name, sensor, wrong in (
            ("drift 0.1 m/s^3", body[1], values + np.outer(late, [0.0, 0.0, 0.1])),
            ("gain 1.15", body[1], 1.15 * values),
            ("turned 0.1 rad", body[1], values @ lean),
            ("base missing", base[0], np.where((late > 0.0)[:, None], np.nan, data.data[base[0]])),
        ):
            changed = dataclasses.replace(data, data={**data.data, sensor: wrong})
            out = scenes.run_pipeline(changed, believed_vehicle(data, None, seed))[0]
            own: Figures = {}
            scenes.add_forces(own, scenes.scored_forces(out, changed, 16.0))
            for key, found in own.items():
                figures.setdefault(f"{name}: {key}", []).extend(np.ravel(found).tolist())
    return figures


def foreign_runs(cases: Sequence[pathlib.Path]) -> Figures:
    """Return errors and coverage on the runs of another program."""
    figures: Figures = {}
    for case in cases:
        found = foreign.judge(case)
        for name in ("live vertical", "live sideways", "smoothed vertical", "smoothed sideways"):
            if name in found:
                error, inside, _, ratio = found[name]  # type: ignore[misc]
                for label, value in (("", error), (" inside", inside), (" std over error", ratio)):
                    figures.setdefault(name + label, []).append(float(value))
        for kind, (inside, count, _) in found["parameters"].items():  # type: ignore[attr-defined]
            figures.setdefault(f"valid k, c inside, {kind} mounts", []).extend([1.0] * inside + [0.0] * (count - inside))
    return figures


GROUPS: dict[str, Callable[[Sequence[int]], Figures]] = {
    "nominal": nominal, "scenes": scene_runs, "losses": losses, "faults": faults, "slight": slight,
}  # fmt: skip


# -- the table -----------------------------------------------------------------------------------------------------------------


def _run(job: tuple[str, str, Sequence[Any]]) -> tuple[str, str, Figures | str, float]:
    name, group, runs = job
    _mechanisms()[name].switch_off()
    began = time.process_time()
    try:
        found: Figures | str = foreign_runs(runs) if group == "foreign" else GROUPS[group](runs)
    except Exception as error:  # a mechanism without which nothing works is a result
        found = f"fails: {type(error).__name__}: {error}"
    return name, group, found, time.process_time() - began


def changes(without: Figures, usual: Figures, least: float) -> list[str]:
    """Return the figures that moved, in words; ``["identical"]`` where none has any other digit."""
    if {k: np.round(v, 12).tolist() for k, v in without.items()} == {k: np.round(v, 12).tolist() for k, v in usual.items()}:
        return ["identical"]
    words = []
    for key in dict.fromkeys([*usual, *without]):
        own, before = (float(np.mean(f[key])) if key in f else np.nan for f in (without, usual))
        share = any(word in key for word in SHARES)
        if not (abs(own - before) <= (least if share else least * abs(before))):
            words.append(f"{key} {100 * own:.1f} ({100 * before:.1f}) %" if share else f"{key} {own:.4g} ({before:.4g})")
    return words or [f"below {100 * least:g} %"]


def main() -> None:
    """Print the table."""
    mechanisms = _mechanisms()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--without", nargs="+", choices=list(mechanisms), default=list(mechanisms)[1:], metavar="NAME")
    parser.add_argument("--groups", nargs="+", choices=[*GROUPS, "foreign"], default=list(GROUPS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[4100, 4101], help="worlds of every group but foreign")
    parser.add_argument("--foreign", type=pathlib.Path, help="folder of foreign runs")
    parser.add_argument("--least", type=float, default=0.02, help="change that is printed")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="print the mechanisms and what they are for")
    chosen = parser.parse_args()
    if chosen.list:
        for name, mechanism in list(mechanisms.items())[1:]:
            print(f"{name}: {mechanism.purpose} ({mechanism.module}.{mechanism.attribute})")
        return
    if "foreign" in chosen.groups and chosen.foreign is None:
        parser.error("--groups foreign needs --foreign FOLDER")
    cases = [c for c in sorted(chosen.foreign.iterdir()) if (c / "vehicle.yaml").exists()] if chosen.foreign else []
    jobs = [(n, g, cases if g == "foreign" else chosen.seeds) for g in chosen.groups for n in ("nothing", *chosen.without)]
    usual: dict[str, Figures] = {}
    print("| without | runs | changes: without (with) |\n|---|---|---|")
    # one process per job: what is switched off stays off in it
    with multiprocessing.get_context("fork").Pool(chosen.processes, maxtasksperchild=1) as pool:
        for name, group, found, spent in pool.imap(_run, jobs):
            if name == "nothing":
                if isinstance(found, str):
                    raise SystemExit(f"{group}: {found}")
                usual[group] = found
                print(f"  {group}: {spent:.0f} s of processor time", file=sys.stderr)
                continue
            words = [found] if isinstance(found, str) else changes(found, usual[group], chosen.least)
            print(f"| {name} | {group} | {'; '.join(words)} |", flush=True)


if __name__ == "__main__":
    main()
