# Copyright 2026 ride_estimation contributors
"""How carried bodies (a seat with its driver) moved in a run: simulated from the motion of what carries them, and as measured."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.forces.carried_bodies import CarriedBodies
from ride_estimation.estimation.motion.motion_kernel import motion_at
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.frames import AXES
from ride_estimation.metrics import nrmse, pearson_r
from ride_estimation.signals.recording import Recording
from ride_estimation.signals.ticks import channel_at

Array = NDArray[np.float64]

#: a measurement that moves less than this many times its noise determines nothing of the motion along that axis
_LEAST_SIGNAL = 3.0


@dataclasses.dataclass(frozen=True)
class CarriedPoint:
    """Specific force at one point of a carried body over a run, axes of the vehicle file on the estimated body.

    Attributes
    ----------
    body, sensor
        Carried body and its accelerometer at the point; the sensor is empty where there is none: the point is then the CG.
    simulated
        From the estimated motion of the carrying body with the numbers of the vehicle file, shape (N, 3) [m/s^2].
    std
        Its standard deviation by what the vehicle file says of those numbers and by that of the carrying body's acceleration,
        which is passed on in full, shape (N, 3).
    measured
        By the sensor at the same ticks, shape (N, 3), None without one.
    noise
        Standard deviation of the noise of the sensor [m/s^2].
    """

    body: str
    sensor: str
    simulated: Array
    std: Array
    measured: Array | None = None
    noise: float = 0.0

    @property
    def place(self) -> str:
        """Return the body, or body and sensor."""
        return f"{self.body}.{self.sensor}" if self.sensor else self.body

    def scores(self, valid: NDArray[np.bool_]) -> dict[str, dict[str, float]]:
        """Return axis -> how the simulation agrees with the measurement, about the means; axes that were at rest are left out.

        Parameters
        ----------
        valid
            Ticks to compare, shape (N,).
        """
        if self.measured is None or np.sum(valid) < 2:
            return {}
        found = {}
        for i, axis in enumerate(AXES):
            measured, simulated = (v[valid, i] - np.mean(v[valid, i]) for v in (self.measured, self.simulated))
            if np.std(measured) < _LEAST_SIGNAL * self.noise or not np.std(measured) > 0.0:
                continue
            sigma = np.hypot(self.std[valid, i], self.noise)
            found[axis] = {
                "measured_rms_m_per_s2": float(np.std(measured)),
                "simulated_rms_m_per_s2": float(np.std(simulated)),
                "nrmse": nrmse(measured, simulated),
                "correlation": pearson_r(measured, simulated) if np.std(simulated) > 0.0 else 0.0,
                "std_m_per_s2": float(np.sqrt(np.mean(sigma**2))),
                "within_two_std": float(np.mean(np.abs(measured - simulated) <= 2.0 * sigma)),
            }
        return found


def carried_points(recording: Recording, pipeline: Pipeline, run: OfflineRun) -> tuple[CarriedPoint, ...]:
    """Return the points of all carried bodies: those of their accelerometers, or the CG of a body without one.

    Parameters
    ----------
    recording, pipeline, run
        What was read, the estimator it went through, what it found.
    """
    geometry = pipeline.geometry
    if geometry.carried is None or len(run.stamp_ns) < 2:
        return ()
    vehicle = geometry.vehicle
    s = run.signals
    motion = np.ascontiguousarray(s["cg_specific_force"])
    rate = np.ascontiguousarray(s["angular_rate"])
    dt = float(np.median(np.diff(run.stamp_ns))) * 1e-9
    bodies = CarriedBodies(geometry, pipeline.settings).motions(motion, rate, dt)
    found = []
    for body, (moved, spread) in bodies.items():
        cg = geometry.carried.bodies[body].cg
        std = np.hypot(spread[:, :3], s["cg_accel_std"][:, :3])
        point = CarriedPoint(body, "", moved[:, :3], std)
        sensors = [v for v in vehicle.sensors.values() if v.body == body and v.kind in ("accelerometer", "imu") and v.triaxial]
        here = []
        for sensor in sensors:
            values = channel_at(recording.channels[sensor.name], run.stamp_ns) if sensor.name in recording.channels else None
            if values is None:
                continue
            place = np.empty((len(rate), 1, 3))
            motion_at(np.ascontiguousarray(moved), rate, np.ascontiguousarray(sensor.position - cg)[None], place)
            measured = values[:, :3] @ sensor.rotation.T
            here.append(CarriedPoint(body, sensor.name, place[:, 0].copy(), std, measured, sensor.noise_std))
        found += here or [point]
    return tuple(found)


def carried_document(points: tuple[CarriedPoint, ...], valid: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """Return what ``result.json`` says of carried bodies."""
    return [
        {
            "body": p.body, "sensor": p.sensor or None,
            "simulated_rms_m_per_s2": [float(np.std(p.simulated[valid, i])) if valid.any() else None for i in range(3)],
            "measured_against_simulated": p.scores(valid),
        }
        for p in points
    ]  # fmt: skip
