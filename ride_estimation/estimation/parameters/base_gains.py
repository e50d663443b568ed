# Copyright 2026 ride_estimation contributors
"""Base sensors that read horizontal motion too large or too small, shown by the body that the mounts carry.

Such an error looks like a deformed frame to the other bases and like a softer mount to the size of the forces, but not to their
history: below its resonance w0 a mount bends by ``a / w0^2``, its base moves by ``a / w^2``. So the innovations of the simulated
body are asked for it: a gain g of one axis adds ``g (k X + c V)`` to the tension of its mount, X and V the motion of the base
through the filters of the deflection. Every such column is judged by a score test with all parameters fitted anew about the
vehicle file. Mounts side by side have the same lever: a sensor that explains nearly as much is named too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.parameters.interval import IntervalMemory
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: intervals that are evaluated: about five seconds
RECENT = 10
#: least number that shows how far they agree
_ENOUGH = 8
#: gain that the noise of the bases, which their readings multiply, leaves [-]; 0.03 at most in a dozen drawn cabs
_NOISE = 0.02
#: gain over its standard deviation from which on it is an error; 1.4 at most in a dozen drawn cabs without one
_BEGINS = 3.0
#: the same down to which it stays one
_ENDS = 2.0
#: share of what the best explains that makes another sensor a rival
_RIVAL = 0.5


class BaseGains:
    """Judge the gains of the horizontal axes of the base sensors of a body.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    possible
        Whether deflections follow from the bases at all.
    """

    def __init__(self, geometry: Geometry, possible: bool) -> None:
        whole = possible & geometry.free[:2] & geometry.base_observable[:, :2].all(axis=0)
        judged = {
            3 * i + axis: sensor.name
            for i, (mount, sensor) in enumerate(zip(geometry.mounts, geometry.base_sensors)) for axis in (0, 1)
            if sensor is not None and sensor.triaxial and AXES[axis] in mount.elements and whole[axis]
        }  # fmt: skip
        #: axes that are judged, 3 times the mount plus 0 or 1
        self.places, self._names = tuple(judged), tuple(judged.values())
        #: variance of the force of every mount that such an error leaves, shape (M, 3) [N^2]
        self.force_variance = np.zeros((len(geometry.mounts), 3))
        self._tolerance = math.hypot(_NOISE, geometry.tolerated_cross_sensitivity)
        #: what is said of an axis of the mounts, by its index
        self.suspects: dict[int, str] = {}

    def judge(self, memory: IntervalMemory, theta: Array, prior_std: Array, first: int, force_square: Array) -> None:
        """Test the gains over the last intervals.

        Parameters
        ----------
        memory
            Intervals with the gains among what is considered.
        theta, prior_std
            Parameters and their standard deviations before anything was learned, shape (N,).
        first
            Index of the first gain among what is considered.
        force_square
            Mean squared force per unit gain of every axis that is judged, shape (S,) [N^2].
        """
        if memory.length < _ENOUGH or not self.places:
            return
        self.force_variance[:] = 0.0
        found, std, drop = memory.judge_considered(theta, prior_std, first, RECENT)
        sure = np.abs(found) / np.hypot(std, self._tolerance)
        best = int(np.argmax(drop))
        axis = self.places[best] % 3
        if sure[best] <= (_ENDS if axis in self.suspects else _BEGINS):
            self.suspects = {}
            return
        meant = [n for n in np.argsort(-drop).tolist() if drop[n] > _RIVAL * drop[best]]
        axes = np.array(self.places)[meant]
        self.force_variance.reshape(-1)[axes] = (found[meant] ** 2 + std[meant] ** 2) * force_square[meant]
        self.suspects = {axis: _words([(self._names[n], float(found[n])) for n in meant], AXES[axis])}


def _words(meant: Sequence[tuple[str, float]], axis: str) -> str:
    (name, gain), *others = meant
    either = "".join(f", or {other} {1.0 + its:.2f} times" for other, its in others)
    return (
        f"{name} reads {1.0 + gain:.2f} times the motion of its mount base along {axis}{either}, judged by the motion of "
        "the body: check gain and wiring"
    )
