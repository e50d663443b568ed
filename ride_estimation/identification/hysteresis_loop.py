# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of a mount from a force-displacement loop (document 001 section 3.1.1, eq. (3.1)-(3.3))."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.elements.harmonic import DEFINITIONS, loop_stiffness
from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

_GRID = 4096  # points a cycle of the common grid; the chord area of a circle is then 4e-7 small
_FLOOR_HARMONICS = 0.5  # share of the harmonics, the highest ones, that show the noise of the displacement
_STANDS_OUT = 10.0  # power of a harmonic over that noise from which it belongs to the motion
_EMPTY_ORDERS = 3  # orders without power after which no more belong to the motion; a wave alike both ways has every second
_RAMP_FORM = 1.1  # form factor below which the motion is called ramps: between ramps (1) and a sine (1.234)
_SINE_FORM = 0.01  # departure from the form factor of a sine within which the motion is called a sine
_REPEATS = 0.05  # share of the displacement's energy that may not repeat with the cycle


@dataclasses.dataclass(frozen=True)
class LoopResult:
    """What one steady loop says.

    Attributes
    ----------
    stiffness
        First-harmonic in-phase stiffness [N/m].
    damping
        Equivalent viscous damping, loss over the time integral of the squared velocity [N s/m], at this speed only.
    loss_energy
        Loop area per cycle [J].
    amplitude
        Half the stroke [m].
    omega
        Angular frequency [rad/s].
    form
        Mean square over squared mean of the speed: 1 for ramps at constant speed, ``pi^2/8`` for a sine.
    by_definition
        Dynamic stiffness K of the mean cycle [N/m] by each definition of :mod:`ride_estimation.elements.harmonic`.
    """

    stiffness: float
    damping: float
    loss_energy: float
    amplitude: float
    omega: float
    form: float
    by_definition: dict[str, float]

    @property
    def wave(self) -> str:
        """Return what kind of motion it was, in words."""
        if abs(self.form - math.pi**2 / 8.0) <= _SINE_FORM:
            return "sine"
        mean_speed = 2.0 * self.omega * self.amplitude / math.pi
        if self.form < _RAMP_FORM:
            return f"ramps at {mean_speed:.3g} m/s"
        return f"no sine and no ramps, mean speed {mean_speed:.3g} m/s"


def analyse_loop(time_s: ArrayLike, displacement: ArrayLike, force: ArrayLike, frequency_hz: float) -> LoopResult:
    """Read stiffness and equivalent damping from whole cycles of a periodic loop: sine, ramps or any other motion.

    ``dW = closed integral of F dx``; a viscous damper takes ``c`` times the integral of the squared velocity, so
    ``c = dW / integral of v^2 dt``: ``dW / (pi omega X^2)`` for a sine, ``dW / (4 v X)`` for ramps at constant speed v. omega is
    in rad/s: document 001 quotes 0.02 Hz beside formulas in rad/s, a factor of 2 pi if confused.

    Parameters
    ----------
    time_s, displacement, force
        Uniform samples [s], [m], [N], shape (N,), at least one whole cycle; whole cycles from the end are used.
    frequency_hz
        Frequency of the test [Hz].

    Raises
    ------
    InputDataError
        Less than one cycle, fewer than 16 samples a cycle, constant displacement, values not finite, a displacement that does
        not repeat with that frequency.
    """
    t, x, f = (np.asarray(v, dtype=float).ravel() for v in (time_s, displacement, force))
    per_cycle = _checked(t, x, f, frequency_hz)
    cycles = max(1, math.floor((t.size - 1) / per_cycle + 1e-6))
    start = t[-1] - cycles / frequency_hz
    grid = start + np.arange(cycles * _GRID + 1) / (_GRID * frequency_hz)
    xg, fg = np.interp(grid, t, x), np.interp(grid, t, f)
    parts = xg[:-1].reshape(cycles, _GRID)
    mean_x, mean_f = parts.mean(axis=0), fg[:-1].reshape(cycles, _GRID).mean(axis=0)
    apart = float(np.sum((parts - mean_x) ** 2) / np.sum((parts - parts.mean()) ** 2))
    if apart > _REPEATS:
        raise InputDataError(
            f"{100 * apart:.0f} % of the displacement's energy does not repeat with {frequency_hz:g} Hz: wrong frequency, or no "
            "steady test"
        )
    harmonics = 2.0 * np.fft.rfft(mean_x) / _GRID
    response = 2.0 * np.fft.rfft(mean_f) / _GRID
    kept = _harmonics_of_the_motion(harmonics, int(per_cycle / 2))
    smooth = np.fft.irfft(np.where(np.arange(harmonics.size) <= kept, harmonics, 0.0) * _GRID / 2.0, _GRID)
    amplitude = 0.5 * float(np.ptp(smooth))
    omega = 2.0 * math.pi * frequency_hz
    orders = np.arange(1, kept + 1)
    squared_speed = 0.5 * omega**2 * float(np.sum(orders**2 * np.abs(harmonics[1 : kept + 1]) ** 2))
    # no motion of this stroke has a smaller mean square than the one at constant speed
    form = max(squared_speed / (2.0 * omega * amplitude / math.pi) ** 2, 1.0)
    squared_speed = form * (2.0 * omega * amplitude / math.pi) ** 2
    loss = float(scipy.integrate.trapezoid(fg, xg)) / cycles
    stiffness = float((response[1] / harmonics[1]).real)
    named = {definition: loop_stiffness(smooth, mean_f, definition) for definition in DEFINITIONS}
    return LoopResult(stiffness, loss * frequency_hz / squared_speed, loss, amplitude, omega, form, named)


