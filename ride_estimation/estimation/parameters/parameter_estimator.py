# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of every mount and axis while driving: quick start by least squares, then an extended Kalman filter.

The filter's measurement is the innovation of a simulated body over an interval (output error, :mod:`response`), compressed to its
gradient, so the joint covariance of motion and parameters is carried by the exact sensitivities. Nothing is learned while the
vehicle stands; only excited directions are forgotten; the standard deviation comes from how much the gradients of the last
intervals really scatter, not from white-noise theory.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.elements.base import Parameter
from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import plain
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.free_parameters import FreeParameter, find_free_parameters
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.parameters.amplitude import AmplitudeDependence
from ride_estimation.estimation.parameters.base_gains import BaseGains
from ride_estimation.estimation.parameters.force_balance import (
    OFFSET_UNIT,
    BalanceChunk,
    BalanceInput,
    unseen_acceleration,
    weighed_share,
)
from ride_estimation.estimation.parameters.identifiable import null_directions
from ride_estimation.estimation.parameters.interval import Interval, IntervalMemory
from ride_estimation.estimation.parameters.parameter_filter import ParameterFilter
from ride_estimation.estimation.parameters.parameter_model import ParameterModel
from ride_estimation.estimation.parameters.parameter_status import StatusTracker
from ride_estimation.estimation.parameters.periodic_excitation import PeriodicExcitation
from ride_estimation.estimation.parameters.refinement import Kept, Refinement
from ride_estimation.estimation.parameters.suspect_axes import suspect_axes
from ride_estimation.estimation.parameters.transducer_balance import transducers_suffice
from ride_estimation.estimation.sensor_errors.installed_errors import InstalledErrors
from ride_estimation.estimation.sensor_errors.spurious_deformation import SpuriousDeformation
from ride_estimation.frames import AXES
from ride_estimation.sensors.installation import pooled

Array = NDArray[np.float64]

#: the mounts turn with their brackets (1) or with the body (0): prior of that share
FOLLOW_STD = 0.3
#: largest ratio of an inertia to the file's, either way
_INERTIA_RATIO = 2.0
#: sections of the high-pass times its time constant after which the start is forgotten
_SETTLE = 9.0
#: the same of deflections, which two integrations and six sections make: ``(w t)^5 / 5! exp(-w t)`` is a thousandth
_SETTLE_DEFLECTION = 16.0
#: time in which a simulated body that begins where the measured one is forgets that beginning [s]
_FADE = 1.0
#: excited time gathered before the first estimate [s]
_FIRST = 2.5
#: length of the segment of a batch estimate [s]
_LONGEST = 7.0
#: excited time after a start or a change at which one is made [s]
_REVIEWS = (4.5, 9.0)
_REVIEWS_AFTER_CHANGE = (3.0, 7.0)
#: standard deviation of a CG that a load has moved [m]
_LOADED_CG = 0.1
#: farthest that it is sought [m]
_REACH = 0.5
#: share of mass or inertia that mounts without a base sensor must leave to the others: below, only ratios are observable
_WEIGHED = 0.2
#: probability with which a CG is off its file: one drive in four has a load. Squares over what is expected of 24 drawn drives
#: without one reached 12, of 20 with one (without transducers) 16 exceed 14
_CERTAINLY = 1.0 - 1e-3
#: the same of a body with fewer than six degrees of freedom: what it does along the others is in the innovations too, and reached
#: 17 without a load (foreign run planar_15, whose vertical forces would be 43 instead of 6 % off)
_CERTAINLY_GUIDED = 1.0 - 1e-5
#: probability with which it still is when its place has been estimated
_STILL = 0.99
#: intervals that are asked for it
_ENOUGH = 16
#: share of the second order of the deflection that is not known at a mount. It alone distinguishes left from right where a frame
#: hardly deforms: on `bags/nominal` their stiffness along y is 13 to 15 % off (5 to 11 % with exact sensors), stated as 10 % with
#: this and as 4 % without
_SECOND_ORDER = 0.4
#: passes over a chunk that a batch estimate may take per second of data: about a tenth of a core
_PACE = 250.0


