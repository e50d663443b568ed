# Copyright 2026 ride_estimation contributors
"""An oscillator from excitation and response whose mount is more than a nonlinear spring: hysteresis, relaxation, stops, play.

Per unit mass, ``y'' = b u - c y' - k y - f``; the laws f of the library that have a continuous form ::

    hysteresis   f = z,  z' = A y' (1 - (g sign(z y') + h) |z / Z|^n)         (Bouc 1967, Wen 1976; Dahl 1968: g = n = 1, h = 0)
    relaxation   f = z,  z' = A y' - z / tau                                  (Maxwell)
    dry friction F tanh(y' / w), nonlinear spring k3 y^3 + k5 y^5, square damping, stop on both sides, play

are integrated (Runge-Kutta, fourth order, the excitation interpolated band-limited between samples) and fitted by SIMULATION
error, only u is fed, from several starts: first on a short stretch, the best then on all of what is fitted. The state at the
start of a record (response, rate, z) is estimated with it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.oscillator import OscillatorRecord
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: parameters of the integration, order of the kernel; all per unit mass
PARAMETERS = ("b", "c", "k", "k3", "c2", "A", "Z", "g", "h", "n", "tau", "stop", "gap", "play", "k5", "F", "w")
_B, _C, _K, _K3, _C2, _A, _Z, _G, _H, _N, _TAU, _STOP, _GAP, _PLAY, _K5, _F, _W = range(len(PARAMETERS))
_OFF = {_Z: 1.0, _G: 1.0, _N: 1.0, _TAU: np.inf, _W: 1.0}  # values of parameters of laws that are not there

#: integration steps per sample while searching and in the end: 20 samples per period need as many for a ten-millionth
_COARSE, _FINE = 1, 8
_SEARCHED = 6000  # samples of the stretch on which starts are compared
_MOST = 20_000  # samples of the stretch that is fitted in the end
_NEAR = 4.0  # squared error over that of the best start up to which a law is fitted to the end
_PRICE = 0.05  # of a parameter, in logarithms of the squared error
_EVALUATIONS = 30  # of the fit from one start
_POLISHED = 60  # of the final fit


@dataclasses.dataclass(frozen=True)
class Law:
    """A law of the library as an oscillator can have it.

    Attributes
    ----------
    cause
        Id of the cause.
    free
        Parameters beyond b, c, k.
    starts
        Per start the values of ``free`` in units of the linear fit: rates over k, deflections over the rms of the response,
        forces over k times that, times over the period.
    """

    name: str
    cause: str
    free: tuple[int, ...]
    starts: tuple[tuple[float, ...], ...]


LAWS = (
    Law("Bouc-Wen hysteresis", "coulomb_friction", (_A, _G, _H, _N), ((0.5, 0.5, 0.0, 1.0), (0.5, 0.5, -0.5, 1.0))),
    Law("Dahl friction", "coulomb_friction", (_A, _Z), ((0.5, 0.5), (3.0, 0.1))),
    Law("Maxwell relaxation", "viscoelasticity", (_A, _TAU), ((0.5, 0.1), (0.5, 1.0))),
    Law("dry friction", "coulomb_friction", (_F, _W), ((0.1, 0.1),)),
    Law("nonlinear spring", "stiffness_nonlinearity", (_K3, _K5), ((0.02, 0.0), (-0.02, 0.0))),
    Law("square damping", "damping_nonlinearity", (_C2,), ((0.5,),)),
    Law("stop", "bump_stop", (_STOP, _GAP), ((1.0, 1.5),)),
    Law("play", "backlash", (_PLAY,), ((0.2,),)),
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class LawFit:
    """A fitted law.

    Attributes
    ----------
    values, std
        Order of :data:`PARAMETERS`, shape (17,); zero std where not fitted.
    mse
        Mean squared error where the law was not fitted, over the variance of the response.
    count
        Number of fitted parameters.
    """

    law: Law
    values: Array
    std: Array
    mse: float
    count: int


@compile_kernel
def _slope(u: float, y: float, v: float, z: float, q: Array) -> tuple[float, float]:
    """Return y'' and z' per unit mass."""
    f = (q[3] + q[14] * y * y) * y * y * y + q[4] * abs(v) * v + q[15] * math.tanh(v / q[16]) + z
    if q[11] > 0.0:
        if y > q[12]:
            f += q[11] * (y - q[12])
        elif y < -q[12]:
            f += q[11] * (y + q[12])
    if q[13] > 0.0:
        f -= q[2] * min(max(y, -q[13]), q[13])
    zd = 0.0
    if q[5] > 0.0:
        if q[10] == np.inf:
            s = 1.0 if z * v > 0.0 else -1.0
            size = abs(z) / q[6]
            power = size if q[9] == 1.0 else size ** q[9]
            zd = q[5] * v * (1.0 - (q[7] * s + q[8]) * power)
        else:
            zd = q[5] * v - z / q[10]
    return q[0] * u - q[1] * v - q[2] * y - f, zd


