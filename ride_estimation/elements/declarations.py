# Copyright 2026 ride_estimation contributors
"""Parameters that several elements declare alike: Berg's friction, the weighted Dahl friction of buffers, contact."""

from __future__ import annotations

from typing import Any

from ride_estimation.elements.base import parameter, series


def friction_limit() -> Any:
    """Declare Berg's largest friction force."""
    return parameter(
        "N", key="friction_n", lower=0.0, upper=1e6, meaning="largest friction force f_max", role="friction", source="003 (9)"
    )


def half_stroke() -> Any:
    """Declare Berg's stroke to half the largest friction force."""
    return parameter(
        "m", key="half_stroke_m", lower=1e-9, upper=1.0, meaning="stroke x_2 from rest to half the largest friction force",
        source="003 (9)",
    )


def dead_band() -> Any:
    """Declare the shortest way back that counts as a reversal."""
    return parameter(
        "m", key="dead_band_m", lower=0.0, upper=0.01, default=0.0,
        meaning="shortest way back that is a reversal; about 8 standard deviations of the noise of a measured deflection",
        source="this project",
    )


def clearance() -> Any:
    """Declare the compression at which a buffer is reached."""
    return parameter(
        "m", key="clearance_m", lower=-1.0, upper=10.0, default=0.0,
        meaning="compression at which the buffer is reached; negative where it is preloaded at rest", source="this project",
    )


def hysteresis_heights() -> Any:
    """Declare the heights of the static hysteresis of a buffer at its travels."""
    return series(
        "N", key="heights_n", lower=0.0, upper=1e7, meaning="height w of the static hysteresis at the points", role="friction",
        source="004 (5)",
    )


def reference_travel() -> Any:
    """Declare the travel of the reference height of the weighted Dahl friction."""
    return parameter(
        "m", key="reference_travel_m", lower=1e-4, upper=10.0, meaning="reference travel u_ref, that of 9 kN", source="004 (3)"
    )


def dahl_slope_at_rest() -> Any:
    """Declare the Dahl stiffness at no travel."""
    return parameter(
        "N/m", key="lowest_slope_n_per_m", lower=0.0, upper=1e10, meaning="Dahl stiffness s_min at no travel", role="friction",
        source="004 (3)",
    )


def dahl_slope_at_reference() -> Any:
    """Declare the Dahl stiffness at the reference travel."""
    return parameter(
        "N/m", key="highest_slope_n_per_m", lower=0.0, upper=1e10, meaning="Dahl stiffness s_max at the reference travel",
        role="friction", source="004 (3)",
    )


def distortion() -> Any:
    """Declare the exponent between both Dahl stiffnesses."""
    return parameter("1", key="exponent", lower=0.05, upper=20.0, meaning="distortion exponent n", source="004 (3)")
