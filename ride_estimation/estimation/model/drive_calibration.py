# Copyright 2026 ride_estimation contributors
"""Gain, misalignment, position, delay and bias of every sensor from a recorded drive, with covariance.

The errors of the sensors are slow states of the model (:mod:`ride_estimation.estimation.model.joint`), estimated together with
stiffness, damping, inertia and bracket tilt. What no drive shows keeps the standard deviation of its installation.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.joint import DETERMINED, LARGEST_NIS, JointEstimate
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.readings import axes
from ride_estimation.estimation.model.run_parameters import load_in_words
from ride_estimation.estimation.model.run_readings import SHORTEST_SEGMENT_S, run_readings
from ride_estimation.estimation.model.states import error_std, reading_width
from ride_estimation.sensors.installation import USUAL, Installation
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.correction import Correction
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: shortest sum of segments [s]
_SHORTEST_S = 20.0
#: rms of the moving readings over their noise, below which there is nothing to calibrate with
_LEAST_SIGNAL = 5.0
_KINDS = ("gain", "misalignment", "position", "delay", "bias")


@dataclasses.dataclass(frozen=True)
class CalibratedSensor:
    """What a drive tells about one sensor.

    Attributes
    ----------
    sensor
        The sensor with what was found, its installation what is left uncertain.
    errors, stds
        By kind of error the values found and their standard deviations, shape (1,) or (3,): bias [unit], gain [-],
        misalignment [rad] (rotation vector, sensor axes), position [m] (axes of the body), delay [s].
    determined
        By kind the values of which the drive halved the prior standard deviation or better.
    """

    sensor: Sensor
    errors: Mapping[str, Array]
    stds: Mapping[str, Array]
    determined: Mapping[str, NDArray[np.bool_]]


@dataclasses.dataclass(frozen=True)
class DriveCalibration:
    """Calibration of the sensors of a vehicle.

    Attributes
    ----------
    sensors
        By name.
    names, covariance
        ``sensor.kind[.axis]`` of every error and their joint covariance, shape (E, E).
    nis, largest_nis
        Mean normalised square of what no motion of the base explains, over all frequencies and in the octave where it is largest:
        1 where the model explains the readings.
    duration_s
        Time that was used.
    conflicts
        Errors in ``names`` that moved although the drive hardly determines them: the model misses something that they explain.
    findings
        Sentences.
    """

    sensors: Mapping[str, CalibratedSensor]
    names: tuple[str, ...]
    covariance: Array
    nis: float
    largest_nis: float
    duration_s: float
    conflicts: tuple[str, ...]
    findings: tuple[str, ...]

    @property
    def usable(self) -> bool:
        """Return whether the model describes the drive well enough."""
        return not self.conflicts and self.largest_nis <= LARGEST_NIS

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with the calibrated sensors."""
        found = {name: self.sensors[name].sensor if name in self.sensors else s for name, s in vehicle.sensors.items()}
        return dataclasses.replace(vehicle, sensors=found, checksum="")


def calibrate_drive(recording: Recording, vehicle: Vehicle) -> DriveCalibration:
    """Calibrate the sensors of a vehicle from a drive that moves it in all axes, about a minute.

    Parameters
    ----------
    recording
        The drive; accelerometers on the body and at the base of every mount, transducers where there are some.
    vehicle
        Its corrections are taken off the readings first; what is found comes on top of them.

    Raises
    ------
    ConfigurationError
        The vehicle is none the model describes.
    InputDataError
        Too short, a sensor missing, or hardly any motion.
    """
    found = run_readings(recording, vehicle)
    plant, segments = found.plant, found.segments
    duration = sum(len(s) for s in segments) * found.dt
    if duration < _SHORTEST_S:
        raise InputDataError(
            f"{recording.name}: {duration:.1f} s in which all {len(plant.sensors)} sensors have data without a gap for "
            f"{SHORTEST_SEGMENT_S:g} s or longer; at least {_SHORTEST_S:g} s are needed"
        )
    _require_motion(recording.name, segments, plant)
    joint = JointEstimate(plant, segments, found.dt)
    joint.fit()
    return _result(vehicle, plant, joint, duration)


def _require_motion(name: str, segments: Sequence[Array], plant: Plant) -> None:
    moving = np.vstack([s - s.mean(axis=0) for s in segments])
    at = 0
    ratio = []
    for s in plant.sensors:
        width = reading_width(s)
        ratio.append(float(np.sqrt(np.mean(moving[:, at : at + width] ** 2))) / s.noise_std)
        at += width
    if min(ratio) < _LEAST_SIGNAL:
        still = plant.sensors[int(np.argmin(ratio))].name
        raise InputDataError(
            f"{name}: {still} moves {min(ratio):.1f} times its noise; at least {_LEAST_SIGNAL:g} are needed. "
            "Drive over a rough road, brake and steer (without --drive: calibration at standstill)"
        )


