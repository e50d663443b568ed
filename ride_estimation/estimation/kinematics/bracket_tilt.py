# Copyright 2026 ride_estimation contributors
"""How the brackets of a frame tilt, learned from the accelerometers on both sides of the mounts.

Vertical readings show how a frame rolls and pitches and how far it twists, ``z = W x y``. With a rigid frame its brackets tilt
as the frame does, unless their sensors are levelled or a rig only translates them. What they do in a twist depends on the
members they sit on: on a cross member they roll, ``W x``, on a rail they pitch, ``-W y``, on a stiff subframe neither. Gravity
shows it: a bracket that rolls by phi and pitches by theta reads ``g phi`` in y and ``-g theta`` in x. With shares (s_r, c_r,
s_p, c_p, l_r, l_p)

    ``phi_j = (1 - l_r) phi + W (s_r x_j + c_r)``,   ``theta_j = (1 - l_p) theta - W (s_p y_j + c_p)``

(c shifts the axis the frame twists about) the horizontal readings of the brackets less those of the body at the same places,
which share nearly all real motion at low frequency, are regressed on W, on the roll and pitch of the frame, on its rotation
against the body and on the accelerations of all these, which move the brackets sideways for real; everything passes the same
band, where gravity dominates. Angles fall with the square of the frequency and readings do not: the upper end of the band is
steep, or what the body does above it is taken for tilt. Noise of the vertical readings adds N to the moments M of the regressors
and makes coefficients small (errors in variables): ``E b = (I - M^-1 N) b_true``, N from the stated noise. Least squares weighted
by the covariance of what is left, with a prior: brackets tilt with a rigid frame and follow its twist about half way.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import USUAL_SHARES, Geometry, plate_fit, relative_tilt_maps
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: shares before anything was learned and their standard deviations; shifts in metres
_PRIOR = np.concatenate([USUAL_SHARES, [0.0, 0.0]])
_PRIOR_STD = np.array([0.6, 0.15, 0.6, 0.15, 0.3, 0.3])
#: band in which gravity dominates the horizontal readings: corners of the high-pass and the low-pass [Hz]
_BAND = (0.25, 1.5)
#: the band makes so many independent values per second of a run
_PER_SECOND = 2.0 * (_BAND[1] - _BAND[0])
#: relative standard deviation of the variance of a stated noise
_NOISE_KNOWN = 0.2
#: time the filters need [s]
_SETTLED = 1.5 / _BAND[0]
#: least time before anything is concluded [s]
_LEAST = 5.0
#: time between two conclusions [s]
_EVERY = 1.0
#: one-pole stages of the filters: two of the high-pass that stand for the double integration of angles, high-pass, low-pass
_STAGES = 8
#: those of the high-pass
_HIGH_PASS = 4
#: slopes that are observed: twist, roll and pitch of the frame, roll and pitch of the frame against the body
_SLOPES = 5
#: levelled share that is acted on: brackets tilt with their frame or they do not; a share nearer to none than to all is an error
#: that does not average out (sensors, a drive that is played again and again)
_LEVELLED = 0.5
#: standard deviations that it must be
_CERTAIN = 4.0
#: memory of the mean of angular accelerations [s]
_MEMORY = 30.0
#: noise of the angle that its leak is chosen for [rad]
_ANGLE_NOISE = 5e-3
#: bounds of the corner of the leak [Hz]
_CORNERS = (0.04, 0.25)
#: attributes that are part of a saved state
_SAVED = ("_moments", "_time", "_noisy", "_next", "_state", "_angle", "_started", "_applied")
#: time over which the rotation sets in [s]: a step would ring in every double integration
_FADE = 3.0


@compile_kernel
def accumulate(
    slopes: Array, horizontal: Array, ok: BoolArray, corner: float, top: float, dt: float, state: Array, moments: Array
) -> int:
    """Filter readings and regressors alike and add their products.

    Parameters
    ----------
    slopes
        Angular accelerations (twist: per metre), shape (K, S).
    horizontal
        Readings in x and y of all brackets, shape (K, N).
    ok
        Who spoke, shape (K, M); ticks at which not all did are left out.
    corner, top
        Angular corner frequencies of the band [rad/s].
    dt
        Tick [s].
    state
        One-pole low-pass states, shape (2 S + N, 8); in place.
    moments
        Products of angles, angular accelerations and readings, lower half of (2 S + N, 2 S + N); in place.

    Returns
    -------
    int
        Ticks that were added.
    """
    low = 1.0 - np.exp(-corner * dt)
    high = 1.0 - np.exp(-top * dt)
    angles = slopes.shape[1]
    size = 2 * angles + horizontal.shape[1]
    row = np.zeros(size)
    added = 0
    for n in range(len(ok)):
        if not ok[n].all():
            continue
        for i in range(size):
            if i < angles:
                value = slopes[n, i] / (corner * corner)
            elif i < 2 * angles:
                value = slopes[n, i - angles]
            else:
                value = horizontal[n, i - 2 * angles]
            for stage in range(_STAGES):
                gain = low if stage < _HIGH_PASS else high
                state[i, stage] += gain * (value - state[i, stage])
                # angles: two low-passes over corner^2 stand for the double integration of two high-passes
                if stage >= _HIGH_PASS or (i < angles and stage >= 2):
                    value = state[i, stage]
                else:
                    value -= state[i, stage]
            row[i] = value
        for i in range(size):
            for j in range(i + 1):
                moments[i, j] += row[i] * row[j]
        added += 1
    return added


def noise_gains(corner: float, top: float) -> Array:
    """Return what a tick of white noise of unit variance leaves after :func:`accumulate`: covariance of angle and acceleration.

    ``2 int_0^inf re(H_i conj(H_j)) df``; ``s^2 / (s + c)^4 / (1 + s / t)^4`` makes an angle of an angular acceleration,
    ``s^4 / (s + c)^4 / (1 + s / t)^4`` passes accelerations and readings. Shape (2, 2), [s^3, 1/s; 1/s, 1/s].

    Parameters
    ----------
    corner, top
        c and t, as for :func:`accumulate`.
    """
    w = np.geomspace(1e-3 * corner, 1e3 * top, 10_000)
    band = 1.0 / (w**2 + corner**2) ** 4 / (1.0 + (w / top) ** 2) ** (_STAGES - _HIGH_PASS)
    parts = np.stack([w**4, -(w**6), w**6 * w**2]) * band
    own, both, passed = np.sum(0.5 * (parts[:, 1:] + parts[:, :-1]) * np.diff(w), axis=1) / np.pi
    return np.array([[own, both], [both, passed]])


@compile_kernel
def take_readings(base: Array, body: Array, fit: Array, slopes: Array, horizontal: Array) -> None:
    """Write the regressors and the readings of :func:`accumulate`.

    Parameters
    ----------
    base, body
        Specific force of the brackets and of the body at the same places, shape (K, M, 3).
    fit
        Plane and twist from vertical readings: height, slope in x, slope in y, twist; shape (4, M).
    slopes
        Output: twist of the body against the frame, roll and pitch of the frame, then of the body against it, shape (K, 5).
    horizontal
        Output: readings in x and y of the brackets less those of the body, shape (K, 2 M).
    """
    for k in range(base.shape[0]):
        for s in range(5):
            slopes[k, s] = 0.0
        for i in range(base.shape[1]):
            frame, against = base[k, i, 2], base[k, i, 2] - body[k, i, 2]
            slopes[k, 0] += fit[3, i] * against
            slopes[k, 1] += fit[2, i] * frame
            slopes[k, 2] -= fit[1, i] * frame
            slopes[k, 3] += fit[2, i] * against
            slopes[k, 4] -= fit[1, i] * against
            horizontal[k, 2 * i] = base[k, i, 0] - body[k, i, 0]
            horizontal[k, 2 * i + 1] = base[k, i, 1] - body[k, i, 1]


@compile_kernel
def integrate_slope(
    slopes: Array, measured: BoolArray, corner: float, memory: float, dt: float, state: Array, angle: Array, rate: Array
) -> None:
    """Integrate angular accelerations (K, 2) twice without their running mean, leaking at ``corner`` [rad/s].

    They count as their mean where nothing measures them, ``measured`` (K,). ``state`` (2, 4): mean over ``memory`` [s], rate,
    angle, age; in place. ``angle``, ``rate`` (K, 2) out.
    """
    leak = np.exp(-corner * dt)
    for n in range(len(slopes)):
        for i in range(2):
            if measured[n]:
                state[i, 3] += dt
                state[i, 0] += min(1.0, dt / min(memory, state[i, 3])) * (slopes[n, i] - state[i, 0])
            push = slopes[n, i] - state[i, 0] if measured[n] else 0.0
            # leap frog: the rate is kept half a tick late
            early = state[i, 1]
            state[i, 2] = leak * state[i, 2] + dt * early
            state[i, 1] = leak * early + dt * push
            angle[n, i] = state[i, 2]
            rate[n, i] = 0.5 * (early + state[i, 1]) - corner * state[i, 2]


class BracketTilt:
    """Shares by which brackets follow their frame, the tilt maps that follow from them, and how far a frame tilts without them.

    Parameters
    ----------
    geometry
        Body, mounts and sensors. Learned where every mount has a DC accelerometer on its base and the layout shows a twist.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._mounts = geometry.mounts
        self._gravity = geometry.vehicle.gravity
        place, self._fit = plate_fit(self._mounts)
        dc = all(s is not None and s.coupling == "dc" for s in geometry.base_sensors)
        #: from vertical specific force of the brackets to the angular acceleration of the frame, roll and pitch, shape (M, 2)
        self._to_slopes = self._fit[[2, 1]].T * np.array([1.0, -1.0])
        self.learns = bool(geometry.has_base_motion and dc and len(self._fit) == 4)
        self._noise = np.array([s.noise_std**2 if s is not None else 0.0 for s in geometry.base_sensors])
        gains = noise_gains(*(2.0 * np.pi * f for f in _BAND))
        #: moments that noise adds to readings (2 M,) and regressors (2 S, 2 S), per second and second of a tick
        self._reading_noise, self._slope_noise = gains[1, 1] * np.repeat(self._noise, 2), np.zeros((2 * _SLOPES, 2 * _SLOPES))
        if self.learns:
            rows = self._fit[[3, 2, 1, 2, 1]] * np.array([[1.0], [1.0], [-1.0], [1.0], [-1.0]])
            self._slope_noise = np.kron(gains, (rows * self._noise) @ rows.T)
        #: what one unit of every share adds to the readings, order x and y of each bracket, per unit of W, shape (2 M, 4)
        self._pattern = np.zeros((2 * len(self._mounts), 4))
        self._pattern[0::2, 2], self._pattern[0::2, 3] = self._gravity * place[:, 1], self._gravity
        self._pattern[1::2, 0], self._pattern[1::2, 1] = self._gravity * place[:, 0], self._gravity
        self._slope_variance = float(np.max(self._fit[1:3] ** 2 @ self._noise)) if self.learns else 0.0
        #: the maps where no bracket follows the twist, and what a unit of every share adds, (M, 3, 3 M) and (4, M, 3, 3 M)
        self._stiff = relative_tilt_maps(self._mounts, np.zeros(4))
        self._per_share = np.array([relative_tilt_maps(self._mounts, unit) - self._stiff for unit in np.eye(4)])
        self.reset()

    def reset(self) -> None:
        """Forget everything: the prior."""
        self.shares = _PRIOR.copy()
        self.covariance = np.diag(_PRIOR_STD**2)
        size = 2 * _SLOPES + len(self._pattern)
        self._moments = np.zeros((size, size))
        #: time that was added, and that times its ticks [s^2]
        self._time, self._noisy, self._next = 0.0, 0.0, _LEAST
        #: mean, rate, angle, age of the roll and pitch of the frame
        self._angle = np.zeros((2, 4))
        self.restart()
        self._conclude()

    def restart(self) -> None:
        """Begin a new time base: the filters start again, what was learned stays."""
        self._state = np.zeros((2 * _SLOPES + len(self._pattern), _STAGES))
        # what sensors read of a frame at rest is no matter of time: the mean of a moment, integrated twice, is degrees
        self._angle[:, 1:3] = 0.0
        self._started = 0.0
        self._offset: Array | None = None
        self._applied = np.zeros(2)

    def _conclude(self) -> None:
        #: from the stacked deflections to the rotation of the body relative to each bracket, shape (M, 3, 3 M)
        self.maps = self._stiff + np.tensordot(self.shares[:4], self._per_share, 1)
        share, std = self.shares[4:], np.sqrt(np.diag(self.covariance)[4:])
        #: share of roll and pitch of the frame that its brackets do not make, zero unless it is certain
        self.levelled = np.where((share > _LEVELLED) & (share > _CERTAIN * std), share, 0.0)

    @property
    def spread(self) -> Array:
        """Return maps like :attr:`maps` of one standard deviation of every independent error of the shares, (4, M, 3, 3 M)."""
        values, vectors = np.linalg.eigh(self.covariance[:4, :4])
        return np.tensordot((vectors * np.sqrt(np.maximum(values, 0.0))).T, self._per_share, 1)

    def observe(self, base: Array, body: Array, ok: BoolArray, dt: float) -> bool:
        """Learn from a block where :attr:`learns`; return whether the maps changed.

        Parameters
        ----------
        base, body
            Specific force of the brackets in bracket axes and of the body at the same places, shape (K, M, 3).
        ok
            Which brackets spoke, shape (K, M).
        dt
            Tick [s].
        """
        slopes, horizontal = np.empty((len(base), _SLOPES)), np.empty((len(base), len(self._pattern)))
        take_readings(base, body, self._fit, slopes, horizontal)
        # constant parts are outside the band; the first reading is taken out at once, the filters would take long over gravity
        if self._offset is None:
            self._offset = np.concatenate([slopes[0], horizontal[0]])
        moments = np.zeros_like(self._moments)
        added = accumulate(
            slopes - self._offset[:_SLOPES], horizontal - self._offset[_SLOPES:], ok,
            2.0 * np.pi * _BAND[0], 2.0 * np.pi * _BAND[1], dt, self._state, moments,
        )  # fmt: skip
        # what was before a gap and what comes after it do not fit together: the filters need their time again
        self._started = self._started + added * dt if added == len(base) else 0.0
        if self._started < _SETTLED or not np.isfinite(moments).all():
            return False
        # per second, so that the answer does not depend on the tick
        self._moments += moments * dt
        self._time += added * dt
        self._noisy += added * dt * dt
        if self._time < self._next:
            return False
        self._next = self._time + _EVERY
        return self._learn()

    def frame_turn(self, base: Array, measured: BoolArray, dt: float) -> tuple[Array, Array]:
        """Return the rotation of the frame that its brackets do not make, and its rate, shape (K, 3) each [rad, rad/s].

        Parameters
        ----------
        base
            Specific force of the brackets, shape (K, M, 3).
        measured
            Whether all of them were measured, shape (K,).
        dt
            Tick [s].
        """
        angle, rate = np.zeros((len(base), 3)), np.zeros((len(base), 3))
        if not self.learns:
            return angle, rate
        plane = base[:, :, 2] @ self._to_slopes
        # white noise s^2 dt integrated twice with a leak w leaves an angle of variance s^2 dt / (4 w^3)
        corner = (self._slope_variance * dt / (4.0 * _ANGLE_NOISE**2)) ** (1.0 / 3.0)
        corner = min(max(corner, 2.0 * np.pi * _CORNERS[0]), 2.0 * np.pi * _CORNERS[1])
        whole, whole_rate = np.empty_like(plane), np.empty_like(plane)
        integrate_slope(plane, measured, corner, _MEMORY, dt, self._angle, whole, whole_rate)
        if not (self.levelled.any() or self._applied.any()):
            return angle, rate
        fade = np.exp(-dt / _FADE * np.arange(1, len(base) + 1))[:, None]
        share = self.levelled + (self._applied - self.levelled) * fade
        self._applied = share[-1]
        angle[:, :2], rate[:, :2] = share * whole, share * whole_rate
        return angle, rate

    def _learn(self) -> bool:
        """Weigh what was regressed against the prior; return whether that was possible."""
        full = self._moments + np.tril(self._moments, -1).T
        n = 2 * _SLOPES
        scale = np.sqrt(np.maximum(np.diag(full)[:n], 1e-300))
        normal = full[:n, :n] / np.outer(scale, scale)
        if not np.all(np.diag(full)[:n] > 0.0) or np.linalg.cond(normal) > 1e9:
            return False
        inverse = np.linalg.inv(normal) / np.outer(scale, scale)
        slope = inverse @ full[:n, n:]
        left = (full[n:, n:] - full[n:, :n] @ slope) / self._time
        left = 0.5 * (left + left.T) + np.diag(self._reading_noise) * self._noisy / self._time
        independent = max(self._time * _PER_SECOND - n, 1.0)
        # coefficients of twist, roll and pitch of the frame: Kronecker product of both covariances
        covariance = np.kron(inverse[:3, :3] * (self._time / independent), left)
        size = len(self._pattern)
        pattern = np.zeros((3 * size, 6))
        pattern[:size, :4] = self._pattern
        pattern[size + 1 : 2 * size : 2, 4] = -self._gravity
        pattern[2 * size :: 2, 5] = self._gravity
        # a body rolls and pitches whole: what its sensors read of gravity is known
        others = slope[3:].copy()
        others[:2] = 0.0
        others[0, 1::2], others[1, 0::2] = self._gravity, -self._gravity
        small = inverse[:3] @ (self._noisy * self._slope_noise)
        # what is not known of the moments of the noise is an error of that correction: the sample, and the stated value
        square = 2.0 / independent + _NOISE_KNOWN**2
        moment = _PRIOR_STD**2 + _PRIOR**2
        whole = [(own * moment) @ own.T for own in pattern.reshape(3, size, 6)] + [np.outer(own, own) for own in others]
        covariance += square * sum(np.kron(np.outer(k, k), own) for k, own in zip(small.T, whole, strict=True))
        kept = np.eye(3, n) - small
        pattern, seen = np.kron(kept[:, :3], np.eye(size)) @ pattern, slope[:3] - kept[:, 3:] @ others
        weighted = np.linalg.solve(covariance, np.column_stack([pattern, seen.ravel()]))
        self.covariance = np.linalg.inv(pattern.T @ weighted[:, :6] + np.diag(_PRIOR_STD**-2))
        self.shares = self.covariance @ (pattern.T @ weighted[:, 6] + _PRIOR / _PRIOR_STD**2)
        self._conclude()
        return True

    def notes(self) -> list[str]:
        """Return words on brackets that do not tilt with their frame."""
        names = [name for name, share in zip(("roll", "pitch"), self.levelled) if share > 0.0]
        if not names:
            return []
        return [
            f"accelerometers at the mount bases do not show the {' and '.join(names)} of the frame: brackets are taken not to "
            "turn with it (levelled, or a rig that only translates)"
        ]

    def save(self) -> dict[str, Any]:
        """Return what was learned and the state of the filters as plain lists."""
        return fields_of(self, (*_SAVED, "_offset"))

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self.reset()
        take_fields(self, _SAVED, saved)
        self._offset = None if saved["offset"] is None else np.array(saved["offset"], dtype=float)
        if self.learns and self._time >= _LEAST:
            self._learn()
