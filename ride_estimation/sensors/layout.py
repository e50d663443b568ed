# Copyright 2026 ride_estimation contributors
"""What a set of accelerometers on one rigid body can tell about its motion: rank, condition, what is missing.

Row of one accelerometer axis e at r from the CG: ``e^T [I, -skew(r)] [a, alpha]`` (rigid body, small rates; document 000,
matrix B). A gyro adds the three angular accelerations as the derivative of its rates.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: scaled condition number above which small position errors spoil a direction
CONDITION_LIMIT = 100.0
_WORDS = {
    "x": "longitudinal acceleration", "y": "lateral acceleration", "z": "vertical acceleration",
    "roll": "roll acceleration", "pitch": "pitch acceleration", "yaw": "yaw acceleration",
}


@dataclasses.dataclass(frozen=True)
class LayoutCheck:
    """What a layout determines.

    Attributes
    ----------
    coordinates
        Coordinates asked for.
    channels
        Accelerometer channels on the body.
    rank
        Independent directions the accelerometers determine.
    rank_with_gyro
        The same with the derivative of the gyro rates.
    condition
        Condition number with rotations scaled by the size of the layout, ``inf`` where rank is missing.
    length
        Root mean square distance of the sensors from the CG [m], the scale of the rotations.
    undetermined
        Directions that even the gyro does not add, in words.
    """

    coordinates: tuple[str, ...]
    channels: int
    rank: int
    rank_with_gyro: int
    condition: float
    length: float
    undetermined: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Return whether accelerometers and gyros together determine all coordinates."""
        return self.rank_with_gyro == len(self.coordinates)

    @property
    def accelerometers_suffice(self) -> bool:
        """Return whether the accelerometers alone determine all coordinates."""
        return self.rank == len(self.coordinates)

    def sentence(self, body: str) -> str:
        """Return the result in words, for reports, diagnostics and errors."""
        needed = len(self.coordinates)
        if self.channels == 0:
            return f"no accelerometer sits on body {body!r}: nothing about its motion can be estimated"
        if not self.complete:
            return (
                f"the {self.channels} accelerometer channels on body {body!r} determine {self.rank_with_gyro} of {needed} "
                f"motion components; not determined: {', '.join(self.undetermined)}. Six components need at least three "
                "triaxial accelerometers that are not on one line (or one with gyro, kind imu), or as many single axes"
            )
        if not self.accelerometers_suffice:
            return (
                f"the {self.channels} accelerometer channels on body {body!r} determine {self.rank} of {needed} motion "
                "components; the rest comes from differentiated gyro rates only, and nothing checks one channel against another"
            )
        spare = self.channels - needed
        text = (
            f"{self.channels} accelerometer channels on body {body!r} determine all {needed} motion components, "
            f"{spare} are left to check them"
        )
        if self.condition > CONDITION_LIMIT:
            text += f"; the layout is badly conditioned ({self.condition:.0f}): sensors are nearly on one line or close together"
        return text


def measured_channels(sensors: Iterable[Sensor]) -> NDArray[np.bool_]:
    """Return which of three channels per accelerometer are measured, shape (3 S,)."""
    return np.array([axis in sensor.axes for sensor in sensors for axis in AXES], dtype=bool)


def residual_projection(rows: Array) -> Array:
    """Return what readings leave of themselves beside the rigid motion that fits them best, ``P = D - H H^+``, shape (C, C).

    D is one for every channel that is measured: a row of zeros is of an axis that is not, and no equation.

    Parameters
    ----------
    rows
        H of :func:`motion_rows` or some of its rows, shape (C, 6).
    """
    measured = np.any(rows != 0.0, axis=1).astype(float)
    return np.asarray(np.diag(measured) - rows @ np.linalg.pinv(rows, rcond=1e-6))