def _result(vehicle: Vehicle, plant: Plant, joint: JointEstimate, duration: float) -> DriveCalibration:
    std = np.sqrt(np.diag(joint.covariance))
    found: dict[str, CalibratedSensor] = {}
    names: list[str] = []
    places: list[int] = []
    for sensor in plant.sensors:
        parts = plant.slow.sensors[sensor.name]
        kinds = [k for k in _KINDS if k in parts]
        errors, stds = {k: joint.theta[parts[k]] for k in kinds}, {k: std[parts[k]] for k in kinds}
        determined = {k: stds[k] < DETERMINED * plant.slow.std[parts[k]] for k in kinds}
        original = vehicle.sensors[sensor.name]
        found[sensor.name] = CalibratedSensor(_corrected(original, errors, stds), errors, stds, determined)
        for k in kinds:
            names += plant.slow.names(sensor.name, k)
            places += range(parts[k].start, parts[k].stop)
    covariance, conflicts = joint.covariance[np.ix_(places, places)], joint.conflicts()
    return DriveCalibration(
        found, tuple(names), covariance, joint.nis, joint.largest_nis, duration, conflicts,
        _findings(found, joint.largest_nis, conflicts, load_in_words(joint)),
    )


def _corrected(sensor: Sensor, errors: Mapping[str, Array], stds: Mapping[str, Array]) -> Sensor:
    """Return a sensor whose description contains the errors found."""
    count = reading_width(sensor)
    known = sensor.correction
    gain = known.gains(count) * (1.0 + errors["gain"])
    bias = known.biases(count) + known.gains(count) * errors["bias"]
    correction = Correction(known.delay + float(errors["delay"][0]), tuple(gain.tolist()), tuple(bias.tolist()))

    def size(kind: str) -> float:
        return float(np.sqrt(np.mean(stds[kind] ** 2)))

    if count == 1:
        left = Installation(gain=size("gain"), delay=size("delay"), travel_zero=size("bias"))
        return dataclasses.replace(sensor, correction=correction, installation=left)
    return dataclasses.replace(
        sensor, correction=correction, position=sensor.position + errors["position"],
        rotation=axes(sensor, errors["misalignment"]), installation=Installation(**{k: size(k) for k in _KINDS}),
    )  # fmt: skip


def _findings(
    found: Mapping[str, CalibratedSensor], largest_nis: float, conflicts: Sequence[str], load: str
) -> tuple[str, ...]:
    words = []
    for kind in _KINDS:
        open_ = [n for n, c in found.items() if kind in c.determined and not np.any(c.determined[kind])]
        if open_:
            words.append(f"{kind}: not determined by this drive, the standard deviation stays near that of the installation: "
                         f"{', '.join(open_)}")  # fmt: skip
    words.append("delay: relative to the mean of all sensors; a delay common to all is not observable")
    words.append("gain: the part common to all sensors is observable from gravity along z only, through the bias that is stated")
    if load and largest_nis <= LARGEST_NIS:
        words.append(f"{load}; errors of sensors do not depend on it")
    if largest_nis > LARGEST_NIS:
        words.append(
            f"do not use this: the model does not explain the readings (NIS {largest_nis:.1f} in one octave): a law that is not "
            "linear, a fault, or another vehicle"
        )
    if conflicts:
        words.append(
            f"do not use this: {', '.join(conflicts[:6])}{' ...' if len(conflicts) > 6 else ''} explain motion of the vehicle "
            "that the model does not contain, or the sensors are installed worse than `installation` states"
        )
    for name, c in found.items():
        for kind, values in c.errors.items():
            prior = error_std(USUAL, kind, c.sensor.kind == "displacement")
            if np.any(np.abs(values) > 4.0 * prior):
                words.append(f"{name}: {kind} beyond four standard deviations of a usual installation: check the sensor")
    return tuple(words)


def summary_lines(found: DriveCalibration) -> Sequence[str]:
    """Return the table a command prints; what the drive does not determine is in brackets."""
    lines = [
        f"{found.duration_s:.1f} s; normalised residual squared (NIS) {found.nis:.2f}, worst octave {found.largest_nis:.2f} "
        "(1: the model explains the readings)",
        f"{'sensor':<22}{'error':<14}{'x':>20}{'y':>20}{'z':>20}  unit",
    ]
    units = {"gain": (100.0, "%"), "misalignment": (math.degrees(1.0), "deg"), "position": (1e3, "mm"), "delay": (1e3, "ms")}
    for name, c in found.sensors.items():
        travel = c.sensor.kind == "displacement"
        for kind, values in c.errors.items():
            factor, unit = units.get(kind, (1e3, "mm") if travel else (1.0, "m/s^2"))
            cells = []
            for value, std, known in zip(values, c.stds[kind], c.determined[kind]):
                text = f"{factor * value:.3f} +- {factor * std:.3f}"
                cells.append(text if known else f"({text})")
            table = "".join(f"{cell:>20}" for cell in [*cells, "", ""][:3])
            lines.append(f"{name:<22}{kind:<14}{table}  {unit}")
    return [*lines, *found.findings]
