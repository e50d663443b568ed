# Copyright 2026 ride_estimation contributors
"""Which bench tests tell the parameters of a named model as well as wanted, in the least time: Fisher information.

A force with white noise of known size and a model with roughly known parameters say beforehand how well each parameter will come
out of a drive signal: ``std = sqrt(diag((sum J'J / sigma^2)^-1))``. Tests are added one after the other, each time the one that
brings most for its time, until every parameter is as accurate as wanted or nothing brings more.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.excitation.programmes import band_limited_random, dma_plan, harmonic_pulse, preconditioning
from ride_estimation.excitation.sigmoid_chirp import SigmoidChirp
from ride_estimation.identification.bench.choices import LONGEST_S
from ride_estimation.identification.bench.models import BenchModel
from ride_estimation.identification.bench.reversals import find_motion
from ride_estimation.identification.bench.time_domain import model_jacobian

Array = NDArray[np.float64]

#: rest between two tests of one drive file [s]
_REST_S = 1.0
#: share of the stroke of the static ramps
_STATIC_SHARES = (0.25, 0.5, 1.0)
#: time of one static ramp to full stroke and back [s]
_STATIC_RAMP_S = 60.0
#: relative standard deviation a parameter has before any test: hardly anything is known
_BEFORE = 1.0e3


@dataclasses.dataclass(frozen=True)
class DriveSignal:
    """One test: name, times [s], displacement [m] (extension positive), and the largest rate of its formula [m/s]."""

    name: str
    time_s: Array
    displacement: Array

    @property
    def duration_s(self) -> float:
        """Return the duration [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def peak_speed(self) -> float:
        """Return the largest rate [m/s]."""
        return float(np.max(np.abs(np.diff(self.displacement))) / (self.time_s[1] - self.time_s[0]))


@dataclasses.dataclass(frozen=True)
class Design:
    """A chosen programme and what it will tell.

    Attributes
    ----------
    signals
        In the order to run them.
    std
        Expected standard deviation of each parameter [its unit], in the order of the model; infinite where not identifiable.
    wanted
        Standard deviations asked for.
    not_identifiable
        Names of parameters that no test of the machine tells as well as wanted.
    left_out
        Tests the machine cannot run, and why.
    """

    signals: tuple[DriveSignal, ...]
    std: Array
    wanted: Array
    not_identifiable: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Return the time of all tests [s]."""
        return sum(signal.duration_s for signal in self.signals)


def candidate_signals(stroke: float, highest_hz: float, rate_hz: float, seed: int = 0) -> tuple[DriveSignal, ...]:
    """Return the tests that are considered: static ramps, DMA plan, sigmoid chirp, random sets and a pulse.

    Parameters
    ----------
    stroke
        Largest displacement from rest [m].
    highest_hz
        Highest frequency [Hz].
    rate_hz
        Sampling rate [Hz], above twice the highest frequency.
    seed
        Of the random set.
    """
    if not (stroke > 0.0 and highest_hz > 0.0 and rate_hz > 2.0 * highest_hz):
        raise InputDataError(
            f"stroke {stroke:g} m, highest frequency {highest_hz:g} Hz and rate {rate_hz:g} Hz; allowed: above zero, and a rate "
            "above twice the frequency"
        )
    document = SigmoidChirp()
    scale = stroke / document.amplitude_max
    chirp = dataclasses.replace(
        document, amplitude_max=stroke, amplitude_min=scale * document.amplitude_min, frequency_max=highest_hz,
        frequency_min=min(document.frequency_min, 0.1 * highest_hz),
    )  # fmt: skip
    lowest = highest_hz / 1000.0
    tests = dma_plan(stroke / 500.0, stroke, lowest, highest_hz)
    slow = preconditioning(tests, excess=0.0)
    parts = [t.displacement for t in (_harmonic(test.frequency_hz, test.amplitude_m, test.cycles, rate_hz) for test in tests)]
    random = band_limited_random(0.25 * stroke, 2.0 * lowest, 0.5 * highest_hz, 60.0, rate_hz, seed)
    wide = band_limited_random(0.05 * stroke, 0.025 * highest_hz, 0.8 * highest_hz, 60.0, rate_hz, seed + 1)
    pulse = harmonic_pulse(stroke, 0.05 * highest_hz, rate_hz=rate_hz)
    return (
        _harmonic(slow.frequency_hz, slow.amplitude_m, slow.cycles, rate_hz, "preconditioning"),
        _joined("static", [_ramp(share * stroke, stroke, rate_hz) for share in _STATIC_SHARES], rate_hz),
        DriveSignal("sigmoid_chirp", *chirp.signal(rate_hz)),
        _joined("dma", parts, rate_hz),
        DriveSignal("random", *_within(random, stroke)),
        DriveSignal("random_wide", *_within(wide, stroke)),
        DriveSignal("pulse", *pulse),
    )


def _within(signal: tuple[Array, Array], stroke: float) -> tuple[Array, Array]:
    time_s, x = signal
    return time_s, x * min(1.0, stroke / float(np.max(np.abs(x))))


def _harmonic(frequency: float, amplitude: float, cycles: int, rate_hz: float, name: str = "") -> DriveSignal:
    time_s = np.arange(round(cycles / frequency * rate_hz) + 1) / rate_hz
    return DriveSignal(name, time_s, amplitude * np.sin(2.0 * np.pi * frequency * time_s))


def _ramp(peak: float, stroke: float, rate_hz: float) -> Array:
    quarter = max(round(0.25 * _STATIC_RAMP_S * peak / stroke * rate_hz), 2)
    corners = np.array([0.0, peak, -peak, 0.0])
    return np.asarray(np.interp(np.arange(4 * quarter + 1), np.array([0, quarter, 3 * quarter, 4 * quarter]), corners))


def _joined(name: str, parts: Sequence[Array], rate_hz: float) -> DriveSignal:
    rest = np.zeros(round(_REST_S * rate_hz))
    x = np.concatenate([piece for part in parts for piece in (part, rest)])
    return DriveSignal(name, np.arange(x.size) / rate_hz, x)


def information(model: BenchModel, values: Array, signal: DriveSignal, force_noise: float) -> Array:
    """Return the Fisher information of one test about the reported parameters, shape (P, P).

    Parameters
    ----------
    model, values
        Rung of the ladder and its parameters in SI, order of its quantities.
    signal
        The test.
    force_noise
        Standard deviation of the force [N], white at the rate of the test.
    """
    theta, coefficients = model.searched(values)
    motion = find_motion(signal.displacement, float(signal.time_s[1] - signal.time_s[0]))
    jacobian = model_jacobian(model, theta, coefficients, motion)
    jacobian -= jacobian.mean(axis=1, keepdims=True)  # the zero of the load cell is not known
    to_searched = np.linalg.inv(model.physical_jacobian(theta, coefficients))
    return np.asarray(to_searched.T @ (jacobian @ jacobian.T) @ to_searched / force_noise**2)


def design_tests(
    model: BenchModel,
    values: Array,
    wanted: Array,
    signals: Sequence[DriveSignal],
    *,
    force_noise: float,
    peak_speed: float = np.inf,
    longest_s: float = LONGEST_S,
) -> Design:
    """Choose the tests that tell every parameter as well as wanted in the least time.

    Parameters
    ----------
    model
        Rung of the ladder.
    values
        What its parameters are expected to be, SI, order of its quantities, none zero.
    wanted
        Standard deviations that are wanted, shape (P,).
    signals
        Candidates of :func:`candidate_signals`; the first, preconditioning, is run in any case.
    force_noise
        Standard deviation of the force of the load cell [N].
    peak_speed
        Largest rate of the machine [m/s].
    longest_s
        Longest time of all tests [s].
    """
    if not force_noise > 0.0 or np.any(values == 0.0) or not np.all(wanted > 0.0):
        raise InputDataError("noise, wanted standard deviations and expected values must not be zero")
    able = [s for s in signals if s.peak_speed <= peak_speed]
    left_out = tuple(
        f"{s.name}: {s.peak_speed:.3g} m/s, the machine reaches {peak_speed:.3g} m/s" for s in signals if s not in able
    )
    tests = [s for s in able if s.name != signals[0].name]
    if not tests:
        raise InputDataError(f"no test stays below {peak_speed:g} m/s; take a smaller stroke or frequency")
    each = [information(model, values, s, force_noise) for s in tests]
    total = np.diag(1.0 / (_BEFORE * values) ** 2)
    chosen: list[int] = []

    def excess(matrix: Array) -> float:
        return float(np.sum(np.log(np.maximum(_std(matrix, values) / wanted, 1.0))))

    times = np.array([s.duration_s for s in tests])
    left = longest_s - sum(s.duration_s for s in able if s.name == signals[0].name)
    while excess(total) > 0.0:
        gains = np.array([excess(total) - excess(total + one) for one in each])
        gains[times > left] = 0.0
        best = int(np.argmax(gains / times))
        if gains[best] <= 0.0:
            break
        chosen.append(best)
        left -= times[best]
        total = total + each[best]
    for i in sorted(set(chosen), key=lambda i: -times[i]):
        # what was needed on the way may no longer be
        while i in chosen and excess(total - each[i]) <= excess(total):
            chosen.remove(i)
            total = total - each[i]
    std = _std(total, values)
    std[std > 0.5 * _BEFORE * np.abs(values)] = np.inf
    not_identifiable = tuple(q.name for q, s, w in zip(model.quantities, std, wanted, strict=True) if s > 1.001 * w)
    first = [s for s in able if s.name == signals[0].name]
    run = [_repeated(tests[i], chosen.count(i)) for i in dict.fromkeys(chosen)]
    return Design((*first, *run), std, wanted, not_identifiable, left_out)


def _repeated(signal: DriveSignal, times: int) -> DriveSignal:
    """Return a test run several times in one file."""
    if times == 1:
        return signal
    x = np.concatenate([signal.displacement] * times)
    step = signal.time_s[1] - signal.time_s[0]
    return DriveSignal(f"{signal.name}_{times}_times", np.arange(x.size) * step, x)


def _std(matrix: Array, values: Array) -> Array:
    """Return standard deviations from an information matrix, scaled by the values so that it can be inverted."""
    scaled = matrix * np.outer(values, values)
    root = np.sqrt(np.diag(scaled))
    inverse = np.linalg.inv(scaled / np.outer(root, root))
    return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0)) / root * np.abs(values))
