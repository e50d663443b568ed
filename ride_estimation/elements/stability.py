# Copyright 2026 ride_estimation contributors
"""The largest step with which the memory of an element may be integrated explicitly."""

from __future__ import annotations

import math

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError

#: ``rate * step`` below which explicit integration of a memory is stable; classical Runge-Kutta on the negative real axis
STABILITY_BOUNDS = {"euler": 2.0, "rk4": 2.785293563405282}
#: ``sigma v h / f_c`` above which one explicit Euler step takes Dahl friction from rest past its limit
DAHL_OVERSHOOT = 1.0


def largest_explicit_step(element: ForceElement, peak_speed: float, method: str = "euler") -> float:
    """Return the largest stable explicit step [s] of the memory of an element, ``inf`` where there is no bound.

    Parameters
    ----------
    element
        Its rate equation (:meth:`ForceElement.rate`) is integrated explicitly.
    peak_speed
        Largest rate of the deflection [m/s].
    method
        ``euler`` or ``rk4``.

    Notes
    -----
    Source: document 004, stability regions: ``Omega T_s < 2`` for a Maxwell cell; the same kind of bound holds for Dahl
    friction, ``sigma v T_s / f_c < 2``, which the document does not mention. It overshoots its limit from 1 on.
    """
    if method not in STABILITY_BOUNDS:
        raise ConfigurationError(f"method: {method!r} is unknown; allowed: {', '.join(STABILITY_BOUNDS)}")
    rate = element.fastest_rate(peak_speed)
    return STABILITY_BOUNDS[method] / rate if rate > 0.0 else math.inf


def require_explicit_step(element: ForceElement, step_s: float, peak_speed: float, method: str = "euler") -> None:
    """Refuse a step that makes explicit integration of the memory of an element unstable.

    Raises
    ------
    ConfigurationError
        The step reaches the bound; the message names the element, the rate, the step and the largest step.
    """
    limit = largest_explicit_step(element, peak_speed, method)
    if step_s >= limit:
        rate = element.fastest_rate(peak_speed)
        raise ConfigurationError(
            f"step {step_s:g} s is too long for explicit {method} integration: fastest rate {rate:g} 1/s at {peak_speed:g} m/s "
            f"times the step is {rate * step_s:.3g}, allowed below {STABILITY_BOUNDS[method]:.3g}; take a step below "
            f"{limit:.3g} s, or the exact step of the element's terms, which has no bound",
            where=element.KIND,
        )
