# Copyright 2026 ride_estimation contributors
"""The sensors of a vehicle as streams of the stamp aligner."""

from __future__ import annotations

from collections.abc import Iterable

from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.streams import StreamSpec


def stream_specs(sensors: Iterable[Sensor]) -> tuple[StreamSpec, ...]:
    """Return one stream per sensor in the order given.

    Accelerometers define rate and phase of the time base; nobody waits for the vehicle speed, whose last value is held.

    Parameters
    ----------
    sensors
        Sensors of a vehicle file.
    """
    return tuple(
        StreamSpec(
            s.name, s.channels, waited_for=s.kind != "speed", reference=s.kind in ("accelerometer", "imu"),
            correction=s.correction, largest=s.largest,
        )
        for s in sensors
    )
