# Copyright 2026 ride_estimation contributors
"""What the mounting of the sensors leaves uncertain of horizontal parameters, however long a run is.

A base accelerometer that is turned by epsilon takes part of the large vertical motion for horizontal motion of its bracket: an
error ``epsilon z`` of the deflection that no averaging removes. The sum over the mounts hardly feels it; how the sum is split
among them is told by the deformation of the frame only, often a few hundredths of a millimetre, and is off by about
``epsilon rms(z) / rms(deformation)``. Stiffness goes with deflections, damping with rates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.arrangement import Arrangement

Array = NDArray[np.float64]

#: standard deviation of the angle at which a sensor is mounted [rad]: a tenth of a degree, on a machined face
_ANGLE = np.radians(0.1)
#: smallest deformation and rigid motion that count as such, share of the vertical motion: less is certainly not told
_LEAST = 1e-6


class MountingDoubt:
    """Follows how much the mounts move and states what the mounting of the sensors may hide.

    Parameters
    ----------
    arrangement
        Body and mounts.
    """

    def __init__(self, arrangement: Arrangement) -> None:
        wrench = arrangement.wrench[arrangement.free]
        self._rigid = np.linalg.pinv(wrench) @ wrench
        self._count = len(arrangement.mounts)
        #: sums of squares of deflection and rate (first index): whole, rigid and deforming part (second), shape (2, 3, M, 3)
        self._square = np.zeros((2, 3, self._count, 3))

    def observe(self, deflection: Array, rate: Array) -> None:
        """Add ticks, shape (K, M, 3) each."""
        for role, signal in enumerate((deflection, rate)):
            flat = signal.reshape(len(signal), -1)
            rigid = flat @ self._rigid.T
            for part, values in enumerate((flat, rigid, flat - rigid)):
                self._square[role, part] += np.sum(values**2, axis=0).reshape(self._count, 3)

    def std(self) -> Array:
        """Return the standard deviation of the logarithm of every stiffness and damping, shape (2, M, 3); zero for z."""
        total = np.sqrt(self._square.mean(axis=2))
        out = np.zeros((2, self._count, 3))
        for role in range(2):
            error = _ANGLE * total[role, 0, 2]
            if error <= 0.0:
                continue
            floor = _LEAST * total[role, 0, 2]
            common = error / np.sqrt(self._count) / np.maximum(total[role, 1, :2], floor)
            split = error / np.maximum(total[role, 2, :2], floor)
            out[role, :, :2] = np.hypot(common, split)
        return out

    def save(self) -> list[Any]:
        """Return the sums as plain lists."""
        return list(self._square.tolist())

    def load(self, saved: list[Any]) -> None:
        """Continue from :meth:`save`."""
        self._square = np.array(saved, dtype=float).reshape(self._square.shape)