@compile_kernel
def _integrate(u: Array, step: float, steps: int, q: Array, start: Array, out: Array) -> None:
    """Integrate; ``u`` at half steps, shape (2 steps N,), ``out`` at samples, shape (N,)."""
    y, v, z = start[0], start[1], start[2]
    last = len(u) - 1
    for i in range(len(out)):
        out[i] = y
        for j in range(steps):
            at = 2 * (i * steps + j)
            u0, u1, u2 = u[at], u[min(at + 1, last)], u[min(at + 2, last)]
            a1, z1 = _slope(u0, y, v, z, q)
            a2, z2 = _slope(u1, y + 0.5 * step * v, v + 0.5 * step * a1, z + 0.5 * step * z1, q)
            v2 = v + 0.5 * step * a1
            v3 = v + 0.5 * step * a2
            a3, z3 = _slope(u1, y + 0.5 * step * v2, v3, z + 0.5 * step * z2, q)
            v4 = v + step * a3
            a4, z4 = _slope(u2, y + step * v3, v4, z + step * z3, q)
            y += step / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            z += step / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
            if not abs(y) < 1e12:
                out[i + 1 :] = 1e12
                return


def _refined(u: Array, factor: int) -> Array:
    """Return a signal band-limited between its samples, shape (factor N,); a line through both ends is taken out before."""
    n = len(u)
    line = u[0] + (u[-1] - u[0]) * np.arange(n) / max(n - 1, 1)
    periodic = abs(u[-1] - u[0]) < 4.0 * np.median(np.abs(np.diff(u))) + 1e-300
    if periodic:
        return np.asarray(scipy.signal.resample(u, factor * n))
    dense = u[0] + (u[-1] - u[0]) * np.arange(factor * n) / (factor * max(n - 1, 1))
    return np.asarray(scipy.signal.resample(u - line, factor * n) + dense)


class LawSimulator:
    """Simulates laws on a stretch of a record.

    Parameters
    ----------
    record
        Excitation and response.
    steps
        Integration steps per sample.
    first, count
        Stretch, all of the record where no count is given.
    """

    def __init__(self, record: OscillatorRecord, steps: int, first: int = 0, count: int | None = None) -> None:
        last = len(record.y) if count is None else first + count
        self._steps, self._h = steps, record.step_s
        self._u = np.ascontiguousarray(_refined(record.u, 2 * steps)[2 * steps * first : 2 * steps * last])
        self.y = record.y[first:last]
        self.rms = float(np.std(record.y))
        self.omega = float(np.std(np.diff(record.y))) / record.step_s / self.rms
        #: response and rate at the start as measured, z at rest
        self.start = np.array([self.y[0], (self.y[1] - self.y[0]) / record.step_s, 0.0])

    def simulate(self, values: Array, start: Array) -> Array:
        """Return the response, shape (count,)."""
        out = np.empty(len(self.y))
        _integrate(self._u, self._h / self._steps, self._steps, values, start, out)
        return out

    def scales(self, force: float) -> Array:
        """Return the sizes that response, rate and z have, shape (3,)."""
        return np.array([self.rms, self.rms * self.omega, force])


def _fit(
    simulator: LawSimulator, law: Law, values: Array, start: Array, used: BoolArray, evaluations: int
) -> tuple[Array, Array, Array, float]:
    """Return values, start, standard deviations and mean squared error of a fit from some values; factors are fitted."""
    free = (_B, _C, _K, *law.free)
    k, x = float(values[_K]), simulator.rms
    scale = simulator.scales(k * x)
    unit = np.array([{_H: 1.0, _K3: k / x**2, _K5: k / x**4}.get(place, 0.0) for place in free])
    target = simulator.y[used]

    def spread(p: Array) -> tuple[Array, Array]:
        q = values.copy()
        known, moves = values[list(free)], p[: len(free)]
        q[list(free)] = np.where(unit > 0.0, known + unit * moves, known * np.exp(moves))
        return q, start + p[len(free) :] * scale

    def error(p: Array) -> Array:
        q, begin = spread(p)
        return np.clip((simulator.simulate(q, begin)[used] - target) / simulator.rms, -1e3, 1e3)

    size = len(free) + 3
    bound = np.concatenate([np.full(len(free), 4.0), np.full(3, 3.0)])
    found = scipy.optimize.least_squares(
        error, np.zeros(size), bounds=(-bound, bound), x_scale="jac", max_nfev=evaluations, diff_step=1e-5
    )
    q, begin = spread(found.x)
    mse = float(np.mean(found.fun**2))
    normal = found.jac.T @ found.jac
    # an error that lasts is fewer samples than it has: neighbours of a residual at the resonance are alike
    covariance = np.linalg.pinv(normal) * mse
    std = np.zeros(len(values))
    std[list(free)] = np.sqrt(np.maximum(np.diag(covariance)[: len(free)], 0.0)) * np.where(unit > 0.0, unit, q[list(free)])
    return q, begin, std, mse


