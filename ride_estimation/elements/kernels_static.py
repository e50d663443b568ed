# Copyright 2026 ride_estimation contributors
"""Compiled force laws without memory: springs, dampers, contact, smooth friction.

Plain scalar functions; :mod:`ride_estimation.elements.terms` calls them with the numbers of one term.
"""

from __future__ import annotations

import math

from ride_estimation.jit import compile_lean_kernel


@compile_lean_kernel
def signed_power(value: float, reference: float, exponent: float, rounding: float) -> float:
    """Return ``r sign(u) |u / r|^n`` with the corner at zero rounded over ``rounding``.

    With ``rounding = 0`` it is the power law itself; else ``u (sqrt(u^2 + eps^2) / r)^(n - 1)``, whose slope stays finite
    at zero for n < 1.
    """
    if value == 0.0:
        return 0.0
    size = math.sqrt(value * value + rounding * rounding)
    result: float = value * (size / reference) ** (exponent - 1.0)
    return result


@compile_lean_kernel
def penetration(x: float, side: float, gap: float, half_width: float) -> float:
    """Return the smoothed penetration [m] past a stop, ``u = (e + p)^2 / (4 p)`` inside ``|e| < p``, ``e = side x - gap``.

    The polynomial with matching value and slope at both ends; its cubic coefficient is identically zero
    (document 004, smoothing of the contact points).
    """
    excess = side * x - gap
    if excess <= -half_width:
        return 0.0
    if excess < half_width:
        return (excess + half_width) * (excess + half_width) / (4.0 * half_width)
    return excess


@compile_lean_kernel
def engagement(x: float, side: float, gap: float, half_width: float) -> float:
    """Return the slope of :func:`penetration` with respect to ``side x``, 0 (free) to 1 (fully in contact)."""
    excess = side * x - gap
    if excess <= -half_width:
        return 0.0
    if excess < half_width:
        return (excess + half_width) / (2.0 * half_width)
    return 1.0


@compile_lean_kernel
def contact_force(
    x: float, v: float, side: float, gap: float, half_width: float, stiffness: float, cubic: float, damping: float
) -> float:
    """Return the tension [N] of a one-sided stop, ``side max(k u + k3 u^3 + c u' side v, 0)``; it pushes, never pulls."""
    u = penetration(x, side, gap, half_width)
    if u <= 0.0:
        return 0.0
    push = stiffness * u + cubic * u * u * u + damping * engagement(x, side, gap, half_width) * side * v
    if push <= 0.0:
        return 0.0
    return side * push


@compile_lean_kernel
def stribeck_force(v: float, kinetic: float, static: float, stribeck_speed: float, rounding_speed: float) -> float:
    """Return ``(f_k + (f_s - f_k) exp(-(v / v_s)^2)) tanh(v / v_0)`` [N]."""
    ratio = v / stribeck_speed
    return (kinetic + (static - kinetic) * math.exp(-ratio * ratio)) * math.tanh(v / rounding_speed)
