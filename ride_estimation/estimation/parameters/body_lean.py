# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not know, from how far it makes the body lean on its mounts.

Where accelerometers are the only sensors, gravity shows how far the bases lean together against the body. A load that moves
the CG by d turns it by ``theta = [(G K G^T)^-1 (d x m g)]``: soft mounts make a large angle of a load that innovations hardly
show. A body that was not set level, or sensors that are turned together by more than they state, lean alike: with even odds
between these the CG is off by ``d / 2 +- d / 2``, and so are the forces.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.sensor_errors.lean import Lean
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: probability that a body leans by more than its sensors may err, at first and while it does
_CERTAINLY, _STILL = 1.0 - 1e-3, 0.99
#: time before anything is stated [s]
_LEAST_TIME = 10.0
#: memory [s]: bends and slopes of the road are shorter
_MEMORY = 120.0
#: time over which a lean in a bend lasts [s]
_LASTS = 10.0
#: attributes that are part of a saved state
_SAVED = ("_mean", "_square", "_time", "_leans")


@dataclasses.dataclass(frozen=True)
class Leaning:
    """A body that leans.

    Attributes
    ----------
    angle
        About x and y against the bases, shape (2,) [rad].
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
        self._mean, self._square, self._time, self._leans = np.zeros(2), np.zeros(2), 0.0, False
        self._std = np.zeros(2)

    def observe(self, lean: Lean, duration: float) -> None:
        """Add what the bases lean now, for ``duration`` [s]."""
        self._time += duration
        share = max(duration / self._time, min(duration / _MEMORY, 1.0))
        # a lean along y is a rotation about -x
        turned = np.array([-lean.common[1], lean.common[0]])
        self._mean = self._mean + share * (turned - self._mean)
        self._square = self._square + share * (turned**2 - self._square)
        self._std = lean.common_std[::-1]

    def found(self, stiffness: Array) -> Leaning | None:
        """Return how the body leans, None while its sensors explain it; ``stiffness`` of the mounts, shape (M, 3) [N/m]."""
        if not self._possible or self._time < _LEAST_TIME:
            return None
        scatter = np.maximum(self._square - self._mean**2, 0.0) / max(min(self._time, _MEMORY) / _LASTS, 1.0)
        variance = self._std**2 + scatter
        bound = stats.chi2.ppf(_STILL if self._leans else _CERTAINLY, 2)
        self._leans = bool(np.sum(self._mean**2 / np.maximum(variance, 1e-300)) > bound)
        if not self._leans:
            return None
        wrench, weight = self._geometry.wrench, self._geometry.body.mass.value * self._geometry.vehicle.gravity
        moments = np.zeros((6, 2))
        moments[3, 1], moments[4, 0] = -weight, weight
        turned = np.linalg.solve((wrench * stiffness.ravel()) @ wrench.T, moments)[3:5]
        place = np.linalg.inv(turned)
        spread = np.sqrt(place**2 @ variance)
        return Leaning(self._mean, np.append(place @ self._mean, 0.0), np.append(spread, 0.0))

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return fields_of(self, _SAVED)

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)
