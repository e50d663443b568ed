# Copyright 2026 ride_estimation contributors
"""Deflection of the mounts from the accelerations of a whole stretch: integrated with what came before and after.

The same steps as live (:mod:`deflection`, :mod:`frame_deformation`), with filters that look both ways (:mod:`zero_phase`):
vertical deflections tell how body and brackets tilt, gravity through that tilt is taken out of the horizontal accelerations, and
rigid relative motion and deformation of the frame, ``D = P D + Q D``, are filtered each for its own spectrum. What is of second
order (axes that turn, motion of the mounts on a body that turns) takes two rounds. Windows of half a minute follow spectra that
change along a run; they fade into each other.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.kinematics.deformation_spectrum import DeformationSpectrum
from ride_estimation.estimation.kinematics.frame_deformation import FrameDeformation
from ride_estimation.estimation.kinematics.frame_kernel import straighten
from ride_estimation.estimation.motion.motion_kernel import motion_at
from ride_estimation.estimation.sensor_errors.installation_uncertainty import lean_square
from ride_estimation.estimation.smoothing.zero_phase import EDGES, ZeroPhaseBank, zero_phase_bank
from ride_estimation.sensors.installation import pooled

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: distance of the centres of two windows, what a window reaches further than its neighbours' centres, its fade-out [s]
_HOP, _MARGIN, _TAPER = 12.0, 8.0, 2.0
#: silence after a window: a transform wraps around [s]
_SILENCE = 8.0
#: samples go into a spectrum in portions of so long [s]
_PORTION = 4.0
#: share of the twist's mean square its error must be below for its tilt to be taken out
_TRUSTED = 0.25
#: largest corner over the rate of the ticks
_RESOLVED = 0.05


@dataclasses.dataclass(frozen=True)
class _Choice:
    """Filter of one axis: error variance of the value [m^2], density of the motion [(m/s^2)^2/Hz], densities of the error of
    the value and of the value [m^2/Hz].
    """

    index: int
    variance: float
    signal: Array
    left: Array
    whole: Array


@dataclasses.dataclass(frozen=True)
class SmoothedDeflection:
    """Deflections of a stretch of N ticks.

    Attributes
    ----------
    value, rate
        Cab axes, shape (N, 3 M) [m, m/s].
    centre
        Middle of each window [s after the start], shape (W,).
    variance
        Error variance of a channel before projection: window, rigid motion or deformation, value or rate, axis; (W, 2, 2, 3).
    edge
        What is added at the distances :data:`EDGES` from start and end, by the first and the last window: (2, 2, 2, 3, E).
    duration
        [s].
    """

    value: Array
    rate: Array
    centre: Array
    variance: Array
    edge: Array
    duration: float

    def variance_at(self, time: float) -> Array:
        """Return the error variances at a time [s after the start], shape (2, 2, 3): rigid or deforming, value or rate, axis."""
        index = np.arange(len(self.centre))
        at = float(np.interp(time, self.centre, index))
        low = int(at)
        high = min(low + 1, len(index) - 1)
        found: Array = (1.0 - at + low) * self.variance[low] + (at - low) * self.variance[high]
        for side, distance in enumerate((time, self.duration - time)):
            if distance < EDGES[-1]:
                n = min(int(np.searchsorted(EDGES, max(distance, 0.0), side="right")), len(EDGES) - 1)
                share = (max(distance, 0.0) - EDGES[n - 1]) / (EDGES[n] - EDGES[n - 1])
                found = found + (1.0 - share) * self.edge[side, ..., n - 1] + share * self.edge[side, ..., n]
        return found


class DeflectionSmoother:
    """Smoother of one vehicle.

    Parameters
    ----------
    geometry
        Body and mounts, with an accelerometer at the base of every mount.
    frame
        Projector on deformation, and what tilt makes of it.
    maps
        From the stacked deflections to the rotation of the body relative to each bracket, (M, 3, 3 M).
    stiffness, damping
        Tangents of the mounts, shape (M, 3): what an error of value and rate costs.
    """

    def __init__(self, geometry: Geometry, frame: FrameDeformation, maps: Array, stiffness: Array, damping: Array) -> None:
        self._arms, self._gravity = geometry.arms, geometry.vehicle.gravity
        self._frame, self._maps = frame, maps
        self._cost = np.mean(stiffness**2, axis=0), np.mean(damping**2, axis=0)
        self._deforming = frame.projector
        self._rigid = np.eye(len(frame.projector)) - frame.projector
        self._installation = pooled([s.stated_installation for s in geometry.base_sensors if s is not None])
        self._base_variance = float(np.mean([s.noise_std**2 for s in geometry.base_sensors if s is not None]))

    def smooth(
        self, motion: Array, spin: Array, base: Array, frame_turn: Array, motion_variance: Array, dt: float
    ) -> SmoothedDeflection:
        """Integrate a stretch.

        Parameters
        ----------
        motion, spin
            Specific force and angular acceleration of the CG, shape (N, 6), and angular rate, shape (N, 3).
        base
            Specific force of the brackets in bracket axes, shape (N, 3 M) [m/s^2].
        frame_turn
            Rotation of the frame that the brackets do not make, shape (N, 3).
        motion_variance
            Noise variance of the body's motion at the mounts, shape (3,).
        dt
            Tick [s].
        """
        ticks = len(base)
        count = max(1, round(ticks * dt / _HOP))
        centre = (np.arange(count) + 0.5) * ticks / count
        value, rate = np.zeros(base.shape), np.zeros(base.shape)
        rows, edges = [], []
        margin = round(_MARGIN / dt)
        for i in range(count):
            start = 0 if i == 0 else int(centre[i - 1])
            end = ticks if i == count - 1 else int(centre[i + 1])
            low, high = max(start - margin, 0), min(end + margin, ticks)
            at = slice(low, high)
            inside = low > 0, high < ticks
            window = _Window(
                self, motion[at], spin[at], base[at], frame_turn[at], inside, centre[i] - low, motion_variance, dt
            )
            own = window.deflection()
            weight = np.interp(np.arange(start, end), centre, np.eye(count)[i])[:, None]
            value[start:end] += weight * own[0][start - low : end - low]
            rate[start:end] += weight * own[1][start - low : end - low]
            rows.append(window.variance)
            edges.append(window.edge)
        edge = np.stack([edges[0], edges[-1]])
        return SmoothedDeflection(value, rate, centre * dt, np.array(rows), edge, ticks * dt)


class _Window:
    """One window of :meth:`DeflectionSmoother.smooth`."""

    def __init__(
        self, smoother: DeflectionSmoother, motion: Array, spin: Array, base: Array, frame_turn: Array, inside: tuple[bool, bool],
        centre: float, motion_variance: Array, dt: float,
    ) -> None:  # fmt: skip
        self._s, self._dt, self._frame_turn, self._inside = smoother, dt, frame_turn, inside
        self._motion, self._spin = motion, spin
        #: spectra fade with a memory: the last sample they take lies so far after the middle that the middle counts most
        self._heard = round(centre + _MARGIN / dt)
        self._shape = (len(base), len(smoother._arms), 3)
        self._base = base.reshape(self._shape)
        self._size = fft.next_fast_len(len(base) + round(_SILENCE / dt), real=True)
        self._omega = 2.0 * np.pi * np.arange(self._size // 2 + 1) / (self._size * dt)
        quiet = smoother._base_variance
        self._white = 2.0 * dt * np.stack([quiet + motion_variance, np.full(3, quiet)])
        #: see :class:`SmoothedDeflection`
        self.variance, self.edge = np.zeros((2, 2, 3)), np.zeros((2, 2, 3, len(EDGES)))

    def _faded(self, relative: Array) -> Array:
        """Return relative accelerations (n, M, 3) without mean, faded out where the window ends inside the stretch, (n, 3 M)."""
        flat: Array = relative.reshape(len(relative), -1) - relative.reshape(len(relative), -1).mean(axis=0)
        fade = round(_TAPER / self._dt)
        rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(fade) + 0.5) / fade)[:, None]
        if self._inside[0]:
            flat[:fade] *= rise
        if self._inside[1]:
            flat[-fade:] *= rise[::-1]
        return np.asarray(flat)

    def _wrongly_read(self, apart: Array) -> Array:
        """Return the density of what a base sensor wrongly takes from the vertical motion of its bracket, shape (F, 3).

        It leans as its installation states and gravity shows beyond what all have in common; its gain is a little off.
        """
        flat = self._base.reshape(len(self._base), -1)
        vertical = self._measured(flat - flat.mean(axis=0), np.eye(flat.shape[1])).density[:, 2:]
        lean = apart[:, :, :2].mean(axis=0) / self._s._gravity
        own = lean_square(lean - lean.mean(axis=0), self._s._installation, self._s._gravity)
        return np.asarray(vertical * np.append(own, self._s._installation.gain**2))

    def _second_order(self, value: Array, rate: Array, turn: Array) -> Array:
        """Return what turning axes add to the relative acceleration, gravity apart, (n, M, 3).

        ``theta x (b - g) - theta x (theta x b) / 2 - 2 omega x D' - alpha x D - omega x (omega x D)``.
        """
        apart = self._base - np.array([0.0, 0.0, self._s._gravity])
        spin, turning = self._spin[:, None], self._motion[:, None, 3:]
        found = np.cross(turn, apart - 0.5 * np.cross(turn, self._base))
        return np.asarray(found - np.cross(spin, 2.0 * rate + np.cross(spin, value)) - np.cross(turning, value))

    def _spectrum(self, signals: Array) -> Complex:
        return np.asarray(fft.rfft(signals, self._size, axis=0))

    def _signals(self, spectrum: Complex) -> Array:
        return np.asarray(fft.irfft(spectrum, self._size, axis=0)[: self._shape[0]])

    def deflection(self) -> tuple[Array, Array]:
        """Return deflection and rate, shape (n, 3 M)."""
        s, slope = self._s, 1j * self._omega[:, None]
        apart = np.empty(self._shape)
        motion_at(self._motion, self._spin, s._arms, apart)
        apart -= self._base
        self._wrong = self._wrongly_read(apart)
        relative = self._faded(apart)
        motion, turn = self._rigid_motion(relative)
        value, rate = (self._signals(x).reshape(self._shape) for x in (motion, slope * motion))
        against = np.einsum("iab,nb->nia", s._maps, value.reshape(len(value), -1)) + self._frame_turn[:, None]
        relative = self._faded(apart + self._second_order(value, rate, against))
        motion, turn = self._rigid_motion(relative)
        # strain by finite rotations, with the mean rotation against the frame
        spin, spin_rate = self._signals(turn), self._signals(slope * turn)
        flat, second_order, second_order_rate = (np.empty(relative.shape) for _ in range(3))
        straighten(
            relative.reshape(self._shape), spin, spin_rate, s._maps.mean(axis=0), s._arms, flat, second_order, second_order_rate
        )
        deforming = self._deformation(flat @ s._deforming.T)
        total = motion @ s._rigid.T + deforming @ s._deforming.T
        value, rate = self._signals(total), self._signals(slope * total)
        return value + second_order @ s._deforming.T, rate + second_order_rate @ s._deforming.T

    def _rigid_motion(self, relative: Array) -> tuple[Complex, Complex]:
        """Return spectra of the deflections that count for rigid motion, (F, 3 M), and of the mean rotation, (F, 3)."""
        s = self._s
        given = self._spectrum(relative)
        spectrum = self._measured(relative @ s._rigid.T, s._rigid)
        found = np.zeros_like(given)
        vertical = self._choose(0, 2, spectrum, np.zeros(len(spectrum.frequencies)))
        if vertical is not None:
            found[:, 2::3] = self._bank.response(vertical.index, self._omega)[:, None] * given[:, 2::3]
        # rotation against every bracket from the vertical deflections, and the gravity it brings in
        tilt = np.einsum("iaj,fj->fia", s._maps[:, :2, 2::3], found[:, 2::3])
        tilt += self._spectrum(self._frame_turn[:, :2])[:, None] if np.any(self._frame_turn) else 0.0
        given[:, 0::3] += s._gravity * tilt[:, :, 1]
        given[:, 1::3] -= s._gravity * tilt[:, :, 0]
        spectrum = self._measured(self._signals(given) @ s._rigid.T, s._rigid)
        # what is left of the vertical deflections leans the body: gravity makes noise of it, far the most at low frequency
        leaning = s._gravity**2 * np.mean(np.sum(s._maps[:, [1, 0], 2::3] ** 2, axis=2), axis=0)
        for axis in range(2):
            noise = np.zeros(len(spectrum.frequencies)) if vertical is None else leaning[axis] * vertical.left
            choice = self._choose(0, axis, spectrum, noise)
            if choice is not None:
                found[:, axis::3] = self._bank.response(choice.index, self._omega)[:, None] * given[:, axis::3]
        return found, found @ s._maps.mean(axis=0).T

    def _deformation(self, flat: Array) -> Complex:
        """Return spectra of the deformation, (F, 3 M), from projected accelerations (n, 3 M)."""
        s, frame = self._s, self._s._frame
        given = self._spectrum(flat)
        spectrum = self._measured(flat, s._deforming)
        found = np.zeros_like(given)
        noise = spread = np.zeros(len(spectrum.frequencies))
        vertical = self._choose(1, 2, spectrum, noise)
        if vertical is not None:
            found[:, 2::3] = self._bank.response(vertical.index, self._omega)[:, None] * given[:, 2::3]
            trusted = vertical.variance < _TRUSTED * float(spectrum.widths @ vertical.whole)
            if trusted:
                given += found[:, 2::3] @ frame.tilt.T
                spectrum = self._measured(self._signals(given), s._deforming)
            noise, spread = (vertical.left if trusted else vertical.whole), vertical.whole
        for axis in range(2):
            leaning = noise * frame.tilt_square[axis] + spread * frame.spread_square[axis]
            choice = self._choose(1, axis, spectrum, leaning, None if vertical is None else vertical.signal)
            if choice is not None:
                found[:, axis::3] = self._bank.response(choice.index, self._omega)[:, None] * given[:, axis::3]
        return found

    def _measured(self, signals: Array, projector: Array) -> DeformationSpectrum:
        """Return the spectrum of projected accelerations."""
        freedom = np.array([np.trace(projector[a::3, a::3]) for a in range(3)])
        spectrum = DeformationSpectrum(freedom, self._dt)
        portion = round(_PORTION / self._dt)
        heard = signals[: self._heard]
        for first in range(0, len(heard), portion):
            spectrum.add(heard[first : first + portion])
        frequencies, widths = tuple(spectrum.frequencies.tolist()), tuple(spectrum.widths.tolist())
        self._bank: ZeroPhaseBank = zero_phase_bank(frequencies, widths, _RESOLVED / self._dt)
        self._freedom = freedom
        return spectrum

    def _choose(
        self, part: int, axis: int, spectrum: DeformationSpectrum, noise: Array, vertical: Array | None = None
    ) -> _Choice | None:
        """Choose the filter of an axis for rigid motion (part 0) or deformation (1); None where there is no such motion.

        Parameters
        ----------
        part, axis
            Which.
        spectrum, noise
            Measured acceleration, and density of what is known to be none of the motion, shape (F,).
        vertical
            Density of the vertical deformation, shape (F,): a frame that twists slowly moves its brackets sideways too.
        """
        if self._freedom[axis] < 1e-6:
            return None
        signal, other, white = spectrum.split(axis, self._white[part, axis], noise + self._wrong[:, axis])
        if vertical is not None:
            signal = signal + _hidden(spectrum, axis, signal, noise + self._white[part, axis], vertical)
        value, rate = self._bank.errors(signal, other, white)
        index = int(np.argmin(self._s._cost[0][axis] * value + self._s._cost[1][axis] * rate))
        self.variance[part, :, axis] = value[index], rate[index]
        if not all(self._inside):
            self.edge[part, :, axis] = self._bank.edge(index, spectrum.density[:, axis])
        left = self._bank.left(index, signal, other + white)
        # what passes is motion for the most part, also where it cannot be distinguished from noise
        return _Choice(index, float(value[index]), signal, left, left + self._bank.passed(index, spectrum.density[:, axis]))


def _hidden(spectrum: DeformationSpectrum, axis: int, signal: Array, noise: Array, vertical: Array) -> Array:
    """Return the density of horizontal deformation that may be where the spectrum does not tell it from noise, shape (F,).

    As much of the vertical deformation as where it is observable, and no more than was measured beyond the known noise.
    """
    seen = signal > 0.0
    weight = spectrum.widths / spectrum.frequencies**4
    size = float(np.sum((vertical * weight)[seen]))
    ratio = float(np.sum((signal * weight)[seen])) / size if size > 0.0 else 0.0
    open_ = np.clip(spectrum.density[:, axis] - noise, 0.0, None)
    return np.asarray(np.where(seen, 0.0, np.minimum(open_, ratio * vertical)))
