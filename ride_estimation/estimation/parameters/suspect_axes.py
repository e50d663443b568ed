# Copyright 2026 ride_estimation contributors
"""Horizontal axes on which a mount or its base sensor is wrong and neither can be isolated.

The vertical balance of the body distinguishes a changed mount from a faulty base sensor. In the plane nothing does: frames that
bend and brackets that tilt resemble a wrong gain of one axis. What such a gain does is plain, though: the stiffness of its
mount falls or rises and the others make up for it, at once or, where it is there from the start, far from the file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.free_parameters import FreeParameter
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: distance from the file that is no chance, in standard deviations of the difference
_FAR = 3.5
#: the same from what was before a sudden change
_MOVED = 3.0


def suspect_axes(
    geometry: Geometry, free_parameters: Sequence[FreeParameter], now: tuple[Array, Array], before: tuple[Array, Array] | None
) -> dict[int, str]:
    """Return what is said of every suspect axis, by its index.

    Parameters
    ----------
    geometry
        Mounts and base sensors.
    free_parameters
        The N multipliers.
    now
        Their logarithms and standard deviations, shapes (N,).
    before
        The same before the first sudden change; None before one, then the file is what they are compared with.
    """
    if before is None:
        reference, std = np.zeros(len(free_parameters)), np.array([s.std for s in free_parameters])
        limit, how = _FAR, "is far from the file"
    else:
        (reference, std), limit, how = before, _MOVED, "changed suddenly"
    off = np.abs(now[0] - reference)
    far = off > limit * np.hypot(now[1], std)
    found = {}
    for axis in (0, 1):
        stiffness = [n for n, s in enumerate(free_parameters) if s.role == 0 and s.axis == axis]
        if not any(far[n] and geometry.base_sensors[free_parameters[n].mount] is not None for n in stiffness):
            continue
        most = free_parameters[max(stiffness, key=lambda n: float(off[n]))].mount
        sensor = geometry.base_sensors[most]
        found[axis] = (
            f"stiffness along {AXES[axis]} {how}, most at {geometry.mounts[most].name}: this mount, or its base sensor"
            f"{'' if sensor is None else f' {sensor.name}'} along this axis; the data do not distinguish them"
        )
    return found
