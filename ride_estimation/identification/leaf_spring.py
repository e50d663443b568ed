# Copyright 2026 ride_estimation contributors
"""Leaf spring rate from geometry or a load test, as a prior for identification (document 002 section 4.3)."""

from __future__ import annotations

import math

from ride_estimation.errors import InputDataError
from ride_estimation.vehicles.vehicle import Prior

STEEL_MODULUS = 206e9  # Pa, spring steel 51CrV4


def semi_elliptic_rate(
    span: float, width: float, thickness: float, leaves: int, modulus: float = STEEL_MODULUS, relative_std: float = 0.1
) -> Prior:
    """Return the rate of a semi-elliptic multi-leaf spring loaded in the middle, without friction between leaves.

    ``k = 8 E n b t^3 / (3 L^3)`` (trapezoidal spring of uniform strength). Clamping, shackles and friction between leaves
    change it by about 10 %, the default standard deviation.

    Parameters
    ----------
    span
        Distance of the eyes L [m].
    width, thickness
        One leaf b, t [m].
    leaves
        Number of equal leaves n.
    modulus
        Young's modulus E [Pa].
    """
    if min(span, width, thickness, modulus) <= 0.0 or leaves < 1:
        raise InputDataError(
            f"span {span:g} m, width {width:g} m, thickness {thickness:g} m, modulus {modulus:g} Pa, {leaves} leaves; "
            "allowed: all of them greater than zero"
        )
    rate = 8.0 * modulus * leaves * width * thickness**3 / (3.0 * span**3)
    return Prior(rate, relative_std * rate, source="leaf geometry")


def rate_from_load(force: float, deflection: float, deflection_std: float = 0.0) -> Prior:
    """Return ``k = F / dx`` of a load test or finite element run [N/m] with the error of the deflection carried over.

    Document 002 prints 10000 / 0.030455 = 328 407 N/m; that quotient is 328 353, and 328 407 belongs to 0.03045 m.

    Parameters
    ----------
    force
        [N].
    deflection, deflection_std
        [m].
    """
    if deflection == 0.0 or not (math.isfinite(force) and math.isfinite(deflection)):
        raise InputDataError(f"force {force:g} N and deflection {deflection:g} m must be finite and the deflection not zero")
    rate = force / deflection
    return Prior(rate, abs(rate * deflection_std / deflection), source="load test")
