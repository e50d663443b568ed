# Copyright 2026 ride_estimation contributors
"""What is known of one sensor."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ride_estimation.frames import AXES
from ride_estimation.sensors.installation import USUAL, Installation
from ride_estimation.signals.correction import NO_CORRECTION, Correction

Array = NDArray[np.float64]

#: kinds of sensor a vehicle file may declare -> (number of channels, unit of a sample)
SENSOR_KINDS: dict[str, tuple[int, str]] = {
    "accelerometer": (3, "m/s^2"),
    "imu": (6, "m/s^2, rad/s"),
    "displacement": (1, "m"),
    "speed": (1, "m/s"),
    "force": (3, "N"),
}
#: largest magnitude a reading can have, whatever the sensor [its unit]: a value beyond is a fault of the transmission
LARGEST_READINGS: dict[str, float] = {
    "m/s^2": 1e6,  # shock accelerometers for ballistics end at 100 000 times gravity
    "rad/s": 1e3,  # the fastest gyros end at 50 000 degrees per second
    "m": 100.0,  # draw-wire transducers end at 60 m
    "m/s": 1e4,  # beyond any vehicle with mounts
    "N": 1e9,  # the largest load cells of the standards laboratories end at 30 MN
}


@dataclasses.dataclass(frozen=True)
class Sensor:
    """One sensor of a layout, checked by the vehicle file loader.

    Attributes
    ----------
    name
        Name in the vehicle file; the channel name everywhere inside.
    kind
        One of :data:`SENSOR_KINDS`. ``imu`` is an accelerometer whose angular velocity is used too. ``displacement`` is
        one transducer along one axis of one mount (body side minus base side).
    topic
        ROS topic. Several displacement sensors share the topic of one JointState; ``element`` is their name in it.
    body
        Body the sensor sits on (``cab``, ``chassis``, ``seat``, any body of the vehicle file).
    mount
        Mount a chassis-side accelerometer or a displacement or force sensor belongs to, else empty.
    axis
        Axis of a displacement sensor (``x y z``), else empty.
    position
        [m], shape (3,), vehicle-file axes.
    rotation
        Shape (3, 3), takes sensor components to body components.
    noise_std
        Standard deviation of one corrected sample [unit of the kind] (acceleration for ``imu``).
    gyro_noise_std
        [rad/s], for ``imu``.
    full_scale
        Largest magnitude a reading can have [unit], ``inf`` where unknown.
    coupling
        ``dc`` (gravity is in the signal) or ``ac``.
    trust_despite_minus_one
        Use the data although the driver publishes covariance[0] == -1.
    correction
        What is known to be wrong with the readings: delay, gain, bias.
    noise_slope
        Power of the angular frequency that the noise grows with: 2 for an acceleration that was made of a deflection.
    installation
        How well it is installed, None where the vehicle file states nothing of it.
    axes
        Axes that an accelerometer measures. A sample has three values all the same; that of an axis it does not measure is zero
        and is a reading of nothing: no row of any equation.
    """

    name: str
    kind: str
    topic: str
    body: str
    mount: str = ""
    axis: str = ""
    element: str = ""
    position: Array = dataclasses.field(default_factory=lambda: np.zeros(3))
    rotation: Array = dataclasses.field(default_factory=lambda: np.eye(3))
    noise_std: float = 0.02
    gyro_noise_std: float = 0.001
    full_scale: float = float("inf")
    coupling: str = "dc"
    trust_despite_minus_one: bool = False
    correction: Correction = NO_CORRECTION
    noise_slope: int = 0
    installation: Installation | None = None
    axes: tuple[str, ...] = AXES

    @property
    def stated_installation(self) -> Installation:
        """Return how well it is installed: as the vehicle file states, usual where it does not."""
        return self.installation or USUAL

    @functools.cached_property
    def tolerated_installation(self) -> Installation:
        """Return the same, at least usual: a file that states less, as after a calibration, makes no fault of what is usual."""
        return self.stated_installation.at_least(USUAL)

    @property
    def channels(self) -> int:
        """Return the number of values in one sample."""
        return SENSOR_KINDS[self.kind][0]

    @property
    def triaxial(self) -> bool:
        """Return whether all values of a sample are measured."""
        return len(self.axes) == len(AXES)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Return which values of a sample are measured, shape (C,)."""
        found = np.ones(self.channels, dtype=bool)
        if not self.triaxial:
            found[: len(AXES)] = [axis in self.axes for axis in AXES]
        return found

    def only_measured(self, values: Array) -> Array:
        """Return samples, shape (..., C), with zero for the axes that are not measured, whatever a message says of them."""
        return values if self.triaxial else np.where(self.measured, values, 0.0)

    @property
    def largest(self) -> tuple[float, ...]:
        """Return the largest magnitude that any sensor of this kind can give, per value of a sample."""
        units = SENSOR_KINDS[self.kind][1].split(", ")
        return tuple(LARGEST_READINGS[unit] for unit in units for _ in range(self.channels // len(units)))

    @property
    def reach(self) -> float:
        """Return the magnitude of a corrected value [unit] from which on the reading may be cut at full scale."""
        return self.correction.reach(self.full_scale)