def motion_rows(sensors: Iterable[Sensor], cg: Array) -> Array:
    """Return the rows that map (a_cg, alpha) to the accelerometer samples in sensor axes, shape (3 S, 6).

    Rows of axes that are not measured are zero.

    Parameters
    ----------
    sensors
        Accelerometers and IMUs of one body, in the order of the rows.
    cg
        Centre of gravity [m], shape (3,).
    """
    rows = [
        sensor.measured[:3, None] * (sensor.rotation.T @ point_motion_matrix(sensor.position - cg)) for sensor in sensors
    ]
    return np.vstack(rows) if rows else np.zeros((0, 6))


def check_layout(sensors: Sequence[Sensor], cg: Array, coordinates: Sequence[str] = COORDINATES) -> LayoutCheck:
    """Judge the accelerometers on one body.

    Parameters
    ----------
    sensors
        Sensors of the body; other kinds than ``accelerometer`` and ``imu`` are passed over.
    cg
        Centre of gravity [m], shape (3,).
    coordinates
        Coordinates to be determined, a subset of :data:`ride_estimation.frames.COORDINATES`.

    Returns
    -------
    LayoutCheck
        Rank by singular values relative to 1e-6 of the largest.
    """
    accelerometers = [s for s in sensors if s.kind in ("accelerometer", "imu")]
    columns = [COORDINATES.index(c) for c in coordinates]
    rows = motion_rows(accelerometers, cg)[:, columns]
    distances = [float(np.linalg.norm(s.position - cg)) for s in accelerometers]
    length = float(np.sqrt(np.mean(np.square(distances)))) if distances else 0.0
    scale = np.array([1.0 if c in ("x", "y", "z") else 1.0 / max(length, 1e-3) for c in coordinates])
    scaled = rows * scale
    gyro_rows = np.zeros((0, len(columns)))
    if any(s.kind == "imu" for s in accelerometers):
        gyro_rows = np.eye(6)[3:][:, columns]
    singular = np.linalg.svd(scaled, compute_uv=False) if len(scaled) else np.zeros(0)
    rank = int(np.sum(singular > 1e-6 * singular[0])) if singular.size else 0
    _, singular_all, directions = np.linalg.svd(np.vstack([scaled, gyro_rows, np.zeros((len(columns), len(columns)))]))
    rank_all = int(np.sum(singular_all > 1e-6 * singular_all[0])) if singular_all[0] > 0.0 else 0
    undetermined = tuple(_direction_words(directions[i] * scale, coordinates) for i in range(rank_all, len(columns)))
    condition = float(singular[0] / singular[-1]) if rank == len(columns) else float("inf")
    channels = int(np.count_nonzero(measured_channels(accelerometers)))
    return LayoutCheck(tuple(coordinates), channels, rank, rank_all, condition, length, undetermined)


def _direction_words(direction: Array, coordinates: Sequence[str]) -> str:
    shares = np.abs(direction) / np.max(np.abs(direction))
    parts = [_WORDS[c] for c, share in zip(coordinates, shares) if share > 0.1]
    return parts[0] if len(parts) == 1 else f"the combination of {' and '.join(parts)}"


def b_matrix(sensors: Sequence[tuple[Array, str]]) -> Array:
    """Return B of document 000 eq. (3): rows ``[e, r x e]`` of single channels, shape (C, 6).

    Parameters
    ----------
    sensors
        Per channel the place relative to the CG [m] and the axis ``x``, ``y`` or ``z``.

    Raises
    ------
    ConfigurationError
        Six channels that do not determine the six accelerations (document 000: three sensors on one line in plan, or
        sensors 2 and 3 with equal x).
    """
    rows = []
    for place, axis in sensors:
        e = np.eye(3)["xyz".index(axis)]
        rows.append(np.concatenate([e, np.cross(np.asarray(place, dtype=float), e)]))
    matrix = np.array(rows)
    singular = np.linalg.svd(matrix, compute_uv=False)
    if len(matrix) < 6 or singular[-1] < 1e-9 * singular[0]:
        raise ConfigurationError(
            f"{len(matrix)} channels of rank {int(np.sum(singular > 1e-9 * singular[0]))} do not determine the six "
            "accelerations of a body; place three triaxial sensors off one line", where="sensor layout",
        )  # fmt: skip
    return matrix
