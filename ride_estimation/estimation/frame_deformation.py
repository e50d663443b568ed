# Copyright 2026 ride_estimation contributors
"""Deformation of the frame under the mounts: the part of the deflections no rigid motion explains, as a random process.

Deflections are ``D = Phi q + e``: rigid relative motion q (equilibrium tells what it does to the forces) and deformation e, with
``Q = I - Phi Phi^+`` and ``Q D'' = -Q a_base``: the body and everything common to all brackets (attitude, bias of the body)
cancel. Integrated twice the noise of the base sensors grows as ``1 / omega^4`` below about 2 Hz, where frames are nearly rigid.

Per axis a steady-state Kalman filter of (value, rate) with acceleration noise density q and a pseudo measurement of the value,
``e_hat = A / (s^2 + sqrt(2) w s + w^2)``; the corner w minimises the expected squared error of the force

``sum_m S_m (k^2 |1 - H(w_m)|^2 + c^2 w_m^2 |1 - H_v(w_m)|^2) + q (k^2 + 3 c^2 w^2) / (2 sqrt(2) w^3)``

with S_m the mean squared deformation in octave m, estimated online from the measured acceleration less the noise. To the noise of
horizontal axes belongs what gravity adds when the twist of the frame tilts the brackets. The same sum is the variance the
attachment forces state. What a finite rotation strains in second order is no deformation and comes from the rotation itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.block_math import cross
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]

#: centres of the octaves [Hz]
_OCTAVES = 0.2 * 2.0 ** np.arange(7)
#: half the reciprocal quality of a section of the band-pass (one octave wide)
_DAMPING = 0.36
#: corners to choose from [Hz]
_CORNERS = np.geomspace(0.2, 8.0, 36)
#: memory of the spectrum [s]
_MEMORY = 10.0
#: memory of the constant bias [s]
_BIAS_MEMORY = 8.0
#: a corner w is allowed once w times the time since the start exceeds this: what the start left has then decayed
_SETTLED = 8.0
#: time between two choices of the corner [s]
_INTERVAL = 0.2


@compile_kernel
def deformation_block(
    acceleration: Array, dt: float, forget_bias: float, corner: Array, coefficients: Array, state: Array, sections: Array,
    power: Array, value: Array, rate: Array,
) -> None:  # fmt: skip
    """Integrate the deformation of every channel and gather the power of its acceleration per octave.

    Parameters
    ----------
    acceleration
        Q times relative acceleration, shape (K, N).
    dt, forget_bias
        Tick [s]; share of a new sample in the mean that is taken as bias.
    corner
        w of every channel [rad/s], shape (N,).
    coefficients
        b, a1, a2 of a section ``b (1 - z^-2) / (1 + a1 z^-1 + a2 z^-2)`` of every octave, shape (B, 3).
    state
        (4, N): value, rate, bias, last acceleration; in place.
    sections
        (B, 4, N): memories of the two sections of every octave; in place.
    power
        (B, N): sum of squares is added.
    value, rate
        Outputs (K, N).
    """
    bands = coefficients.shape[0]
    for n in range(acceleration.shape[1]):
        w = corner[n]
        # exact for the closed loop of a pseudo measurement at every tick to second order of w dt
        gain_value, gain_rate = 2.0**0.5 * w * dt, w * w * dt
        for k in range(acceleration.shape[0]):
            state[2, n] += forget_bias * (acceleration[k, n] - state[2, n])
            u = acceleration[k, n] - state[2, n]
            old = state[3, n]
            state[3, n] = u
            e = state[0, n] + dt * state[1, n] + dt * dt * (old / 3.0 + u / 6.0)
            v = state[1, n] + 0.5 * dt * (old + u)
            state[0, n] = e - gain_value * e
            state[1, n] = v - gain_rate * e
            # the linear hold between samples loses (omega dt)^2 / 12 of the value; put it back
            value[k, n] = state[0, n] - dt * dt / 12.0 * u
            rate[k, n] = state[1, n] - dt / 12.0 * (u - old)
            for m in range(bands):
                b, a1, a2 = coefficients[m, 0], coefficients[m, 1], coefficients[m, 2]
                y = b * u + sections[m, 0, n]
                sections[m, 0, n] = sections[m, 1, n] - a1 * y
                sections[m, 1, n] = -b * u - a2 * y
                z = b * y + sections[m, 2, n]
                sections[m, 2, n] = sections[m, 3, n] - a1 * z
                sections[m, 3, n] = -b * y - a2 * z
                power[m, n] += z * z


class FrameDeformation:
    """Deformation of the frame at the mounts, and how well it is known.

    Parameters
    ----------
    wrench
        G of the free coordinates, shape (F, 3 M); its transpose gives the deflections of a rigid motion.
    base_variance
        Noise variance of the base sensors, shape (M,).
    tilt_maps
        From the stacked deflections to the rotation against each bracket, shape (M, 3, 3 M).
    gravity
        [m/s^2].
    arms
        Mount minus CG, shape (M, 3) [m].
    """

    def __init__(self, wrench: Array, base_variance: Array, tilt_maps: Array, gravity: float, arms: Array) -> None:
        size = wrench.shape[1]
        self.projector = np.eye(size) - np.linalg.pinv(wrench) @ wrench
        self._count = size // 3
        self._arms, self._turn_map = arms, tilt_maps.mean(axis=0)
        self._axes = np.tile(np.arange(3), self._count)
        self._freedom = np.array([np.trace(self.projector[a::3, a::3]) for a in range(3)])
        self._base_variance = float(np.mean(base_variance))
        # twist of the frame may tilt the brackets, and gravity appears in their horizontal axes: noise as large as the twist
        tilt = np.zeros((size, size))
        tilt[0::3], tilt[1::3] = gravity * tilt_maps[:, 1], -gravity * tilt_maps[:, 0]
        tilt = self.projector @ tilt[:, 2::3] @ self.projector[2::3, 2::3]
        self._tilt_square = np.sum(tilt**2, axis=1).reshape(self._count, 3).sum(axis=0) / np.maximum(self._freedom, 1e-9)
        self.reset()

    def reset(self) -> None:
        """Start again from an undeformed frame."""
        size = len(self.projector)
        self._state = np.zeros((4, size))
        self._sections = np.zeros((len(_OCTAVES), 4, size))
        self._sum = np.zeros((len(_OCTAVES), size))
        self._mean_square = np.zeros((len(_OCTAVES), 3))
        self._pending, self._time, self._step = 0.0, 0.0, 0.0
        self._corner = np.full(3, 2.0 * np.pi * _CORNERS[-1])
        #: error variance of value and rate of a channel before projection, per axis
        self.variance, self.rate_variance = np.zeros(3), np.zeros(3)

    def observe(
        self, relative: Array, turn: Array, turn_rate: Array, stiffness: Array, damping: Array, dt: float
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return deformation and its rate at the ticks of a block, shape (K, M, 3) each.

        Parameters
        ----------
        relative
            Relative acceleration of body and bracket without what gravity adds through tilt, shape (K, M, 3) [m/s^2].
        turn, turn_rate
            Rotation of the body against the frame and its rate, shape (K, 3).
        stiffness, damping
            Tangents of the mounts, shape (M, 3): what an error of value and rate costs.
        dt
            Tick [s].
        """
        ticks = len(relative)
        if dt != self._step:
            self._design(dt)
        self._time += ticks * dt
        flat = relative.reshape(ticks, -1)
        # a finite rotation strains the mounts in second order like a deformation: -theta x (theta x r) / 2 in body axes
        spin = (flat @ self._turn_map.T)[:, None]
        arms, theta, omega = self._arms, turn[:, None], turn_rate[:, None]
        across, across_rate = cross(theta, arms), cross(omega, arms)
        bent = -0.5 * cross(theta, across)
        bent_rate = -0.5 * (cross(omega, across) + cross(theta, across_rate))
        bent_accel = -0.5 * (cross(spin, across) + 2.0 * cross(omega, across_rate) + cross(theta, cross(spin, arms)))
        flat = (flat - bent_accel.reshape(flat.shape)) @ self.projector.T
        value, rate = np.empty_like(flat), np.empty_like(flat)
        deformation_block(
            flat, dt, 1.0 - np.exp(-dt / min(_BIAS_MEMORY, self._time)), self._corner[self._axes], self._coefficients,
            self._state, self._sections, self._sum, value, rate,
        )  # fmt: skip
        self._pending += ticks * dt
        if self._pending >= _INTERVAL - 1e-9:
            self._choose(stiffness, damping, dt)
        value += bent.reshape(flat.shape) @ self.projector.T
        rate += bent_rate.reshape(flat.shape) @ self.projector.T
        return value.reshape(relative.shape), rate.reshape(relative.shape)

    def covariance(self) -> tuple[Array, Array]:
        """Return the error covariances of value and rate, shape (3 M, 3 M) each."""
        q = self.projector
        return (q * np.tile(self.variance, self._count)) @ q, (q * np.tile(self.rate_variance, self._count)) @ q

    def _design(self, dt: float) -> None:
        """Design the octaves that fit below the Nyquist frequency and their gain for white noise."""
        self._step = dt
        half = np.minimum(np.pi * _OCTAVES * dt, 1.2)
        t = np.tan(half)
        norm = 1.0 + 2.0 * _DAMPING * t + t * t
        self._coefficients = np.column_stack(
            [2.0 * _DAMPING * t / norm, 2.0 * (t * t - 1.0) / norm, (1.0 - 2.0 * _DAMPING * t + t * t) / norm]
        )
        grid = np.geomspace(0.002, 0.5 / dt, 4000)
        z = np.exp(-2j * np.pi * grid * dt)[:, None]
        b, a1, a2 = self._coefficients.T
        gain = np.abs(b * (1 - z**2) / (1 + a1 * z + a2 * z**2)) ** 4
        width = np.sum(0.5 * (gain[1:] + gain[:-1]) * np.diff(grid)[:, None], axis=0)
        self._noise_gain, self._width = 2.0 * dt * width, width
        self._used = _OCTAVES * dt < 0.2

    def _choose(self, stiffness: Array, damping: Array, dt: float) -> None:
        """Estimate the spectrum and choose the corner of every axis."""
        forget = 1.0 - np.exp(-self._pending / min(_MEMORY, self._time))
        ticks = self._pending / dt
        freedom = np.maximum(self._freedom, 1e-9)
        fresh = self._sum.reshape(len(_OCTAVES), self._count, 3).sum(axis=1) / (ticks * freedom)
        self._mean_square += forget * (fresh - self._mean_square)
        self._sum[:] = 0.0
        self._pending = 0.0
        k2, c2 = np.mean(stiffness**2, axis=0), np.mean(damping**2, axis=0)
        twist = np.zeros(len(_OCTAVES))
        for axis in (2, 0, 1):
            if self._freedom[axis] > 1e-6:
                square = self._choose_axis(axis, k2[axis], c2[axis], twist * self._tilt_square[axis])
                twist = square if axis == 2 else twist

    def _choose_axis(self, axis: int, k2: float, c2: float, tilt: Array) -> Array:
        """Choose the corner of an axis for what errors cost and what tilt adds; return the mean square per octave."""
        dt, omega = self._step, 2.0 * np.pi * _OCTAVES
        # mean square of an octave over that of its band-pass
        whole = np.sqrt(0.5) * _OCTAVES / self._width
        # relative standard deviation of a mean square over the memory
        spread = 1.0 / np.sqrt(np.maximum(self._width * min(_MEMORY, self._time) * self._freedom[axis], 0.25))
        measured, expected = self._mean_square[:, axis], self._noise_gain * self._base_variance + tilt / whole
        # a stated noise larger than what was ever measured is too large
        share = min(1.0, float(np.min((measured * (1.0 + 2.0 * spread) / expected)[self._used])))
        expected = share * expected
        excess = np.maximum(measured - expected * (1.0 + 2.0 * spread), 0.0) * self._used
        square = excess * whole / omega**4
        resolved = _CORNERS[_CORNERS * dt < 0.05] if _CORNERS[0] * dt < 0.05 else _CORNERS[:1]
        settled = resolved[2.0 * np.pi * resolved * self._time >= _SETTLED]
        w = 2.0 * np.pi * (settled if settled.size else resolved[-1:])[:, None]
        pole = (1j * omega) ** 2 + np.sqrt(2.0) * w * 1j * omega + w * w
        missing = np.abs((np.sqrt(2.0) * w * 1j * omega + w * w) / pole) ** 2
        missing_rate = np.abs(w * w / pole) ** 2 * omega**2
        passed = np.abs(1.0 / pole) ** 2
        density = share * self._base_variance * dt
        # the running mean that stands for the bias follows what is slow; its error is integrated like an acceleration
        drift = measured[0] / self._width[0] / (4.0 * min(_BIAS_MEMORY, self._time))
        variance = missing @ square + passed @ (share * tilt) + density / (2.0 * np.sqrt(2.0) * w[:, 0] ** 3)
        variance += drift / w[:, 0] ** 4
        rate_variance = missing_rate @ square + 3.0 * density / (2.0 * np.sqrt(2.0) * w[:, 0])
        best = int(np.argmin(k2 * variance + c2 * rate_variance))
        self._corner[axis] = w[best, 0]
        self.variance[axis], self.rate_variance[axis] = variance[best], rate_variance[best]
        return np.asarray(square)

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {
            "state": self._state.tolist(), "sections": self._sections.tolist(), "sum": self._sum.tolist(),
            "mean_square": self._mean_square.tolist(), "corner": self._corner.tolist(), "variance": self.variance.tolist(),
            "rate_variance": self.rate_variance.tolist(), "pending": self._pending, "time": self._time,
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._state = np.array(saved["state"], dtype=float).reshape(self._state.shape)
        self._sections = np.array(saved["sections"], dtype=float).reshape(self._sections.shape)
        self._sum = np.array(saved["sum"], dtype=float).reshape(self._sum.shape)
        self._mean_square = np.array(saved["mean_square"], dtype=float).reshape(self._mean_square.shape)
        self._corner = np.array(saved["corner"], dtype=float)
        self.variance = np.array(saved["variance"], dtype=float)
        self.rate_variance = np.array(saved["rate_variance"], dtype=float)
        self._pending, self._time = float(saved["pending"]), float(saved["time"])
