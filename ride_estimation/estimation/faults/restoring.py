# Copyright 2026 ride_estimation contributors
"""State of the deflections without what a faulty sensor did to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

#: standard deviation of deflection [m] and rate [m/s] of a mount that starts again
_DEFLECTION_STD, _RATE_STD = 0.01, 0.1


def restarted(now: Mapping[str, Any], earlier: Mapping[str, Any], mounts: Sequence[int]) -> dict[str, Any]:
    """Return the saved state of a deflection estimator with some mounts started again.

    Their biases are those of before the fault; deflection and rate are zero with a wide standard deviation.

    Parameters
    ----------
    now, earlier
        Saved states, the earlier one of before the fault.
    mounts
        Which mounts start again.
    """
    state, old = np.array(now["state"], dtype=float), np.array(earlier["state"], dtype=float)
    p, old_p = np.array(now["p"], dtype=float), np.array(earlier["p"], dtype=float)
    size, old_size = np.array(now["mean_square"], dtype=float), np.array(earlier["mean_square"], dtype=float)
    for m in mounts:
        state[:, m], size[m] = old[:, m], old_size[m]
        state[:2, m] = 0.0
        for axis in range(3):
            p[m, axis] = np.diag([_DEFLECTION_STD**2, _RATE_STD**2, old_p[m, axis, 2, 2]])
    return {**now, "state": state.tolist(), "p": p.tolist(), "mean_square": size.tolist()}
