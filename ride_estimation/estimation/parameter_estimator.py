# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of every mount and axis while driving: quick start by least squares, then an extended Kalman filter.

The filter's measurement is the innovation of a simulated body over an interval (output error, :mod:`response`), compressed to its
gradient, so the joint covariance of motion and parameters is carried by the exact sensitivities. Nothing is learned while the
vehicle stands; only excited directions are forgotten; the standard deviation comes from how much the gradients of the last
intervals really scatter, not from white-noise theory.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.arrangement import Arrangement
from ride_estimation.estimation.bracket_tilt import BracketTilt
from ride_estimation.estimation.cg_motion import MotionBlock
from ride_estimation.estimation.estimate import Estimate, Status
from ride_estimation.estimation.force_balance import BalanceChunk, BalanceInput, ForceBalance
from ride_estimation.estimation.guarded_ekf import GuardedEkf
from ride_estimation.estimation.identifiable import null_directions
from ride_estimation.estimation.interval import Interval, IntervalMemory
from ride_estimation.estimation.mount_forces import static_share
from ride_estimation.estimation.mount_law import ROLES, MountLaw
from ride_estimation.estimation.mounting_doubt import MountingDoubt
from ride_estimation.estimation.parameter_status import StatusTracker
from ride_estimation.estimation.refinement import Refinement
from ride_estimation.estimation.response import ModelResponse
from ride_estimation.estimation.rls import forgetting_noise
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.estimation.slots import find_slots
from ride_estimation.estimation.transducer_balance import MeasuredResponse, TransducerBalance, transducers_suffice
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: the mounts turn with their brackets (1) or with the body (0): prior of that share
FOLLOW_STD = 0.3
#: largest ratio of an inertia to the file's, either way
_INERTIA_RATIO = 2.0
#: sections of the high-pass times its time constant after which the start is forgotten
_SETTLE = 9.0
#: time in which a simulated body that begins where the measured one is forgets that beginning [s]
_FADE = 1.0
#: excited time gathered before the first estimate [s]
_FIRST = 2.5
#: length of the stretch that is looked at as a whole [s]
_LONGEST = 7.0
#: excited time after a start or a change at which it is [s]
_REVIEWS = (4.5, 9.0)
_REVIEWS_AFTER_CHANGE = (3.0, 7.0)
#: improvement of the squared error that moves the parameters then, in units of its scatter
_CLEARLY = 6.0
#: standard deviation a change of the vehicle opens in every logarithm
_CHANGE_STD = 0.15
#: refused intervals in a row that make a change
_REFUSED = 2
#: mean over ten intervals of the normalised innovation squared that has the last seconds looked at again: one is expected
_RESTLESS = 2.5
#: factor on the innovation covariance from here on a change is suspected
_SUSPECT_RATIO = 16.0


