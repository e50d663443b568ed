# Copyright 2026 ride_estimation contributors
"""Ways in which the brackets of mounts tilt, as far as the vertical motion of their neighbours shows it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ride_estimation.vehicles.prior import TWIST_SHARE, TWIST_SHARE_STD

Array = NDArray[np.float64]

#: share of a rigid tilt that brackets follow, and its standard deviation [-]: a frame is rigid or stands on a rig that translates
_RIGID_SHARE, _RIGID_STD = 1.0, 0.5
TILT_KINDS = frozenset({"tilt", "twist"})


@dataclasses.dataclass(frozen=True)
class BracketTilt:
    """One way in which brackets tilt, inferred from the vertical motion of their neighbours.

    With a rigid frame brackets follow it fully, unless their sensors are levelled or a rig only translates them. How much
    each follows a twisting frame depends on the member it sits on: a cross member rolls with it, a rail pitches with it.
    Where three cannot show the twist, each follows what they show by a share of its own.

    Attributes
    ----------
    kind
        ``tilt`` (rigid frame) or ``twist``.
    place, axis
        ``frame`` or a mount; ``roll`` or ``pitch``.
    slope
        Roll, pitch, yaw of the brackets from twice integrated readings, shape (nb, nu).
    usual, usual_std
        Share of it that brackets follow where nothing is known, and its standard deviation [-].
    """

    kind: str
    place: str
    axis: str
    slope: Array
    usual: float = _RIGID_SHARE
    usual_std: float = _RIGID_STD


def bracket_tilts(mounts: tuple[str, ...], rigid: Array, twist: Array) -> tuple[BracketTilt, ...]:
    """Return the tilts of a rigid frame and, bracket by bracket, of a twisting one that the base sensors show at all.

    Three brackets show no twist, so what they show as tilt may be twist: each follows it by a share of its own. What all brackets
    have in common is as uncertain as the one share that the estimator has for them.

    Parameters
    ----------
    mounts
        Names, M.
    rigid, twist
        Roll, pitch, yaw of the brackets from twice integrated readings, the parts of a rigid frame and of its twist, shape
        (3 M, nu) each.
    """
    rows = [3 * j + part for j in range(len(mounts)) for part in range(2)]
    blind = {r for r in rows if np.all(np.any(rigid[r - r % 3 :][:2], axis=1)) and not np.any(twist[r - r % 3 :][:2])}
    out: list[BracketTilt] = []
    for part, axis in enumerate(("roll", "pitch")):
        own = {m: 3 * j + part for j, m in enumerate(mounts)}
        out.append(BracketTilt("tilt", "frame", axis, _only(rigid, set(own.values()) - blind)))
        for m, r in own.items():
            if r in blind:
                out.append(BracketTilt("tilt", m, axis, _only(rigid, {r})))
            else:
                std = TWIST_SHARE_STD * math.sqrt(len(mounts))
                out.append(BracketTilt("twist", m, axis, _only(twist, {r}), TWIST_SHARE, std))
    return tuple(t for t in out if np.any(t.slope))


def _only(matrix: Array, rows: Collection[int]) -> Array:
    """Return a matrix with all rows but some set to zero."""
    return np.where(np.isin(np.arange(len(matrix)), list(rows))[:, None], matrix, 0.0)
