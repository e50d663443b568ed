# Copyright 2026 ride_estimation contributors
"""Noise, bias and orientation of sensors from a recording at standstill.

At rest an accelerometer reads gravity. What it reads along gravity beyond 1 g is bias; what it reads across is a bias or a
wrong mounting angle, and one standstill cannot tell which: below a limit that a good sensor's bias does not exceed it is
taken for bias, above for an angle. The direction of gravity comes from all accelerometers together (the bodies stand in
their rest position, so their axes are parallel), so that a slope under the vehicle does no harm; an error that all
sensors share cannot be seen.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.frames import skew
from ride_estimation.sensors.sensor import SENSOR_KINDS, Sensor
from ride_estimation.signals.correction import Correction
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

SHORTEST_S = 5.0
BLOCK_S = 1.0
#: scatter of one-second means beyond what the noise explains, from which the vehicle moved [m/s^2, rad/s, m, m/s, N]
_MOVING = {"accelerometer": 0.03, "imu": 0.03, "displacement": 2e-4, "speed": 0.05, "force": 50.0}
_MOVING_GYRO = 0.01
#: bias across gravity above which a mounting angle is the likelier reason: zero-g offset of MEMS sensors, 15 mg [m/s^2]
BIAS_LIMIT = 0.15
#: sample variance over that of the flat part of the spectrum, from which there is more than noise (an engine)
_LINES = 2.0
#: angles above are no mounting error but another axis
_LARGEST_ANGLE = math.radians(20.0)


@dataclasses.dataclass(frozen=True)
class SensorCalibration:
    """What a standstill tells about one sensor.

    Attributes
    ----------
    sensor
        The sensor with what was found.
    noise, noise_before
        Standard deviation of one sample, found and of the vehicle file [unit of the sensor].
    gyro_noise
        [rad/s], None without gyro.
    gyro_bias
        Mean rate at rest [rad/s], shape (3,), None without gyro; it is reported, the estimator tracks it by itself.
    bias
        Found, shape (axes,) [unit]; zeros where nothing was found.
    bias_std
        Standard deviation of the mean [unit].
    angle_deg
        Mounting angle taken out of the rotation [deg].
    findings
        Sentences.
    """

    sensor: Sensor
    noise: float
    noise_before: float
    gyro_noise: float | None
    gyro_bias: Array | None
    bias: Array
    bias_std: float
    angle_deg: float
    findings: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Standstill:
    """Calibration of a vehicle.

    Attributes
    ----------
    sensors
        By name.
    slope_deg
        Angle between gravity and the z axis of the vehicle file: the slope it stood on, or an error all sensors share.
    duration_s
        Of the recording.
    """

    sensors: Mapping[str, SensorCalibration]
    slope_deg: float
    duration_s: float

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with the calibrated sensors."""
        found = {name: self.sensors[name].sensor if name in self.sensors else s for name, s in vehicle.sensors.items()}
        return dataclasses.replace(vehicle, sensors=found, checksum="")


def calibrate(recording: Recording, vehicle: Vehicle) -> Standstill:
    """Calibrate the sensors of a vehicle.

    Parameters
    ----------
    recording
        Vehicle standing, engine off, nobody moving; at least five seconds.
    vehicle
        Its sensors' rotations are the starting point; known corrections are taken off the readings first.

    Raises
    ------
    InputDataError
        Too short, the vehicle moved, or gravity is not where the vehicle file expects it.
    """
    stats = {name: _statistics(vehicle.sensors[name], channel) for name, channel in recording.channels.items()}
    short = [f"{name} ({s.duration:.1f} s)" for name, s in stats.items() if s.duration < SHORTEST_S]
    if short:
        raise InputDataError(f"{recording.name}: at least {SHORTEST_S:g} s of standstill are needed; given {', '.join(short)}")
    moving = [f"{name}: {s.moving}" for name, s in stats.items() if s.moving]
    if moving:
        raise InputDataError(f"{recording.name}: the vehicle did not stand still\n  - " + "\n  - ".join(moving))
    gravity = _gravity_direction(recording, vehicle, stats)
    found = {name: _calibrated(vehicle.sensors[name], s, gravity, vehicle.gravity) for name, s in stats.items()}
    slope = math.degrees(math.acos(min(float(gravity[2]), 1.0))) if gravity is not None else 0.0
    return Standstill(found, slope, max(s.duration for s in stats.values()))


@dataclasses.dataclass(frozen=True)
class _Statistics:
    mean: Array
    std: Array
    floor: Array  # standard deviation of the flat part of the spectrum
    mean_std: Array
    duration: float
    moving: str