def _checked(t: Array, x: Array, f: Array, frequency_hz: float) -> float:
    """Refuse what is no loop; return the samples a cycle."""
    if not t.size == x.size == f.size:
        raise InputDataError(f"time, displacement and force have {t.size}, {x.size}, {f.size} samples: they must be equal")
    if not all(np.all(np.isfinite(v)) for v in (t, x, f)):
        raise InputDataError("the loop contains values that are not finite")
    step = (t[-1] - t[0]) / (t.size - 1)
    per_cycle = 1.0 / (frequency_hz * step)
    # half a sample of rounding in the time column is no missing cycle
    if per_cycle < 16 or t.size + 0.5 < per_cycle + 1:
        raise InputDataError(
            f"{t.size} samples with {per_cycle:.1f} samples a cycle; at least one whole cycle of 16 samples is needed"
        )
    if np.ptp(x) == 0.0:
        raise InputDataError("the displacement is constant: a loop has no stiffness")
    return float(per_cycle)


def _harmonics_of_the_motion(harmonics: NDArray[np.complex128], nyquist: int) -> int:
    """Return the highest harmonic that stands out of the noise of the displacement."""
    power = np.abs(harmonics[1 : nyquist + 1]) ** 2
    floor = float(np.median(power[int(_FLOOR_HARMONICS * nyquist) :]))
    above = np.flatnonzero(power > _STANDS_OUT * floor)
    gaps = np.flatnonzero(np.diff(above) > _EMPTY_ORDERS)
    return int(above[gaps[0] if gaps.size else -1]) + 1


def viscous_check(loops: list[LoopResult]) -> str:
    """Say whether the equivalent damping may be used at other frequencies.

    A viscous damper has the same c in every loop; dry friction has the same loss in every loop, so that c ~ 1/omega and a
    value from a slow test is wrong at ride frequencies by the frequency ratio.

    Returns
    -------
    str
        Empty where c is the same within 20 %, else the warning.
    """
    if len(loops) < 2:
        return "one frequency only: viscous damping and friction cannot be distinguished; repeat at ride frequency"
    ordered = sorted(loops, key=lambda r: r.omega)
    low, high = ordered[0], ordered[-1]
    if low.damping <= 0.0 or high.damping <= 0.0:
        return "a loop gives no positive damping: check the sign of the force and the time skew of the channels"
    slope = math.log(high.damping / low.damping) / math.log(high.omega / low.omega)
    if abs(high.damping / low.damping - 1.0) <= 0.2:
        return ""
    ratio = low.damping / high.damping
    return (
        f"equivalent damping falls as omega^{slope:.2f} (viscous: 0, friction: -1): the value at "
        f"{low.omega / 2 / math.pi:.3g} Hz "
        f"is {ratio:.3g} times that at {high.omega / 2 / math.pi:.3g} Hz and must not be used as a viscous constant"
    )
