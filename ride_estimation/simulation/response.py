# Copyright 2026 ride_estimation contributors
"""The response of a simulated vehicle and what ideal sensors on it would read."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, rotation_matrices
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

        accelerometer: ``R^T (a + g e_z)``; imu: that and the angular velocity; displacement: deflection
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
        force, rate = self._on_body(sensor) if sensor.body in vehicle.bodies else self._on_base(sensor)
        reading = force @ sensor.rotation
        return reading if sensor.kind == "accelerometer" else np.hstack([reading, rate @ sensor.rotation])

    def _on_body(self, sensor: Sensor) -> tuple[Array, Array]:
        """Return specific force and angular rate where a sensor sits on a body, body axes, shape (N, 3) each.

        Equations of motion may be those of small rotations, a sensor turns and is flung about by all of them.
        """
        turn = rotation_matrices(self.body_motion(sensor.body, "coordinates")[:, 3:])
        rate, motion = self.body_motion(sensor.body, "rates")[:, 3:], self.body_motion(sensor.body)
        arm = turn @ sensor_offset(self.assembly.vehicle, sensor)
        felt = motion[:, :3] + np.cross(motion[:, 3:], arm) + np.cross(rate, np.cross(rate, arm))
        felt[:, 2] += self.assembly.vehicle.gravity
        return np.einsum("nji,nj->ni", turn, felt), np.einsum("nji,nj->ni", turn, rate)

    def _on_base(self, sensor: Sensor) -> tuple[Array, Array]:
        """Return specific force and angular rate where a sensor sits on a prescribed base, axes of that, shape (N, 3) each."""
        mount = self.assembly.mount_names.index(sensor.mount)
        base = self.base_motion
        matrix = _bracket_matrices(base.angle[:, mount])
        omega = _bracket_rates(base.angle[:, mount], base.angular_rate[:, mount])
        turning = np.gradient(omega, 1.0 / base.rate_hz, axis=0)
        arm = sensor_offset(self.assembly.vehicle, sensor)
        world = base.acceleration[:, mount] + np.array([0.0, 0.0, self.assembly.vehicle.gravity])
        local = np.einsum("nji,nj->ni", matrix, world)
        return local + np.cross(turning, arm) + np.cross(omega, np.cross(omega, arm)), omega


def _bracket_matrices(angle: Array) -> Array:
    (cr, cp, cy), (sr, sp, sy) = np.cos(angle).T, np.sin(angle).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _bracket_rates(angle: Array, rate: Array) -> Array:
    roll, pitch = angle[:, 0], angle[:, 1]
    return np.stack(
        [
            rate[:, 0] - rate[:, 2] * np.sin(pitch),
            rate[:, 1] * np.cos(roll) + rate[:, 2] * np.sin(roll) * np.cos(pitch),
            -rate[:, 1] * np.sin(roll) + rate[:, 2] * np.cos(roll) * np.cos(pitch),
        ],
        axis=1,
    )
