# Copyright 2026 ride_estimation contributors
"""Joint estimation of all slow states of a run: maximum of the likelihood of the innovations, with priors.

``-ln p = 1/2 sum (nu^T S^-1 nu + ln det S) + 1/2 (theta - mean)^T Sigma^-1 (theta - mean)`` is minimised by Fisher scoring
(Ljung, System Identification, 1999, 7.4; Watson and Engle, J. Econometrics 23, 1983). Gain and covariance of the filter change
with theta: held, they would turn what no run can tell, a common gain of all sensors, into information. Levels and corners of the
base motion are slow states too, so that they say nothing of a scale. Second-order terms are renewed from the smoothed states
between the steps.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.dynamics import Dynamics, diffusion, discretise, dynamics, transition
from ride_estimation.estimation.model.kalman import (
    CHUNK,
    Derivatives,
    Filter,
    filter_derivatives,
    run,
    sensitivities,
    smooth,
    stationary,
)
from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.estimation.model.readings import reading, readings
from ride_estimation.estimation.model.second_order import SecondOrder, second_order
from ride_estimation.frames import point_motion_matrix

Array = NDArray[np.float64]

#: time after the start of a segment in which the filter forgets its start [s]
SETTLE_S = 1.0
#: step of differences in slow states, in their own unit
_STEP = 1e-4
#: largest change of ln k and ln c, and of a logarithm of the noise, in one step
_LARGEST_STEP, _LARGEST_NOISE_STEP = 0.5, 1.0
#: unmodelled share of the readings at the first step, where stiffness and damping are those of the file
_FIRST_MODEL = 0.05
#: length of the part that is estimated from first [s]
_FIRST_S = 15.0
#: scoring steps at most; converged when the largest step is this share of its standard deviation
_STEPS, _CONVERGED = 15, 0.1
#: how often the second order is computed anew before the whole run is fitted
_FIRST_RENEWALS = 3
#: times a step is halved at most while it does not lower the cost by more than its rounding
_HALVINGS, _NOISE_OF_COST = 4, 0.5
#: length of the blocks whose scores state the covariance [s]
_BLOCK_S = 1.0


@dataclasses.dataclass(frozen=True)
class Model:
    """The model at one value of the slow states.

    Attributes
    ----------
    constants, dynamics
        What it was built from.
    filter
        System in discrete time with its gain.
    Q, R
        Covariance of the process noise (N, N), diagonal of the covariance of the readings (C,).
    constant
        Part of the readings that does not move: gravity and bias, shape (C,).
    push, direct
        Effect of a known specific force of the body on the next state (N, 6) and on the readings (C, 6).
    """

    constants: Constants
    dynamics: Dynamics
    filter: Filter
    Q: Array
    R: Array
    constant: Array
    push: Array
    direct: Array


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

    Attributes
    ----------
    theta, covariance
        Slow states (P,) and their covariance (P, P); rows of held states are zero.
    nis
        Mean normalised innovation squared: 1 where model and noise are right.
    """

    def __init__(self, plant: Plant, segments: Sequence[Array], dt: float) -> None:
        self.plant, self.dt = plant, dt
        self._segments = [np.asarray(s, dtype=float) for s in segments]
        self._settle = round(SETTLE_S / dt)
        moving = np.vstack([s - s.mean(axis=0) for s in self._segments])
        widths = [_width(s.kind) for s in plant.sensors]
        travel = np.repeat([s.kind == "displacement" for s in plant.sensors], widths)
        self._white = np.repeat([s.noise_std for s in plant.sensors], widths)
        self._size = np.empty(len(travel))
        for kind in (True, False):
            if np.any(travel == kind):
                self._size[travel == kind] = np.sqrt(np.mean(moving[:, travel == kind] ** 2))
        self._mean = plant.slow.mean.copy()
        first = 3 * len(plant.geometry.body_sensors)
        base = moving[:, first : first + 3 * len(plant.base_sensors)].reshape(len(moving), -1, 3)
        turned = np.hstack([base[:, i] @ s.rotation.T for i, s in enumerate(plant.base_sensors)])
        rigid = np.linalg.pinv(plant.points(plant.geometry.body.cg))
        for part, signal in ((plant.slow.log_rigid, turned @ rigid.T), (plant.slow.log_deforming, turned @ plant.patterns)):
            self._mean[part] = 0.5 * np.log(np.mean(signal**2, axis=0))
        self.theta = self._mean.copy()
        self._second: list[SecondOrder] | None = None
        self._scores = np.zeros((0, 0))
        self.covariance = np.diag(plant.slow.std**2)
        self.nis = np.nan

    def _system(self, theta: Array) -> tuple[Constants, Dynamics, Array, Array, Array, Array, Array]:
        """Return constants, dynamics and F, Q, H, the diagonal of R and the constant part of the readings."""
        m = self.plant.constants(theta)
        d = dynamics(self.plant, m)
        F, Q = discretise(d.A, diffusion(self.plant, m), self.dt)
        H, constant = readings(self.plant, d, theta)
        return m, d, F, Q, H, self._white**2 + (m.model * self._size) ** 2, constant

    def model(self) -> Model:
        """Return the model at the present slow states."""
        plant = self.plant
        m, d, F, Q, H, R, constant = self._system(self.theta)
        size = plant.states.size
        wide = np.zeros((size + 6, size + 6))
        wide[:size, :size] = d.A
        wide[plant.states.relative_rate, size:] = np.eye(6)
        direct = np.zeros((len(H), 6))
        for i, s in enumerate(plant.geometry.body_sensors):
            direct[3 * i : 3 * i + 3] = s.rotation.T @ point_motion_matrix(s.position - m.cg)
        found = stationary(F, H, Q, np.diag(R))
        return Model(m, d, found, Q, R, constant, transition(wide, self.dt)[:size, size:], direct)

    def innovations(self, model: Model, segment: int) -> tuple[Array, Array]:
        """Return innovations (T, C) and predicted states (T, N) of one segment."""
        y, known = self._shifted(segment) - model.constant, None
        if self._second is not None:
            second = self._second[segment]
            y = y - second.readings - second.accel @ model.direct.T
            known = _between(second.accel) @ model.push.T
        return run(model.filter, y, known)

    def _shifted(self, segment: int) -> Array:
        """Return the readings of a segment at the instants they belong to: every sensor earlier by its delay."""
        y = self._segments[segment].copy()
        at = 0
        for sensor in self.plant.sensors:
            part = slice(at, at + _width(sensor.kind))
            at = part.stop
            late = float(self.theta[self.plant.slow.sensors[sensor.name]["delay"]][0])
            if late != 0.0:
                y[:, part] = CubicSpline(np.arange(len(y)), y[:, part])(np.arange(len(y)) + late / self.dt)
        return y

    def fit(self) -> None:
        """Estimate the slow states: first from the liveliest part, then from the whole run."""
        whole = self._segments
        self.theta[self.plant.slow.log_model] = np.log(_FIRST_MODEL)
        self._segments = [_liveliest(whole, round(_FIRST_S / self.dt))]
        self._iterate()
        self._segments, self._second = whole, None
        # states without the second order are poor in lively parts: what follows from them first is too
        for _ in range(_FIRST_RENEWALS):
            self._renew()
        self._iterate()
        self.covariance = self._covariance()

    def _iterate(self) -> None:
        """Repeat scoring steps until they are small against their standard deviation.

        Raises
        ------
        InputDataError
            The numbers left what can be computed.
        """
        slow, free = self.plant.slow, self.plant.slow.free
        laws = free < slow.log_damping.stop
        noise = (free >= slow.log_rigid.start) & (free < slow.system)
        for _ in range(_STEPS):
            model = self.model()
            information, gradient = self.normal_equations(model)
            if not (np.all(np.isfinite(information)) and np.all(np.isfinite(gradient))):
                raise InputDataError("the errors of the sensors cannot be estimated: the vehicle file does not fit this drive")
            change = -np.linalg.solve(information, gradient)
            scale = min(1.0, _LARGEST_STEP / max(float(np.abs(change[laws]).max()), 1e-12))
            change = np.where(noise, np.clip(change, -_LARGEST_NOISE_STEP, _LARGEST_NOISE_STEP), scale * change)
            before, start = self.cost(model), self.theta.copy()
            for halved in range(_HALVINGS):
                self.theta = start.copy()
                self.theta[free] += 0.5**halved * change
                if self.cost(self.model()) < before + _NOISE_OF_COST:
                    break
            else:
                self.theta = start
            moved = np.abs(self.theta - start)[free] / np.sqrt(np.diag(np.linalg.inv(information)))
            if scale == 1.0 and moved[~noise].max() < _CONVERGED:
                break
            self._renew()

    def cost(self, model: Model) -> float:
        """Return the negative logarithm of likelihood times prior, up to a constant."""
        slow, white = self.plant.slow, model.filter.whitening()
        free = slow.free
        total = 0.5 * float(np.sum(((self.theta - self._mean)[free] / slow.std[free]) ** 2))
        for i in range(len(self._segments)):
            w = self.innovations(model, i)[0][self._settle :] @ white.T
            total += 0.5 * float(np.sum(w**2)) + 0.5 * len(w) * model.filter.log_determinant()
        return total

    def _covariance(self) -> Array:
        """Return the covariance of the slow states at the solution.

        ``I^-1 (sum s s^T + Sigma^-1) I^-1`` with the scores s of blocks of a second (White, Econometrica 50, 1982): what the
        model does not describe correlates the innovations, and the information alone would state too little.
        """
        slow, free = self.plant.slow, self.plant.slow.free
        information, _ = self.normal_equations(self.model())
        inverse = np.linalg.inv(information)
        length = max(1, round(_BLOCK_S / (CHUNK * self.dt)))
        count = len(self._scores) // length
        scores = self._scores[: count * length].reshape(count, length, -1).sum(axis=1)
        scores -= scores.mean(axis=0)
        spread = scores.T @ scores * (len(self._scores) / length / max(count - 1, 1)) + np.diag(slow.std[free] ** -2.0)
        out = np.zeros((len(self.theta),) * 2)
        out[np.ix_(free, free)] = inverse @ spread @ inverse
        return out

    def normal_equations(self, model: Model) -> tuple[Array, Array]:
        """Return Fisher information and gradient of the negative log-likelihood, priors included, of the free slow states."""
        slow, free = self.plant.slow, self.plant.slow.free
        d = self._derivatives(model)
        gains, covariances = filter_derivatives(model.filter, d)
        white = model.filter.whitening()
        spread = np.matmul(np.matmul(white, covariances), white.T)
        flat = spread.reshape(len(free), -1)
        delays = self._common_delay()
        flat[delays] -= flat[delays].mean(axis=0)
        trace = np.trace(flat.reshape(spread.shape), axis1=1, axis2=2)
        information = np.diag(slow.std[free] ** -2.0)
        gradient = (self.theta - self._mean)[free] / slow.std[free] ** 2
        pair = 0.5 * flat @ flat.T
        squares, count, scores = 0.0, 0, []
        for i in range(len(self._segments)):
            nu, x = self.innovations(model, i)
            for first, part in sensitivities(model.filter, nu, x, d, gains, self._known_rate(model, i)):
                skip = max(self._settle - first, 0)
                if skip >= len(part):
                    continue
                J = np.matmul(white, part[skip:])
                J[:, :, delays] -= J[:, :, delays].mean(axis=2, keepdims=True)
                w = nu[first + skip : first + len(part)] @ white.T
                J = J.reshape(-1, J.shape[2])
                information += J.T @ J + len(w) * pair
                score = J.T @ w.ravel() + 0.5 * (len(w) * trace - flat @ (w.T @ w).ravel())
                scores.append(score)
                gradient += score
                squares, count = squares + float(np.sum(w**2)), count + w.size
        self.nis = squares / max(count, 1)
        self._scores = np.array(scores)
        return information, gradient

    def _derivatives(self, model: Model) -> Derivatives:
        """Return the derivatives of the system with respect to the free slow states."""
        plant, slow = self.plant, self.plant.slow
        f, constant = model.filter, model.constant
        system: list[list[Array]] = [[], [], []]
        rows: list[Array] = []
        offsets: list[Array] = []
        for i in slow.free[slow.free < slow.system]:
            theta = self.theta.copy()
            theta[i] += _STEP
            _, _, F, Q, H, R, c = self._system(theta)
            for kept, new, old in zip((*system, rows, offsets), (F, Q, R, H, c), (f.F, model.Q, model.R, f.H, constant)):
                kept.append((new - old) / _STEP)
        at, own = 0, np.full(len(constant), -1)
        for sensor in plant.sensors:
            width = _width(sensor.kind)
            for kind, part in slow.sensors[sensor.name].items():
                for i in range(part.start, part.stop):
                    if slow.std[i] <= 0.0:
                        continue
                    theta, late = self.theta.copy(), 0.0
                    if kind == "delay":
                        late = _STEP
                        own[at : at + width] = len(rows)
                    else:
                        theta[i] += _STEP
                    H, c = reading(plant, model.dynamics, sensor, theta, model.constants.cg, late)
                    rows.append(np.zeros_like(f.H))
                    offsets.append(np.zeros_like(constant))
                    rows[-1][at : at + width] = (H - f.H[at : at + width]) / _STEP
                    offsets[-1][at : at + width] = (c - constant[at : at + width]) / _STEP
            at += width
        F, Q, R = (np.array(kept) for kept in system)
        return Derivatives(F, Q, np.array(rows), np.array(offsets), R, own)

    def _common_delay(self) -> NDArray[np.int64]:
        """Return the places of all delays among the free states, or none where a delay is held and defines the time.

        A delay that all sensors have in common is a shift of the time: no run shows it, and what discretisation makes of it is no
        information.
        """
        slow = self.plant.slow
        delays = np.array([part["delay"].start for part in slow.sensors.values()])
        return np.searchsorted(slow.free, delays) if np.all(slow.std[delays] > 0.0) else np.zeros(0, dtype=np.int64)

    def _known_rate(self, model: Model, segment: int) -> Array | None:
        """Return how the second order, which no state holds, changes the readings of late sensors, shape (T, C)."""
        if self._second is None:
            return None
        second = self._second[segment]
        moving = np.gradient(second.readings + second.accel @ model.direct.T, self.dt, axis=0)
        return -(moving + second.accel @ model.filter.H[:, self.plant.states.relative_rate].T)

    def _renew(self) -> None:
        """Compute the second order from the smoothed states."""
        model = self.model()
        found = []
        for i in range(len(self._segments)):
            x = smooth(model.filter, *self.innovations(model, i))
            found.append(second_order(self.plant, model.constants, model.dynamics, self.theta, x, self.dt))
        self._second = found


def _between(known: Array) -> Array:
    """Return the mean of every value and the next: what acts until the next sample, shape (T, ...)."""
    return 0.5 * (known + np.vstack([known[1:], known[-1:]]))


def _liveliest(segments: Sequence[Array], length: int) -> Array:
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


def _width(kind: str) -> int:
    return 1 if kind == "displacement" else 3
