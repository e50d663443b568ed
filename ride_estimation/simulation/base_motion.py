# Copyright 2026 ride_estimation contributors
"""Prescribed motion of the mount bases, each mount on its own."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.signals.smoothing import difference

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class BaseMotion:
    """Motion of M mount bases on N uniform samples, vehicle-file axes, relative to the steadily moving frame.

    Attributes
    ----------
    rate_hz
        Sample rate [Hz].
    displacement, velocity, acceleration
        Shape (N, M, 3) [m], [m/s], [m/s^2]. The acceleration is only used by sensors on the base.
    angle, angular_rate, angular_acceleration
        Roll, pitch, yaw of the bracket, shape (N, M, 3) [rad], [rad/s], [rad/s^2]; zeros where not given.
    """

    rate_hz: float
    displacement: Array
    velocity: Array
    acceleration: Array
    angle: Array
    angular_rate: Array
    angular_acceleration: Array

    def __post_init__(self) -> None:
        shape = self.displacement.shape
        if not self.rate_hz > 0.0:
            raise InputDataError(f"rate_hz: {self.rate_hz:g}; allowed: greater than zero")
        if len(shape) != 3 or shape[2] != 3 or shape[0] < 2:
            raise InputDataError(f"base displacement: shape {shape}; allowed: (N >= 2, mounts, 3)")
        for field in dataclasses.fields(self)[1:]:
            value = getattr(self, field.name)
            if value.shape != shape:
                raise InputDataError(f"base {field.name}: shape {value.shape}; allowed: {shape} as the displacement")
            if not np.all(np.isfinite(value)):
                raise InputDataError(f"base {field.name}: {np.count_nonzero(~np.isfinite(value))} values are not finite")

    @property
    def samples(self) -> int:
        """Return N."""
        return len(self.displacement)

    @property
    def time_s(self) -> Array:
        """Return seconds since the start, shape (N,)."""
        return np.arange(self.samples) / self.rate_hz

    @classmethod
    def from_displacement(cls, displacement: Array, rate_hz: float, angle: Array | None = None) -> BaseMotion:
        """Derive rates and accelerations from displacements (and angles) by fourth-order central differences.

        Parameters
        ----------
        displacement
            Shape (N, M, 3) [m].
        rate_hz
            [Hz].
        angle
            Shape (N, M, 3) [rad].
        """
        displacement = np.ascontiguousarray(displacement, dtype=float)
        turned = np.zeros_like(displacement) if angle is None else np.ascontiguousarray(angle, dtype=float)
        velocity = derivative(displacement, rate_hz)
        angular_rate = derivative(turned, rate_hz)
        return cls(
            rate_hz, displacement, velocity, derivative(velocity, rate_hz),
            turned, angular_rate, derivative(angular_rate, rate_hz),
        )

    @classmethod
    def from_acceleration(
        cls, acceleration: Array, rate_hz: float, corner_hz: float = 0.0, angle: Array | None = None
    ) -> BaseMotion:
        """Integrate measured base accelerations twice, exactly for a signal that is straight between samples.

        Only differences between body and base enter the mounts, so a common drift does no harm in a simulation; drift
        that differs between mounts is a false warp of the base: set ``corner_hz``, and filter what is compared alike.

        Parameters
        ----------
        acceleration
            Gravity removed, shape (N, M, 3) [m/s^2].
        corner_hz
            Corner of a zero-phase high-pass (gain ``f^4 / (f^4 + corner^4)``) applied to the acceleration; 0: none. Two
            periods of the corner at both ends of the record are less certain.
        """
        acceleration = np.ascontiguousarray(acceleration, dtype=float)
        if corner_hz > 0.0:
            displacement, velocity, acceleration = _integrate_high_passed(acceleration, rate_hz, corner_hz)
        else:
            h = 1.0 / rate_hz
            velocity = np.zeros_like(acceleration)
            displacement = np.zeros_like(acceleration)
            velocity[1:] = np.cumsum(0.5 * h * (acceleration[1:] + acceleration[:-1]), axis=0)
            displacement[1:] = np.cumsum(
                h * velocity[:-1] + h * h * (acceleration[:-1] / 3.0 + acceleration[1:] / 6.0), axis=0
            )
        turned = np.zeros_like(displacement) if angle is None else np.ascontiguousarray(angle, dtype=float)
        angular_rate = derivative(turned, rate_hz)
        return cls(rate_hz, displacement, velocity, acceleration, turned, angular_rate, derivative(angular_rate, rate_hz))


def derivative(signal: Array, rate_hz: float) -> Array:
    """Return the time derivative along axis 0 by differences of fourth order; by plain differences below five samples.

    Parameters
    ----------
    signal
        Shape (N, ...).
    rate_hz
        [Hz].
    """
    if len(signal) < 5:
        return np.asarray(np.gradient(signal, 1.0 / rate_hz, axis=0), dtype=float)
    return difference(signal, 1.0 / rate_hz)


def high_passed(signal: Array, rate_hz: float, corner_hz: float) -> Array:
    """Return a signal behind the high-pass of :meth:`BaseMotion.from_acceleration`, for what is compared with its response.

    Parameters
    ----------
    signal
        Shape (N, ...).
    rate_hz, corner_hz
        [Hz]; the gain is ``f^4 / (f^4 + corner^4)``, without phase.
    """
    return _integrate_high_passed(np.asarray(signal, dtype=float), rate_hz, corner_hz)[2]


def _integrate_high_passed(signal: Array, rate_hz: float, corner_hz: float) -> tuple[Array, Array, Array]:
    """Return displacement, velocity and acceleration of the high-passed signal, padded against wrap-around."""
    count = len(signal)
    pad = min(count - 1, math.ceil(3.0 * rate_hz / corner_hz))
    extended = np.concatenate([signal[pad:0:-1], signal, signal[-2 : -pad - 2 : -1]])
    frequency = np.fft.rfftfreq(len(extended), 1.0 / rate_hz)
    omega = 2.0 * math.pi * np.where(frequency > 0.0, frequency, 1.0)
    gain = frequency**4 / (frequency**4 + corner_hz**4)
    spectrum = np.fft.rfft(extended, axis=0)
    rest = (1,) * (signal.ndim - 1)

    def back(factor: NDArray[Any]) -> Array:
        full = np.fft.irfft(spectrum * factor.reshape(-1, *rest), n=len(extended), axis=0)
        return np.ascontiguousarray(full[pad : pad + count], dtype=float)

    return back(-gain / omega**2), back(gain / (1j * omega)), back(gain)
