# Copyright 2026 ride_estimation contributors
"""What the linear balance of :mod:`travel` leaves out, to second order, taken out of the readings of the body.

Three products of motions: ``omega x (omega x r)`` in every accelerometer, the gyroscopic moment ``omega x I omega``, and sideways
mount forces that point up or down because the body is turned against the frame by ``theta``: their vertical part along body axes
is ``theta_y S_x - theta_x S_y``. With 2 kN sideways and a hundredth of a radian that is 20 N, the size of a small hidden law.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.spectra import edge_taper, make_grid
from ride_estimation.frames import COORDINATES

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class BodyMaps:
    """Linear maps of one body: C free coordinates, S accelerometers, U sideways mount forces, M transducers.

    Attributes
    ----------
    free
        Coordinates, as indices of ``x y z roll pitch yaw``.
    rows, motion
        Accelerations of the coordinates -> readings, (3 S, C), and back, (C, 3 S).
    mass, inertia
        Of the coordinates, (C, C); about the CG, (3, 3).
    rotations, offsets
        Of every accelerometer, (S, 3, 3), and its place from the CG [m], (S, 3).
    sideways
        Readings -> sideways forces by stiffness [N], (U, 3 S).
    along
        Axis of each, 0 or 1, (U,).
    lift
        Vertical unit force at its mount on the coordinates, (C, U).
    places
        Of the transducers in the plane [m], (M, 2).
    """

    free: tuple[int, ...]
    rows: Array
    motion: Array
    mass: Array
    inertia: Array
    rotations: Array
    offsets: Array
    sideways: Array
    along: NDArray[np.int64]
    lift: Array
    places: Array


def without_second_order(
    maps: BodyMaps, readings: Array, deflection: Array, rate_hz: float, band_hz: tuple[float, float]
) -> Array:
    """Return readings of which the linear balance holds, shape (N, 3 S).

    Parameters
    ----------
    readings
        Of the accelerometers, shape (N, 3 S).
    deflection
        Vertical, of the transducers [m], shape (N, M).
    rate_hz, band_hz
        Of the run; rates of turn are integrated within the band.
    """
    fade = edge_taper(len(readings), rate_hz)[:, None]
    dynamic = (readings - readings.mean(axis=0)) * fade
    travel = (deflection - deflection.mean(axis=0)) * fade
    grid = make_grid(len(dynamic), rate_hz, band_hz)
    turning = np.zeros((len(dynamic), 3))
    for row, c in enumerate(maps.free):
        if COORDINATES[c] in ("roll", "pitch", "yaw"):
            turning[:, c - 3] = dynamic @ maps.motion[row]
    omega = grid.signal(grid.spectrum(turning) / (1j * grid.omega[:, None]))
    plane = np.column_stack([np.ones(len(maps.places)), maps.places])
    _, by_x, by_y = np.linalg.pinv(plane) @ travel.T
    force = dynamic @ maps.sideways.T
    upward = np.where(maps.along == 0, -by_x[:, None] * force, -by_y[:, None] * force)
    wrench = upward @ maps.lift.T
    gyroscopic = np.cross(omega, omega @ maps.inertia.T)
    for row, c in enumerate(maps.free):
        if c >= 3:
            wrench[:, row] -= gyroscopic[:, c - 3]
    extra = np.linalg.solve(maps.mass, wrench.T).T @ maps.rows.T
    for i, (rotation, offset) in enumerate(zip(maps.rotations, maps.offsets)):
        extra[:, 3 * i : 3 * i + 3] += np.cross(omega, np.cross(omega, offset)) @ rotation
    return np.asarray(readings - extra)