class ParameterEstimator:
    """Multipliers of the mount elements; holds the vehicle file's values until the data determine them.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    settings
        Of the pipeline.
    """

    def __init__(self, geometry: Geometry, tilting: BracketTilt, settings: PipelineSettings) -> None:
        self.geometry = geometry
        self.settings = settings
        all_free = find_free_parameters(geometry, settings)
        by_transducers = not geometry.has_base_motion and transducers_suffice(geometry)
        observable = geometry.base_observable
        own = tuple(s for s in all_free if (s.axis == 2 if by_transducers else observable[s.mount, s.axis]))
        # where nothing is seen at all every parameter stays listed, with the reason
        self.free_parameters = own or all_free
        self._left_out = tuple(s for s in all_free if s not in self.free_parameters)
        self.count = len(self.free_parameters)
        #: acceleration of the body by forces of mounts whose base is not measured, (6, 6): along that nothing is learned
        self._unseen = np.zeros((6, 6)) if by_transducers else unseen_acceleration(geometry)
        seen = by_transducers or (bool(observable.any()) and weighed_share(geometry) > _WEIGHED)
        self.possible = seen and self.count > 0 and settings.estimate_parameters
        self._turns = () if by_transducers else self._inertia_axes()
        body = geometry.body
        self._cg_std = np.zeros(3) if body.cg_std is None else np.asarray(body.cg_std, dtype=float)
        offsets = () if by_transducers else self._offset_axes()
        self._gains = BaseGains(geometry, not by_transducers)
        #: of the sensors, considered
        self.errors = InstalledErrors(geometry, self._gains.places)
        #: whether the body carries something that its file does not know: where the CG lies is estimated
        self.loaded = False
        #: whether that was thought and proved wrong since the last change
        self._refuted = False
        #: offset of the CG that was beyond what the file lets expect the last time, shape (0,) before
        self._confirmed = np.zeros(0)
        corner = settings.parameter_corner_hz
        model = (geometry, tilting, self.free_parameters, self._turns, offsets, self.errors, corner, by_transducers)
        self._model = ParameterModel(*model)
        #: least standard deviation of a CG in accelerations: that of the positions of sensors [m]
        self._position_std = pooled([s.tolerated_installation for s in geometry.body_sensors]).position
        variances = [b.noise_std**2 for b in geometry.base_sensors if b is not None]
        self._base_variance = float(np.mean(variances)) if variances else 0.0
        turns, bound = len(self._turns), math.log(_INERTIA_RATIO)
        self._prior_std = np.array([s.std for s in self.free_parameters] + [FOLLOW_STD] + turns * [self._inertia_std()])
        self._lower = np.array([s.lower for s in self.free_parameters] + [-1.2] + turns * [-bound])
        self._upper = np.array([s.upper for s in self.free_parameters] + [0.2] + turns * [bound])
        #: logarithms of the multipliers, the follow share minus one, logarithms of the inverse inertia over the file's and, with
        #: a load, the offsets of the CG
        self.theta = np.zeros(self.count + 1 + turns)
        self.std = self._prior_std.copy()
        self.status = StatusTracker(self.free_parameters, geometry, self.possible, self._no_input_reason())
        self.rejected: dict[str, int] = {}
        self.changes = 0
        #: logarithms and standard deviations of the multipliers before the first change, None before one
        self._before_change: tuple[Array, Array] | None = None
        self.excited = False
        self.excited_time = 0.0
        self.stamp_ns = 0
        self._spurious: SpuriousDeformation | None = None
        if self._model.inertial is not None:
            self._spurious = SpuriousDeformation(geometry, self.errors, self._model.inertial.corner)
        self._amplitude = AmplitudeDependence(self._prior_std, self.count)
        self._filter: ParameterFilter | None = None
        self._review_model = ParameterModel(*model)
        self._refinement = self._new_refinement()
        self._reviews: tuple[float, ...] = _REVIEWS
        #: first estimate or review under way, the chunks it sees, whether the excitation lasts since it began, steps it may take
        self._batch: Generator[int, None, ParameterFilter | None] | None = None
        self._batch_chunks: list[Kept] = []
        self._batch_open, self._credit = False, 0.0
        self.restart()

    def _no_input_reason(self) -> str:
        if not self.settings.estimate_parameters:
            return "estimation of parameters is switched off"
        if self.geometry.base_observable.any():
            return (
                "mounts without a motion sensor on their base could carry the body alone, which leaves nothing that its mass or "
                "a stated inertia could be compared with: triaxial accelerometers at more of the bases make them observable"
            )
        return "no motion sensor on the base side of every mount: triaxial accelerometers at all mount bases make them observable"

    def restart(self) -> None:
        """Begin with empty filters after a gap or a new time base; what was learned stays."""
        self._model.balance.reset()
        self._model.response.reset()
        self._blocks: list[BalanceInput] = []
        self._pending_ticks = 0
        self._settled = self._followed = 0.0
        self._begin_interval()
        self._kept: list[Kept] = []
        self._periodic = PeriodicExcitation()
        self._drop_batch()

    def _begin_interval(self) -> None:
        self._interval = Interval(len(self.theta), self._considered_count, self.geometry.tolerated_cross_sensitivity)
        #: sums of squares of deflection and rate in it, shape (2, 3 M), and their ticks
        self._squares, self._square_ticks = np.zeros((2, 3 * len(self.geometry.mounts))), 0

    def _fresh(self, theta: Array) -> ParameterFilter:
        kept = 1.0 - min(self.settings.parameter_interval / self.settings.parameter_memory, 0.5)
        roles = np.array([s.role for s in self.free_parameters])
        common = np.zeros((len(theta), 2))
        common[: self.count] = roles[:, None] == (0, 1)
        common = common[:, common.any(axis=0)] / np.sqrt(max(self.count, 1))
        return ParameterFilter(theta, self._prior_std, self._lower, self._upper, kept, common, self._considered_count)

    # -- results ----------------------------------------------------------------------------------------------------------

    def multipliers(self) -> Array:
        """Return the multipliers, shape (2, M, 3)."""
        return self._model.spread(np.exp(self.theta[: self.count]), 1.0)

    def stds(self) -> Array:
        """Return the standard deviations of the logarithms, shape (2, M, 3)."""
        return self._model.spread(self.std[: self.count], 0.0)

    @property
    def innovation_ratio(self) -> float:
        """Return the mean normalised innovation squared of the last intervals, 0 before the first; one is expected."""
        return 0.0 if self._filter is None else self._filter.innovation_ratio

    @property
    def follow(self) -> float:
        """Return the share of the rotation of the brackets that the mount forces follow."""
        return 1.0 + float(self.theta[self.count])

    def _inertia_axes(self) -> tuple[int, ...]:
        """Return the axes about which the body turns and its inertia over its mass is not known for certain."""
        return tuple(int(a) for a in np.flatnonzero(self.geometry.free[3:])) if self._inertia_std() > 0.0 else ()

    def _inertia_std(self) -> float:
        """Return the standard deviation of the logarithm of inertia over mass: either may be off alone."""
        body = self.geometry.body
        mass = body.mass.std / body.mass.value if body.mass.std else 0.0
        return math.sqrt(math.log1p(mass**2 + (body.inertia_relative_std or 0.0) ** 2))

    def inertia(self) -> tuple[Array, float]:
        """Return the inertia about the CG for the file's mass, shape (3, 3) [kg m^2], and its largest relative std."""
        root, body = np.ones(3), self.geometry.body
        turning = slice(self.count + 1, self.count + 1 + len(self._turns))
        root[list(self._turns)] = np.exp(-0.5 * self.theta[turning])
        own = self.std[turning]
        return root[:, None] * np.asarray(body.inertia) * root, float(own.max()) if own.size else body.inertia_relative_std or 0.0

    def _offset_axes(self) -> tuple[int, ...]:
        """Return the axes along which an offset of the CG shows: the body moves along a second one and turns about the third.

        What holds a body that does not move along an axis acts nobody knows where.
        """
        moves, turns = self.geometry.free[:3], self.geometry.free[3:]
        return tuple(a for a in range(3) if any(moves[(a + n) % 3] and turns[(a + 3 - n) % 3] for n in (1, 2)))

    def cg_offset(self) -> tuple[Array, Array]:
        """Return the offset of the CG from its place in the file and its standard deviation, shape (3,) each [m]."""
        std = self._cg_std.copy()
        if self.loaded:
            std[list(self._model.offsets)] = OFFSET_UNIT * self.std[-len(self._model.offsets) :]
        return self._model.offset_of(self.theta), std

    @property
    def seen_offset(self) -> Array:
        """Return the offset of the CG, (3,) [m]; while it is estimated anew the one that was seen before."""
        offset = self.cg_offset()[0]
        if self.loaded and self._filter is None and self._confirmed.size:
            offset[list(self._model.offsets)] = OFFSET_UNIT * self._confirmed
        return offset

    def offset_of_cg(self) -> Array | None:
        """Return the offset of the CG in the last seconds, (3,) [m], where it is beyond what the file lets expect, else None."""
        own, axes = self._filter, list(self._model.offsets)
        if not axes or own is None or own.memory.length < _ENOUGH or self._refuted:
            return self.cg_offset()[0] if self.loaded else None
        found, covariance, beyond = self._shown_offset(own)
        size = len(axes)
        certainly = _CERTAINLY if self.geometry.free.all() else _CERTAINLY_GUIDED
        if beyond > stats.chi2.ppf(_STILL if self.loaded else certainly, size):
            self._confirmed = found.copy()
        elif not self.loaded or self._contradicted(found, covariance):
            return None
        offset = np.zeros(3)
        offset[axes] = OFFSET_UNIT * found
        return offset

    def _contradicted(self, found: Array, covariance: Array) -> bool:
        """Return whether an offset of the CG and its covariance exclude where it was seen: seconds that show nothing do not."""
        if not self._confirmed.size:
            return True
        moved = found - self._confirmed
        return not moved @ np.linalg.solve(covariance, moved) <= stats.chi2.ppf(_STILL, len(moved))

    def _shown_offset(self, own: ParameterFilter) -> tuple[Array, Array, float]:
        """Return the offset of the CG that the last seconds show, its covariance, its square over what is expected."""
        axes = list(self._model.offsets)
        size = len(axes)
        if self.loaded:
            found, covariance = self.theta[-size:], np.diag(self.std[-size:] ** 2)
        else:
            spread = np.zeros(len(self.theta))
            spread[: self.count] = self._amplitude.std
            found, covariance = own.memory.estimate_considered(self.theta, self._prior_std, spread, size)
        expected = np.diag((np.maximum(self._cg_std[axes], self._position_std) / OFFSET_UNIT) ** 2)
        return found, covariance, float(found @ np.linalg.solve(covariance + expected, found))

    def take_load(self, there: bool) -> None:
        """Learn anew with a CG that may be wherever a load takes it, or with that of the file where there is no load."""
        if self.loaded is there or not self._model.offsets:
            return
        self._refuted = not there
        kept = self._kept
        self._estimate_cg(there)
        self.status = StatusTracker(self.free_parameters, self.geometry, self.possible, self._no_input_reason())
        self.std, self._filter, self._reviews = self._prior_std.copy(), None, _REVIEWS
        self._begin_interval()
        self._drop_batch()
        n = self.count + 1 + len(self._turns)
        self._kept = [(chunk, np.append(theta[:n], self.theta[n:])) for chunk, theta in kept]

    def _estimate_cg(self, loaded: bool) -> None:
        """Make the offsets of the CG parameters, which begin at zero, or something that is considered."""
        self.loaded, n = loaded, self.count + 1 + len(self._turns)
        free = np.ones(len(self._model.offsets) if loaded else 0)
        self.theta = np.append(self.theta[:n], 0.0 * free)
        self._prior_std = np.append(self._prior_std[:n], _LOADED_CG / OFFSET_UNIT * free)
        self._lower = np.append(self._lower[:n], -_REACH / OFFSET_UNIT * free)
        self._upper = np.append(self._upper[:n], _REACH / OFFSET_UNIT * free)
        self._amplitude = AmplitudeDependence(self._prior_std, self.count)
        self._refinement = self._new_refinement()

    def _new_refinement(self) -> Refinement:
        return Refinement(self._review_model, self._prior_std, self._lower, self._upper, self._fresh)

    def estimates(self) -> tuple[Estimate, ...]:
        """Return one estimate per parameter that is scaled: value, standard deviation, status and reason."""
        found = []
        listed = [(s, float(self.theta[n]), float(self.std[n]), *self.status.of(n)) for n, s in enumerate(self.free_parameters)]
        by_transducers = self._model.inertial is None
        what = "transducer" if by_transducers else "motion sensor at the mount bases"
        unseen = f"no {what} measures this axis: a triaxial accelerometer at each mount base would"
        listed += [(s, 0.0, s.std, Status.NOT_IDENTIFIABLE, unseen) for s in self._left_out]
        suspects = self._suspect_axes()
        for parameter, log, std, own, why in listed:
            suspect = own is Status.VALID and parameter.axis in suspects
            status, reason = (Status.SUSPECT, suspects[parameter.axis]) if suspect else (own, why)
            for name, p, prior in self._scaled(parameter):
                value = prior * float(np.exp(log))
                found.append(Estimate(name, value, abs(value) * std, p.unit, prior, status, reason, self.stamp_ns))
        return tuple(found)

    def _scaled(self, parameter: FreeParameter) -> list[tuple[str, Parameter, float]]:
        """Return name, description and value in the vehicle file of what a multiplier scales."""
        mount, axis = self.geometry.mounts[parameter.mount], AXES[parameter.axis]
        own = [p for p in mount.elements[axis].parameters() if p.role == ROLES[parameter.role]]
        return [(f"{mount.name}.{axis}.{p.name}", p, float(getattr(mount.elements[axis], p.name))) for p in own]

    def amplitude_std(self) -> dict[str, float]:
        """Return by name what dependence on the amplitude adds to the standard deviation of the logarithm of a parameter."""
        scaled = zip(self.free_parameters, self._amplitude.std.tolist())
        return {name: std for parameter, std in scaled for name, _, _ in self._scaled(parameter)}

    @property
    def _considered_count(self) -> int:
        placed, own = 0 if self.loaded else len(self._model.offsets), self._model.inertial
        return placed + (0 if own is None else own.turned_count + self.errors.count)

    def _considered_std(self) -> Array:
        """Return the standard deviation of the position of the CG [``OFFSET_UNIT``], where that is not estimated, of the
        second order and of the errors of the sensors.
        """
        placed = np.zeros(0) if self.loaded else self._cg_std[list(self._model.offsets)] / OFFSET_UNIT
        own = self._model.inertial
        return placed if own is None else np.concatenate([placed, np.full(own.turned_count, _SECOND_ORDER), self.errors.std])

    def _suspect_axes(self) -> dict[int, str]:
        return suspect_axes(self.geometry, self.free_parameters, self._now(), self._before_change) | self._gains.suspects

    @property
    def misread_variance(self) -> Array:
        """Return the variance of the forces that a wrong horizontal gain of a base sensor leaves, shape (M, 3) [N^2]."""
        return self._gains.force_variance

    def null_directions(self) -> list[str]:
        """Return the combinations of parameters are not identifiable from the run, in words; empty before the first estimate."""
        if self._filter is None:
            return []
        learned = self._filter.covariance[: self.count, : self.count]
        return null_directions(learned, self._prior_std[: self.count], self._names())

    def notes(self) -> list[str]:
        """Return what the person in the field should know about the parameters."""
        found = []
        if self.changes:
            found.append(f"the parameters changed {self.changes} times during the run faster than driving conditions explain")
        found += self._suspect_axes().values()
        found += self._amplitude.notes(self._names())
        vertical = np.array([s.axis == 2 for s in self.free_parameters], dtype=bool)
        moved = self.theta[: self.count][vertical]
        sure = self.std[: self.count][vertical]
        if len(moved) >= 4 and np.max(sure) < 0.03 and np.ptp(moved) < 0.03 and abs(np.mean(moved)) > 0.04:
            found.append(
                f"all vertical stiffness and damping values are {100 * np.expm1(np.mean(moved)):+.0f} % off the vehicle file "
                "together: a mass that differs from the file explains that better than the mounts"
            )  # fmt: skip
        return found

    def at_bound(self) -> tuple[str, ...]:
        """Return the names of multipliers at a bound."""
        low, high = self.theta <= self._lower + 1e-9, self.theta >= self._upper - 1e-9
        return tuple(name for n, name in enumerate(self._names()) if low[n] or high[n])

    def _names(self) -> list[str]:
        return [f"{self.geometry.mounts[s.mount].name}.{AXES[s.axis]}.{ROLES[s.role]}" for s in self.free_parameters]

    # -- input ------------------------------------------------------------------------------------------------------------

    def observe(self, data: BalanceInput, motion: MotionBlock, complete: bool, stamp_ns: int, dt: float) -> bool:
        """Take one block; return whether the parameters moved.

        Parameters
        ----------
        data
            Signals of the force balance.
        motion
            CG motion, for its covariance.
        complete
            Whether every sensor that is needed spoke at every tick.
        stamp_ns
            Newest stamp.
        dt
            Tick [s].
        """
        if not self.possible:
            return False
        if not complete:
            self.rejected["gap in a sensor"] = self.rejected.get("gap in a sensor", 0) + 1
            self.restart()
            return False
        ticks = len(data.support)
        moved = self._advance_batch(ticks * dt, stamp_ns)
        self._blocks.append(data)
        self._pending_ticks += ticks
        if self._pending_ticks * dt < self.settings.parameter_interval / 2.0:
            return moved
        chunk = self._filtered(dt)
        if self._settled < _SETTLE / self._model.balance.corner:
            return moved
        return self._take(chunk, motion.covariance, stamp_ns) or moved

    def _filtered(self, dt: float) -> BalanceChunk:
        joined = BalanceInput.join(self._blocks)
        self._blocks, self._pending_ticks = [], 0
        chunk = self._model.balance.observe(joined, self._model.static_force(), self.follow, dt)
        self._settled += len(joined.support) * dt
        own, settled = self._model.inertial, self._settled >= _SETTLE_DEFLECTION / self._model.balance.corner
        # what leaning sensors make of the start of the filters is ten times the motion and none of it
        if self._spurious is not None and own is not None and settled:
            self._spurious.observe(own.moved, own.moved_bases, dt)
            self._squares += [np.sum(signal**2, axis=0) for signal in own.moved]
            self._square_ticks += len(joined.support)
        return chunk

    def _take(self, chunk: BalanceChunk, covariance: Array, stamp_ns: int) -> bool:
        noise = np.sqrt(np.trace(covariance[:3, :3]))
        size = float(np.sqrt(np.mean(np.sum(chunk.measured[:, :3] ** 2, axis=1))))
        repeats = self._periodic.observe(chunk.measured[:, :3], chunk.step)
        self.excited = size > max(self.settings.excitation_accel, 3.0 * float(noise)) and not repeats
        weights = self._weights(covariance + self._unseen)
        duration = len(chunk.measured) * chunk.step
        self._keep(chunk)
        response = self._model.response
        response.set_noise(covariance, self._base_variance, self._unseen)
        if self._filter is None:
            if self.excited and self._batch is None and self._duration(self._kept) >= _FIRST:
                self._begin_batch(weights, covariance)
            return False
        if response.step != chunk.step:
            self._model.prepare(self.theta, chunk.step)
        innovation, gradient = response.observe(chunk)
        self._followed += duration
        if not self.excited or self._followed < _FADE:
            return False
        self.excited_time += duration
        self._interval.add(innovation, gradient, chunk.measured, weights, duration)
        if self._interval.duration < self.settings.parameter_interval:
            return False
        self._update(self._filter, self._interval, chunk.step)
        self._begin_interval()
        due = bool(self._reviews) and self.excited_time >= self._reviews[0]
        if due and self._batch is None and self._duration(self._kept) >= _FIRST:
            self._begin_batch(weights, covariance)
        self.stamp_ns = stamp_ns
        return True

    def _keep(self, chunk: BalanceChunk) -> None:
        """Remember the last seconds of excitation; a batch estimate that is under way uses what comes meanwhile."""
        if not self.excited:
            self._kept, self._batch_open = [], False
            return
        kept = (chunk, self.theta.copy())
        self._kept.append(kept)
        while len(self._kept) > 2 and self._duration(self._kept) > _LONGEST:
            self._kept.pop(0)
        if self._batch_open:
            self._batch_chunks.append(kept)

    @staticmethod
    def _duration(kept: list[Kept]) -> float:
        return sum(len(c.measured) * c.step for c, _ in kept)

    def _weights(self, covariance: Array) -> Array:
        """Return the whitening of the innovations, shape (6, 6), zero for coordinates the body does not have."""
        free = np.flatnonzero(self.geometry.free)
        result = np.zeros((6, 6))
        result[np.ix_(free, free)] = np.linalg.cholesky(np.linalg.inv(covariance[np.ix_(free, free)]))
        return result

    # -- batch estimates over the last seconds: the start, and reviews ----------------------------------------------------

    def _begin_batch(self, weights: Array, covariance: Array) -> None:
        """Begin the first estimate or a review; the work is spread over the blocks to come while the filter goes on."""
        self._batch_chunks, self._batch_open, self._credit = list(self._kept), True, 0.0
        self._refinement.model.response.set_noise(covariance, self._base_variance, self._unseen)
        if self._filter is None:
            self._batch = self._refinement.first_estimate(self._batch_chunks, self.theta, weights)
        else:
            inflation = max(self._filter.memory.inflation, 1.0)
            self._batch = self._refinement.review(self._batch_chunks, self.theta.copy(), weights, inflation)

    def _drop_batch(self) -> None:
        self._batch, self._batch_chunks, self._batch_open, self._credit = None, [], False, 0.0

    def _advance_batch(self, duration: float, stamp_ns: int) -> bool:
        """Take so many steps of the batch estimate as the data that came since allow; return whether the parameters moved."""
        if self._batch is None:
            return False
        self._credit += _PACE * duration
        try:
            while self._credit > 0.0:
                self._credit -= next(self._batch)
        except StopIteration as end:
            moved = self._adopt(end.value)
            self.stamp_ns = stamp_ns if moved else self.stamp_ns
            self._drop_batch()
            return moved
        return False

    def _adopt(self, found: ParameterFilter | None) -> bool:
        """Go on with the result of a batch estimate, if any; return whether it did."""
        if self._filter is None:
            self.excited_time += self._duration(self._batch_chunks)
        else:
            self._reviews = self._reviews[1:]
        if found is None:
            return False
        self._filter = found
        before = self._now()
        self._take_over(found)
        self._note_changes(found.changes, before)
        response = self._refinement.model.response
        self._model.prepare(self.theta, response.step)
        if self._batch_open:
            # the simulated body of the batch estimate saw every chunk, with parameters hardly different
            self._model.response.take_state(response)
            self._followed = _FADE
        self._begin_interval()
        return True

    # -- tracking ---------------------------------------------------------------------------------------------------------

    def _update(self, own: ParameterFilter, interval: Interval, step: float) -> None:
        before, changes, known = self.theta.copy(), own.changes, self._now()
        if self._square_ticks:
            rms = np.sqrt(self._squares / self._square_ticks)
            amplitude = np.array([rms[s.role, 3 * s.mount + s.axis] for s in self.free_parameters])
            self._amplitude.observe(interval, before, amplitude, own.memory.inflation)
        if own.learn(interval, before):
            largest = self.settings.largest_step
            own.hold(np.clip(own.theta, before - largest, before + largest))
            self._take_over(own)
            self._model.prepare(self.theta, step)
        if self._gains.places:
            first, square = self._considered_count - len(self._gains.places), self._model.balance.read_square
            self._gains.judge(own.memory, self.theta, self._prior_std, first, square[list(self._gains.places)])
        self._count_rejected(own)
        if self._note_changes(own.changes - changes, known):
            self._drop_batch()

    def _now(self) -> tuple[Array, Array]:
        """Return logarithms and standard deviations of the multipliers."""
        return self.theta[: self.count].copy(), self.std[: self.count].copy()

    def _note_changes(self, count: int, before: tuple[Array, Array]) -> bool:
        """After a change of the vehicle the seconds that follow are to be estimated as a batch; return whether there was one."""
        if not count:
            return False
        self.changes += count
        if self._before_change is None:
            self._before_change = before
        self._refuted = False
        self._amplitude.clear()
        self._reviews = tuple(self.excited_time + after for after in _REVIEWS_AFTER_CHANGE)
        return True

    def _take_over(self, own: ParameterFilter) -> None:
        """Take over parameters, standard deviations and status from a filter."""
        self.theta, self.std = own.theta.copy(), own.std.copy()
        mine = slice(0, self.count)
        moved = own.memory.sensitivity(self._prior_std)[mine] * self._considered_std()
        considered = np.sqrt(self.std[mine] ** 2 + np.sum(moved**2, axis=1) + self._amplitude.std**2)
        self.std[mine] = self._with_spurious(np.minimum(considered, np.maximum(self._prior_std[mine], self.std[mine])))
        self.status.follow(
            self.std[mine], self._prior_std[mine], self.theta[mine], own.learned, self._lower[mine], self._upper[mine]
        )  # fmt: skip
        own.learned = 0
        self._count_rejected(own)

    def _count_rejected(self, own: ParameterFilter) -> None:
        for reason, count in own.rejected.items():
            self.rejected[reason] = self.rejected.get(reason, 0) + count
        own.rejected = {}

    def _with_spurious(self, std: Array) -> Array:
        """Return standard deviations with what deformation that the sensors make up leaves open, at most those of the file."""
        if self._spurious is None:
            return std
        left = self._spurious.std(self._model.spread(self._prior_std[: self.count], 0.0))
        added = np.array([left[s.role, s.mount, s.axis] for s in self.free_parameters])
        return np.asarray(np.minimum(np.hypot(std, added), np.maximum(self._prior_std[: self.count], std)))

    # -- persistence ------------------------------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """Return what was learned; the filters of the signals start again. Costs little, arrays are shared."""
        empty = IntervalMemory(len(self.theta), self._considered_count)
        memory = (empty if self._filter is None else self._filter.memory).snapshot()
        return {
            "theta": self.theta, "std": self.std,
            "spurious": None if self._spurious is None else self._spurious.save(),
            "stamp_ns": self.stamp_ns, "excited_time": self.excited_time,
            "p": None if self._filter is None else self._filter.covariance, "memory": memory,
            "amplitude": self._amplitude.snapshot(), "status": self.status.save(),
            "innovation_ratio": self.innovation_ratio, "changes": self.changes, "loaded": self.loaded,
            "confirmed": self._confirmed,
            "before_change": self._before_change, "suspect_gains": {str(a): words for a, words in self._gains.suspects.items()},
            "misread": self._gains.force_variance.copy(),
        }  # fmt: skip

    def save(self) -> dict[str, Any]:
        """Return the same as plain lists."""
        return dict(plain(self.snapshot()))

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save` or :meth:`snapshot`."""
        if bool(saved["loaded"]) != self.loaded:
            self._estimate_cg(not self.loaded)
        self.theta = np.array(saved["theta"], dtype=float)
        self.std = np.array(saved["std"], dtype=float)
        if self._spurious is not None:
            self._spurious.load(saved["spurious"])
        self.stamp_ns, self.excited_time = int(saved["stamp_ns"]), float(saved["excited_time"])
        self.changes = int(saved["changes"])
        self._confirmed = np.array(saved["confirmed"], dtype=float)
        before = saved["before_change"]
        self._before_change = None if before is None else (np.array(before[0], dtype=float), np.array(before[1], dtype=float))
        self._gains.suspects = {int(axis): words for axis, words in saved["suspect_gains"].items()}
        self._gains.force_variance[:] = np.array(saved["misread"], dtype=float)
        self.status.load(saved["status"])
        self._amplitude.load(saved["amplitude"])
        self._filter = None
        if saved["p"] is None:
            self._reviews = _REVIEWS
        else:
            self._filter = self._fresh(self.theta)
            self._filter.load(saved, self.std)
        self._model.scale(self.theta)
        self.restart()
