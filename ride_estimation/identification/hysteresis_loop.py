# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of a mount from a force-displacement loop (document 001 section 3.1.1, eq. (3.1)-(3.3))."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import trapezoid

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

_GRID = 4096  # points a cycle of the common grid; the chord area of a circle is then 4e-7 small


@dataclasses.dataclass(frozen=True)
class LoopResult:
    """What one steady loop says.

    Attributes
    ----------
    stiffness
        First-harmonic in-phase stiffness [N/m].
    damping
        Equivalent viscous damping ``dW / (pi omega X^2)`` [N s/m] at the frequency of the loop only.
    loss_energy
        Loop area per cycle [J].
    amplitude
        Deflection amplitude [m].
    omega
        Angular frequency [rad/s].
    """

    stiffness: float
    damping: float
    loss_energy: float
    amplitude: float
    omega: float


def analyse_loop(time_s: ArrayLike, displacement: ArrayLike, force: ArrayLike, frequency_hz: float) -> LoopResult:
    """Read stiffness and equivalent damping from whole cycles of a sinusoidal loop.

    ``dW = closed integral of F dx``, ``c = dW / (pi omega X^2)`` with omega in rad/s: document 001 quotes 0.02 Hz beside
    formulas in rad/s, a factor of 2 pi if confused.

    Parameters
    ----------
    time_s, displacement, force
        Uniform samples [s], [m], [N], shape (N,), at least one whole cycle; whole cycles from the end are used.
    frequency_hz
        Frequency of the test [Hz].

    Raises
    ------
    InputDataError
        Less than one cycle, fewer than 16 samples a cycle, constant displacement, values not finite.
    """
    t, x, f = (np.asarray(v, dtype=float).ravel() for v in (time_s, displacement, force))
    if not t.size == x.size == f.size:
        raise InputDataError(f"time, displacement and force have {t.size}, {x.size}, {f.size} samples: they must be equal")
    if not all(np.all(np.isfinite(v)) for v in (t, x, f)):
        raise InputDataError("the loop contains values that are not finite")
    step = (t[-1] - t[0]) / (t.size - 1)
    per_cycle = 1.0 / (frequency_hz * step)
    if per_cycle < 16 or t.size < per_cycle + 1:
        raise InputDataError(
            f"{t.size} samples with {per_cycle:.1f} samples a cycle; at least one whole cycle of 16 samples is needed"
        )
    if np.ptp(x) == 0.0:
        raise InputDataError("the displacement is constant: a loop has no stiffness")
    cycles = math.floor((t.size - 1) / per_cycle)
    start = t[-1] - cycles / frequency_hz
    grid = start + np.arange(cycles * _GRID + 1) / (_GRID * frequency_hz)
    xg, fg = np.interp(grid, t, x), np.interp(grid, t, f)
    omega = 2.0 * math.pi * frequency_hz
    carrier = np.exp(-1j * omega * (grid[:-1] - grid[0]))
    x1, f1 = 2.0 * np.mean(xg[:-1] * carrier), 2.0 * np.mean(fg[:-1] * carrier)
    amplitude = abs(x1)
    loss = float(trapezoid(fg, xg)) / cycles
    return LoopResult(float((f1 / x1).real), loss / (math.pi * omega * amplitude**2), loss, amplitude, omega)


def constant_speed_loss(damping: float, speed: float, amplitude: float) -> float:
    """Return the loop area of a viscous damper stroked at constant speed, ``4 c v X`` [J] (ramps instead of a sine)."""
    return 4.0 * damping * speed * amplitude


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
        return "one frequency only: viscous damping and friction cannot be told apart; repeat at ride frequency"
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
