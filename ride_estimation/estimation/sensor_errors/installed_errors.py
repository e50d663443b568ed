# Copyright 2026 ride_estimation contributors
"""Errors of installed accelerometers as columns of the force balance.

A sensor whose gains are off by g, whose axes are turned by epsilon, that lies p beside its place and is late by tau reads ``a
+ (diag(g) + [epsilon]x) a + alpha x p - tau a'``. At a base that hides a deflection, the same of the base's motion, which the
mount turns into a force. What all sensors of the body have in common moves the measured body by ``D z``, ``D = H^+ E H`` with
H the readings of a rigid body and E what the error makes of them; the body that is late as a whole is bases that are early.
No error is estimated here; all are considered (Schmidt, in Jazwinski, Stochastic Processes and Filtering Theory, 8.4): what
of a run looks like them decides how uncertain they leave stiffness and damping.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.sensor_errors.lean import Lean, LeanOfBases
from ride_estimation.frames import skew
from ride_estimation.sensors.installation import pooled

Array = NDArray[np.float64]

_AXES = np.eye(3)
#: what a unit of every error makes of acceleration and angular acceleration at a sensor, (3, 6) each: rotations about x, y, z,
#: gains along them, positions
_TURNS = [np.hstack([skew(axis), np.zeros((3, 3))]) for axis in _AXES]
_GAINS = [np.hstack([np.diag(axis), np.zeros((3, 3))]) for axis in _AXES]
_PLACES = [np.hstack([np.zeros((3, 3)), -skew(axis)]) for axis in _AXES]
#: motion of body or bases: displacement, rate and acceleration, shape (K, 6) or (K, 3 M) each
Motion = tuple[Array, Array, Array]


class InstalledErrors:
    """Columns and standard deviations of the errors of the accelerometers at body and bases.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    judged
        Horizontal axes of base sensors, 3 times the mount plus 0 or 1, whose gain is tested elsewhere: their columns come last.

    Attributes
    ----------
    count
        Number of errors E: of the body nine and its delay, then those of the bases.
    mount
        Mount of every error of a base, shape (B,): of every base sensor three rotations, its vertical gain, three positions and
        its delay, then ``judged``.
    """

    def __init__(self, geometry: Geometry, judged: tuple[int, ...]) -> None:
        self._geometry, self._judged = geometry, judged
        #: mounts that have a sensor at their base, and how well it is installed
        self._bases = {i: s.stated_installation for i, s in enumerate(geometry.base_sensors) if s is not None}
        self._body = pooled([s.stated_installation for s in geometry.body_sensors])
        self._many = max(len(geometry.body_sensors), 1)
        arms = [s.position - np.asarray(geometry.body.cg) for s in geometry.body_sensors]
        at = np.array([np.vstack([np.hstack([np.eye(3), -skew(r)]), np.eye(6)[3:]]) for r in arms]).reshape(-1, 6, 6)
        fit = np.linalg.pinv(at[:, :3].reshape(-1, 6)).reshape(6, -1, 3)
        #: how every error that all sensors of the body have moves it, shape (9, 6, 6)
        self._moved = np.array([np.einsum("zsa,ab,sbw->zw", fit, p, at) for p in _TURNS + _GAINS + _PLACES])
        self._moved *= geometry.free[:, None]
        self._from_points = np.linalg.pinv(geometry.wrench.T)
        late = [np.hstack([np.zeros((3, 6)), -np.eye(3)])]
        own = [np.hstack([p, np.zeros((3, 3))]) for p in _TURNS + _GAINS[2:] + _PLACES] + late
        self.mount = np.array([i for i in self._bases for _ in own] + [place // 3 for place in judged], dtype=np.int64)
        gains = [np.hstack([_GAINS[place % 3], np.zeros((3, 3))]) for place in judged]
        #: what every error of a base makes of displacement, rotation and rate there, shape (B, 3, 9)
        self._pattern = np.array(own * len(self._bases) + gains).reshape(-1, 3, 9)
        self._pattern *= geometry.base_observable[self.mount][:, :, None]
        self._late = np.flatnonzero(self._pattern[:, :, 6:].any(axis=(1, 2)))
        self.count = len(self._moved) + 1 + len(self.mount)
        self._leans = LeanOfBases(geometry)
        #: constant horizontal readings of the bases and their variance, as :meth:`LeanOfBases.of` takes them, None before any
        self.constant: tuple[Array, Array] | None = None

    def body_motion(self, deflection: Array, base: Array) -> Array:
        """Return the motion of the body, (K, 6), of deflections and motions of the bases, (K, 3 M) each."""
        return np.asarray((deflection + base) @ self._from_points.T)

    def columns(
        self, body: tuple[Array, Array], base: Motion, measured: Array, push: Array, stiffness: Array, damping: Array
    ) -> Array:
        """Return the acceleration by the mounts less the measured one per unit of every error, shape (K, 6, E).

        Parameters
        ----------
        body
            Displacement and rate, shape (K, 6) each.
        base
            Of the bases, shape (K, 3 M) each.
        measured
            Acceleration that the mounts cause, shape (K, 6).
        push
            Acceleration per unit tension, shape (6, 3 M).
        stiffness, damping
            Shape (M, 3).
        """
        own, found = len(self._moved), np.zeros((len(measured), 6, self.count))
        hidden, pushed = np.zeros((len(self.mount), len(measured), 6)), push.reshape(6, -1, 3).transpose(1, 0, 2)[self.mount]
        for role, law in enumerate((stiffness, damping)):
            maps = (push * law.ravel()) @ self._geometry.wrench.T @ self._moved
            found[:, :, :own] -= np.einsum("kz,erz->kre", body[role], maps)
            hidden += np.matmul(pushed * law[self.mount, None], self.hidden(base, role)).transpose(0, 2, 1)
        found[:, :, :own] += np.einsum("kz,erz->kre", measured, self._moved)
        found[:, :, own] = -hidden[self._late].sum(axis=0)
        found[:, :, own + 1 :] = hidden.transpose(1, 2, 0)
        return found

    def hidden(self, base: Motion, role: int) -> Array:
        """Return the deflection (``role`` 0) or its rate (1) that a unit of every error of a base hides, shape (B, 3, K)."""
        moved, faster = (base[role + i].reshape(len(base[0]), -1, 3) for i in (0, 1))
        turned = np.broadcast_to((base[role] @ self._from_points[3:].T)[:, None], moved.shape)
        at = np.concatenate([moved, turned, faster], axis=2)[:, self.mount]
        return np.asarray(np.matmul(self._pattern, at.transpose(1, 2, 0)))

    @property
    def lean(self) -> Lean:
        """Return how far the base sensors lean."""
        return self._leans.stated if self.constant is None else self._leans.of(*self.constant)

    @property
    def std(self) -> Array:
        """Return the standard deviation of every error, shape (E,)."""
        body, lean = self._body, self.lean
        # a lean along y is a rotation about x
        turned = np.maximum(body.misalignment, np.sqrt(self._many) * np.append(np.abs(lean.common[::-1]), 0.0))
        own = np.append(turned, [body.gain] * 3 + [body.position] * 3 + [body.delay]) / np.sqrt(self._many)
        return np.append(own, self.std_of_bases)

    @property
    def std_of_bases(self) -> Array:
        """Return the standard deviation of every error of the bases, shape (B,)."""
        found, lean = list[float](), self.lean
        for i, own in self._bases.items():
            found += [*lean.std[i, ::-1], own.misalignment, own.gain, *[own.position] * 3, own.delay]
        return np.array([*found, *(self._bases[place // 3].gain for place in self._judged)])
