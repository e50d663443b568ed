# Copyright 2026 ride_estimation contributors
"""The response of a simulated vehicle and what ideal sensors on it would read."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.vehicles.assembly import Assembly, sensor_offset

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Response:
    """Motion and forces at the N samples of the base motion; small rotations.

    Attributes
    ----------
    coordinates, rates, accelerations
        Shape (N, Q), order of ``assembly.coordinates`` [m, rad], [.../s], [.../s^2].
    deflection, rate, tension
        Per mount component, shape (N, C), order of ``assembly.components`` [m], [m/s], [N]; tension without static share.
    """

    assembly: Assembly
    base_motion: BaseMotion
    coordinates: Array
    rates: Array
    accelerations: Array
    deflection: Array
    rate: Array
    tension: Array

    @property
    def time_s(self) -> Array:
        """Return seconds since the start, shape (N,)."""
        return self.base_motion.time_s

    def body_motion(self, body: str, kind: str = "accelerations") -> Array:
        """Return (x y z roll pitch yaw) of a body's CG, shape (N, 6); zero where a coordinate is not free.

        Parameters
        ----------
        kind
            ``coordinates``, ``rates`` or ``accelerations``.
        """
        if body not in self.assembly.vehicle.bodies:
            raise ConfigurationError(f"body: {body!r}; allowed: {', '.join(self.assembly.vehicle.bodies)}")
        point = self.assembly.point_map(body, self.assembly.vehicle.bodies[body].cg)
        return np.asarray(getattr(self, kind) @ point.T, dtype=float)

    def mount_array(self, name: str) -> Array:
        """Return ``deflection``, ``rate`` or ``tension`` by mount and axis x y z, shape (N, M, 3), zero where there is none."""
        mount, axis = self.assembly.component_index()
        source = getattr(self, name)
        result = np.zeros((len(source), len(self.assembly.mount_names), 3))
        for column in np.flatnonzero(axis < 3):
            result[:, mount[column], axis[column]] = source[:, column]
        return result

    def mount_force(self) -> Array:
        """Return the force on the body by each mount, static share included, shape (N, M, 3) [N]."""
        return self.assembly.static_force - self.mount_array("tension")

    def inertial_load(self, body: str) -> Array:
        """Return ``(m a, J alpha)`` about the CG of a body, shape (N, 6) [N, N m]; ``omega x J omega`` is included."""
        given = self.assembly.vehicle.bodies[body]
        motion = self.body_motion(body)
        omega = self.body_motion(body, "rates")[:, 3:]
        gyroscopic = np.cross(omega, omega @ given.inertia.T)
        return np.hstack([given.mass.value * motion[:, :3], motion[:, 3:] @ given.inertia.T + gyroscopic])

    def specific_force(self, sensor_name: str) -> Array:
        """Return the ideal reading of a sensor, sensor axes, no error, shape (N, channels).

        accelerometer: ``R^T (a + g e_z - g theta x e_z)``; imu: that and the angular velocity; displacement: deflection
        of its mount axis; force: force on the body by its mount.

        Raises
        ------
        ConfigurationError
            Unknown sensor, or a kind (speed) that the vehicle model does not have.
        """
        vehicle = self.assembly.vehicle
        if sensor_name not in vehicle.sensors:
            raise ConfigurationError(f"sensor: {sensor_name!r}; allowed: {', '.join(vehicle.sensors)}")
        sensor = vehicle.sensors[sensor_name]
        if sensor.kind == "displacement":
            return self.mount_array("deflection")[:, self.assembly.mount_names.index(sensor.mount), [AXES.index(sensor.axis)]]
        if sensor.kind == "force":
            return self.mount_force()[:, self.assembly.mount_names.index(sensor.mount)]
        if sensor.kind not in ("accelerometer", "imu"):
            raise ConfigurationError(f"sensors.{sensor_name}.kind: {sensor.kind!r} is not simulated by the vehicle model")
        acceleration, angle, rate = self._carrier(sensor)
        gravity = np.array([0.0, 0.0, vehicle.gravity])
        force = acceleration + gravity - np.cross(angle, gravity)
        reading = force @ sensor.rotation
        return reading if sensor.kind == "accelerometer" else np.hstack([reading, rate @ sensor.rotation])

    def _carrier(self, sensor: Sensor) -> tuple[Array, Array, Array]:
        """Return acceleration, angle and angular rate of the place a sensor sits at, each (N, 3), body axes."""
        offset = sensor_offset(self.assembly.vehicle, sensor)
        if sensor.body in self.assembly.vehicle.bodies:
            point = self.assembly.point_map(sensor.body, sensor.position)
            return (
                self.accelerations @ point[:3].T, self.coordinates @ point[3:].T, self.rates @ point[3:].T,
            )
        mount = self.assembly.mount_names.index(sensor.mount)
        base = self.base_motion
        acceleration = base.acceleration[:, mount] + np.cross(base.angular_acceleration[:, mount], offset)
        return acceleration, base.angle[:, mount], base.angular_rate[:, mount]
