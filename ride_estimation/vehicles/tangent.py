# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of any force element at rest, and its linear equivalent at a frequency and amplitude."""

from __future__ import annotations

import math

from ride_estimation.elements.base import ForceElement

#: half width of the secant that stands for "at rest" [m, rad] and [m/s, rad/s]
REST_DEFLECTION = 1.0e-3
REST_RATE = 1.0e-2


def tangent(element: ForceElement, deflection: float = REST_DEFLECTION, rate: float = REST_RATE) -> tuple[float, float]:
    """Return secant stiffness [N/m] and damping [N s/m] about static equilibrium.

    ``k = (F(d, 0) - F(-d, 0)) / 2d``, ``c = (F(0, v) - F(0, -v)) / 2v``; memory at rest, so a Maxwell branch counts zero
    and a friction element with its initial slope.

    Parameters
    ----------
    deflection, rate
        Half widths d [m] and v [m/s] of the secants.
    """
    s = element.initial()
    stiffness = (element.force(s, deflection, 0.0) - element.force(s, -deflection, 0.0)) / (2.0 * deflection)
    damping = (element.force(s, 0.0, rate) - element.force(s, 0.0, -rate)) / (2.0 * rate)
    return float(stiffness), float(damping)


def equivalent(element: ForceElement, frequency_hz: float, amplitude: float) -> tuple[float, float]:
    """Return the linear equivalent ``k = Re K*``, ``c = Im K* / omega`` of an element for a harmonic deflection.

    Falls back to :func:`tangent` with that amplitude where the element has no closed form.

    Parameters
    ----------
    frequency_hz
        Frequency [Hz], greater than zero.
    amplitude
        Deflection amplitude [m].
    """
    omega = 2.0 * math.pi * frequency_hz
    complex_stiffness = element.dynamic_stiffness(omega, amplitude)
    if complex_stiffness is None:
        return tangent(element, amplitude, omega * amplitude)
    return complex_stiffness.real, complex_stiffness.imag / omega
