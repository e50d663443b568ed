# Copyright 2026 ride_estimation contributors
"""Frames of a vehicle file as fixed transforms, so that a 3D viewer can place wrenches and sensors."""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class FixedFrame:
    """A frame fixed to the vehicle frame.

    Attributes
    ----------
    name
        Child frame.
    position
        In the vehicle frame [m], shape (3,).
    quaternion
        x y z w, takes components of the child to the vehicle frame.
    """

    name: str
    position: Array
    quaternion: Array


def published_frames(vehicle: Vehicle, body: str, cg_frame: str = "cab_cg", mount_prefix: str = "mount_") -> list[FixedFrame]:
    """Return the frames of the outputs and of the sensors, all relative to the vehicle frame at rest.

    Parameters
    ----------
    vehicle
        The vehicle.
    body
        Body whose loads are estimated.
    cg_frame, mount_prefix
        As the parameters of the node.
    """
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    frames = [FixedFrame(cg_frame, vehicle.bodies[body].cg, upright)]
    frames += [FixedFrame(f"{mount_prefix}{m.name}", m.position, upright) for m in vehicle.mounts.values() if m.body == body]
    for sensor in vehicle.sensors.values():
        if sensor.kind in ("accelerometer", "imu"):
            turned = scipy.spatial.transform.Rotation.from_matrix(sensor.rotation)
            frames.append(FixedFrame(sensor.name, sensor.position, np.asarray(turned.as_quat())))
    return frames
