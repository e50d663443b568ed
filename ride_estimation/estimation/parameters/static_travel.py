# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not know, from how far it compresses the mounts: displacement transducers at all of them.

Zeros of the transducers are those of rest without the load. With u the file's mass over the present one, T the tension of the
mounts and W the weight for the file's mass, equilibrium of the means reads ``m_0 f + G T = u W`` and, about the CG of the file,
``m_0 d x f`` more on the left for a CG at an offset d: the vertical row gives u, the others d. Sideways forces follow from their
own sums, shared by stiffness. What is left uncertain are zeros, laws whose static stiffness is not the dynamic one and dampers
whose mean force is not zero while they move.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import mean_of_ticks
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.forces.mount_forces import share_by_stiffness
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.parameters.transducer_balance import transducers_suffice

Array = NDArray[np.float64]

#: standard deviation of the zero of a transducer [m]: set at rest
_ZERO_STD = 1e-3
#: relative standard deviation of a static stiffness over the dynamic one that driving shows
_STATIC_STIFFNESS_STD = 0.1
#: share of the mean size of damper forces that may be their mean: dampers whose two directions differ by a third
_RECTIFIED_STD = 0.15
#: relative standard deviation of the mean vertical reading of the body
_READING_STD = 0.003
#: memory [s]
_MEMORY = 10.0
#: time before anything is stated [s]
_LEAST_TIME = 5.0
#: standard deviations from which on it is a load
_CLEAR = 4.0
#: share of the mass from which on it is a load
_WORTH = 0.02
#: share of both below which it no longer is one
_STAYS = 0.5
#: standard deviations beyond which a load is excluded
_EXCLUDED = 3.0
#: smallest ratio of masses that a load can make, either way: beyond it the zeros are not those of rest
_POSSIBLE = 0.4
_ROWS = [2, 3, 4]


@dataclasses.dataclass(frozen=True)
class Load:
    """A load: logarithm of the present mass over the file's and offset of the CG, (3,) [m], with standard deviations."""

    log: float
    std: float
    offset: Array
    offset_std: Array


class StaticTravel:
    """Running mean of what the mounts carry beyond rest.

    Parameters
    ----------
    geometry
        Body, mounts, transducers.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = a = geometry
        self.possible = transducers_suffice(a) and bool(a.free[2])
        law = MountLaw(a)
        self._stiffness, self._damping = law.stiffness[:, 2], law.damping[:, 2]
        stiffness = np.maximum(law.stiffness, 0.0)
        stiffness[:, 2] = 0.0
        sideways = [r for r in (0, 1, 5) if a.free[r]]
        shared = np.zeros((6, 6))
        if sideways and stiffness.any():
            gain = share_by_stiffness(a.wrench[sideways], stiffness.ravel() + 1e-9 * float(stiffness.max()))
            shared[:, sideways] = a.wrench @ gain
        #: what of a wrench the vertical forces carry: heave, roll and pitch, (3, 6)
        self._vertical = (np.eye(6) - shared)[_ROWS]
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._mean, self._rectified = np.zeros(6), np.zeros(len(self._geometry.mounts))
        self._time, self._loaded = 0.0, False

    def observe(self, missing: Array, rate: Array, duration: float) -> None:
        """Add a block.

        Parameters
        ----------
        missing
            Wrench that the body needs beyond what law and rest of the mounts give, for the file's mass, shape (K, 6) [N, N m].
        rate
            Rates of deflection, shape (K, M) [m/s].
        duration
            [s].
        """
        self._time += duration
        share = max(duration / self._time, 1.0 - math.exp(-duration / _MEMORY))
        self._mean = self._mean + share * (mean_of_ticks(missing) - self._mean)
        self._rectified = self._rectified + share * (mean_of_ticks(np.abs(rate)) - self._rectified)

    @property
    def decided(self) -> bool:
        """Return whether it has been observed for long enough."""
        return self.possible and self._time >= _LEAST_TIME

    def ratio(self) -> tuple[float, float]:
        """Return the mass of the file over the present one and its standard deviation."""
        weight = float(self._geometry.weight[2])
        zero, rectified = float(np.linalg.norm(self._stiffness)), float(self._damping @ self._rectified)
        std = math.hypot(_ZERO_STD * zero, _RECTIFIED_STD * rectified, _READING_STD * weight) / weight
        return 1.0 + float(self._vertical[0] @ self._mean) / weight, std

    def excludes(self, share: float) -> bool:
        """Return whether a load of at least this share of the mass would show."""
        ratio, std = self.ratio()
        return self.decided and ratio - _EXCLUDED * std > 1.0 - share

    def found(self) -> Load | None:
        """Return the load, None while the means agree with the file."""
        a, (_, roll, pitch) = self._geometry, self._vertical @ self._mean
        ratio, std = self.ratio()
        least = max(_CLEAR * std, _WORTH) * (_STAYS if self._loaded else 1.0)
        self._loaded = least < abs(ratio - 1.0) and _POSSIBLE < ratio < 1.0 / _POSSIBLE
        if not self._loaded:
            return None
        own = a.body.mass.value * a.vehicle.gravity
        moment = (ratio - 1.0) * a.weight[3:5] - (roll, pitch)
        shown = a.free[[4, 3, 5]] * np.array([1.0, 1.0, 0.0])
        offset = shown * np.array([-moment[1], moment[0], 0.0]) / own
        zeros = _ZERO_STD * np.linalg.norm(self._stiffness[:, None] * a.arms, axis=0) / own
        spread = shown * np.hypot(zeros, _STATIC_STIFFNESS_STD * offset)
        return Load(-math.log(ratio), math.hypot(std, _STATIC_STIFFNESS_STD * (ratio - 1.0)) / ratio, offset, spread)

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return fields_of(self, ("_mean", "_rectified", "_time", "_loaded"))

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, ("_mean", "_rectified", "_time", "_loaded"), saved)
