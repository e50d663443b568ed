# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not know, from how far it makes the body lean on its mounts.

Where accelerometers are the only sensors, gravity shows how far the bases lean together against the body. A load that moves
the CG by d turns it by ``theta = [(G K G^T)^-1 (d x m g)]``: soft mounts make a large angle of a load that innovations hardly
show. A slope or a long bend leans it too, ``-(G K G^T)^-1 m f`` with the mean specific force f that the body reads: that is
taken off. A body that was not set level, or sensors that are turned together by more than they state, lean alike: with even
odds between these the CG is off by ``d / 2 +- d / 2``, and so are the forces.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: share of the bodies without a load that lean by less, at first (three standard deviations) and while one does
_CERTAINLY, _STILL = 0.9973, 0.99
#: time before anything is stated [s]
_LEAST_TIME = 10.0
#: memory [s]
_MEMORY = 120.0
#: attributes that are part of a saved state
_SAVED = ("_mean", "_force", "_time", "_leans")


@dataclasses.dataclass(frozen=True)
class Leaning:
    """A body that leans.

    Attributes
    ----------
    angle
        About x and y against the bases, without what slope, bends and braking explain, shape (2,) [rad].
    offset, std
        Where a load that makes it lean so would move the CG, and its standard deviation, shape (3,) each [m].
    """

    angle: Array
    offset: Array
    std: Array

    def in_words(self) -> str:
        """Return what the person in the field should know."""
        about = ", ".join(f"{a} {v:+.1f}" for a, v in zip(AXES, np.degrees(self.angle)))
        off = ", ".join(f"{a} {v:+.0f} +- {s:.0f} mm" for a, v, s in zip(AXES, 1e3 * self.offset[:2], 1e3 * self.std[:2]))
        return (
            f"leans against its mount bases (degrees about {about}), more than its sensors may err. Cause: a payload, which "
            f"would move the CG by {off}, a body that was not set level, or sensors turned together. Forces are stated for "
            "either; weigh the body, and where it carries nothing calibrate at standstill"
        )


class BodyLean:
    """Running mean of how far all bases lean against the body.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self._possible = geometry.has_base_motion and bool(geometry.free.all())
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._mean, self._time, self._leans = np.zeros(2), 0.0, False
        self._force = np.array([0.0, 0.0, self._geometry.vehicle.gravity])

    def observe(self, base: Array, force: Array, duration: float) -> None:
        """Add mean readings.

        Parameters
        ----------
        base, force
            Specific force of the bases, axes of the brackets, (M, 3), and of the body, (3,) [m/s^2].
        duration
            [s].
        """
        if not self._possible:
            return
        self._time += duration
        share = max(duration / self._time, min(duration / _MEMORY, 1.0))
        # a lean along y is a rotation about -x
        x, y, _ = (np.median(base, axis=0) - force) / self._geometry.vehicle.gravity
        turned = np.array([-y, x])
        self._mean = self._mean + share * (turned - self._mean)
        self._force = self._force + share * (force - self._force)

    def found(self, stiffness: Array, std: Array) -> Leaning | None:
        """Return how the body leans, None while its sensors explain it.

        Parameters
        ----------
        stiffness
            Of the mounts, shape (M, 3) [N/m].
        std
            Standard deviation of the lean along x and y that sensors leave, shape (2,) [rad].
        """
        if self._time < _LEAST_TIME:
            return None
        variance = std[::-1] ** 2
        g, gravity = self._geometry, self._geometry.vehicle.gravity
        # rotations by a specific force along x, y and z, and by a CG off along x and y
        moved = np.zeros((6, 5))
        moved[:3, :3], moved[3, 4], moved[4, 3] = np.eye(3), gravity, -gravity
        turned = -g.body.mass.value * np.linalg.solve((g.wrench * stiffness.ravel()) @ g.wrench.T, moved)[3:5]
        angle = self._mean - turned[:, :3] @ (self._force - [0.0, 0.0, gravity])
        bound = stats.chi2.ppf(_STILL if self._leans else _CERTAINLY, 2)
        self._leans = bool(np.sum(angle**2 / np.maximum(variance, 1e-300)) > bound)
        if not self._leans:
            return None
        place = np.linalg.inv(turned[:, 3:])
        spread = np.sqrt(place**2 @ variance)
        return Leaning(angle, np.append(place @ angle, 0.0), np.append(spread, 0.0))

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return fields_of(self, _SAVED)

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)