class ParameterEstimator:
    """Multipliers of the mount elements; holds the vehicle file's values until the data can tell more.

    Parameters
    ----------
    arrangement
        Body, mounts, sensors.
    settings
        Of the pipeline.
    """

    def __init__(self, arrangement: Arrangement, tilting: BracketTilt, settings: PipelineSettings) -> None:
        self.arrangement = arrangement
        self.settings = settings
        all_slots = find_slots(arrangement, settings)
        by_transducers = not arrangement.has_base_motion and transducers_suffice(arrangement)
        self.slots = tuple(s for s in all_slots if s.axis == 2) if by_transducers else all_slots
        self._left_out = tuple(s for s in all_slots if s not in self.slots)
        self.count = len(self.slots)
        seen = arrangement.has_base_motion or by_transducers
        self.possible = seen and self.count > 0 and settings.estimate_parameters
        self._law = MountLaw(arrangement)
        self._turns = () if by_transducers else self._inertia_axes()
        self._balance: ForceBalance | TransducerBalance
        balance: ForceBalance | None = None
        self._response: ModelResponse | MeasuredResponse
        if by_transducers:
            self._balance = TransducerBalance(arrangement, self.slots, self._law, settings.parameter_corner_hz)
            self._response = MeasuredResponse()
        else:
            balance = ForceBalance(arrangement, tilting, self.slots, self._law, settings.parameter_corner_hz, self._turns)
            self._balance, self._response = balance, ModelResponse(balance, arrangement.vehicle.gravity)
        variances = [b.noise_std**2 for b in arrangement.base_sensors if b is not None]
        self._base_variance = float(np.mean(variances)) if variances else 0.0
        turns, bound = len(self._turns), math.log(_INERTIA_RATIO)
        self._prior_std = np.array([s.std for s in self.slots] + [FOLLOW_STD] + turns * [self._inertia_std()])
        self._lower = np.array([s.lower for s in self.slots] + [-1.2] + turns * [-bound])
        self._upper = np.array([s.upper for s in self.slots] + [0.2] + turns * [bound])
        #: logarithms of the multipliers, the follow share minus one, logarithms of the inverse inertia over the file's
        self.theta = np.zeros(self.count + 1 + turns)
        self.std = self._prior_std.copy()
        self.status = StatusTracker(self.slots, arrangement, self.possible, self._no_input_reason())
        self.rejected: dict[str, int] = {}
        self.changes = 0
        self.innovation_ratio = 0.0
        self.excited = False
        self.excited_time = 0.0
        self.stamp_ns = 0
        self._doubt: MountingDoubt | None = None if by_transducers else MountingDoubt(arrangement)
        self._filter: GuardedEkf | None = None
        self._memory = IntervalMemory(len(self.theta))
        self._refinement = Refinement(self._response, self._prepare, self._prior_std, self._lower, self._upper, balance)
        self._refused = 0
        self._reviews: tuple[float, ...] = _REVIEWS
        self._pending_ticks_taken = 0
        self.restart()

    def _no_input_reason(self) -> str:
        if not self.settings.estimate_parameters:
            return "estimation of parameters is switched off"
        return "no motion sensor on the base side of every mount: a triaxial accelerometer at each mount base would tell it"

    def restart(self) -> None:
        """Begin with empty filters after a gap or a new time base; what was learned stays."""
        self._balance.reset()
        self._response.reset()
        self._blocks: list[BalanceInput] = []
        self._pending_ticks = 0
        self._settled = self._followed = 0.0
        self._interval = Interval(len(self.theta))
        self._refinement.clear()

    # -- results ----------------------------------------------------------------------------------------------------------

    def multipliers(self) -> Array:
        """Return the multipliers, shape (2, M, 3)."""
        return self._spread(np.exp(self.theta[: self.count]), 1.0)

    def stds(self) -> Array:
        """Return the standard deviations of the logarithms, shape (2, M, 3)."""
        return self._spread(self.std[: self.count], 0.0)

    @property
    def follow(self) -> float:
        """Return the share of the rotation of the brackets that the mount forces follow."""
        return 1.0 + float(self.theta[self.count])

    def _inertia_axes(self) -> tuple[int, ...]:
        """Return the axes about which the body turns and its inertia over its mass is not known for certain."""
        return tuple(int(a) for a in np.flatnonzero(self.arrangement.free[3:])) if self._inertia_std() > 0.0 else ()

    def _inertia_std(self) -> float:
        """Return the standard deviation of the logarithm of inertia over mass: either may be off alone."""
        body = self.arrangement.body
        mass = body.mass.std / body.mass.value if body.mass.std else 0.0
        return math.sqrt(math.log1p(mass**2 + (body.inertia_relative_std or 0.0) ** 2))

    def inertia(self) -> tuple[Array, float]:
        """Return the inertia about the CG for the file's mass, shape (3, 3) [kg m^2], and its largest relative std."""
        root, body = np.ones(3), self.arrangement.body
        root[list(self._turns)] = np.exp(-0.5 * self.theta[self.count + 1 :])
        own = self.std[self.count + 1 :]
        return root[:, None] * np.asarray(body.inertia) * root, float(own.max()) if own.size else body.inertia_relative_std or 0.0

    def _spread(self, values: Array, empty: float) -> Array:
        result = np.full((2, len(self.arrangement.mounts), 3), empty)
        for slot, value in zip(self.slots, values):
            result[slot.role, slot.mount, slot.axis] = value
        return result

    def estimates(self) -> tuple[Estimate, ...]:
        """Return one estimate per parameter that is scaled: value, standard deviation, status and reason."""
        found = []
        listed = [(s, float(self.theta[n]), float(self.std[n]), *self.status.of(n)) for n, s in enumerate(self.slots)]
        unseen = "no transducer tells this axis: a triaxial accelerometer at each mount base would"
        listed += [(s, 0.0, s.std, Status.NOT_IDENTIFIABLE, unseen) for s in self._left_out]
        for slot, log, std, status, reason in listed:
            mount, axis = self.arrangement.mounts[slot.mount], AXES[slot.axis]
            element = mount.elements[axis]
            for p in element.parameters():
                if p.role != ROLES[slot.role]:
                    continue
                prior = float(getattr(element, p.name))
                value = prior * float(np.exp(log))
                name = f"{mount.name}.{axis}.{p.name}"
                found.append(Estimate(name, value, abs(value) * std, p.unit, prior, status, reason, self.stamp_ns))
        return tuple(found)

    def null_directions(self) -> list[str]:
        """Return the combinations of parameters the run has not told, in words; empty before the first estimate."""
        if self._filter is None:
            return []
        names = [f"{self.arrangement.mounts[s.mount].name}.{AXES[s.axis]}.{ROLES[s.role]}" for s in self.slots]
        return null_directions(self._filter.p[: self.count, : self.count], self._prior_std[: self.count], names)

    def notes(self) -> list[str]:
        """Return what the person in the field should know about the parameters."""
        found = []
        if self.changes:
            found.append(f"the parameters changed {self.changes} times during the run faster than driving conditions explain")
        vertical = np.array([s.axis == 2 for s in self.slots], dtype=bool)
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
        names = []
        for n, slot in enumerate(self.slots):
            if self.theta[n] <= self._lower[n] + 1e-9 or self.theta[n] >= self._upper[n] - 1e-9:
                names.append(f"{self.arrangement.mounts[slot.mount].name}.{AXES[slot.axis]}.{ROLES[slot.role]}")
        return tuple(names)

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
            self._count("gap in a sensor")
            self.restart()
            return False
        self._blocks.append(data)
        self._pending_ticks += len(data.support)
        if self._pending_ticks * dt < self.settings.parameter_interval / 2.0:
            return False
        chunk = self._filtered(dt)
        self._settled += self._pending_ticks_taken * dt
        if self._settled < _SETTLE / self._balance.corner:
            return False
        return self._take(chunk, motion.covariance, stamp_ns)

    def _filtered(self, dt: float) -> BalanceChunk:
        joined = BalanceInput.join(self._blocks)
        self._pending_ticks_taken = self._pending_ticks
        self._blocks, self._pending_ticks = [], 0
        if self._doubt is not None:
            self._doubt.observe(joined.deflection, joined.rate)
        return self._balance.observe(joined, self._static(), self.follow, dt)

    def _static(self) -> Array:
        a = self.arrangement
        stiffness = np.maximum(self._law.stiffness, 0.0).ravel()
        stiffness = stiffness + 1e-9 * max(float(stiffness.max()), 1.0)
        return static_share(a.wrench[a.free], stiffness, a.weight[a.free]).reshape(len(a.mounts), 3)

    def _take(self, chunk: BalanceChunk, covariance: Array, stamp_ns: int) -> bool:
        noise = np.sqrt(np.trace(covariance[:3, :3]))
        size = float(np.sqrt(np.mean(np.sum(chunk.measured[:, :3] ** 2, axis=1))))
        self.excited = size > max(self.settings.excitation_accel, 3.0 * float(noise))
        weights = self._weights(covariance)
        self._response.set_noise(covariance, self._base_variance)
        if self.excited:
            self._refinement.add(chunk, self.theta, _LONGEST)
        else:
            self._refinement.clear()
        if self._filter is None:
            return self._start(weights, chunk.step, stamp_ns) if self.excited else False
        if self._response.step != chunk.step:
            self._prepare(self.theta, chunk.step)
        innovation, gradient = self._response.observe(chunk)
        self._followed += len(chunk.measured) * chunk.step
        if not self.excited or self._followed < _FADE:
            return False
        self.excited_time += len(chunk.measured) * chunk.step
        self._interval.add(innovation, gradient, weights, len(chunk.measured) * chunk.step)
        if self._interval.duration < self.settings.parameter_interval:
            return False
        self._update(self._interval, chunk.step)
        self._interval = Interval(len(self.theta))
        if self.innovation_ratio > _RESTLESS and not self._reviews:
            # too small a change for the gate would widen the scatter and never be learned
            self._reviews = tuple(self.excited_time + after for after in _REVIEWS_AFTER_CHANGE)
        self._review(weights, chunk.step)
        self.stamp_ns = stamp_ns
        return True

    def _weights(self, covariance: Array) -> Array:
        """Return the whitening of the innovations, shape (6, 6), zero for coordinates the body does not have."""
        free = np.flatnonzero(self.arrangement.free)
        result = np.zeros((6, 6))
        result[np.ix_(free, free)] = np.linalg.cholesky(np.linalg.inv(covariance[np.ix_(free, free)]))
        return result

    # -- start and review -------------------------------------------------------------------------------------------------

    def _start(self, weights: Array, step: float, stamp_ns: int) -> bool:
        """After a few seconds of excitation estimate by least squares, refine by output error and begin to track."""
        if self._refinement.duration < _FIRST:
            return False
        starts = [self._refinement.least_squares(), self.theta]
        # with sensors far better than the model the first answer overrides the prior in all it cannot tell
        for _ in range(2):
            refined = [self._refinement.refine(start, weights, self._memory.inflation) for start in starts]
            best = min(refined, key=lambda r: r[1])[0]
            before = self._memory.inflation
            self._memory.foresee(self._refinement.passed(best, weights))
            if self._memory.inflation <= before:
                break
        self._filter = GuardedEkf(best, np.diag(self._prior_std**2))
        self._learn_all(best, weights, step)
        self.excited_time += self._refinement.duration
        self.stamp_ns = stamp_ns
        return True

    def _learn_all(self, centre: Array, weights: Array, step: float) -> None:
        """Feed the last seconds to the filter, linearised at one point."""
        intervals = self._refinement.passed(centre, weights)
        self._memory.clear()
        self._memory.foresee(intervals)
        for interval in intervals:
            self._learn(interval, centre)
        self._followed = _FADE
        self._set(self.theta, step)

    def _review(self, weights: Array, step: float) -> None:
        """Look again at the last seconds as a whole; move where that fits clearly better than what the filter holds."""
        if not self._reviews or self.excited_time < self._reviews[0] or self._filter is None:
            return
        if self._refinement.duration < _FIRST:  # what was kept of a pause in the motion is too short to look at
            return
        self._reviews = self._reviews[1:]
        state, last = self._response.state, self._response.last
        inflation = max(self._memory.inflation, 1.0)
        theta, cost = self._refinement.refine(self.theta, weights, inflation)
        prior = inflation * np.sum((self.theta / self._prior_std) ** 2)
        present = sum(i.square for i in self._refinement.passed(self.theta, weights)) + float(prior)
        if present - cost > _CLEARLY * inflation:
            self._filter.replace(x=theta, p=np.diag(self._prior_std**2))
            self._learn_all(theta, weights, step)
        else:
            self._response.state, self._response.last = state, last
            self._set(self.theta, step)

    def _prepare(self, theta: Array, step: float) -> None:
        """Make the response ready for a parameter vector."""
        self._law.scale(self._spread(np.exp(theta[: self.count]), 1.0))
        if isinstance(self._balance, ForceBalance):
            self._balance.scale_inertia(theta[self.count + 1 :])
        self._response.prepare(self._static(), 1.0 + float(theta[self.count]), step)

    # -- tracking ---------------------------------------------------------------------------------------------------------

    def _update(self, interval: Interval, step: float) -> None:
        before = self.theta.copy()
        self._learn(interval, before)
        largest = self.settings.largest_step
        self._set(np.clip(self.theta, before - largest, before + largest), step)

    def _learn(self, interval: Interval, centre: Array) -> None:
        """Give one interval, linearised at ``centre``, to the filter; memory, standard deviations and status follow."""
        ekf = self._filter
        if ekf is None:
            return
        scale = self._memory.inflation
        values, basis = np.linalg.eigh(interval.information)
        keep = values > 1e-9 * max(float(values[-1]), 1e-30)
        if not np.any(keep):
            self._count("no information")
            return
        root = np.sqrt(values[keep])
        jacobian = root[:, None] * basis[:, keep].T
        residual = (basis[:, keep].T @ interval.gradient) / root - jacobian @ (ekf.x - centre)
        kept = 1.0 - min(self.settings.parameter_interval / self.settings.parameter_memory, 0.5)
        ekf.predict(forgetting_noise(ekf.p, interval.information / scale, kept))
        established = self._memory.length >= 8
        ratio = self._normalised(ekf, residual, jacobian, scale)
        if established and ratio > _SUSPECT_RATIO:
            self._refused += 1
            if self._refused <= _REFUSED:
                self._count("innovation beyond the gate")
                return
            self._open()
        self._refused = 0
        self.innovation_ratio += 0.1 * (min(ratio, _SUSPECT_RATIO) - self.innovation_ratio)
        result = ekf.update(residual, jacobian, scale * np.eye(len(root)), gate=False)
        if not result.accepted:
            self._count(result.reason)
            return
        self._keep_within_bounds(ekf)
        self.theta = ekf.x
        self._memory.add(interval, centre)
        self.std = self._memory.standard_deviation(ekf.p, self.theta)
        own = slice(0, self.count)
        self.std[own] = self._with_doubt(self.std[own])
        self.status.follow(
            self.std[own], self._prior_std[own], self.theta[own], self._memory, self._lower[own], self._upper[own]
        )  # fmt: skip

    def _with_doubt(self, std: Array) -> Array:
        """Return standard deviations with what the mounting of the sensors leaves uncertain, at most those of the file."""
        if self._doubt is None:
            return std
        doubt = self._doubt.std()
        added = np.array([doubt[s.role, s.mount, s.axis] for s in self.slots])
        return np.asarray(np.minimum(np.hypot(std, added), np.maximum(self._prior_std[: self.count], std)))

    def _normalised(self, ekf: GuardedEkf, residual: Array, jacobian: Array, scale: float) -> float:
        """Return the normalised innovation squared per degree of freedom."""
        s = jacobian @ ekf.p @ jacobian.T + scale * np.eye(len(residual))
        return float(residual @ np.linalg.solve(s, residual)) / len(residual)

    def _open(self) -> None:
        """The vehicle has changed: open the covariance and forget the scatter of before."""
        self.changes += 1
        self._memory.clear()
        self._reviews = tuple(self.excited_time + after for after in _REVIEWS_AFTER_CHANGE)
        if self._filter is not None:
            self._filter.replace(p=self._filter.p + _CHANGE_STD**2 * np.eye(len(self.theta)))

    def _keep_within_bounds(self, ekf: GuardedEkf) -> None:
        x = np.clip(ekf.x, self._lower, self._upper)
        if not np.array_equal(x, ekf.x):
            ekf.replace(x=x)

    def _set(self, theta: Array, step: float) -> None:
        """Use parameters from now on."""
        self.theta = np.array(theta, dtype=float)
        if self._filter is not None and not np.array_equal(self._filter.x, self.theta):
            self._filter.replace(x=self.theta)
        self._prepare(self.theta, step)

    def _count(self, reason: str) -> None:
        self.rejected[reason] = self.rejected.get(reason, 0) + 1

    # -- persistence ------------------------------------------------------------------------------------------------------

    def save(self) -> dict[str, Any]:
        """Return what was learned as plain lists; the filters of the signals start again."""
        return {
            "theta": self.theta.tolist(), "std": self.std.tolist(),
            "doubt": None if self._doubt is None else self._doubt.save(),
            "stamp_ns": self.stamp_ns, "excited_time": self.excited_time,
            "p": None if self._filter is None else self._filter.p.tolist(), "memory": self._memory.save(),
            "status": self.status.save(), "innovation_ratio": self.innovation_ratio, "changes": self.changes,
        }  # fmt: skip

    def load(self, saved: dict[str, Any], step: float | None = None) -> None:
        """Continue from :meth:`save`."""
        self.theta = np.array(saved["theta"], dtype=float)
        self.std = np.array(saved["std"], dtype=float)
        if self._doubt is not None:
            self._doubt.load(saved["doubt"])
        self.stamp_ns, self.excited_time = int(saved["stamp_ns"]), float(saved["excited_time"])
        self.innovation_ratio, self.changes = float(saved["innovation_ratio"]), int(saved["changes"])
        self._memory.load(saved["memory"])
        self.status.load(saved["status"])
        self._filter = None if saved["p"] is None else GuardedEkf(self.theta, np.array(saved["p"], dtype=float))
        self._law.scale(self.multipliers())
        if isinstance(self._balance, ForceBalance):
            self._balance.scale_inertia(self.theta[self.count + 1 :])
        self.restart()
