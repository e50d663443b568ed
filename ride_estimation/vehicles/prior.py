# Copyright 2026 ride_estimation contributors
"""How well the numbers of a vehicle file are known, also where it states no standard deviation: one statement for all who ask."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.vehicles.vehicle import Body, Prior

Array = NDArray[np.float64]

#: standard deviation of ln k and ln c where the file states none [-]: rubber scatters by a quarter from part to part and with age
STIFFNESS_LOG_STD, DAMPING_LOG_STD = 0.3, 0.5
#: of the CG [m], and of the moments of inertia over their size [-]: a CAD model, or a swing test
CG_STD, INERTIA_STD = 0.01, 0.05
#: of a mass over its size [-]: a scale
MASS_STD = 0.01
#: of a static load over its size [-], where nobody weighed it or stated how well: half of the five per cent within which
#: levelling, free lengths and spring rates of one model keep the loads of its mounts
STATIC_LOAD_STD = 0.025
#: share of the twist of a frame that a bracket follows, and its standard deviation [-]: on a cross member it rolls with it, on a
#: rail it pitches with it
TWIST_SHARE, TWIST_SHARE_STD = 0.6, 0.6


def std_of(prior: Prior, usual: float) -> float:
    """Return the standard deviation of a number, a usual share of its size where none is stated."""
    return usual * abs(prior.value) if prior.std is None else prior.std


def cg_std_of(body: Body) -> Array:
    """Return the standard deviations of the CG of a body, those of its file where it states some, shape (3,) [m]."""
    return np.full(3, CG_STD) if body.cg_std is None else np.asarray(body.cg_std, dtype=float)


def log_std(prior: Prior | None, value: float, usual: float) -> float:
    """Return the standard deviation of the logarithm of a positive number.

    ``sqrt(ln(1 + (std / value)^2))``, that of the lognormal distribution with this mean and standard deviation.

    Parameters
    ----------
    prior
        What is known of it, None where nothing is stated.
    value
        The number.
    usual
        What is returned where no standard deviation is stated.
    """
    if prior is None or not prior.std or value <= 0.0:
        return usual
    return math.sqrt(math.log1p((prior.std / value) ** 2))
