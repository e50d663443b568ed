# Copyright 2026 ride_estimation contributors
"""What mounting and noise of the base sensors leave uncertain of horizontal parameters, however long a run is.

A base accelerometer that is turned by epsilon takes part of the large vertical motion z for horizontal motion of its bracket: an
error ``epsilon z`` of the deflection that no averaging removes. The sum over the mounts hardly feels it; how the sum is split
among them follows from the deformation d of the frame only, often a few hundredths of a millimetre. The stiffness of a split is
off by up to ``epsilon z / d`` and its damping by ``epsilon z' / d'`` or, as far as z goes along with d', by
``r epsilon k z / (c d')`` (rms values). r is their correlation: a frame that bends with the motion has one, and N independent
values of a run leave it ``1 / sqrt(N)``.

epsilon is what the installation of the sensor states (standard deviation s) and gravity shows: a sensor that leans reads
``epsilon g`` all the time, and so does one with a bias (b). Of a mean reading ``r g`` the share ``w = s^2 / (s^2 + (b / g)^2)``
is lean, with the standard deviation ``s sqrt(1 - w)``. In the sum is how far the mean of M base sensors leans against that of B
sensors of the body: by ``epsilon sqrt(1 / M + 1 / B)`` or, where that is more, by what gravity shows.

Of the vertical stiffnesses rigid motion determines six sums, those over ``k {1, x, y, x^2, x y, y^2}``: all there is with three
or four mounts. Of five and more a split is left (two rows of three: by ``x^2 y``) that only the deformation shows, with gains
and angles of the sensors as epsilon.

A sensor whose gain is off by g, at the body or at a base, makes an error of g of force or deflection that no averaging removes
either. Motion of a base has any phase to the deflection: the stiffness is off by g, the damping by
``g sqrt(1 + (k d / c d')^2)``; where body and base move far more than the mount between them gives, as much more.

Of what looks like deformation, noise is a share lambda, and a split that noise alone shows is not observable: ``lambda`` times
the standard deviation of the vehicle file.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry, plate_fit
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.sensors.installation import Installation, pooled

Array = NDArray[np.float64]

#: pattern of vertical stiffnesses of which rigid motion determines this little, share of what it determines of equal ones
_UNOBSERVABLE = 0.25
#: independent values of the motion on the mounts per second: a resonance of one to two hertz, as wide as it is damped
_PER_SECOND = 2.0
#: smallest deformation and rigid motion that count as such, share of the vertical motion: less is certainly not observable
_LEAST = 1e-6
#: variance of deflection and rate over s^2 dt / w^3 and s^2 dt / w, from white relative acceleration of variance s^2 through
#: six sections s / (s + w): B(9/2, 3/2) / 2 pi and B(11/2, 1/2) / 2 pi
_NOISE = (0.013672, 0.123046)
#: attributes that are part of a saved state
_SAVED = ("_square", "_noisy", "_along", "_time", "_relative", "_weighed", "_vertical", "_lifted")


class InstallationUncertainty:
    """Follows how much the mounts move and states what the sensors at their bases may hide.

    Parameters
    ----------
    geometry
        Body and mounts.
    corner
        w of the sections deflections and rates were passed through [rad/s].
    """

    def __init__(self, geometry: Geometry, corner: float) -> None:
        wrench = geometry.wrench[geometry.free]
        self._rigid = np.linalg.pinv(wrench) @ wrench
        self._count, self._gravity = len(geometry.mounts), geometry.vehicle.gravity
        self._bases = pooled([s.stated_installation for s in geometry.base_sensors if s is not None])
        body = pooled([s.stated_installation for s in geometry.body_sensors])
        #: standard deviation of what a sensor wrongly takes for vertical motion, and of a gain, at the body or at a base
        self._share = max(self._bases.cross_sensitivity, body.cross_sensitivity)
        self._gain = max(self._bases.gain, body.gain)
        #: angle between the means of base sensors and sensors of the body, share of that of one sensor
        self._mean = np.sqrt(1.0 / max(self._count, 1) + 1.0 / max(len(geometry.body_sensors), 1))
        variance = np.array([s.noise_std**2 if s is not None else 0.0 for s in geometry.base_sensors])
        split = 1.0 - np.diag(self._rigid).reshape(self._count, 3)
        #: variance per tick that noise makes of the deforming part of deflection and rate, (2, M, 3)
        self._noise = np.array([share / corner**power for share, power in zip(_NOISE, (3, 1))])[:, None, None] * (
            variance[:, None] * split
        )
        #: share of every vertical stiffness in the splits that only the deformation shows, shape (M,)
        self._open = _unobservable_share(plate_fit(geometry.mounts)[0])
        self._time = 0.0
        #: sums of squares of deflection and rate (first index): whole, rigid and deforming part (second), shape (2, 3, M, 3)
        self._square = np.zeros((2, 3, self._count, 3))
        #: sums of products of vertical deflection, or its rate, and deforming rate along x and y, shape (2, M, 2)
        self._along = np.zeros((2, self._count, 2))
        #: sums of what noise makes of the deforming part, shape (2, M, 3)
        self._noisy = np.zeros((2, self._count, 3))
        #: sums of squares of the vertical acceleration relative to every base, shape (M,), and of the body's
        self._vertical, self._lifted = np.zeros(self._count), 0.0
        #: sum of the relative accelerations along x and y, shape (M, 2) [m s / s^2], and their time [s]
        self._relative, self._weighed = np.zeros((self._count, 2)), 0.0

    def observe(self, deflection: Array, rate: Array, dt: float) -> None:
        """Add deflections [m] and rates [m/s] of the mounts, shape (K, 3 M) each, at ticks of ``dt`` [s]."""
        for role, signal in enumerate((deflection, rate)):
            rigid = signal @ self._rigid.T
            for part, values in enumerate((signal, rigid, signal - rigid)):
                self._square[role, part] += np.sum(values**2, axis=0).reshape(self._count, 3)
        vertical = np.stack([deflection[:, 2::3], rate[:, 2::3]])
        self._along += np.einsum("rkm,kma->rma", vertical, (rate - rigid).reshape(-1, self._count, 3)[:, :, :2])
        self._noisy += len(deflection) * dt * self._noise
        self._time += len(deflection) * dt

    def weigh(self, relative: Array, vertical: Array, dt: float) -> None:
        """Add accelerations of the body against the bases (K, M, 3) and along z (K,) [m/s^2] at ticks of ``dt`` [s]."""
        self._vertical += dt * np.sum(relative[:, :, 2] ** 2, axis=0)
        self._lifted += dt * float(vertical @ vertical)
        self._relative += dt * relative[:, :, :2].sum(axis=0)
        self._weighed += len(relative) * dt

    def _angles(self) -> tuple[Array, Array]:
        """Return the angle a base sensor may lean by along x and y, and their mean against the body's, shape (2,) each [rad]."""
        lean = self._relative / (max(self._weighed, 1e-9) * self._gravity)
        common = lean.mean(axis=0)
        own = np.sqrt(lean_square(lean - common, self._bases, self._gravity))
        return own, np.maximum(own * self._mean, np.abs(common))

    def std(self, stiffness: Array, damping: Array, prior: Array) -> Array:
        """Return the standard deviation of the logarithm of every stiffness and damping, shape (2, M, 3).

        Parameters
        ----------
        stiffness, damping
            Of the mounts, shape (M, 3) [N/m, N s/m].
        prior
            Standard deviations of the vehicle file, shape (2, M, 3).
        """
        total = np.sqrt(self._square.mean(axis=2))
        out = np.zeros((2, self._count, 3))
        chance = 1.0 / np.sqrt(max(_PER_SECOND * self._time, 1.0))
        own, together = self._angles()
        for role in range(2):
            error = np.full((self._count, 2), total[role, 0, 2])
            if total[role, 0, 2] <= 0.0:
                # no motion seen yet: what only it shows is as uncertain as in the file
                out[role, :, :2], out[role, :, 2] = prior[role, :, :2], self._open * prior[role, :, 2]
                continue
            if role == 1:
                along = total[0, 0, 2] * stiffness[:, :2] / np.maximum(damping[:, :2], 1e-9)
                error = np.hypot(error, np.hypot(self._correlation(), chance) * along)
            floor = _LEAST * total[role, 0, 2]
            seen, noisy = (np.mean(a, axis=0) for a in (self._square[role, 2], self._noisy[role]))
            share = np.minimum(noisy / np.maximum(seen, 1e-300), 1.0)
            noise = share[:2]
            common = together * error / np.maximum(total[role, 1, :2], floor)
            split = own * error / np.maximum(total[role, 2, :2] * np.sqrt(1.0 - noise), floor)
            out[role, :, :2] = np.sqrt(common**2 + split**2 + (noise * prior[role, :, :2]) ** 2)
            wrong = self._share * total[role, 0, 2]
            if role == 1:
                wrong = np.hypot(wrong, chance * self._share * total[0, 0, 2] * stiffness[:, 2] / np.maximum(damping[:, 2], 1e-9))
            vertical = wrong / max(total[role, 2, 2] * np.sqrt(1.0 - share[2]), floor)
            out[role, :, 2] = self._open * np.hypot(vertical, share[2] * prior[role, :, 2])
        if not total[:, 0].all():
            return out
        gain = np.full((self._count, 3), self._gain)
        gain[:, 2] *= np.sqrt(np.maximum(self._lifted / np.maximum(self._vertical, 1e-300), 1.0))
        out[0] = np.hypot(out[0], gain)
        phase = stiffness * total[0, 0] / np.maximum(damping * total[1, 0], 1e-9)
        out[1] = np.hypot(out[1], gain * np.hypot(1.0, phase))
        return out

    def _correlation(self) -> Array:
        """Return how far vertical motion and deforming rate along x and y go together, shape (M, 2), noise taken off.

        A base moves with any phase to the deflection, so deflection and rate, which do not go together, share what it has.
        """
        real = np.maximum(self._square[1, 2, :, :2] - self._noisy[1, :, :2], _LEAST * self._square[1, 2, :, :2])
        size = np.sqrt(self._square[:, 0, :, 2:] * real)
        return np.asarray(np.minimum(np.linalg.norm(self._along / np.maximum(size, 1e-300), axis=0), 1.0))

    def save(self) -> dict[str, Any]:
        """Return the sums as plain lists."""
        return fields_of(self, _SAVED)

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)


