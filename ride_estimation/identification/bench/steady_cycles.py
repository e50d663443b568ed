# Copyright 2026 ride_estimation contributors
"""Dynamic stiffness and loss energy from harmonic tests: find the steady part, fit harmonics, take the loop area.

The extraction is a named option because definitions differ by several per cent on nonlinear elements:

``harmonic``
    complex ratio of the first harmonics of force and displacement (the closed forms of this package are this one);
``peak``
    force at largest displacement over that displacement (secant), loss from the loop area;
``range``
    force range over displacement range, loss from the loop area.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.choices import EXTRACTIONS
from ride_estimation.identification.bench.reversals import noise_level
from ride_estimation.identification.bench.time_domain import PreparedRecord

Array = NDArray[np.float64]

#: harmonics fitted besides the mean
HARMONICS = 7
#: cycles left out at the start of each steady part
SETTLING_CYCLES = 2
#: half cycles belong together whose amplitude and duration agree within this share
SAME_TEST = 0.08


@dataclasses.dataclass(frozen=True)
class OperatingPoints:
    """Measured K and W, one row per test.

    Attributes
    ----------
    omega, amplitude
        [rad/s], [m], shape (N,).
    stiffness
        Complex stiffness [N/m], shape (N,).
    force_std
        Standard deviation of the first harmonic of the force [N], shape (N,); 0 where unknown.
    """

    omega: Array
    amplitude: Array
    stiffness: NDArray[np.complex128]
    force_std: Array

    @property
    def loss_energy(self) -> Array:
        """Return the loss energy per cycle [J], shape (N,)."""
        energy: Array = np.pi * self.amplitude**2 * self.stiffness.imag
        return energy


def operating_points(omega: Array, amplitude: Array, stiffness: Array, loss_energy: Array) -> OperatingPoints:
    """Build operating points from a table of K = abs(K*) and W.

    Raises
    ------
    InputDataError
        A loss energy that no stiffness of that magnitude can have, or values that are not positive.
    """
    loss = loss_energy / (np.pi * amplitude**2)
    bad = np.flatnonzero((omega <= 0) | (amplitude <= 0) | (stiffness <= 0) | (np.abs(loss) > stiffness))
    if bad.size:
        raise InputDataError(
            f"row {bad[0] + 1} of the table: frequency, amplitude and stiffness must be positive and the loss energy at most "
            f"pi A^2 K = {np.pi * amplitude[bad[0]] ** 2 * stiffness[bad[0]]:.3g} J (given {loss_energy[bad[0]]:.3g} J)"
        )
    return OperatingPoints(omega, amplitude, np.sqrt(stiffness**2 - loss**2) + 1j * loss, np.zeros(omega.size))


def fit_cycles(t: Array, x: Array, force: Array, omega: float, extraction: str = "harmonic") -> tuple[complex, float, float]:
    """Return complex stiffness [N/m], displacement amplitude [m], std of the first force harmonic [N].

    Parameters
    ----------
    t, x, force
        A steady part of about whole cycles, shape (N,).
    omega
        Start value of the angular frequency [rad/s]; refined by least squares on the displacement.
    extraction
        One of ``EXTRACTIONS``.
    """
    omega = _refined_frequency(t, x, omega)
    count = int(np.clip(t.size // 4, 1, HARMONICS))
    nyquist = np.pi / (t[1] - t[0])
    count = max(1, min(count, int(0.8 * nyquist / omega)))
    angles = omega * (t - t[0])[:, None] * np.arange(1, count + 1)
    design = np.hstack([np.ones((t.size, 1)), np.cos(angles), np.sin(angles)])
    solution, _, _, _ = np.linalg.lstsq(design, np.stack([x, force], axis=1), rcond=None)
    first = solution[1] - 1j * solution[1 + count]
    amplitude = float(abs(first[0]))
    residual = force - design @ solution[:, 1]
    std = float(np.sqrt(2.0 * np.sum(residual**2)) / max(t.size - 2 * count - 1, 1))
    stiffness = complex(first[1] / first[0])
    if extraction == "harmonic":
        return stiffness, amplitude, std
    fine = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)[:, None] * np.arange(1, count + 1)
    basis = np.hstack([np.cos(fine), np.sin(fine)])
    loop_x, loop_f = basis @ solution[1:, 0], basis @ solution[1:, 1]
    at = int(np.argmax(loop_x))
    if extraction == "peak":
        magnitude = float((loop_f[at] - loop_f[int(np.argmin(loop_x))]) / np.ptp(loop_x))
    elif extraction == "range":
        magnitude = float(np.ptp(loop_f) / np.ptp(loop_x))
    else:
        raise InputDataError(f"extraction {extraction!r} is unknown; allowed: {', '.join(EXTRACTIONS)}")
    slope = np.hstack([-np.sin(fine) * np.arange(1, count + 1), np.cos(fine) * np.arange(1, count + 1)]) @ solution[1:, 0]
    loss = float(np.mean(loop_f * slope) * 2.0 * np.pi) / (np.pi * amplitude**2)
    return complex(np.sqrt(max(magnitude**2 - loss**2, 0.0)), loss), amplitude, std


def _refined_frequency(t: Array, x: Array, omega: float) -> float:
    """Refine a frequency by Gauss-Newton on ``c + a cos wt + b sin wt``."""
    s = t - t[0]
    span = max(s[-1], 1e-12)
    for _ in range(8):
        design = np.stack([np.ones_like(s), np.cos(omega * s), np.sin(omega * s)], axis=1)
        c = np.linalg.lstsq(design, x, rcond=None)[0]
        slope = s * (-c[1] * np.sin(omega * s) + c[2] * np.cos(omega * s))
        full = np.column_stack([design, slope])
        step = float(np.linalg.lstsq(full, x, rcond=None)[0][-1])
        step = float(np.clip(step, -0.5 / span, 0.5 / span))
        omega += step
        if abs(step) * span < 1e-10:
            break
    return omega


def find_operating_points(prepared: Sequence[PreparedRecord], extraction: str = "harmonic") -> OperatingPoints:
    """Find the steady harmonic tests in records and extract K and W of each.

    A test is a run of half cycles of equal amplitude and duration; its first two cycles settle and are left out, and at
    least one and a half steady cycles must remain.

    Raises
    ------
    InputDataError
        No harmonic test in the records.
    """
    rows = []
    for item in prepared:
        rows += [_extract(item, first, last, extraction) for first, last in _tests(item)]
    if not rows:
        raise InputDataError(
            "no steady harmonic test was found (runs of at least four cycles of equal amplitude and frequency are needed); "
            "use --method time for sweeps and random records"
        )
    table = np.array([(w, a, s) for w, a, _, s in rows])
    return OperatingPoints(table[:, 0], table[:, 1], np.array([k for _, _, k, _ in rows]), table[:, 2])


def _tests(item: PreparedRecord) -> list[tuple[int, int]]:
    """Return sample ranges of the steady parts."""
    motion = item.motion
    starts = motion.starts[1:-1]
    if starts.size < 6:
        return []
    durations = np.diff(starts) * motion.step_s
    strokes = np.abs(np.diff(motion.x[starts]))
    found, begin = [], 0
    for i in range(1, strokes.size + 1):
        inside = slice(begin, i)
        if i < strokes.size:
            d, s = float(np.median(durations[inside])), float(np.median(strokes[inside]))
            tolerance = SAME_TEST * d + 1.5 * motion.step_s
            if abs(durations[i] - d) <= tolerance and abs(strokes[i] - s) <= SAME_TEST * s:
                continue
        steady = begin + 2 * SETTLING_CYCLES
        whole = (i - steady) // 2 * 2
        if whole >= 2:
            found.append((int(starts[steady]), int(starts[steady + whole])))
        begin = i
    return found


def _extract(item: PreparedRecord, first: int, last: int, extraction: str) -> tuple[float, float, complex, float]:
    motion = item.motion
    inside = motion.starts[(motion.starts >= first) & (motion.starts <= last)]
    period = 2.0 * (last - first) * motion.step_s / (inside.size - 1)
    part = slice(first, last)
    t, x = item.record.time_s[part], item.record.displacement[part]
    omega = _refined_frequency(t, x, 2.0 * np.pi / period)
    stiffness, amplitude, std = fit_cycles(t, x, item.force[part], omega, extraction)
    floor = noise_level(item.force) * float(np.sqrt(2.0 / t.size))
    return omega, amplitude, stiffness, max(std, floor)
