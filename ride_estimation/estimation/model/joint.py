# Copyright 2026 ride_estimation contributors
"""Joint estimation of all slow states of a run: errors in variables in the frequency domain, with priors.

At every frequency the readings are ``y = T(theta) w + G(theta) b + noise``: w the unknown acceleration of base and its patterns,
b the unknown difference of the states before and after a segment, noise white and of known size. There are more channels than
inputs: ``sum |(1 - T T^+)(y - G b)|^2`` is minimised together with the priors of theta (Gauss-Newton). No spectrum of the base is
assumed, so none can be wrong. Derivatives are taken at the estimate of w that is shrunk by its signal-to-noise ratio: a function
of ``T^+ y``, it is independent of what is left over, so the score has mean zero and the covariance that is stated (conditional
score, Stefanski and Carroll, Biometrika 74, 1987). Second-order terms are renewed from the states between the steps, and so is
the factor on the noise, per frequency, of what the model does not describe. How the second order changes with k and c is in the
Jacobian: it alone tells a stiff mount on the left from one on the right, and steps that took it for given ran away.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.load import Load, LoadEvidence, moved_by_load, of_delivery
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.readings import travel_place
from ride_estimation.estimation.model.segments import (
    DEFORMS_HZ,
    ENDS_HZ,
    SLOW_OCTAVES,
    Model,
    Projected,
    Segment,
    force_scores,
    project,
    renew,
    states_of,
)  # fmt: skip
from ride_estimation.estimation.model.sensitivity import Sensitivity

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: largest change of ln k and ln c in one step
_LARGEST_STEP = 0.5
#: length of the part that is estimated from first; longer segments are divided into equal ones [s]
_FIRST_S, _LONGEST_S = 15.0, 60.0
#: scoring steps at most; converged when the largest step is this share of its standard deviation; how often the second order of
#: the whole run is renewed before
_STEPS, _CONVERGED, _RENEWALS = 12, 0.1, 3
#: shortest and longest of the shares that are taken of steps
_RELAX = 0.2, 1.0
#: times a step is halved at most while it does not lower the cost by more than its rounding
_HALVINGS, _NOISE_OF_COST = 4, 0.5
#: share of the second order that is not known: a factor on it, estimated with all else, is 0.3 to 1.4 % less than one in drawn
#: cabs that move much and within 0.8 % of one in foreign ones. What is left is no common factor: estimated as a slow state,
#: errors of the sensors of two drawn cabs that move most were to 75 and 84 % inside two standard deviations instead of 94 and 95
_HIGHER_ORDER = 0.05
#: standard deviations of its prior from which an error is a fault of the sensor (a bias of 0.25 m/s^2 of one sensor on a cab left
#: 14 % of the horizontal forces wrong, freed 4 %: foreign run cab_12)
_FAULT = 4.0
#: standard deviations from which a force beside the law of a mount shows (healthy foreign runs up to 8.5; play of a damper that a
#: linear law hides, cab_14, 78)
_SHOWN = 12.0
#: standard deviations of the CG from which a load is looked for
_LOOKS = 2.5
#: least standard deviations that are believed: CG and zero of a transducer [m]
_LEAST_CG, _LEAST_ZERO = 1e-3, 1e-4
#: odds that a body is what its file states: one drive in four has a load, or a file with a wrong CG
_ODDS = 3.0
#: how often a body leans anew by a load at most, and change of its lean from which it does, over the lean
_LEANS, _STANDS = 3, 0.05
#: how often causes of what is left over are looked for at most
_CAUSES = 6
_DIVERGES = "the motion is too large: kinematics of second order are larger than those of first"
_UNFIT = "the errors of the sensors cannot be estimated: the vehicle file does not fit this drive"
#: an error is determined where its standard deviation fell below this share of the prior
DETERMINED = 0.5
#: mean normalised square of what no input explains, in the octave where it is largest, above which the model does not explain the
#: readings. Drawn cabs 1.0 to 1.6; slight degressive dampers, softening and hardening springs of foreign cabs 5.6, 5.1, 6.4
#: (mean over all lines 1.1, 0.8, 1.2, with noise that the file states a third too large)
LARGEST_NIS = 2.5
#: move of an error that is not determined, over what it could be, from which something else moved it; 100 normal values reach
#: five once in 17 000 drives. Least change of a variance that is reckoned with
_CONFLICT, _LEAST_SHARE = 5.0, 0.2
#: lines of the Jacobian handled together: bounds the memory
_CHUNK = 256


class JointEstimate:
    """Slow states of one run.

    Parameters
    ----------
    plant
        Vehicle.
    segments
        Readings without gaps, one array (T, C) each, in the order of the plant's sensors.
    dt
        Sample [s].
    free_forces
        Whether mounts may have a force beside their law. Where they may not, mounts that are not linear are not explained.

    Attributes
    ----------
    theta, covariance
        Slow states (P,) and their covariance (P, P); rows of held states are zero, delays are relative to their mean.
    nis, largest_nis, largest_slow_nis
        Mean normalised square of what no input explains, over all lines, in the octave where it is largest, and in the one of
        those below 4 Hz: 1 where model and noise are right.
    """

    def __init__(self, plant: Plant, segments: Sequence[Array], dt: float, free_forces: bool = False) -> None:
        self.plant, self.dt, self._free_forces = plant, dt, free_forces
        self._raw = [part for s in segments for part in np.array_split(s, max(1, round(len(s) * dt / _LONGEST_S)))]
        self.segments = [Segment.of(s, dt, plant) for s in self._raw]
        delays = np.unique(plant.delay_of)
        self._delays = delays if np.all(plant.slow.std[delays] > 0.0) else np.zeros(0, dtype=np.int64)
        self.theta = plant.slow.mean.copy()
        self.covariance = np.diag(plant.slow.std**2)
        self.nis = self.largest_nis = self.largest_slow_nis = np.nan
        #: slow states as the vehicle file states them
        self.stated = plant.slow
        #: part of the variances that the second order causes which is not known, shape (P,)
        self._considered = np.zeros(len(self.theta))

    def model(self, theta: Array | None = None) -> Model:
        """Return the model at slow states, the present ones unless given."""
        return Model.of(self.plant, (self.theta if theta is None else theta).copy())

    def fit(self) -> None:
        """Estimate the slow states: first from the liveliest part, then from the whole run.

        Raises
        ------
        InputDataError
            The numbers left what can be computed.
        """
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                self._fit()
        except (np.linalg.LinAlgError, FloatingPointError) as error:
            raise InputDataError(_UNFIT) from error

    def _fit(self) -> None:
        first = liveliest(self._raw, round(_FIRST_S / self.dt))
        self._begin(first)
        for _ in range(_CAUSES):
            plant, theta, segments = self.plant, self.theta, self.segments
            try:
                if not ((self._free_forces and self._free_force(first)) or self._take_load() or self._widen()):
                    break
            except (np.linalg.LinAlgError, FloatingPointError, InputDataError):
                # a force beside the law fed the second order until the numbers ran away: two drawn linear cabs of 26
                if self.plant.freed == plant.freed:
                    raise
                self.plant, self.theta, self.segments, self._free_forces = plant, theta, segments, False
        self._whole()
        if self.plant.freed:
            self._settle_laws()
        if self.plant.load.presence:
            load = self._load(self.plant.load.leaning)[0]
            self.plant = self.plant.carrying(dataclasses.replace(self.plant.load, share=load.share, std=load.std))
        model = self.model()
        projected = self._projected(model)
        information, _, along = self.normal_equations(model, projected)
        free, inverse = self.plant.slow.free, self._inverse(information)
        higher = _HIGHER_ORDER * inverse @ along
        learned, considered = np.zeros((2, *self.covariance.shape))
        learned[np.ix_(free, free)], considered[np.ix_(free, free)] = inverse, np.outer(higher, higher)
        self.covariance = self._relative(learned + considered)
        self._considered = np.diag(self._relative(considered))

    def _begin(self, part: Array) -> None:
        """Estimate from one part alone."""
        self.segments = [Segment.of(part, self.dt, self.plant)]
        self._go_on()

    def _whole(self) -> None:
        """Estimate from the whole run."""
        self.segments = [Segment.of(s, self.dt, self.plant) for s in self._raw]
        for _ in range(_RENEWALS):
            self.renew()
        self._iterate()
        if self._diverges():
            raise InputDataError(_UNFIT)

    def _go_on(self) -> None:
        """Estimate from where the segments are; refuse motion that the second order does not describe."""
        self._iterate()
        if self._diverges():
            raise InputDataError(_DIVERGES)

    def _diverges(self) -> bool:
        return any(np.linalg.norm(s.second_readings) > np.linalg.norm(s.moving) for s in self.segments)

    def _take_load(self) -> bool:
        """Take a CG far from the file for that of a load; return whether it is.

        A load on springs makes the body lean, which a levelled body and a wrong CG do not, and a CG may err by what the file
        states: of the three the likeliest counts, by the whole run.
        """
        off, plant, theta, segments = self.cg_offset(), self.plant, self.theta, self.segments
        std = np.maximum(self.stated.std[self.stated.cg], _LEAST_CG)
        if plant.load.presence or np.all(np.abs(off) <= _LOOKS * std) or not np.any(off[:2]):
            return False
        as_stated = 0.5 * float(np.sum((off / std) ** 2)) + float(np.log(2.0 * np.pi * std[0] * std[1] / _ODDS))
        found = []
        for leans in (None, True, False):
            self.plant, self.theta = plant, theta
            try:
                if leans is None:
                    self._whole()
                    found.append((self._misfit() + as_stated, plant, theta, segments))
                else:
                    found.append((self._with_load(leans, off) + self._misfit(), self.plant, self.theta, self.segments))
            except (np.linalg.LinAlgError, FloatingPointError, InputDataError):
                continue
        if not found:
            raise InputDataError(_UNFIT)
        best, self.plant, self.theta, self.segments = min(found, key=lambda one: one[0])
        if not self.plant.load.presence:
            return False
        odds = [(np.exp(best - misfit), one.load.presence) for misfit, one, *_ in found if one.load.presence]
        presence = sum(weight * one for weight, one in odds) / sum(weight for weight, _ in odds)
        self.plant = self.plant.carrying(dataclasses.replace(self.plant.load, presence=float(presence)))
        return True

    def _with_load(self, leans: bool, off: Array) -> float:
        """Estimate with a load until the body leans as it makes it; return how unlikely what tells its mass is."""
        plant, before = self.plant, np.zeros(3)
        for _ in range(_LEANS):
            load, unlikely = self._load(leans)
            if leans and np.linalg.norm(load.leans - before) < _STANDS * np.linalg.norm(load.leans):
                break
            self.plant, before = plant.with_load(load, off), load.leans
            self.theta = np.where(self.plant.slow.std > 0.0, self.theta, self.plant.slow.mean)
            self._whole()
            if not leans:
                break
        return unlikely

    def _misfit(self) -> float:
        """Return the negative logarithm of the likelihood of readings and errors of sensors, up to a constant.

        Restricted to what no input explains (Harville, Biometrika 61, 1974), with the noise as it came out.
        """
        self.renew()
        slow, model = self.plant.slow, self.model()
        errors = slow.free[slow.free >= slow.mean_accel.stop]
        total = 0.5 * float(np.sum((self.theta[errors] / slow.std[errors]) ** 2))
        for segment, p in zip(self.segments, self._projected(model)):
            noise = (len(segment.noise) - segment.silent) * np.sum(np.log(segment.factor)) - 2.0 * np.sum(p.white.log_volume)
            inputs = 2.0 * np.sum(np.log(np.abs(np.diagonal(p.root, axis1=1, axis2=2))))
            total += p.cost + float(noise + inputs)
        return total

    def _load(self, leans: bool) -> tuple[Load, float]:
        """Return the mass of a load that moves the CG to where it is, and how unlikely what tells it is."""
        plant, slow, model = self.plant, self.stated, self.model()
        m = model.constants
        vertical = [i for i in range(2, len(m.stiffness), 3) if i not in plant.freed]
        motion = moved_by_load(m.points, m.stiffness, m.cg - slow.mean[slow.cg], m.mass * plant.gravity)
        rows = [travel_place(plant, s) for s in plant.transducers]
        travel = np.mean([(s.mean - s.second_mean - model.constant)[plant.travels] for s in self.segments], axis=0)
        zero = np.maximum(slow.std[[slow.sensors[s.name]["bias"].start for s in plant.transducers]], _LEAST_ZERO)
        stiffness = of_delivery(*(part[slow.log_stiffness][vertical] for part in (self.theta - slow.mean, slow.std)))
        off = self.cg_offset()
        least = plant.geometry.least_load_share(off)
        evidence = LoadEvidence(off, least, *stiffness, motion, m.cg, plant.centre, m.points[rows], travel, zero)
        return evidence.load(leans)

    def _free_force(self, part: Array) -> bool:
        """Give the mount that explains most of what is left a force beside its law, and begin anew; return whether one does."""
        model = self.model()
        projected = self._projected(model)
        scores, spreads = (sum(x) for x in zip(*(force_scores(model, s, p) for s, p in zip(self.segments, projected))))
        possible = [place for place in np.argsort(scores)[::-1].tolist() if self.plant.may_free(place)]
        if not possible or scores[possible[0]] < max(_SHOWN * np.sqrt(spreads), self._fault_score()):
            return False
        self.plant = self.plant.with_free_force(possible[0])
        self.theta = self.plant.slow.mean.copy()
        self._begin(part)
        return True

    def _settle_laws(self) -> None:
        """Give laws with a force beside them the stiffness and damping of their whole force, ``F = -k x - c x' + rest``.

        That changes the force beside the law and not their sum. But the mount carries its weight by k: with that of the vehicle
        file smoothed vertical forces of a cab with friction were 7 to 15 % off, live ones 5 to 9 %, with this one 2 to 5 %. It is
        as uncertain as the rest is large beside k x; what the file states is the other measurement.
        """
        model, slow, freed = self.model(), self.plant.slow, list(self.plant.freed)
        force, travel, rate = (np.zeros((0, len(freed)), dtype=np.complex128) for _ in range(3))
        for segment, p in zip(self.segments, self._projected(model)):
            v, fast = states_of(model, segment, p)[0], segment.lines.frequency > DEFORMS_HZ
            x = (v @ model.dynamics.deflection[freed].T)[fast]
            force, travel = np.vstack([force, (v @ model.dynamics.force[freed].T)[fast]]), np.vstack([travel, x])
            rate = np.vstack([rate, segment.lines.laplace[fast, None] * x])
        spread = []
        for i, place in enumerate(freed):
            columns = np.column_stack([travel[:, i], rate[:, i]])
            law, *_ = np.linalg.lstsq(np.vstack([columns.real, columns.imag]), -np.r_[force[:, i].real, force[:, i].imag], None)
            rest = np.linalg.norm(force[:, i] + columns @ law) / np.linalg.norm(law[0] * travel[:, i])
            spread.append(self.plant.freed_std[i])
            if law[0] > 0.0:
                share, at = spread[i] ** 2 / (spread[i] ** 2 + rest**2), slow.log_stiffness.start + place
                self.theta[at] += share * (np.log(law[0]) - self.theta[at])
                spread[i] *= float(np.sqrt(1.0 - share))
            if law[1] > 0.0:
                self.theta[slow.log_damping.start + place] = np.log(law[1])
        self.plant = self.plant.with_laws_known_to(tuple(spread))
        self.renew()

    def _fault_score(self) -> float:
        """Return how much less errors of sensors beyond all priors would leave, were they free."""
        slow, faulty = self.plant.slow, np.flatnonzero(self._faulty())
        if not len(faulty):
            return 0.0
        free = slow.free
        information, gradient, _ = self.normal_equations(self.model())
        at = np.searchsorted(free, faulty)
        prior = slow.std[faulty] ** -2.0
        information[at, at] -= (1.0 - 1.0 / _FAULT**2) * prior
        gradient[at] -= prior * self.theta[faulty]
        unit = slow.std[free]
        return 0.5 * float((unit * gradient) @ np.linalg.solve(unit[:, None] * information * unit, unit * gradient))

    def _widen(self) -> bool:
        """Give errors of sensors beyond all priors a prior of their size and go on; return whether there are some.

        A faulty sensor does not err by a normal distribution: held to it, it bends what it is read together with.
        """
        slow, found = self.plant.slow, self._faulty()
        if not found.any():
            return False
        std = slow.std.copy()
        std[found] = np.abs(self.theta[found])
        self.plant.slow = dataclasses.replace(slow, std=std)
        self._go_on()
        return True

    def _faulty(self) -> NDArray[np.bool_]:
        """Return which errors of sensors are beyond all priors, shape (P,)."""
        slow, found = self.plant.slow, np.zeros(len(self.theta), dtype=bool)
        errors = slice(slow.mean_accel.stop, None)
        found[errors] = np.abs(self.theta[errors]) > _FAULT * slow.std[errors]
        return found

    @property
    def faults(self) -> tuple[str, ...]:
        """Errors of sensors that are beyond their priors, by which they were not held."""
        return self.plant.slow.errors(np.abs(self.theta) > _FAULT * self.stated.std)

    def conflicts(self) -> tuple[str, ...]:
        """Return errors of sensors that moved although the run hardly determines them: the model misses what they explain."""
        slow, prior, considered = self.plant.slow, self.plant.slow.std, self._considered
        std = np.sqrt(np.maximum(np.diag(self.covariance) - considered, 0.0))
        learned = np.sqrt(np.maximum(prior**2 - std**2, (_LEAST_SHARE * prior) ** 2) + considered)
        far = (np.abs(self.theta) > _CONFLICT * learned) & (std >= DETERMINED * prior)
        return slow.errors(far)

    def cg_offset(self) -> Array:
        """Return where the CG is, from where the vehicle file states it, shape (3,) [m]."""
        return np.asarray(self.plant.load.own(self.theta[self.stated.cg]) - self.stated.mean[self.stated.cg])

    def _inverse(self, information: Array) -> Array:
        """Return the inverse of an information, computed in units of the prior standard deviations."""
        unit = self.plant.slow.std[self.plant.slow.free]
        return np.asarray(unit[:, None] * np.linalg.inv(unit[:, None] * information * unit) * unit)

    def _relative(self, covariance: Array) -> Array:
        """Return the covariance without what all delays have in common: a shift of the time, which no run shows."""
        if not len(self._delays):
            return covariance
        turn = np.eye(len(covariance))
        turn[np.ix_(self._delays, self._delays)] -= 1.0 / len(self._delays)
        return np.asarray(turn @ covariance @ turn.T)

    def _iterate(self) -> None:
        """Repeat Gauss-Newton steps until they are small against their standard deviation.

        Second order and noise, renewed between them, may turn a step back: steps that go to and fro are shortened (Aitken's
        relaxation for vectors: Irons and Tuck, Int. J. Numer. Methods Eng. 1, 1969).
        """
        slow, free = self.plant.slow, self.plant.slow.free
        laws = free < slow.log_damping.stop
        model = self.model()
        projected = self._projected(model)
        relax, last = 1.0, np.zeros(len(free))
        for _ in range(_STEPS):
            information, gradient, _ = self.normal_equations(model, projected)
            if not (np.all(np.isfinite(information)) and np.all(np.isfinite(gradient))):
                raise InputDataError(_UNFIT)
            inverse = self._inverse(information)
            change = -inverse @ gradient
            scale = min(1.0, _LARGEST_STEP / max(float(np.abs(change[laws]).max()), 1e-12))
            size = change / np.sqrt(np.diag(inverse))
            turned = size - last
            relax = float(np.clip(-relax * (last @ turned) / max(float(turned @ turned), 1e-12), *_RELAX)) if last.any() else 1.0
            last = size
            before, start = self.cost(model, projected), self.theta.copy()
            for halved in range(_HALVINGS):
                self.theta = start.copy()
                self.theta[free] += 0.5**halved * relax * scale * change
                moved_model = self.model()
                moved_projected = self._projected(moved_model)
                if self.cost(moved_model, moved_projected) < before + _NOISE_OF_COST:
                    model, projected = moved_model, moved_projected
                    break
            else:
                self.theta = start
            self._renew(model, projected)
            if (scale == 1.0 and np.abs(size).max() < _CONVERGED) or np.array_equal(self.theta, start):
                break
            projected = self._projected(model)

    def renew(self) -> None:
        """Compute the second order from the states, and the factor on the noise from what is left over."""
        model = self.model()
        self._renew(model, self._projected(model))

    def _renew(self, model: Model, projected: Sequence[Projected]) -> None:
        for segment, p in zip(self.segments, projected):
            renew(model, segment, p)

    def _projected(self, model: Model) -> list[Projected]:
        return [project(model, segment) for segment in self.segments]

    def cost(self, model: Model, projected: Sequence[Projected] = ()) -> float:
        """Return the negative logarithm of likelihood times prior, up to a constant, at the present second order and noise.

        Parameters
        ----------
        model
            At the slow states in question.
        projected
            The segments at that model, where they are at hand.
        """
        slow = self.plant.slow
        free = slow.free
        total = 0.5 * float(np.sum(((self.theta - slow.mean)[free] / slow.std[free]) ** 2))
        for segment, p in zip(self.segments, projected or self._projected(model)):
            white, offset = self._offset(model, segment)
            total += p.cost + 0.5 * float(np.sum((white @ offset) ** 2))
        return total

    def _offset(self, model: Model, segment: Segment) -> tuple[Array, Array]:
        """Return what whitens the mean readings of accelerometers and what they differ from the model.

        Means of a segment are not zero: those of accelerations are changes of velocity over its duration, the deformation
        wanders, and the body follows both. The mean of a travel depends on the load and tells nothing of the transducer.
        """
        at, lines = self._means(segment), segment.lines
        offset = (segment.mean - model.constant - segment.second_mean)[at]
        rows, std = self._slow_motion(model, segment)
        higher = _HIGHER_ORDER * np.std(segment.second_mean[at])
        covariance = np.diag(segment.factor[0] * segment.noise[at] ** 2 / lines.count + higher**2)
        covariance += (rows[at] * std**2) @ rows[at].T
        return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance))), offset

    def _means(self, segment: Segment) -> NDArray[np.bool_]:
        """Return the readings whose mean counts, shape (C,)."""
        return np.asarray(np.isfinite(segment.noise) & ~self.plant.travels)

    def _slow_motion(self, model: Model, segment: Segment) -> tuple[Array, Array]:
        """Return rows of the mean readings over independent causes, shape (C, K), and their standard deviations."""
        s, A = self.plant.states, model.dynamics.A
        relative = slice(0, s.carried_rate.stop)
        inverse = np.linalg.inv(A[relative, relative])
        answer = model.rows[:, relative] @ inverse
        follows = model.rows - answer @ A[relative]
        duration, slow = segment.lines.count * segment.lines.dt, 2.0 * np.pi * ENDS_HZ
        change = np.sqrt(2.0) * segment.size / slow / duration
        free = slice(s.free_force.start - s.drive.start, None)
        change[free] = segment.size[free]
        rows = np.hstack([follows[:, s.drive], follows[:, s.deformation], answer])
        patterns = s.deformation.stop - s.deformation.start
        moves = np.append(change[:6], np.full(self.plant.carried.count, change[:6].max()))
        wanders = np.full(patterns, segment.deformation / np.sqrt(duration * ENDS_HZ))
        return rows, np.concatenate([change, wanders, moves / slow, moves])

    def normal_equations(self, model: Model, projected: Sequence[Projected] = ()) -> tuple[Array, Array, Array]:
        """Return the normal equations of the free slow states.

        A common factor on the second order is known to :data:`_HIGHER_ORDER`: it is considered and not estimated (Schmidt, in
        Bierman, Factorization Methods, 1977, VIII).

        Parameters
        ----------
        model, projected
            As in :meth:`cost`.

        Returns
        -------
        tuple
            Information (P, P) and gradient (P,) of the negative log-likelihood, priors included; gradient by that factor (P,).
        """
        slow, free = self.plant.slow, self.plant.slow.free
        sensitivity = Sensitivity.of(model)
        information, along = np.diag(slow.std[free] ** -2.0), np.zeros(len(free))
        gradient = (self.theta - slow.mean)[free] / slow.std[free] ** 2
        squares, counts = np.zeros((2, 1))
        for segment, p in zip(self.segments, projected or self._projected(model)):
            own, cross, scores = self._jacobian(sensitivity, segment, p, states_of(model, segment, p)[0])
            information += 2.0 * (own - cross @ np.linalg.solve(p.ends_information, cross.T))
            gradient -= 2.0 * scores[:, 0]
            along += 2.0 * scores[:, 1]
            white, offset = self._offset(model, segment)
            slope = white @ sensitivity.constants[:, self._means(segment)].T
            information += slope.T @ slope
            gradient -= slope.T @ (white @ offset)
            own_squares, own_counts = p.squares(segment)
            squares, counts = squares + own_squares, counts + own_counts
        self.nis, self.largest_nis = float(squares.sum() / counts.sum()), largest(squares, counts)
        self.largest_slow_nis = largest(squares[:SLOW_OCTAVES], counts[:SLOW_OCTAVES])
        return information, gradient, along

    def _jacobian(self, sensitivity: Sensitivity, segment: Segment, p: Projected, v: Complex) -> tuple[Array, Array, Array]:
        """Return sums over the lines: Jacobian by itself (P, P), by the ends (P, X), by residual and second order (P, 2)."""
        parameters = len(self.plant.slow.free)
        own, cross, scores = np.zeros((parameters,) * 2), np.zeros((parameters, len(p.ends))), np.zeros((parameters, 2))
        common, ends = np.searchsorted(self.plant.slow.free, self._delays), np.zeros(len(p.ends))
        for first in range(0, len(v), _CHUNK):
            at = slice(first, first + _CHUNK)
            J = sensitivity.readings(segment, p, v, at)
            if len(common):
                J[:, :, common] -= J[:, :, common].mean(axis=2, keepdims=True)
            real = _real(np.matmul(p.free[at], J))
            over, left = _real(p.jump[at]), _real(np.dstack([p.left[at], np.matmul(p.free[at], p.second[at, :, None])[:, :, 0]]))
            own += real.T @ real
            cross += real.T @ over
            scores += real.T @ left
            ends += over.T @ left[:, 1]
        scores[:, 1] -= cross @ np.linalg.solve(p.ends_information, ends)
        return own, cross, scores


def _real(values: Complex) -> Array:
    """Return complex values (F, R, K) as rows of real and imaginary parts, shape (2 F R, K)."""
    flat = values.reshape(-1, values.shape[2])
    return np.vstack([flat.real, flat.imag])


def largest(squares: Array, counts: Array) -> float:
    """Return the largest mean square over the octaves, from sums and numbers of squares."""
    return float(np.max(squares / np.maximum(counts, 1.0)))


def liveliest(segments: Sequence[Array], length: int) -> Array:
    """Return the part of at most ``length`` samples in which the readings move most."""
    best, found = -1.0, segments[0]
    for segment in segments:
        power = np.cumsum(np.r_[0.0, np.sum((segment - segment.mean(axis=0)) ** 2, axis=1)])
        size = min(length, len(segment))
        gain = power[size:] - power[: len(power) - size]
        if gain.max() > best:
            best, first = float(gain.max()), int(np.argmax(gain))
            found = segment[first : first + size]
    return found
