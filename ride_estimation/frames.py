# Copyright 2026 ride_estimation contributors
"""Rotations and rigid-body kinematics in REP-103 axes (x forward, y left, z up, right-handed).

Roll, pitch, yaw are intrinsic z-y'-x'' angles [rad]; positive pitch is nose down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

AXES: tuple[str, ...] = ("x", "y", "z")
COORDINATES: tuple[str, ...] = ("x", "y", "z", "roll", "pitch", "yaw")


def skew(vector: ArrayLike) -> Array:
    """Return the matrix S with ``S @ u == cross(vector, u)``.

    Parameters
    ----------
    vector
        Shape (3,).
    """
    x, y, z = np.asarray(vector, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), taking sensor or body components to parent components.

    Parameters
    ----------
    roll, pitch, yaw
        Angles [rad].
    """
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def point_motion_matrix(offset: ArrayLike) -> Array:
    """Return the (3, 6) matrix that maps small rigid-body motion to the motion of a point.

    ``u_point = u_reference + theta x offset``; the same matrix maps (a, alpha) to the linear part of the acceleration.

    Parameters
    ----------
    offset
        Point minus reference, shape (3,) [m].
    """
    return np.hstack([np.eye(3), -skew(offset)])


def rotation_matrices(angle: Array) -> Array:
    """Return the rotation matrices exp([angle]x) of rotation vectors (Rodrigues), shape (N, 3, 3).

    Parameters
    ----------
    angle
        Rotation vectors, shape (N, 3) [rad].
    """
    size = np.linalg.norm(angle, axis=1)
    a = np.where(size > 1e-8, np.sin(size) / np.maximum(size, 1e-8), 1.0)
    b = np.where(size > 1e-8, (1.0 - np.cos(size)) / np.maximum(size, 1e-8) ** 2, 0.5)
    x, y, z = np.ascontiguousarray(angle.T)
    out = np.empty((len(angle), 3, 3))
    # I + a S + b S^2 with S = [angle]x, entry by entry: products of small matrices take twice as long
    for i, (u, v) in enumerate(((y, z), (z, x), (x, y))):
        out[:, i, i] = 1.0 - b * (u * u + v * v)
    for i, j, turn, product in ((0, 1, z, x * y), (2, 0, y, z * x), (1, 2, x, y * z)):
        out[:, i, j], out[:, j, i] = b * product - a * turn, b * product + a * turn
    return out
