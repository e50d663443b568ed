# Copyright 2026 ride_estimation contributors
"""Joint estimation of all slow states of a run: errors in variables in the frequency domain, with priors.

At every frequency the readings are ``y = T(theta) w + G(theta) b + noise``: w the unknown acceleration of base and its patterns,
b the unknown difference of the states before and after a segment, noise white and of known size. There are more channels than
inputs: ``sum |(1 - T T^+)(y - G b)|^2`` is minimised together with the priors of theta (Gauss-Newton). No spectrum of the base is
assumed, so none can be wrong. Derivatives are taken at the estimate of w that is shrunk by its signal-to-noise ratio: a function
of ``T^+ y``, it is independent of what is left over, so the score has mean zero and the covariance that is stated (conditional
score, Stefanski and Carroll, Biometrika 74, 1987). Second-order terms are renewed from the states between the steps, and so is
the factor on the noise, per frequency, of what the model does not describe.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.dynamics import Dynamics, dynamics
from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.estimation.model.readings import reading, readings
from ride_estimation.estimation.model.second_order import second_order
from ride_estimation.estimation.model.spectral import Lines, Response, response
from ride_estimation.estimation.model.states import FastStates, reading_width
from ride_estimation.frames import point_motion_matrix

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: step of differences in slow states, in their own unit
_STEP = 1e-5
#: largest change of ln k and ln c in one step
_LARGEST_STEP = 0.5
#: length of the part that is estimated from first; longer segments are divided into equal ones [s]
_FIRST_S, _LONGEST_S = 15.0, 60.0
#: scoring steps at most; converged when the largest step is this share of its standard deviation, not before the second order
#: was renewed so often
_STEPS, _CONVERGED, _RENEWALS = 12, 0.1, 3
#: times a step is halved at most while it does not lower the cost by more than its rounding
_HALVINGS, _NOISE_OF_COST = 4, 0.5
#: below this frequency [Hz] a base deforms too slowly for its acceleration to show it: integrated noise was 100 times the
#: deflection of a drive, and its products with forces made the second order diverge
_DEFORMS_HZ = 0.3
#: slowest motion that differs much between the ends of a segment [Hz]: size of the prior of that difference
_ENDS_HZ = 0.5
#: rms of the inputs [m/s^2, rad/s^2] and of the deformation of the base [m] before they are estimated: rough roads stay below
_FIRST_SIZE, _FIRST_BENT = 10.0, 0.02
#: angular rates slower than this are left out of the second order [Hz]
_RATE_HZ = 0.2
#: share of the mean second-order reading that higher orders change (drawn cabs on roads of pitch up to 1.2 degrees rms: 0.08)
_HIGHER_ORDER = 0.1
#: share of the variance of a reading below which what mounts move by themselves is left out
_NO_SHARE = 1e-3
_UNFIT = "the errors of the sensors cannot be estimated: the vehicle file does not fit this drive"
#: lines of the Jacobian handled together: bounds the memory
_CHUNK = 256


@dataclasses.dataclass(frozen=True)
class Model:
    """The model at one value of the slow states.

    Attributes
    ----------
    constants, dynamics
        What it was built from.
    rows, constant
        Readings: rows over states and inputs (C, V), part that does not move: gravity and bias, shape (C,).
    direct
        Effect of an acceleration of the body and of carried bodies on the readings, shape (C, 6 + Q).
    lean
        Effect on the readings of gravity, where a bracket does not tilt as its neighbours moved, shape (C, 3 M) [1/s^2].
    """

    constants: Constants
    dynamics: Dynamics
    rows: Array
    constant: Array
    direct: Array
    lean: Array


@dataclasses.dataclass
class _Segment:
    """Transform of the readings of a segment, what is known beside them and what is not described, per line.

    ``factor`` on the variance of the noise; ``wandering`` is the variance of what every mount moves by itself [m^2], ``size``
    (W,) the rms of the inputs, ``bent`` that of the deformations [m].
    """

    lines: Lines
    mean: Array
    moving: Complex
    second_mean: Array
    second_readings: Complex
    second_accel: Complex
    factor: Array
    wandering: Array
    size: Array
    bent: float

    @classmethod
    def of(cls, readings: Array, dt: float, states: FastStates) -> _Segment:
        """Return a segment of readings (N, C)."""
        lines = Lines.of(len(readings), dt)
        count, channels = len(lines.frequency), readings.shape[1]
        inputs, accelerated = (part.stop - part.start for part in (states.drive, states.accelerated))
        nothing, still = (np.zeros((count, size), dtype=np.complex128) for size in (channels, accelerated))
        return cls(
            lines, readings.mean(axis=0), lines.transform(readings), np.zeros(channels), nothing, still, np.ones(count),
            np.zeros(count), np.full(inputs, _FIRST_SIZE), _FIRST_BENT,
        )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class _Projected:
    """A segment at one model, whitened: what no input explains, and what is needed for the inputs.

    ``late`` (F, C) are the phases of the delays, ``free`` (F, C - W, C) whitens what no input explains, ``left`` (F, C - W) is
    the residual there, ``jump`` (F, C - W, X) the effect of the ends, ``ends`` (X,) their estimate and ``ends_information`` its
    information, ``basis`` (F, C, W) and ``root`` (F, W, W) factors of T, ``seen`` (F, C) the readings less what is known,
    ``jump_readings`` (F, C, X) the effect of the ends on them.
    """

    response: Response
    late: Complex
    free: Complex
    left: Complex
    jump: Complex
    ends: Array
    ends_information: Array
    basis: Complex
    root: Complex
    seen: Complex
    jump_readings: Complex
    cost: float


@dataclasses.dataclass(frozen=True)
class Whitening:
    """What gives the noise of the readings unit variance.

    Attributes
    ----------
    std
        Of the white noise per line, shape (F, C).
    lines, matrix
        Lines at which more than white noise counts, and what is applied there after dividing by ``std``, shape (L, C, C).
    """

    std: Array
    lines: NDArray[np.int64]
    matrix: Array

    @classmethod
    def of(cls, std: Array, wandering: Array, lean: Array) -> Whitening:
        """Return the whitening of white noise and of ``lean`` (C, 3 M) times what every mount moves by itself."""
        share = wandering * np.max(np.sum(lean**2, axis=1) / std**2, axis=1)
        lines = np.flatnonzero(share > _NO_SHARE)
        rows = lean / std[lines, :, None]
        covariance = np.eye(std.shape[1]) + wandering[lines, None, None] * np.matmul(rows, rows.transpose(0, 2, 1))
        return cls(std, lines, np.linalg.inv(np.linalg.cholesky(covariance)))

    def whiten(self, values: Complex) -> Complex:
        """Return whitened columns, shape (F, C, K)."""
        found = values / self.std[:, :, None]
        found[self.lines] = np.matmul(self.matrix, found[self.lines])
        return np.asarray(found)

    def transform(self, rows: Complex) -> Complex:
        """Return rows over whitened readings as rows over readings, shape (F, K, C)."""
        found = rows.copy()
        found[self.lines] = np.matmul(found[self.lines], self.matrix)
        return np.asarray(found / self.std[:, None, :])


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
        Slow states (P,) and their covariance (P, P); rows of held states are zero, delays are relative to their mean.
    nis
        Mean normalised square of what no input explains: 1 where model and noise are right.
    """

    def __init__(self, plant: Plant, segments: Sequence[Array], dt: float) -> None:
        self.plant, self.dt = plant, dt
        self._raw = [part for s in segments for part in np.array_split(s, max(1, round(len(s) * dt / _LONGEST_S)))]
        self._segments = [_Segment.of(s, dt, plant.states) for s in self._raw]
        widths = [reading_width(s) for s in plant.sensors]
        self._white = np.repeat([s.noise_std for s in plant.sensors], widths)
        self._travel = np.repeat([s.kind == "displacement" for s in plant.sensors], widths)
        delays = [plant.slow.sensors[s.name]["delay"].start for s in plant.sensors]
        self._delay = np.repeat(delays, widths)
        self._delays = np.array(delays) if np.all(plant.slow.std[delays] > 0.0) else np.zeros(0, dtype=np.int64)
        self.theta = plant.slow.mean.copy()
        self.covariance = np.diag(plant.slow.std**2)
        self.nis = np.nan

    def model(self, theta: Array | None = None) -> Model:
        """Return the model at slow states, the present ones unless given."""
        theta = self.theta if theta is None else theta
        m = self.plant.constants(theta)
        d = dynamics(self.plant, m)
        rows, constant = readings(self.plant, d, theta)
        direct = np.zeros((len(rows), 6 + self.plant.carried.count))
        for i, s in enumerate(self.plant.geometry.body_sensors):
            direct[3 * i : 3 * i + 3, :6] = s.rotation.T @ point_motion_matrix(s.position - m.cg)
        lean = np.zeros((len(rows), len(m.tilt)))
        first = 3 * len(self.plant.geometry.body_sensors)
        for i, s in enumerate(self.plant.base_sensors):
            turn = m.tilt[3 * i : 3 * i + 3]
            tilted = self.plant.gravity * np.stack([turn[1], -turn[0], 0.0 * turn[2]])
            lean[first + 3 * i : first + 3 * i + 3] = s.rotation.T @ tilted
        return Model(m, d, rows, constant, direct, lean)

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
        whole = self._segments
        self._segments = [_Segment.of(_liveliest(self._raw, round(_FIRST_S / self.dt)), self.dt, self.plant.states)]
        self._iterate()
        self._segments = whole
        for _ in range(_RENEWALS):
            self.renew()
        self._iterate()
        information, _ = self.normal_equations(self.model())
        free = self.plant.slow.free
        out = np.zeros((len(self.theta),) * 2)
        out[np.ix_(free, free)] = self._inverse(information)
        self.covariance = self._relative(out)

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
        """Repeat Gauss-Newton steps until they are small against their standard deviation."""
        slow, free = self.plant.slow, self.plant.slow.free
        laws = free < slow.log_damping.stop
        model = self.model()
        projected = self._projected(model)
        for step in range(_STEPS):
            information, gradient = self.normal_equations(model, projected)
            if not (np.all(np.isfinite(information)) and np.all(np.isfinite(gradient))):
                raise InputDataError(_UNFIT)
            inverse = self._inverse(information)
            change = -inverse @ gradient
            scale = min(1.0, _LARGEST_STEP / max(float(np.abs(change[laws]).max()), 1e-12))
            before, start = self.cost(model, projected), self.theta.copy()
            for halved in range(_HALVINGS):
                self.theta = start.copy()
                self.theta[free] += 0.5**halved * scale * change
                moved_model = self.model()
                moved_projected = self._projected(moved_model)
                if self.cost(moved_model, moved_projected) < before + _NOISE_OF_COST:
                    model, projected = moved_model, moved_projected
                    break
            else:
                self.theta = start
            moved = np.abs(self.theta - start)[free] / np.sqrt(np.diag(inverse))
            self._renew(model, projected)
            if scale == 1.0 and moved.max() < _CONVERGED and step >= _RENEWALS:
                break
            projected = self._projected(model)

    def _projected(self, model: Model) -> list[_Projected]:
        return [self._project(model, segment) for segment in self._segments]

    def cost(self, model: Model, projected: Sequence[_Projected] = ()) -> float:
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
        for segment, p in zip(self._segments, projected or self._projected(model)):
            white, offset = self._offset(model, segment)
            total += p.cost + 0.5 * float(np.sum((white @ offset) ** 2))
        return total

    def _offset(self, model: Model, segment: _Segment) -> tuple[Array, Array]:
        """Return what whitens the mean readings of accelerometers and what they differ from the model.

        Means of a segment are not zero: those of accelerations are changes of velocity over its duration, the deformation
        wanders, and the body follows both. The mean of a travel depends on the load and tells nothing of the transducer.
        """
        at, lines = ~self._travel, segment.lines
        offset = (segment.mean - model.constant - segment.second_mean)[at]
        rows, std = self._slow_motion(model, segment)
        higher = _HIGHER_ORDER * np.std(segment.second_mean[at])
        covariance = np.diag(segment.factor[0] * self._white[at] ** 2 / lines.count + higher**2)
        covariance += (rows[at] * std**2) @ rows[at].T
        return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance))), offset

    def _slow_motion(self, model: Model, segment: _Segment) -> tuple[Array, Array]:
        """Return rows of the mean readings over independent causes, shape (C, K), and their standard deviations."""
        s, A = self.plant.states, model.dynamics.A
        relative = slice(0, s.carried_rate.stop)
        inverse = np.linalg.inv(A[relative, relative])
        answer = model.rows[:, relative] @ inverse
        follows = model.rows - answer @ A[relative]
        duration, slow = segment.lines.count * segment.lines.dt, 2.0 * np.pi * _ENDS_HZ
        change = np.sqrt(2.0) * segment.size / slow / duration
        rows = np.hstack([follows[:, s.drive], follows[:, s.deformation], answer])
        patterns = s.deformation.stop - s.deformation.start
        moves = np.append(change[:6], np.full(self.plant.carried.count, change[:6].max()))
        wanders = np.full(patterns, segment.bent / np.sqrt(duration * _ENDS_HZ))
        return rows, np.concatenate([change, wanders, moves / slow, moves])

    def _project(self, model: Model, segment: _Segment) -> _Projected:
        """Return what the inputs leave over of a segment."""
        states, lines = self.plant.states, segment.lines
        found = response(model.dynamics.A, lines, states.accelerated, states.deformation.start)
        rows = model.rows[:, states.motion]
        late = np.exp(-lines.laplace[:, None] * self.theta[self._delay])
        pushed = np.matmul(found.accel, segment.second_accel[:, :, None])[:, :, 0]
        known = segment.second_readings + segment.second_accel @ model.direct.T + pushed @ rows.T
        white = Whitening.of(np.sqrt(segment.factor)[:, None] * self._white, segment.wandering, model.lean)
        seen = white.whiten((segment.moving - late * known)[:, :, None])[:, :, 0]
        inputs = white.whiten(late[:, :, None] * (np.matmul(rows, found.drive) + model.rows[:, states.drive]))
        jump = white.whiten(late[:, :, None] * np.matmul(rows, found.jump))
        q, r = np.linalg.qr(inputs, mode="complete")
        count = inputs.shape[2]
        basis, free, root = q[:, :, :count], q[:, :, count:].conj().transpose(0, 2, 1), r[:, :count]
        left, over = np.matmul(free, seen[:, :, None])[:, :, 0], np.matmul(free, jump)
        prior = self._ends_std(basis, root, seen, lines)
        stacked = over.reshape(-1, over.shape[2])
        information = (stacked.conj().T @ stacked).real + np.diag(0.5 * prior**-2.0)
        ends = np.linalg.solve(information, (stacked.conj().T @ left.ravel()).real)
        left = left - over @ ends
        cost = float(np.sum(np.abs(left) ** 2)) + 0.5 * float(np.sum((ends / prior) ** 2))
        return _Projected(found, late, white.transform(free), left, over, ends, information, basis, root, seen, jump, cost)

    def _ends_std(self, basis: Complex, root: Complex, seen: Complex, lines: Lines) -> Array:
        """Return the standard deviation of the difference of the states between both ends, shape (X,), as transforms count it."""
        raw = np.linalg.solve(root, np.matmul(basis.conj().transpose(0, 2, 1), seen[:, :, None]))[:, :, 0]
        rms = np.sqrt(2.0 * np.sum(np.abs(raw[lines.frequency > _ENDS_HZ]) ** 2, axis=0) / lines.count)
        slow = 2.0 * np.pi * _ENDS_HZ
        rigid, patterns = np.append(rms[:6], np.full(self.plant.carried.count, rms[:6].max())), rms[6:]
        size = np.concatenate([rigid / slow**2, rigid / slow, patterns / slow**2, patterns / slow])
        return np.asarray(np.sqrt(2.0 / lines.count) * size)

    def _states(self, segment: _Segment, p: _Projected) -> tuple[Complex, Array]:
        """Return states and inputs of a segment without the second order, shape (F, V), and the spectra of the inputs (F, W).

        Inputs are shrunk by their signal-to-noise ratio (Wiener).
        """
        lines, states = segment.lines, self.plant.states
        adjoint = p.root.conj().transpose(0, 2, 1)
        moved = p.seen - p.jump_readings @ p.ends
        raw = np.linalg.solve(p.root, np.matmul(p.basis.conj().transpose(0, 2, 1), moved[:, :, None]))
        information = np.matmul(adjoint, p.root)
        noise = lines.smooth(np.sum(np.abs(np.linalg.inv(p.root)) ** 2, axis=2))
        power = lines.smooth(np.abs(raw[:, :, 0]) ** 2) - (1.0 + 2.0 * lines.smoothing_error()) * noise
        power = np.maximum(power, 1e-6 * noise)
        total = information + np.eye(raw.shape[1]) / power[:, :, None]
        drive = np.linalg.solve(total, np.matmul(information, raw))[:, :, 0]
        deforms = (1.0 / (1.0 + (_DEFORMS_HZ / lines.frequency) ** 8))[:, None]
        drive[:, 6:] *= deforms
        bends = np.arange(len(p.ends)) >= states.deformation.start
        motion = np.matmul(p.response.drive, drive[:, :, None])[:, :, 0]
        motion += p.response.jump @ np.where(bends, 0.0, p.ends) + deforms * (p.response.jump @ np.where(bends, p.ends, 0.0))
        return np.hstack([motion, drive]), power

    def normal_equations(self, model: Model, projected: Sequence[_Projected] = ()) -> tuple[Array, Array]:
        """Return information and gradient of the negative log-likelihood, priors included, of the free slow states.

        Parameters
        ----------
        model, projected
            As in :meth:`cost`.
        """
        slow, free = self.plant.slow, self.plant.slow.free
        turned, rows, constants = self._derivatives(model)
        information = np.diag(slow.std[free] ** -2.0)
        gradient = (self.theta - slow.mean)[free] / slow.std[free] ** 2
        squares, count = 0.0, 0
        for segment, p in zip(self._segments, projected or self._projected(model)):
            v, _ = self._states(segment, p)
            own, cross, score = self._jacobian(model, segment, p, v, turned, rows)
            information += 2.0 * (own - cross @ np.linalg.solve(p.ends_information, cross.T))
            gradient -= 2.0 * score
            white, offset = self._offset(model, segment)
            slope = white @ constants[:, ~self._travel].T
            information += slope.T @ slope
            gradient -= slope.T @ (white @ offset)
            squares += float(np.sum(np.abs(p.left) ** 2 * segment.factor[:, None]))
            count += p.left.size
        self.nis = squares / max(count, 1)
        return information, gradient

    def _jacobian(
        self, model: Model, segment: _Segment, p: _Projected, v: Complex, turned: Array, rows: Array
    ) -> tuple[Array, Array, Array]:
        """Return sums over the lines: Jacobian by itself (P, P), by the ends (P, X), by the residual (P,)."""
        free, states = self.plant.slow.free, self.plant.states
        parameters = len(free)
        own, cross, score = np.zeros((parameters,) * 2), np.zeros((parameters, len(p.ends))), np.zeros(parameters)
        effect = np.matmul(model.rows[:, states.motion], p.response.accel)
        late = [(c, int(np.searchsorted(free, place))) for c, place in enumerate(self._delay) if self.plant.slow.std[place] > 0.0]
        common = np.searchsorted(free, self._delays)
        flat, flat_rows = turned.reshape(-1, turned.shape[2]).T, rows.reshape(-1, rows.shape[2]).T
        channels = rows.shape[1]
        for first in range(0, len(v), _CHUNK):
            at = slice(first, first + _CHUNK)
            x = v[at]
            push = (x @ flat).reshape(len(x), parameters, -1).transpose(0, 2, 1)
            J = np.matmul(effect[at], push) + (x @ flat_rows).reshape(len(x), parameters, channels).transpose(0, 2, 1)
            moving = x @ model.rows.T
            for channel, place in late:
                J[:, channel, place] = -segment.lines.laplace[at] * moving[:, channel]
            if len(common):
                J[:, :, common] -= J[:, :, common].mean(axis=2, keepdims=True)
            J = np.matmul(p.free[at], p.late[at][:, :, None] * J).reshape(-1, parameters)
            real = np.vstack([J.real, J.imag])
            own += real.T @ real
            over, left = p.jump[at].reshape(-1, len(p.ends)), p.left[at].ravel()
            cross += real.T @ np.vstack([over.real, over.imag])
            score += real.T @ np.r_[left.real, left.imag]
        return own, cross, score

    def _derivatives(self, model: Model) -> tuple[Array, Array, Array]:
        """Return derivatives with the free slow states: of accelerations (P, 6 + Q, V), of rows (P, C, V) and constant (P, C) of
        the readings.
        """
        plant, slow, rate = self.plant, self.plant.slow, self.plant.states.accelerated
        free = slow.free
        turned = np.zeros((len(free), rate.stop - rate.start, plant.states.size))
        rows, constants = np.zeros((len(free), *model.rows.shape)), np.zeros((len(free), len(model.constant)))
        owners = {
            place: sensor for sensor in plant.sensors for part in slow.sensors[sensor.name].values()
            for place in range(part.start, part.stop)
        }  # fmt: skip
        first = dict(zip((s.name for s in plant.sensors), np.cumsum([0, *(reading_width(s) for s in plant.sensors)]).tolist()))
        for n, i in enumerate(free.tolist()):
            theta = self.theta.copy()
            theta[i] += _STEP
            if i in owners:  # an error of a sensor changes its own readings only
                sensor = owners[i]
                at = slice(first[sensor.name], first[sensor.name] + reading_width(sensor))
                own, constant = reading(plant, model.dynamics, sensor, theta, theta[slow.cg])
                rows[n, at], constants[n, at] = (own - model.rows[at]) / _STEP, (constant - model.constant[at]) / _STEP
            else:
                other = self.model(theta)
                turned[n] = (other.dynamics.A[rate] - model.dynamics.A[rate]) / _STEP
                rows[n], constants[n] = (other.rows - model.rows) / _STEP, (other.constant - model.constant) / _STEP
        return turned, rows, constants

    def renew(self) -> None:
        """Compute the second order from the states, and the factor on the noise from what is left over."""
        model = self.model()
        self._renew(model, self._projected(model))

    def _renew(self, model: Model, projected: Sequence[_Projected]) -> None:
        states = self.plant.states
        for segment, p in zip(self._segments, projected):
            lines = segment.lines
            v, power = self._states(segment, p)
            v[:, states.motion] += np.matmul(p.response.accel, segment.second_accel[:, :, None])[:, :, 0]
            fast = 1.0 / (1.0 + (_RATE_HZ / lines.frequency) ** 2)
            rate = v[:, states.base_accel][:, 3:] * (fast / lines.laplace)[:, None]
            both = lines.back(np.hstack([v, rate]))
            found = second_order(self.plant, model.constants, model.dynamics, self.theta, both[:, :-3], both[:, -3:])
            excess = np.mean(np.abs(p.left) ** 2, axis=1) * segment.factor
            segment.second_mean = found.readings.mean(axis=0)
            segment.second_readings, segment.second_accel = lines.transform(found.readings), lines.transform(found.accel)
            segment.factor = np.maximum(lines.smooth(excess), 1.0)
            # the twist of a frame is one pattern and known to tilt brackets: the median pattern is what mounts do by themselves
            own = np.median(power[:, 6:], axis=1) / (1.0 + (_DEFORMS_HZ / lines.frequency) ** 8)
            segment.wandering = own / np.abs(lines.laplace) ** 4
            segment.size = np.sqrt(2.0 * power.sum(axis=0) / lines.count)
            segment.bent = float(np.sqrt(np.mean(both[:, states.deformation] ** 2)))


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
