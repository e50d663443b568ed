# Copyright 2026 ride_estimation contributors
"""What is wrong with the input and the estimates: counts by reason, clipping, statistics, sentences for people."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import AWAY, Geometry, base_distances, base_transport
from ride_estimation.estimation.motion.residuals import ResidualTest
from ride_estimation.estimation.sensor_errors.sensor_faults import Fault
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.streams import StreamHealth

Array = NDArray[np.float64]


#: share of the distance to its own mount within which a base sensor is at another one
_NEARER = 0.3
#: share of the fastest rate below which a sensor is slower than the others
_SLOWER = 0.8


@dataclasses.dataclass(frozen=True)
class SensorHealth:
    """One sensor since the start: counts of ticks and samples, rate, what was rejected and why.

    Attributes
    ----------
    clipped
        Ticks at full scale.
    invalid_ticks
        Ticks without a usable sample.
    residual_ratio
        Root mean square residual over its expected value, largest channel; 1 is right, NaN never (0 where not tested).
    refused
        Reason -> ticks at which samples were there but not fit to be used.
    """

    name: str
    accepted: int
    rejected: Mapping[str, int]
    rate_hz: float
    gaps: int
    longest_gap_s: float
    silent: bool
    clipped: int
    invalid_ticks: int
    residual_ratio: float
    refused: Mapping[str, int] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Health:
    """State of the whole pipeline.

    Attributes
    ----------
    sensors
        By name.
    restarts
        Reason -> times the time base began anew.
    unknown_samples
        Name -> samples of sensors the vehicle file does not have or the estimator does not use.
    ticks, invalid_ticks
        Ticks handed out, and those without complete motion.
    residual
        Test of the redundant equations of the CG motion.
    equilibrium_ratio
        Mean squared residual of equilibrium per component over its stated variance.
    innovation_ratio
        The same for the parameter estimator, 0 before it started.
    excited
        Whether the last interval taught the parameters something.
    at_bound
        Parameters at a bound.
    messages
        Sentences for the person in the field, most important first.
    faults
        Numerical faults: words -> times.
    faulty
        Whether the estimates are not yet those of before the last of them.
    """

    sensors: Mapping[str, SensorHealth]
    restarts: Mapping[str, int]
    unknown_samples: Mapping[str, int]
    ticks: int
    invalid_ticks: int
    residual: ResidualTest
    equilibrium_ratio: float
    innovation_ratio: float
    excited: bool
    at_bound: tuple[str, ...]
    messages: tuple[str, ...]
    faults: Mapping[str, int] = dataclasses.field(default_factory=dict)
    faulty: bool = False

    @property
    def ok(self) -> bool:
        """Return whether there is nothing to report."""
        return not self.messages


def residual_message(test: ResidualTest) -> str:
    """Return the residual test in words, empty where it passed."""
    return "" if test.passed else _disagreement(test)


def rate_message(sensors: Sequence[Sensor], health: Mapping[str, SensorHealth]) -> str:
    """Return which accelerometers sample more slowly than the others and what that means, empty where none does."""
    rates_hz = {s.name: health[s.name].rate_hz for s in sensors if s.kind in ("accelerometer", "imu")}
    fastest = max(rates_hz.values(), default=0.0)
    slow = {name: rate for name, rate in rates_hz.items() if 0.0 < rate < _SLOWER * fastest}
    if not slow:
        return ""
    names = ", ".join(f"{name} samples at {rate:.0f} Hz" for name, rate in slow.items())
    return (
        f"{names} where others do at {fastest:.0f} Hz: quick motion that a slower sensor does not see looks like an error of "
        "gain or mounting. Filter all sensors of a body alike"
    )


def _disagreement(test: ResidualTest) -> str:
    """Return the test that failed in words."""
    if test.fault is not None:
        return _fault_message(test.fault)
    size = np.sqrt(test.ratio)
    text = f"the accelerometers of the body disagree with one rigid body {size:.1f} times more than noise and tolerances explain"
    if test.explained < 0.5:
        return f"{text}; no single sensor explains it (a flexible body, a common delay, several wrong positions or rotations)"
    if test.rivals:
        return f"{text}; {test.sensor} explains {100 * test.explained:.0f} % of it, but {', '.join(test.rivals)} could as well"
    return (
        f"{text}; {test.sensor} explains {100 * test.explained:.0f} % of it: check its position, rotation, gain, delay and fixing"
    )


def _fault_message(fault: Fault) -> str:
    """Return a constant error of a sensor in words."""
    text = f"the accelerometers of the body disagree with one rigid body: {fault.sensor} explains"
    text = f"{text} {100 * fault.explained:.0f} % of it by its {fault.kind} ({fault.amount})"
    if fault.rivals:
        return f"{text}, but an error of {', '.join(fault.rivals)} could as well"
    return f"{text}: check its position, rotation, gain, delay and fixing"


def sensor_messages(sensors: Sequence[SensorHealth], ticks: int) -> list[str]:
    """Return one sentence per sensor that is not well."""
    found = []
    for s in sensors:
        if s.accepted == 0:
            found.append(f"{s.name} is configured but contributed no sample; rejected: {_counts(s.rejected) or 'none'}")
            continue
        if s.silent:
            found.append(f"{s.name} has stopped")
        if s.clipped:
            found.append(
                f"{s.name} was at full scale during {s.clipped} of {ticks} ticks: forces and parameters there are too small"
            )
        if s.rejected:
            found.append(f"{s.name}: samples rejected: {_counts(s.rejected)}")
        if s.gaps:
            found.append(f"{s.name}: {s.gaps} gaps, the longest {s.longest_gap_s:.3g} s")
    return found


def base_messages(geometry: Geometry) -> list[str]:
    """Return one sentence per base sensor that stands at another mount, or whose motion cannot be carried over to its own."""
    found = []
    places = np.array([m.position for m in geometry.mounts]).reshape(-1, 3)
    distances = base_distances(geometry.mounts, geometry.base_sensors)
    for mount, sensor, distance in zip(geometry.mounts, geometry.base_sensors, distances):
        if sensor is None or distance <= AWAY:
            continue
        away = np.linalg.norm(places - sensor.position, axis=1)
        nearest = int(np.argmin(away))
        if away[nearest] < _NEARER * distance:
            other = geometry.mounts[nearest].name
            found.append(
                f"{sensor.name} is at the base of {mount.name} by the vehicle file but stands at {other}, {distance:.2f} m away: "
                "mounts or positions may be exchanged; the positions are used"
            )
    if base_transport(geometry.mounts, geometry.base_sensors) is not None:
        return found
    return found + [
        f"{sensor.name} is {distance:.2f} m from the base of {mount.name} and taken as its motion: the rotation of the frame "
        "that would carry it over is not known (it takes sensors at the bases of all mounts, three or more, not on one line)"
        for mount, sensor, distance in zip(geometry.mounts, geometry.base_sensors, distances)
        if sensor is not None and distance > AWAY
    ]


def _counts(rejected: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {reason}" for reason, count in sorted(rejected.items()))


def sensor_health(
    streams: Mapping[str, StreamHealth], clipped: Sequence[int], invalid: Sequence[int], ratio: Mapping[str, float],
    refused: Mapping[int, Mapping[str, int]],
) -> dict[str, SensorHealth]:  # fmt: skip
    """Return what is known of every sensor.

    Parameters
    ----------
    streams
        Counters of the time base by sensor, in the order of the streams.
    clipped, invalid
        Ticks at full scale and without a sample, per stream.
    ratio
        Residual over what its noise lets expect, where the sensor has redundant equations.
    refused
        Per stream the ticks it was refused by reason.
    """
    return {
        name: SensorHealth(
            name, h.accepted, h.rejected, h.rate_hz, h.gaps, h.longest_gap_s, h.silent, clipped[i], invalid[i],
            ratio.get(name, 0.0), dict(refused.get(i, {})),
        )
        for i, (name, h) in enumerate(streams.items())
    }  # fmt: skip
