# Copyright 2026 ride_estimation contributors
"""A segment of a run at given slow states: what no input explains, the inputs and states, and what follows from them.

At every frequency the readings are ``y = T w + G b + noise``, w the unknown acceleration of base and its patterns, b the unknown
difference of the states before and after the segment. T is of full column rank: ``T^+ y`` are the inputs with an error of known
covariance, ``(1 - T T^+) y`` is the residual.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.model.dynamics import Dynamics, dynamics
from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.estimation.model.readings import as_read, combinations_of, constant
from ride_estimation.estimation.model.second_order import second_order, slopes_of_laws
from ride_estimation.estimation.model.spectral import Lines, Response, response
from ride_estimation.estimation.model.states import FastStates

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: below this frequency [Hz] a base deforms too slowly for its acceleration to show it: integrated noise was 100 times the
#: deflection of a drive, and its products with forces made the second order diverge
DEFORMS_HZ = 0.3
#: slowest motion that differs much between the ends of a segment [Hz]: size of the prior of that difference
ENDS_HZ = 0.5
#: rms of the inputs [m/s^2, rad/s^2] and of the deformation of the base [m] before they are estimated: rough roads stay below
_FIRST_SIZE, _FIRST_DEFORMATION = 10.0, 0.02
#: angular rates slower than this are left out of the second order [Hz]; accelerations slower than this tell how a rate differs
#: between the ends of a segment [Hz]: by slow rates instead, in which errors of sensors are integrated, two foreign cabs ran away
_RATE_HZ, _IMPULSE_HZ = 0.2, 0.3
#: octaves in which the residual is judged: begin of the first [Hz], which contains what is slower, and how many
_FIRST_OCTAVE_HZ, _OCTAVES = 0.5, 12
#: of them those below 4 Hz, in which mounts move most
SLOW_OCTAVES = 3
#: highest frequency at which a force beside the law of a mount is looked for [Hz]: cabs move below
_LAWS_HZ = 25.0
#: share of the variance of a reading below which what mounts move by themselves is left out
_NO_SHARE = 1e-3


@dataclasses.dataclass(frozen=True)
class Model:
    """The model at one value of the slow states.

    Attributes
    ----------
    plant, theta
        What it was built from, shape (P,).
    constants, dynamics
        Slow states in physical units, equations of motion.
    combinations, rows, constant
        Readings: combinations of :attr:`Dynamics.parts`, with them rows over states and inputs (C, V), part that does not move:
        gravity and bias, shape (C,).
    """

    plant: Plant
    theta: Array
    constants: Constants
    dynamics: Dynamics
    combinations: Array
    rows: Array
    constant: Array

    @classmethod
    def of(cls, plant: Plant, theta: Array, combinations: Array | None = None) -> Model:
        """Return the model of a plant at slow states; ``combinations`` are given where no sensor and no CG differs."""
        m = plant.constants(theta)
        d = dynamics(plant, m)
        read = combinations_of(plant, theta, m.cg) if combinations is None else combinations
        still = np.concatenate([constant(plant, m, s, theta) for s in plant.sensors])
        return cls(plant, theta, m, d, read, read @ d.parts, still)

    @property
    def still(self) -> Array:
        """Mean force of the mounts, shape (3 M,) [N]."""
        return np.asarray(self.constants.static.ravel() - self.constants.stiffness * self.constants.deflected)

    @functools.cached_property
    def direct(self) -> Array:
        """Effect of an acceleration of the body and of carried bodies on the readings, shape (C, 6 + Q)."""
        return np.pad(self.combinations[:, :6], ((0, 0), (0, self.plant.carried.count)))

    @functools.cached_property
    def lean(self) -> Array:
        """Effect on the readings of gravity, where a bracket does not tilt as its neighbours moved, shape (C, 3 M) [1/s^2]."""
        tilt = self.constants.tilt
        found = np.zeros((len(self.rows), len(tilt)))
        for i, s in enumerate(self.plant.base_sensors):
            turn = tilt[3 * i : 3 * i + 3]
            tilted = self.plant.gravity * np.stack([turn[1], -turn[0], 0.0 * turn[2]])
            found[self.plant.of_bases[3 * i : 3 * i + 3]] = as_read(self.plant, s, self.theta) @ tilted
        return found

    def response(self, lines: Lines) -> Response:
        """Return the response of the states at the lines of a segment; it is kept while the second order is renewed."""
        if lines.count not in self._responses:
            states = self.plant.states
            self._responses[lines.count] = response(self.dynamics.A, lines, states.accelerated, states.deformation.start)
        return self._responses[lines.count]

    @functools.cached_property
    def _responses(self) -> dict[int, Response]:
        return {}

    @functools.cached_property
    def twist(self) -> tuple[Array, Array]:
        """Part of the accelerations of body and carried bodies, (6 + Q, V), and of ``rows`` that is there because brackets follow
        the twist of the base.
        """
        straight = dynamics(self.plant, dataclasses.replace(self.constants, tilt=self.plant.untwisted))
        at = self.plant.states.accelerated
        return self.dynamics.A[at] - straight.A[at], self.rows - self.combinations @ straight.parts


@dataclasses.dataclass
class Segment:
    """Transform of the readings of a segment, what is known beside them and what is not described, per line.

    Attributes
    ----------
    lines
        Frequencies, F of them.
    noise
        Standard deviation of the noise of the readings, shape (C,), infinite where there are none.
    mean, moving
        Of the readings: mean (C,), transform (F, C).
    second_mean, second_readings, second_accel
        Second-order kinematics: its mean (C,) and transform (F, C) in the readings, its effect on the accelerations (F, 6 + Q).
    second_slopes
        Derivative of ``second_accel`` with ln k and ln c, shape (F, 6 + Q, 6 M).
    factor
        On the variance of the noise, shape (F,).
    wandering
        Variance of what every mount moves by itself, shape (F,) [m^2].
    twisting
        Share of the base's twist in what the mounts show of it, shape (F,).
    size
        Rms of the inputs, shape (W,).
    deformation
        Rms of the deformations of the base [m].
    expected
        Spectra of the accelerations of these deformations, shape (F, n), where a sensor of the base is silent: what the others do
        not show of them. None where all are heard and nothing is assumed.
    """

    lines: Lines
    noise: Array
    mean: Array
    moving: Complex
    second_mean: Array
    second_readings: Complex
    second_accel: Complex
    second_slopes: Complex
    factor: Array
    wandering: Array
    twisting: Array
    size: Array
    deformation: float
    expected: Array | None = None

    @classmethod
    def of(cls, readings: Array, dt: float, plant: Plant, silent: NDArray[np.bool_] | None = None) -> Segment:
        """Return a segment of readings (N, C), nothing known beside them; ``silent`` ones, shape (C,), are none."""
        lines, states = Lines.of(len(readings), dt), plant.states
        noise = plant.noise if silent is None else np.where(silent, np.inf, plant.noise)
        count, channels = len(lines.frequency), readings.shape[1]
        inputs, accelerated = (part.stop - part.start for part in (states.drive, states.accelerated))
        nothing, still = (np.zeros((count, size), dtype=np.complex128) for size in (channels, accelerated))
        slopes = np.zeros((count, accelerated, 6 * len(plant.mounts)), dtype=np.complex128)
        return cls(
            lines, noise, readings.mean(axis=0), lines.transform(readings), np.zeros(channels), nothing, still, slopes,
            np.ones(count), np.zeros(count), np.ones(count), np.full(inputs, _FIRST_SIZE), _FIRST_DEFORMATION,
        )  # fmt: skip

    @property
    def silent(self) -> int:
        """Return how many readings are none."""
        return int(np.sum(~np.isfinite(self.noise)))


@dataclasses.dataclass(frozen=True)
class Projected:
    """A segment at one model, whitened.

    Attributes
    ----------
    response, late
        Response of the states; phases of the delays, shape (F, C).
    white
        What whitens the readings.
    free, left
        What whitens what no input explains, shape (F, C - W, C), and the residual there, (F, C - W).
    jump, ends, ends_information
        Effect of the ends on that residual, shape (F, C - W, X), their estimate (X,) and its information (X, X).
    basis, root, unroot
        Factors of T, shape (F, C, W) and (F, W, W), and the inverse of the latter.
    second
        What the second order adds to the readings, shape (F, C).
    seen
        Readings less that, whitened, shape (F, C).
    jump_readings
        Effect of the ends on the readings, shape (F, C, X).
    cost
        Negative logarithm of the likelihood, up to a constant.
    """

    response: Response
    late: Complex
    white: Whitening
    free: Complex
    left: Complex
    jump: Complex
    ends: Array
    ends_information: Array
    basis: Complex
    root: Complex
    unroot: Complex
    second: Complex
    seen: Complex
    jump_readings: Complex
    cost: float

    def squares(self, segment: Segment) -> tuple[Array, Array]:
        """Return per octave from :data:`_FIRST_OCTAVE_HZ` the sum of the normalised squares of the residual, and their number.

        The mean over all lines hides what a wrong law leaves: most lines are above the motion.
        """
        lines = segment.lines.frequency
        octave = np.maximum(np.floor(np.log2(lines / _FIRST_OCTAVE_HZ)), 0.0).astype(np.int64)
        squares = np.sum(np.abs(self.left) ** 2, axis=1) * segment.factor
        each = float(self.left.shape[1] - segment.silent)
        found = np.bincount(octave, squares, _OCTAVES), np.bincount(octave, minlength=_OCTAVES) * each
        return np.asarray(found[0]), np.asarray(found[1])

    def inverse(self) -> Complex:
        """Return ``T^+``: from whitened readings to the inputs, shape (F, W, C)."""
        return np.asarray(np.matmul(self.unroot, self.basis.conj().transpose(0, 2, 1)))

    @property
    def input_noise(self) -> Array:
        """Return the variance of the noise in the inputs, shape (F, W)."""
        return np.asarray(np.sum(np.abs(self.unroot) ** 2, axis=2))

    def inputs(self) -> Complex:
        """Return ``T^+ (y - G b)``, shape (F, W)."""
        return _inverted(self.basis, self.unroot, self.seen - self.jump_readings @ self.ends)


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

    @property
    def log_volume(self) -> Array:
        """Return the logarithm of the determinant of :attr:`matrix`, shape (L,)."""
        return np.asarray(np.sum(np.log(np.diagonal(self.matrix, axis1=1, axis2=2)), axis=1))

    def whiten(self, values: Complex) -> Complex:
        """Return whitened columns, shape (F, C, K)."""
        found = values * (1.0 / self.std)[:, :, None]
        found[self.lines] = np.matmul(self.matrix, found[self.lines])
        return np.asarray(found)

    def transform(self, rows: Complex) -> Complex:
        """Return rows over whitened readings as rows over readings, shape (F, K, C)."""
        found = rows.copy()
        found[self.lines] = np.matmul(found[self.lines], self.matrix)
        found *= (1.0 / self.std)[:, None, :]
        return np.asarray(found)


def project(model: Model, segment: Segment) -> Projected:
    """Return what the inputs leave over of a segment."""
    plant, lines = model.plant, segment.lines
    found = _response(model, segment)
    rows = model.rows[:, plant.states.motion]
    late = np.exp(-lines.laplace[:, None] * model.theta[plant.delay_of])
    second = late * _second_readings(model, segment, found)
    white = Whitening.of(np.sqrt(segment.factor)[:, None] * segment.noise, segment.wandering, model.lean)
    seen = white.whiten((segment.moving - second)[:, :, None])[:, :, 0]
    inputs = np.matmul(rows, found.drive) + model.rows[:, plant.states.drive]
    inputs -= (1.0 - segment.twisting)[:, None, None] * _applied(model.twist[1], found.drive)
    inputs = white.whiten(late[:, :, None] * inputs)
    jump = white.whiten(late[:, :, None] * np.matmul(rows, found.jump))
    heard = inputs.shape[1]
    q, r = np.linalg.qr(_with_expected(segment, plant.states.deforming, inputs), mode="complete")
    count = inputs.shape[2]
    basis, free, root = q[:, :heard, :count], q[:, :heard, count:].conj().transpose(0, 2, 1), r[:, :count]
    left, over = np.matmul(free, seen[:, :, None])[:, :, 0], np.matmul(free, jump)
    unroot = np.linalg.inv(root)
    prior = ends_std(plant, _inverted(basis, unroot, seen), lines)
    stacked = over.reshape(-1, over.shape[2])
    information = (stacked.conj().T @ stacked).real + np.diag(0.5 * prior**-2.0)
    ends = np.linalg.solve(information, (stacked.conj().T @ left.ravel()).real)
    left = left - over @ ends
    cost = float(np.sum(np.abs(left) ** 2)) + 0.5 * float(np.sum((ends / prior) ** 2))
    free = white.transform(free)
    return Projected(found, late, white, free, left, over, ends, information, basis, root, unroot, second, seen, jump, cost)


def _with_expected(segment: Segment, deforming: slice, inputs: Complex) -> Complex:
    """Return whitened rows of the inputs, shape (F, C, W), and below them those of deformations that read zero, as expected."""
    if segment.expected is None:
        return inputs
    rows = np.zeros((len(inputs), segment.expected.shape[1], inputs.shape[2]), dtype=np.complex128)
    rows[:, :, deforming] = (segment.expected**-0.5)[:, :, None] * np.eye(segment.expected.shape[1])
    return np.concatenate([inputs, rows], axis=1)


def _second_readings(model: Model, segment: Segment, found: Response) -> Complex:
    """Return what the second order adds to the readings, without their delays, shape (F, C)."""
    pushed = np.matmul(found.accel, segment.second_accel[:, :, None])[:, :, 0]
    rows = model.rows[:, model.plant.states.motion]
    return np.asarray(segment.second_readings + segment.second_accel @ model.direct.T + pushed @ rows.T)


def _response(model: Model, segment: Segment) -> Response:
    """Return the response of the states, brackets following the share of deformations that is twist of the base."""
    found = model.response(segment.lines)
    less = (1.0 - segment.twisting)[:, None, None] * _applied(model.twist[0], found.drive)
    return dataclasses.replace(found, drive=found.drive - np.matmul(found.accel, less))


def _applied(matrix: Array, drive: Complex) -> Complex:
    """Return what rows (K, V) over states and inputs make of the inputs, given the response (F, X, W) of the states."""
    states = drive.shape[1]
    return np.asarray(np.matmul(matrix[:, :states], drive) + matrix[:, states:])


def force_scores(model: Model, segment: Segment, p: Projected) -> tuple[Array, float]:
    """Return how much less a force beside its law, at each axis of a mount, would leave of the normalised squares, (3 M,).

    Beyond its share where the direction of the residual is random: of what is left at a frequency, one part in as many as there
    are. So the stated noise does not matter. And the variance of these sums where it is random.
    """
    m, states = model.constants, model.plant.states
    push = m.mass * m.mobility[:, :6] @ m.points.T
    effect = np.matmul(model.rows[:, states.motion], p.response.accel) + model.direct
    columns = np.matmul(p.free, p.late[:, :, None] * (effect @ push))
    shown = np.abs(np.einsum("frj,fr->fj", columns.conj(), p.left)) ** 2 / np.sum(np.abs(columns) ** 2, axis=1)
    inside = segment.lines.frequency < _LAWS_HZ
    size = np.sum(np.abs(p.left) ** 2, axis=1)[:, None] / (p.left.shape[1] - segment.silent)
    return np.asarray(np.sum((shown / size - 1.0)[inside], axis=0)), float(inside.sum())


def _inverted(basis: Complex, unroot: Complex, seen: Complex) -> Complex:
    """Return the inputs (F, W) that whitened readings (F, C) show."""
    return np.asarray(np.matmul(unroot, np.matmul(seen.conj()[:, None], basis).conj().transpose(0, 2, 1))[:, :, 0])


def ends_std(plant: Plant, raw: Complex, lines: Lines) -> Array:
    """Return the standard deviation of the difference of the states between both ends, shape (X,), as transforms count it.

    ``raw``: inputs as the readings show them, shape (F, W).
    """
    rms = np.sqrt(2.0 * np.sum(np.abs(raw[lines.frequency > ENDS_HZ]) ** 2, axis=0) / lines.count)
    slow = 2.0 * np.pi * ENDS_HZ
    rigid, patterns = np.append(rms[:6], np.full(plant.carried.count, rms[:6].max())), rms[plant.states.deforming]
    size = np.concatenate([rigid / slow**2, rigid / slow, patterns / slow**2, patterns / slow])
    return np.asarray(np.sqrt(2.0 / lines.count) * size)


def states_of(model: Model, segment: Segment, p: Projected) -> tuple[Complex, Array]:
    """Return states and inputs of a segment without the second order, shape (F, V), and the spectra of the inputs (F, W).

    Inputs are shrunk by their signal-to-noise ratio (Wiener).
    """
    lines, states = segment.lines, model.plant.states
    raw = p.inputs()
    power, shrinks = shrinkage(segment, states.deforming, input_power(lines, raw, p.input_noise))
    information = np.matmul(p.root.conj().transpose(0, 2, 1), p.root)
    total = information + np.eye(raw.shape[1]) * shrinks[:, :, None]
    drive = np.linalg.solve(total, np.matmul(information, raw[:, :, None]))[:, :, 0]
    deforms = (1.0 / (1.0 + (DEFORMS_HZ / lines.frequency) ** 8))[:, None]
    drive[:, 6:] *= deforms
    return motion_of(states, p, drive, deforms), power


def shrinkage(segment: Segment, deforming: slice, power: Array) -> tuple[Array, Array]:
    """Return the spectra of the inputs and one over them where they still have to shrink estimates, shape (F, W) each.

    Deformations of an expected size are shrunk already.
    """
    if segment.expected is None:
        return power, 1.0 / power
    known, shrinks = power.copy(), 1.0 / power
    known[:, deforming], shrinks[:, deforming] = segment.expected, 0.0
    return known, shrinks


def input_power(lines: Lines, raw: Complex, noise: Array) -> Array:
    """Return the spectra of the inputs, shape (F, W), from inputs with an error of the variance ``noise`` (F, W).

    Tapered: the ends of a segment would fill the lines in which a base is quiet. Not below what noise is mistaken for.
    """
    noise = lines.smooth(noise)
    power = lines.smooth(np.abs(lines.taper(raw)) ** 2) - (1.0 + 2.0 * lines.smoothing_error()) * noise
    return np.asarray(np.maximum(power, 1e-6 * noise))


def motion_of(states: FastStates, p: Projected, drive: Complex, deforms: Array) -> Complex:
    """Return states and inputs (F, V) of inputs (F, W); ``deforms`` (F, 1) is kept of the deformation the ends cause."""
    bends = np.arange(len(p.ends)) >= states.deformation.start
    motion = np.matmul(p.response.drive, drive[:, :, None])[:, :, 0]
    motion += p.response.jump @ np.where(bends, 0.0, p.ends) + deforms * (p.response.jump @ np.where(bends, p.ends, 0.0))
    return np.hstack([motion, drive])


def renew(model: Model, segment: Segment, p: Projected) -> None:
    """Compute the second order of a segment from its states, and the factor on the noise from what is left over."""
    plant, lines = model.plant, segment.lines
    states = plant.states
    v, power = states_of(model, segment, p)
    v[:, states.motion] += np.matmul(p.response.accel, segment.second_accel[:, :, None])[:, :, 0]
    both = lines.back(np.hstack([v, rates(lines, v[:, states.base_accel][:, 3:])]))
    found = second_order(plant, model.constants, model.dynamics, model.theta, both[:, :-3], both[:, -3:])
    excess = np.sum(np.abs(p.left) ** 2, axis=1) / (p.left.shape[1] - segment.silent) * segment.factor
    segment.second_mean = found.readings.mean(axis=0)
    segment.second_readings, segment.second_accel = lines.transform(found.readings), lines.transform(found.accel)
    slopes = slopes_of_laws(plant, model.constants, model.dynamics, both[:, :-3])
    segment.second_slopes = lines.transform(slopes.reshape(lines.count, -1)).reshape(len(lines.frequency), *slopes.shape[1:])
    segment.factor = np.maximum(lines.smooth(excess), 1.0)
    if segment.expected is not None:
        # another part of the run tells the size of deformations here only roughly (expectation maximisation)
        estimated, shown = lines.smooth(np.abs(lines.taper(p.inputs())) ** 2 + p.input_noise), lines.frequency > DEFORMS_HZ
        segment.expected = np.where(shown[:, None], estimated[:, states.deforming], segment.expected)
    # the twist of a frame is one pattern and known to tilt brackets: the median pattern is what mounts do by themselves
    deforming = power[:, states.deforming]
    own = np.median(deforming, axis=1) / (1.0 + (DEFORMS_HZ / lines.frequency) ** 8)
    segment.wandering = own / np.abs(lines.laplace) ** 4
    segment.twisting = _twisting(plant, lines, deforming)
    segment.size = np.sqrt(2.0 * power.sum(axis=0) / lines.count)
    segment.deformation = float(np.sqrt(np.mean(both[:, states.deformation] ** 2)))


def rates(lines: Lines, accel: Complex) -> Complex:
    """Return the angular rate (F, 3) of an angular acceleration (F, 3), without what is slower than :data:`_RATE_HZ`.

    What the rate is before a segment less what it is after it is an impulse that the acceleration does not contain. A vehicle
    turns with little slow acceleration: it is the impulse that leaves least of that. Without it the rates of a segment of 15 s
    contained a ramp as large as they are.
    """
    frequency = lines.frequency[:, None]
    jump = 1.0 / (1.0 - np.exp(-lines.laplace * lines.dt))[:, None]
    impulse, slow = lines.laplace[:, None] * jump, 1.0 / (1.0 + (frequency / _IMPULSE_HZ) ** 8)
    ends = np.sum(slow * (impulse.conj() * accel).real, axis=0) / np.sum(slow * np.abs(impulse) ** 2)
    return np.asarray((accel / lines.laplace[:, None] - ends * jump) / (1.0 + (_RATE_HZ / frequency) ** 2))


def _twisting(plant: Plant, lines: Lines, power: Array) -> Array:
    """Return the share of the twist of the base in the power (F, n) that the mounts show of it.

    Brackets follow the twist, not what a mount moves by itself: of the twist W + n that is seen, ``S_W / (S_W + S_n)`` is the
    best estimate of W. Where the base deforms too slowly to show it is taken to be what it is in the octave above: there it
    changed by leaps, and the steps of a fit went round in a circle (foreign run cab_00).
    """
    if not np.any(plant.twist):
        return np.ones(len(power))
    seen = power @ (plant.twist / np.linalg.norm(plant.twist)) ** 2
    share = np.clip(1.0 - np.median(power, axis=1) / seen, 0.0, 1.0)
    slow = lines.frequency < DEFORMS_HZ
    share[slow] = share[~slow & (lines.frequency < 2.0 * DEFORMS_HZ)].mean()
    return np.asarray(share)
