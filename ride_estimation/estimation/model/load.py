# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not contain: how it strains the mounts at rest, and what tells its mass.

Accelerations of a body on a moving base tell k/m, c/m, J/m and the CG, and never m: a heavier cab on stiffer mounts moves alike.
A CG beyond its standard deviation is a load at an unknown place, or a wrong CG in the file. Three things tell its mass: where it
can lie, what the file states of the stiffness of the mounts, and the static travel where transducers measure it.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: largest share that is reckoned with
_LARGEST = 0.5
#: probability that a load was taken away and not put on
_TAKEN_AWAY = 0.1
#: points of the integral over the mass
_POINTS = 400
#: least standard deviation of ln k that is believed
_LEAST_SPREAD = 0.01


def _nothing() -> Array:
    return np.zeros(3)


@dataclasses.dataclass(frozen=True)
class Load:
    """Mass of a load over that of the body in the vehicle file.

    Attributes
    ----------
    share, std
        Mean and standard deviation, zero where the CG is where the file states it.
    presence
        Probability that there is a load and not a wrong CG in the file.
    sinks, leans
        How it moves the body at rest: at a point ``centre`` [m], and its rotation about that [rad], shape (3,) each; zero where
        air springs level the body, and where the CG in the file is wrong.
    centre
        Between the mounts, shape (3,) [m].
    """

    share: float = 0.0
    std: float = 0.0
    presence: float = 0.0
    sinks: Array = dataclasses.field(default_factory=_nothing)
    leans: Array = dataclasses.field(default_factory=_nothing)
    centre: Array = dataclasses.field(default_factory=_nothing)

    @property
    def leaning(self) -> bool:
        """Return whether the body leans by it."""
        return bool(np.any(self.leans))

    @functools.cached_property
    def _turn(self) -> Rotation:
        return Rotation.from_rotvec(self.leans)

    def moved(self, point: Array) -> Array:
        """Return where a point of the body (3,) is with the load, in axes of the brackets."""
        return np.asarray(self.centre + self.sinks + self._turn.apply(point - self.centre))

    def own(self, point: Array) -> Array:
        """Return where a point of the body (3,) is without the load, in axes of the body: the inverse of :meth:`moved`."""
        return np.asarray(self.centre + self._turn.inv().apply(point - self.sinks - self.centre))

    def moved_sensor(self, sensor: Sensor) -> Sensor:
        """Return a sensor of the body where the load has moved it."""
        rotation = self._turn.as_matrix() @ sensor.rotation
        return dataclasses.replace(sensor, position=self.moved(sensor.position), rotation=rotation)

    def in_body_axes(self, vectors: Array) -> Array:
        """Return vectors (..., 3) in axes of the body from those in axes of the brackets."""
        return np.asarray(vectors @ self._turn.as_matrix())