def _linear(record: OscillatorRecord, simulator: LawSimulator) -> Array:
    """Return b, c, k of the linear oscillator by its transfer function around the resonance, others off."""
    n = len(record.y)
    u, y = (np.fft.rfft((v - np.mean(v)) * np.hanning(n)) for v in (record.u, record.y))
    w = 2.0 * np.pi * np.fft.rfftfreq(n, record.step_s)
    near = np.abs(y) ** 2 > 1e-3 * float(np.max(np.abs(y) ** 2))
    # b u - c y' - k y = y'': least squares over the bins that carry the response
    rows = np.stack([u[near], -1j * w[near] * y[near], -y[near]], axis=1)
    right = -(w[near] ** 2) * y[near]
    stacked, target = np.vstack([rows.real, rows.imag]), np.concatenate([right.real, right.imag])
    scale = np.linalg.norm(stacked, axis=0)
    b, c, k = np.linalg.lstsq(stacked / scale, target, rcond=None)[0] / scale
    values = linear_values(0.0, 0.0, 0.0)
    k = max(float(k), 0.1 * simulator.omega**2)
    values[[_B, _C, _K]] = b, max(float(c), 0.002 * np.sqrt(k)), k
    return values


def linear_values(b: float, c: float, k: float) -> Array:
    """Return the parameters of an oscillator without any law, shape (17,)."""
    values = np.zeros(len(PARAMETERS))
    for place, value in _OFF.items():
        values[place] = value
    values[[_B, _C, _K]] = b, c, k
    return values


def _begun(law: Law, start: Sequence[float], linear: Array, simulator: LawSimulator) -> Array:
    """Return the values of a start: half of the stiffness is the law's where it has one of its own."""
    values, k, x = linear.copy(), float(linear[_K]), simulator.rms
    unit = {
        _A: k, _Z: k * x, _K3: k / x**2, _C2: float(linear[_C]) / (x * simulator.omega), _TAU: 2.0 * np.pi / simulator.omega,
        _STOP: k, _GAP: x, _PLAY: x, _K5: k / x**4, _F: k * x, _W: x * simulator.omega, _G: 1.0, _H: 1.0, _N: 1.0,
    }  # fmt: skip
    for place, value in zip(law.free, start):
        values[place] = value * unit[place]
    if _G in law.free:
        values[_Z] = k * x  # one reference for both parts of a loop
    if _A in law.free and values[_A] < k:
        values[_K] = k - 0.9 * values[_A]
    return values


def fit_laws(record: OscillatorRecord, fit: BoolArray, choose: BoolArray) -> list[LawFit]:
    """Return the laws that come nearest on a short stretch, fitted on all of what is fitted, best first.

    Parameters
    ----------
    record
        Excitation and response.
    fit, choose
        Samples that are fitted and that choose, shape (N,) each.
    """
    first, last = (int(np.flatnonzero(fit)[i]) for i in (0, -1))
    count = min(last + 1 - first, _MOST)
    short = LawSimulator(record, _COARSE, first, min(count, _SEARCHED))
    linear = _linear(record, short)
    tried = []
    for law in LAWS:
        trials = [
            _fit(short, law, _begun(law, start, linear, short), short.start, fit[first : first + len(short.y)], _EVALUATIONS)
            for start in law.starts
        ]
        tried.append((min(trials, key=lambda trial: trial[3]), law))
    tried.sort(key=lambda item: item[0][3])
    whole, out = LawSimulator(record, _FINE, first, count), []
    for (values, start, _, mse), law in tried[:2]:
        if mse > _NEAR * tried[0][0][3]:
            continue
        found, _, std, _ = _fit(whole, law, values, start, fit[first : first + count], _POLISHED)
        rough = LawFit(law, found, std, np.inf, len(law.free) + 3)
        error = simulate_law(rough, record)[choose] - record.y[choose]
        out.append(dataclasses.replace(rough, mse=float(np.mean(error**2) / np.var(record.y[choose]))))
    return sorted(out, key=lambda item: float(np.log(max(item.mse, 1e-300))) + _PRICE * item.count)


def simulate_law(fit: LawFit, record: OscillatorRecord) -> Array:
    """Return the response of a fitted law to another excitation, the state at its start estimated, shape (N,)."""
    simulator = LawSimulator(record, _FINE)
    scale = simulator.scales(float(fit.values[_K]) * simulator.rms)

    def error(x: Array) -> Array:
        return np.clip((simulator.simulate(fit.values, simulator.start + x * scale) - record.y) / simulator.rms, -1e3, 1e3)

    found = scipy.optimize.least_squares(error, np.zeros(3), x_scale="jac", max_nfev=_EVALUATIONS, diff_step=1e-5)
    return simulator.simulate(fit.values, simulator.start + found.x * scale)