def _statistics(sensor: Sensor, channel: Channel) -> _Statistics:
    good = np.all(np.isfinite(channel.values), axis=1)
    values, stamps = sensor.correction.apply(channel.values[good]), channel.stamp_ns[good]
    count = sensor.channels
    duration = float(np.ptp(stamps)) * 1e-9 if len(stamps) > 1 else 0.0
    period = float(np.median(np.diff(np.unique(stamps)))) * 1e-9 if duration > 0.0 else 0.0
    block = max(round(BLOCK_S / period), 2) if period > 0.0 else 2
    if duration < SHORTEST_S or len(values) * BLOCK_S < SHORTEST_S * block:
        zero = np.zeros(count)
        return _Statistics(zero, zero, zero, zero, min(duration, len(values) / block * BLOCK_S), "")
    blocks = values[: len(values) // block * block].reshape(-1, block, count)
    means, std = blocks.mean(axis=1), np.sqrt(np.mean(blocks.var(axis=1, ddof=1), axis=0))
    scatter = means.std(axis=0, ddof=1)
    limits = np.full(count, _MOVING[sensor.kind])
    limits[3:] = _MOVING_GYRO
    density = scipy.signal.welch(values, 1.0 / period, nperseg=min(block * 2, len(values)), axis=0, detrend="linear")[1][1:]
    floor = np.sqrt(np.median(density, axis=0) * 0.5 / period)
    # the noise alone makes the means scatter too; an engine does not, its vibration is over within a second
    limits = limits + 4.0 * floor / math.sqrt(block)
    moving = ""
    if np.any(scatter > limits):
        worst = int(np.argmax(scatter / limits))
        unit = SENSOR_KINDS[sensor.kind][1].split(", ")[worst // 3]
        moving = f"its one-second means scatter by {scatter[worst]:.2g} {unit} (at rest below {limits[worst]:.2g})"
    return _Statistics(values.mean(axis=0), std, floor, scatter / math.sqrt(len(means)), duration, moving)


def _gravity_direction(recording: Recording, vehicle: Vehicle, stats: Mapping[str, _Statistics]) -> Array | None:
    """Return the direction of gravity's reaction in the axes of the vehicle file, from all accelerometers."""
    directions = []
    for name, s in stats.items():
        sensor = vehicle.sensors[name]
        if sensor.kind not in ("accelerometer", "imu") or sensor.coupling != "dc" or not sensor.triaxial:
            continue
        reading = sensor.rotation @ s.mean[:3]
        size = float(np.linalg.norm(reading))
        if abs(size - vehicle.gravity) > 0.1 * vehicle.gravity:
            raise InputDataError(
                f"{recording.name}: {name} reads {size:.3g} m/s^2 at rest instead of {vehicle.gravity:.4g}: unit, range or fault"
            )
        directions.append(reading / size)
    if not directions:
        return None
    middle = np.median(directions, axis=0)
    return np.asarray(middle / np.linalg.norm(middle))


def _calibrated(sensor: Sensor, s: _Statistics, gravity: Array | None, g: float) -> SensorCalibration:
    findings: list[str] = []
    motion = sensor.kind in ("accelerometer", "imu")
    axes = 3 if sensor.channels >= 3 else 1
    measured = np.flatnonzero(sensor.measured[:axes])
    noise = _noise(s.std[measured], s.floor[measured], findings)
    gyro_noise = _noise(s.std[3:6], s.floor[3:6], findings) if sensor.kind == "imu" else None
    bias, angle, rotation = np.zeros(axes), 0.0, sensor.rotation
    if motion and gravity is not None and sensor.coupling == "dc" and not sensor.triaxial:
        bias = _zero(sensor, s.mean[:3], g * gravity, findings)
    elif motion and gravity is not None and sensor.coupling == "dc":
        bias, angle, rotation = _orientation(sensor, s.mean[:3], gravity, g, findings)
    elif sensor.kind == "displacement":
        # deflection counts from static equilibrium, where the vehicle stands
        bias = s.mean[:1]
    if sensor.kind == "imu":
        findings.append(f"gyro reads {', '.join(f'{v:.2g}' for v in s.mean[3:6])} rad/s at rest")
    known = sensor.correction
    total = known.biases(axes) + known.gains(axes) * bias
    if np.any(total != 0.0):
        known = Correction(known.delay, tuple(known.gains(axes).tolist()), tuple(float(v) for v in total))
    changed = dataclasses.replace(sensor, noise_std=noise, rotation=rotation, correction=known)
    if gyro_noise is not None:
        changed = dataclasses.replace(changed, gyro_noise_std=gyro_noise)
    return SensorCalibration(
        changed, noise, sensor.noise_std, gyro_noise, s.mean[3:6] if sensor.kind == "imu" else None, bias,
        float(np.max(s.mean_std[:axes])), math.degrees(angle), tuple(findings),
    )  # fmt: skip


def _noise(std: Array, floor: Array, findings: list[str]) -> float:
    """Return the noise of one sample; where there is more than noise, that of the flat part of the spectrum."""
    if np.all(std == 0.0):
        findings.append("the values do not change at all: dead, or coarser than its noise")
        return 1e-9
    ratio = float(np.sqrt(np.mean(std**2) / max(float(np.mean(floor**2)), 1e-300)))
    if ratio**2 > _LINES and np.all(floor > 0.0):
        findings.append(
            f"moves {ratio:.1f} times its noise (engine, wind, people): the noise is that of the flat part of the spectrum; "
            "calibrate with the engine off"
        )
        return float(np.sqrt(np.mean(floor**2)))
    return float(np.sqrt(np.mean(std**2)))


def _zero(sensor: Sensor, mean: Array, gravity: Array, findings: list[str]) -> Array:
    """Return the bias of an accelerometer that does not measure all axes, in sensor axes: how it leans it does not show."""
    away = sensor.only_measured(mean - sensor.rotation.T @ gravity)
    if float(np.abs(away).max()) > _LARGEST_ANGLE * float(np.linalg.norm(gravity)):
        raise InputDataError(
            f"{sensor.name} reads {float(np.abs(away).max()):.2g} m/s^2 beside what gravity is along its axes: its rotation in "
            "the vehicle file is wrong, or its unit or range, or it is faulty"
        )
    named = ", ".join(sensor.axes)
    findings.append(f"measures {named} only: what it reads at rest is taken as bias, an angle would read the same")
    return np.asarray(away)


def _orientation(
    sensor: Sensor, mean: Array, gravity: Array, g: float, findings: list[str]
) -> tuple[Array, float, Array]:
    """Return bias in sensor axes, mounting angle [rad] and the new rotation."""
    reading = sensor.rotation @ mean
    along = float(reading @ gravity)
    across = reading - along * gravity
    rotation, angle = sensor.rotation, 0.0
    if float(np.linalg.norm(across)) > BIAS_LIMIT:
        angle = math.atan2(float(np.linalg.norm(across)), along)
        if angle > _LARGEST_ANGLE:
            raise InputDataError(
                f"{sensor.name}: gravity is {math.degrees(angle):.0f} deg off where the other sensors see it: its rotation "
                "in the vehicle file is wrong, not a mounting error"
            )
        rotation = _rotation_between(reading, gravity) @ sensor.rotation
        findings.append(f"misaligned by {math.degrees(angle):.2f} deg about a horizontal axis (heading is not observable)")
        left = (float(np.linalg.norm(reading)) - g) * gravity
    else:
        left = reading - g * gravity
    return np.asarray(rotation.T @ left), angle, np.asarray(rotation)


def _rotation_between(start: Array, end: Array) -> Array:
    """Return the smallest rotation that takes the direction of one vector to that of another, less than 180 deg apart.

    ``1 + S + S^2 / (1 + a . b)`` with ``S u = (a x b) x u`` for the unit vectors a and b.
    """
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    s = skew(np.cross(a, b))
    return np.asarray(np.eye(3) + s + s @ s / (1.0 + float(a @ b)))


def summary_lines(found: Standstill) -> Sequence[str]:
    """Return the table a command prints."""
    lines = [
        f"{found.duration_s:.1f} s at rest; gravity is {found.slope_deg:.2f} deg off z (slope, or an error of all sensors)",
        f"{'sensor':<24}{'noise':>10}{'was':>10}  {'bias':<30}{'unit':<8}{'angle [deg]':>12}",
    ]
    for name, c in found.sensors.items():
        bias = "  ".join(f"{v:>8.2g}" for v in c.bias)
        unit = SENSOR_KINDS[c.sensor.kind][1].partition(",")[0]
        lines.append(f"{name:<24}{c.noise:>10.2g}{c.noise_before:>10.2g}  {bias:<30}{unit:<8}{c.angle_deg:>12.2f}")
        lines += [f"    {finding}" for finding in c.findings]
    return lines