@dataclasses.dataclass(frozen=True)
class LoadEvidence:
    """What tells the mass of a load.

    Attributes
    ----------
    offset
        Of the CG from the file, shape (3,) [m].
    least_share
        Share of the mass that a load at the edge of the mounts has.
    log_stiffness, stiffness_std
        Mean of ln k over the file's, for the mass of the file, and standard deviation of what the file states of it.
    motion
        Of the body at rest by the load, as :func:`moved_by_load` returns it, shape (6, 2).
    cg, centre
        Where that motion is stated, and a point between the mounts, shape (3,) each [m].
    points
        From the motion of the body to the travel of the transducers, shape (T, 6).
    travel, travel_std
        Static travel of the transducers and standard deviation of their zero, shape (T,) [m].
    ratio
        Mass of the file over the present one as something else tells it, and its standard deviation.
    """

    offset: Array
    least_share: float
    log_stiffness: float
    stiffness_std: float
    motion: Array
    cg: Array
    centre: Array
    points: Array
    travel: Array
    travel_std: Array
    ratio: tuple[float, float] = (1.0, np.inf)

    @classmethod
    def of_accelerations(
        cls, offset: Array, least_share: float, stiffness: tuple[float, float], ratio: tuple[float, float] = (1.0, np.inf)
    ) -> LoadEvidence:
        """Return the evidence where nothing is known of how the body stands; ``stiffness`` as :func:`of_delivery` returns it."""
        nothing = np.zeros(0)
        return cls(
            offset, least_share, *stiffness, np.zeros((6, 2)), np.zeros(3), np.zeros(3), np.zeros((0, 6)), nothing, nothing, ratio
        )

    def load(self, leans: bool) -> tuple[Load, float]:
        """Return the mass and the negative logarithm of the likelihood of what tells it and of the offset of the CG.

        A load lies anywhere over the area between the mounts, so the density of a CG that is off by so much falls with the
        square of the share; one time in ten it was taken away. A body that does not lean may carry one too, on air springs that
        level it: that and a wrong CG have even odds.

        Parameters
        ----------
        leans
            Whether the body stands as a load on springs moves it.
        """
        place = np.linspace(1.0, min(self.least_share / _LARGEST, 1.0), _POINTS)
        share = np.concatenate([[0.0], self.least_share / place, -self.least_share / (1.0 + self.least_share) / place])
        odds = 0.5 * np.repeat([1.0, (1.0 - _TAKEN_AWAY) / _POINTS, _TAKEN_AWAY / _POINTS], [1, _POINTS, _POINTS])
        score = ((self.log_stiffness + np.log1p(share)) / self.stiffness_std) ** 2
        score += ((self.ratio[0] - 1.0 / (1.0 + share)) / self.ratio[1]) ** 2
        travel = np.zeros((len(self.travel), len(share)))
        if leans:
            odds[0] = 0.0
            travel = self.points @ ((np.outer(self.motion[:, 0], share) + self.motion[:, 1:]) / (1.0 + share))
        score += np.sum(((self.travel[:, None] - travel) / self.travel_std[:, None]) ** 2, axis=0)
        least = float(score.min())
        weight = odds * np.exp(-0.5 * (score - least))
        # density of an offset by a load of any share up to the largest
        density = self.least_share / (_LARGEST * np.pi * float(np.sum(self.offset[:2] ** 2)))
        unlikely = 0.5 * least - float(np.log(weight.sum() * density))
        weight /= weight.sum()
        mean = float(weight @ share)
        load = Load(mean, float(np.sqrt(weight @ (share - mean) ** 2)), float(1.0 - weight[0]))
        if not leans:
            return load, unlikely
        motion = self.motion @ np.array([mean, 1.0]) / (1.0 + mean)
        sinks = motion[:3] + np.cross(motion[3:], self.centre - self.cg)
        return dataclasses.replace(load, sinks=sinks, leans=motion[3:], centre=self.centre), unlikely


def of_delivery(change: Array, std: Array) -> tuple[float, float]:
    """Return the mean of ln k over the file's of some mounts and its standard deviation, zero and infinity without any.

    A delivery of mounts is soft or stiff as a whole: its error is not less in the mean.

    Parameters
    ----------
    change, std
        Of every mount, and standard deviation of what the file states, shape (M,) each.
    """
    if not len(change):
        return 0.0, np.inf
    return float(np.mean(change)), max(float(np.sqrt(np.mean(std**2))), _LEAST_SPREAD)


def moved_by_load(points: Array, stiffness: Array, offset: Array, weight: float) -> Array:
    """Return what moves a body at rest: per share of a load, and by its place, shape (6, 2) [m, rad].

    A load of a share s of the mass moves it by ``(first column * s + second) / (1 + s)``: its weight pushes down, and the weight
    without it is no longer above the CG.

    Parameters
    ----------
    points
        P, from rigid motion at the CG with the load to the motion of the mounts, shape (3 M, 6).
    stiffness
        For the mass without the load, shape (3 M,) [N/m].
    offset
        Of the CG by the load, shape (3,) [m].
    weight
        Without the load [N].
    """
    down = np.array([0.0, 0.0, -weight])
    wrench = np.column_stack([np.append(down, np.zeros(3)), np.append(np.zeros(3), np.cross(offset, down))])
    return np.asarray(np.linalg.solve(points.T @ (stiffness[:, None] * points), wrench))


def static_with_load(
    points: Array, stiffness: Array, offset: Array, weight: float, static: Array, share: float
) -> Array:
    """Return the static forces with a load over one and its share, in axes of the brackets, shape (M, 3) [N].

    Parameters
    ----------
    points, stiffness, offset, weight
        As in :func:`moved_by_load`.
    static
        Forces without the load, which carry the weight at the CG without it, shape (M, 3) [N].
    share
        Of the load.
    """
    motion = moved_by_load(points, stiffness, offset, weight) @ np.array([share, 1.0]) / (1.0 + share)
    return np.asarray(static / (1.0 + share) - (stiffness * (points @ motion)).reshape(static.shape))
