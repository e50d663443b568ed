# Copyright 2026 ride_estimation contributors
"""Mass where forces have a scale reference in absolute terms; without one it stays what the vehicle file says.

Accelerations alone leave every signal unchanged under ``(m, J, k, c) -> s (m, J, k, c)``. Everything here estimates that one
factor s: from a stiffness that is known, from a load cell, from the pressure of an air spring at rest or from a mass added during
the run.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.free_parameters import FreeParameter
from ride_estimation.estimation.parameters.body_lean import Leaning
from ride_estimation.estimation.parameters.parameter_change import common_change
from ride_estimation.estimation.parameters.static_travel import Load
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import ForceReference

Array = NDArray[np.float64]

#: relative standard deviation of a reference that states none
DEFAULT_STD = {"known_stiffness": 0.02, "load_cell": 0.01, "air_spring_pressure": 0.03, "known_added_mass": 0.005}
#: relative standard deviation of a mount's share of the weight (levelling)
_SHARE_STD = 0.03
#: memory of the means of a load cell [s]
_MEAN_MEMORY = 4.0
#: correlation time of its misfit [s]
_CORRELATION = 0.3
#: excited time needed on each side of an added mass [s]
_SETTLED = 8.0
#: relative standard deviation that a possible load leaves of a mass that is declared as known, beyond which it is suspect
_KNOWN = 0.03
#: common change of all logarithms that is reported
_LOAD = 0.05
#: standard deviations that it must be
_CLEARLY = 4.0
#: share of all change that it must explain
_COMMON = 0.75

NULL_DIRECTION = (
    "mass, inertia and all stiffness and damping values scaled by one factor together: accelerations do not change; only ratios "
    "such as k/m, c/m and force per mass are identifiable"
)


@dataclasses.dataclass
class _Slope:
    """Regression of a load cell on the estimated force; ``time`` is that of the excitation it remembers [s]."""

    cross: float = 0.0
    square: float = 0.0
    misfit: float = 0.0
    time: float = 0.0

    @property
    def value(self) -> float:
        """Reading of the cell over the estimated force, one before anything is known."""
        return self.cross / self.square if self.square > 0.0 else 1.0

    @property
    def std(self) -> float:
        """Standard deviation of the value by how the cell scatters about it."""
        return math.sqrt(self.misfit * 2.0 * _CORRELATION / (self.square * self.time)) if self.square > 0.0 else math.inf

    def add(self, force: Array, cell: Array, duration: float) -> None:
        """Take moving parts of force and cell, shape (K,) [N], and how long they last [s]."""
        self.cross += float(force @ cell) / len(force) * duration
        self.square += float(force @ force) / len(force) * duration
        self.misfit += float(np.mean((cell - self.value * force) ** 2)) * duration
        self.time += duration


@dataclasses.dataclass
class _Cell:
    """A load cell against the estimated force: means, shape (3,), and slope since the last load came on."""

    mean_cell: Array
    mean_force: Array
    slope: _Slope = dataclasses.field(default_factory=_Slope)
    time: float = 0.0


class MassReference:
    """The factor between the true mass and the one of the vehicle file.

    Parameters
    ----------
    geometry
        Body, mounts, force references.
    free_parameters
        Multipliers of the parameter estimator.
    """

    def __init__(self, geometry: Geometry, free_parameters: Sequence[FreeParameter]) -> None:
        self.geometry = geometry
        self._free_parameters = tuple(free_parameters)
        body = geometry.body.name
        self._references = tuple(
            r for r in geometry.vehicle.force_references if r.mount in geometry.mount_names or r.body == body
        )
        self.known = any(r.kind == "known_mass" for r in self._references)
        self._cells = {r.sensor: _Cell(np.zeros(3), np.zeros(3)) for r in self._references if r.kind == "load_cell"}
        self._found: dict[int, tuple[float, float]] = {}
        self._before: tuple[Array, Array] | None = None
        self._added_at = 0.0
        self._bare: tuple[float, float] | None = None
        #: parameters of the beginning, and by how much all of them together have changed since
        self._first: tuple[Array, Array] | None = None
        self._together = 0.0
        #: the common change from which on load cells are compared
        self._slopes_from = 0.0
        #: logarithm of the mass with what static travel shows over the file's and its standard deviation, and at the beginning
        self._load: tuple[float, float] | None = None
        self._load_first = 0.0
        #: where the CG lies off its place in the file and its standard deviation, shape (3,) each [m], None where it does not
        self.moved_cg: tuple[Array, Array] | None = None
        #: how the body leans where that is not explained
        self.leaning: Leaning | None = None
        #: share of the mass of the file that a load which moved the CG there has, where static travel does not decide, and its
        #: standard deviation
        self.possible_load = (0.0, 0.0)

    @property
    def cells(self) -> tuple[tuple[str, int], ...]:
        """Return (sensor, mount index) of the load cells that are a scale reference."""
        names = self.geometry.mount_names
        return tuple((r.sensor, names.index(r.mount)) for r in self._references if r.kind == "load_cell")

    @property
    def has_reference(self) -> bool:
        """Return whether the vehicle file names a scale reference of forces."""
        return bool(self._references)

    def observe_cell(self, sensor: str, measured: Array, force: Array, duration: float) -> None:
        """Compare a load cell with the force estimated for the file's mass; moving parts only.

        Parameters
        ----------
        sensor
            Name of the cell.
        measured, force
            Shape (K, 3) [N].
        duration
            Of the block [s].
        """
        cell = self._cells[sensor]
        share = 1.0 - math.exp(-duration / _MEAN_MEMORY)
        if cell.time == 0.0:
            cell.mean_cell, cell.mean_force = measured.mean(axis=0), force.mean(axis=0)
        cell.mean_cell = cell.mean_cell + share * (measured.mean(axis=0) - cell.mean_cell)
        cell.mean_force = cell.mean_force + share * (force.mean(axis=0) - cell.mean_force)
        cell.time += duration
        if cell.time < _MEAN_MEMORY:
            return
        a, b = (force - cell.mean_force)[:, 2], (measured - cell.mean_cell)[:, 2]
        cell.slope.add(a, b, duration)

    def update(self, theta: Array, std: Array, static_force: Array, run_time: float, excited_time: float) -> None:
        """Evaluate all references with the present parameters.

        Parameters
        ----------
        theta, std
            Logarithms of the multipliers for the file's mass and their standard deviations, shape (N,).
        static_force
            Of the mounts for the file's mass, shape (M, 3) [N].
        run_time, excited_time
            Since the start of the run, and of excitation in it [s].
        """
        self._compare(theta, std, excited_time)
        for n, reference in enumerate(self._references):
            found = self._evaluated(reference, theta, std, static_force, run_time, excited_time)
            if found is not None:
                self._found[n] = found

    def take_static_travel(self, load: Load | None) -> None:
        """Take what static travel says of a load that the file does not know."""
        self._load = None if load is None else (load.log, load.std)

    def _compare(self, theta: Array, std: Array, excited_time: float) -> None:
        """Follow by how much all stiffness and damping values together have changed since the beginning of the run."""
        if not len(theta) or excited_time < _SETTLED:
            return
        if self._first is None:
            self._first = theta.copy(), std.copy()
            self._load_first = self._load[0] if self._load else 0.0
        change, change_std, share = common_change(*self._first, theta, std)
        # a change that was clear has not gone because the parameters became less certain
        needed = 1.0 if self._together else _CLEARLY
        clear = abs(change) > max(_LOAD, needed * change_std) and share > _COMMON
        self._together = change if clear else 0.0
        if abs(self._together - self._slopes_from) > _LOAD:
            self._begin_slopes_anew()

    def _begin_slopes_anew(self) -> None:
        """A load that came on is none of what load cells showed before; until they show it, what they showed is carried along."""
        for n, r in enumerate(self._references):
            if r.kind == "load_cell":
                self._cells[r.sensor].slope = _Slope()
                if n in self._found:
                    log, std = self._found[n]
                    self._found[n] = log + self._slopes_from - self._together, math.hypot(std, self.load_std)
        self._slopes_from = self._together

    @property
    def load_std(self) -> float:
        """Return the relative standard deviation that an unknown load leaves of the mass.

        A common change of all parameters is a load or mounts that all change alike: at even odds the mean square error of either
        reading is half the square. What static travel shows of a load is known.
        """
        changed = self._together
        if changed and self._load is not None:
            changed += self._load[0] - self._load_first
            changed = changed if abs(changed) > max(_LOAD, _CLEARLY * self._load[1]) else 0.0
        share, std = self.possible_load
        return math.hypot(math.expm1(-changed) / math.sqrt(2.0), std / (1.0 + share))

    @property
    def load_suspicion(self) -> str:
        """Return why nothing learned is called valid for a load that nobody knows, empty where nothing speaks for one."""
        if self.possible_load[1] == 0.0:
            return ""
        if self.leaning is not None:
            return "the body leans against its bases as with a payload"
        return "the CG is not where the vehicle file has it: a payload, whose mass is not observable, or a wrong CG"

    def notes(self) -> list[str]:
        """Return what the person in the field should know about the mass."""
        return [*self._words_of_load(), *self._words_of_change()]

    def _words_of_load(self) -> list[str]:
        body = self.geometry.body
        if self._load is not None:
            mass = self.factor()[0] * self.geometry.file_mass
            added = mass * -math.expm1(-self._load[0])
            way = "carries a load that its file does not know" if added > 0.0 else "is lighter than its file says"
            words = f"{body.name} {way}: {added:+.0f} +- {mass * self._load[1]:.0f} kg by the static travel of its mounts"
            if self.moved_cg is not None:
                place, spread = body.cg + self.moved_cg[0] * mass / added, np.abs(self.moved_cg[1] * mass / added)
                words += ", at " + ", ".join(f"{a} {p:.2f} +- {s:.2f} m" for a, p, s in zip("xy", place, spread))
            return [words + "; mass, stiffness, damping and forces are stated for it"]
        if self.leaning is not None:
            return [f"{body.name} {self.leaning.in_words()}"]
        if self.moved_cg is None:
            return []
        where = ", ".join(f"{axis} {1e3 * v:+.0f} +- {1e3 * s:.0f} mm" for axis, v, s in zip(AXES, *self.moved_cg))
        share, std = (100.0 * part for part in self.possible_load)
        stated = f"; mass and forces are stated for {share:+.0f} +- {std:.0f} % of the mass" if std else ""
        return [
            f"the CG of {body.name} differs from the vehicle file: {where}. Cause: a payload, or a wrong CG in the file; "
            "its mass is not observable from accelerations: weigh the body, or measure the static travel of the mounts" + stated
        ]

    def _words_of_change(self) -> list[str]:
        if (
            self.load_std == 0.0
            or not self._together
            or any(self._references[n].kind != "air_spring_pressure" for n in self._found)
        ):
            return []
        body, load = self.geometry.body.name, math.expm1(-self._together)
        way, other = ("fell", "softened") if load > 0.0 else ("rose", "stiffened")
        return [
            f"all stiffness and damping values {way} together by {100 * abs(math.expm1(self._together)):.0f} % during the run: "
            f"a mass of {body} changed by {100 * load:+.0f} % does exactly that (payload added or removed), and so do mounts "
            f"that all {other} alike; a known stiffness, a load cell or the load as known_added_mass distinguishes them"
        ]

    def _evaluated(
        self, r: ForceReference, theta: Array, std: Array, static_force: Array, run_time: float, excited_time: float
    ) -> tuple[float, float] | None:
        """Return (logarithm of the factor, its standard deviation) of one reference, None while it is not informative."""
        own = float(r.details.get("relative_std", DEFAULT_STD.get(r.kind, 0.0)))
        if r.kind == "known_stiffness":
            parameter = self._free_parameter(r)
            if parameter is None or std[parameter] > 0.1:
                return None
            return -float(theta[parameter]), math.hypot(own, float(std[parameter]))
        if r.kind == "air_spring_pressure":
            force = float(r.details["pressure"]) * float(r.details["area"])
            weight = float(static_force[self.geometry.mount_names.index(r.mount), AXES.index(r.axis or "z")])
            if "force_std" in r.details:
                own = float(r.details["force_std"]) / force
            if weight <= 0.0 or force <= 0.0:
                return None
            # read at the beginning: what has come on since shows in all parameters
            return math.log(force / weight) - self._together, math.hypot(own, _SHARE_STD, self.load_std)
        if r.kind == "load_cell":
            slope = self._cells[r.sensor].slope
            if slope.value <= 0.0 or slope.time < _MEAN_MEMORY:
                return None
            return math.log(slope.value), math.hypot(own, slope.std / slope.value)
        if r.kind == "known_added_mass":
            return self._added(r, own, theta, std, run_time, excited_time)
        return None

    def _free_parameter(self, r: ForceReference) -> int | None:
        names = self.geometry.mount_names
        for n, parameter in enumerate(self._free_parameters):
            if parameter.role == 0 and names[parameter.mount] == r.mount and AXES[parameter.axis] == r.axis:
                return n
        return None

    def _added(
        self, r: ForceReference, own: float, theta: Array, std: Array, run_time: float, excited_time: float
    ) -> tuple[float, float] | None:
        """Return the factor from the fall of all k/m and c/m when a known mass comes on: ``exp(-fall) = m / (m + dm)``.

        It is that of the present mass: with what was added until it is taken off again.
        """
        start, end = float(r.details["from_s"]), float(r.details.get("to_s", math.inf))
        added, file_mass = float(r.details["mass"]), self.geometry.file_mass
        if run_time < start:
            self._before, self._added_at = (theta.copy(), std.copy()), excited_time
            return None
        if run_time > end:
            if self._bare is None:
                return None
            return math.log(self._bare[0] / file_mass), self._bare[1]
        if self._before is None or excited_time - self._added_at < _SETTLED:
            return None
        vertical = np.array([s.axis == 2 for s in self._free_parameters])
        change, fall_std, _ = common_change(*(values[vertical] for values in (*self._before, theta, std)))
        fall = -change
        ratio = math.expm1(fall)
        if ratio * added <= 0.0 or abs(fall) < 3.0 * fall_std:
            return None
        mass = added / ratio
        # d log m = -(1 + ratio) / ratio d fall; of the mass with the load the load itself is known
        relative = math.hypot(own, fall_std * (1.0 + ratio) / abs(ratio))
        self._bare = (mass, relative)
        return math.log((mass + added) / file_mass), relative * mass / (mass + added)

    def factor(self) -> tuple[float, float]:
        """Return the factor on the file's mass and its relative standard deviation."""
        prior = self.geometry.body.mass
        relative = prior.std / prior.value if prior.std else 0.0
        if self.known or not self._found:
            log, std = self._load or (math.log1p(self.possible_load[0]), 0.0)
            return math.exp(log), math.hypot(relative if prior.std or self.known else 0.1, std, self.load_std)
        weights = np.array([1.0 / s**2 for _, s in self._found.values()])
        logs = np.array([v for v, _ in self._found.values()])
        mean = float(np.sum(weights * logs) / np.sum(weights))
        spread = float(np.sqrt(np.sum(weights * (logs - mean) ** 2) / np.sum(weights))) if len(logs) > 1 else 0.0
        return math.exp(mean), math.hypot(1.0 / math.sqrt(float(np.sum(weights))), spread)

    def status(self) -> tuple[Status, str]:
        """Return status and reason of the mass."""
        if self.known and (self.load_std > _KNOWN or self.possible_load[1] > 0.0):
            return Status.SUSPECT, self.load_suspicion or "all stiffness and damping values changed together as with a load"
        if self.known:
            return Status.VALID, f"declared as known in the vehicle file{', with a load by static travel' if self._load else ''}"
        if not self._references:
            return (
                Status.NOT_IDENTIFIABLE,
                f"no force reference sets the absolute scale; {NULL_DIRECTION}; the file's mass is used as given",
            )
        if not self._found:
            kinds = ", ".join(sorted({r.kind for r in self._references}))
            return Status.ESTIMATING, f"waiting for excitation to use {kinds}; the file's mass is used meanwhile"
        kinds = ", ".join(sorted({self._references[n].kind for n in self._found}))
        return Status.VALID, f"from {kinds}"

    def mass(self, stamp_ns: int) -> Estimate:
        """Return the mass as it is estimated."""
        body = self.geometry.body
        factor, relative = self.factor()
        status, reason = self.status()
        mass = body.mass.value * factor
        return Estimate(f"{body.name}.mass", mass, mass * relative, "kg", body.mass.value, status, reason, stamp_ns)

    def absolute(self, estimates: Sequence[Estimate], suspicion: str) -> list[Estimate]:
        """Return estimates, made for the file's mass, for the present one.

        Parameters
        ----------
        estimates
            Stiffnesses and dampings; their standard deviations do not know that of the mass, those of the result do.
        suspicion
            Why nothing that was learned is called valid, empty where nothing speaks against it.
        """
        (factor, relative), has_reference, found = self.factor(), self.has_reference, []
        for e in estimates:
            value, status, reason = e.value * factor, e.status, e.reason
            if not has_reference and status in (Status.VALID, Status.ESTIMATING):
                status, reason = (
                    Status.NOT_IDENTIFIABLE,
                    "only its ratio to the mass is identifiable; the value assumes the mass of the vehicle file",
                )
            if suspicion and status is Status.VALID:
                status, reason = Status.SUSPECT, suspicion
            std = math.hypot(e.std * factor, value * relative)
            found.append(Estimate(e.name, value, std, e.unit, e.prior, status, reason, e.stamp_ns))
        return found

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        cells = {
            name: {**dataclasses.asdict(c), "mean_cell": c.mean_cell.tolist(), "mean_force": c.mean_force.tolist()}
            for name, c in self._cells.items()
        }
        before = None if self._before is None else [self._before[0].tolist(), self._before[1].tolist()]
        return {
            "found": {str(n): list(v) for n, v in self._found.items()},
            "cells": cells,
            "before": before,
            "added_at": self._added_at,
            "bare": None if self._bare is None else list(self._bare),
            "first": None if self._first is None else [self._first[0].tolist(), self._first[1].tolist()],
            "together": self._together,
            "slopes_from": self._slopes_from,
            "load": None if self._load is None else list(self._load),
            "load_first": self._load_first,
            "possible_load": list(self.possible_load),
        }

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._found = {int(n): (float(v[0]), float(v[1])) for n, v in saved["found"].items()}
        for name, c in saved["cells"].items():
            slope = _Slope(**{key: float(value) for key, value in c["slope"].items()})
            mean_cell, mean_force = (np.array(c[key], dtype=float) for key in ("mean_cell", "mean_force"))
            self._cells[name] = _Cell(mean_cell, mean_force, slope, float(c["time"]))
        self._before, self._first = (
            None if pair is None else (np.array(pair[0], dtype=float), np.array(pair[1], dtype=float))
            for pair in (saved["before"], saved["first"])
        )
        self._together, self._slopes_from = float(saved["together"]), float(saved["slopes_from"])
        self._added_at = float(saved["added_at"])
        load = saved["load"]
        self._load = None if load is None else (float(load[0]), float(load[1]))
        self._load_first = float(saved["load_first"])
        share, std = saved["possible_load"]
        self.possible_load = (float(share), float(std))
        bare = saved.get("bare")
        self._bare = None if bare is None else (float(bare[0]), float(bare[1]))
