# Copyright 2026 ride_estimation contributors
"""A made-up drive through a throw-away pipeline: afterwards every kernel that a drive needs is compiled and loaded."""

from __future__ import annotations

import math

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.vehicles.vehicle import Vehicle

#: length of the drive: long enough for the first estimate of the parameters [s]
_LENGTH_S = 10.0
#: its rate [Hz]
_RATE_HZ = 50.0
#: its first stamp [ns]
_START_NS = 1_000_000_000_000
#: vertical acceleration of the body in it [m/s^2]
_ACCEL = 1.0
#: the same of the bases [m/s^2]
_BASE_ACCEL = 0.6
#: its frequencies [Hz]
_HZ = (1.3, 3.1)
#: checksums of vehicle files and settings whose drive this process has been on: compiled code stays loaded as long as it lives
_driven: set[tuple[str, PipelineSettings]] = set()


def warm_up(vehicle: Vehicle, settings: PipelineSettings) -> None:
    """Run the drive, once per process for a vehicle file and settings: a node that is configured again has all it needs.

    Parameters
    ----------
    vehicle
        Whose sensors are made up.
    settings
        Of the pipeline.
    """
    key = (vehicle.checksum, settings)
    if key in _driven:
        return
    pipeline = Pipeline(vehicle, settings)
    body = {s.name for s in pipeline.geometry.body_sensors}
    period_ns = round(1e9 / _RATE_HZ)
    for k in range(round(_LENGTH_S * _RATE_HZ)):
        wave = sum(math.sin(2.0 * math.pi * f * k / _RATE_HZ) for f in _HZ)
        for sensor in vehicle.sensors.values():
            size = _ACCEL if sensor.name in body else _BASE_ACCEL
            # a little of its own in every sample, or it would count as stuck
            sample = [1e-3 * math.sin(0.3 * k + channel) for channel in range(sensor.channels)]
            if sensor.kind in ("accelerometer", "imu"):
                up = sensor.rotation[2] * (vehicle.gravity + size * wave)
                sample[:3] = [v + float(u) for v, u in zip(sample, up)]
            pipeline.observe(sensor.name, _START_NS + k * period_ns, sample, None)
    pipeline.finish()
    pipeline.parameters()
    pipeline.health()
    if vehicle.checksum:
        _driven.add(key)