def lean_square(lean: Array, installation: Installation, gravity: float) -> Array:
    """Return the mean square of the angle by which base sensors lean along x and y, shape (2,) [rad^2].

    Parameters
    ----------
    lean
        Mean horizontal readings beyond what all have in common, share of gravity, shape (M, 2).
    installation
        Of the sensors.
    gravity
        [m/s^2].
    """
    whole = installation.offset(gravity)
    share = (installation.misalignment * gravity / whole) ** 2 if whole else 0.0
    return np.asarray(np.mean((share * lean) ** 2, axis=0) + installation.misalignment**2 * (1.0 - share))


def _unobservable_share(place: Array) -> Array:
    """Return the share of each mount in the patterns of vertical stiffness that are not observable by rigid motion, shape (M,).

    Parameters
    ----------
    place
        Horizontal places of the mounts from their middle, shape (M, 2).
    """
    if not len(place):
        return np.zeros(0)
    x, y = (p / max(float(np.sqrt(np.mean(p**2))), 1e-12) for p in place.T)
    surface = np.column_stack([np.ones(len(place)), x, y, x * x, x * y, y * y])
    vectors, values, _ = np.linalg.svd(surface, full_matrices=False)
    kept = vectors[:, values > _UNOBSERVABLE * np.sqrt(len(place))]
    rest = 1.0 - np.sum(kept**2, axis=1)
    return np.asarray(np.sqrt(np.where(rest > 1e-9, rest, 0.0)))
