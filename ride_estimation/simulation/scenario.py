# Copyright 2026 ride_estimation contributors
"""What happens in a simulated field run: road, driving, engine, payload, hidden effects, sensor errors and faults."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError
from ride_estimation.excitation.road import COHERENCE_LENGTH
from ride_estimation.sensors.measurement import Fault, SensorErrors
from ride_estimation.simulation.rotation import Payload
from ride_estimation.vehicles.two_axle_truck import TruckData

Array = NDArray[np.float64]

OBSTACLE_KINDS = ("cosine", "block", "ramp")
SIDES = ("both", "left", "right")


@dataclasses.dataclass(frozen=True)
class RoadSpec:
    """The random part of the road: Gd(n0) [m^3], waviness, decay length of the track coherence [m]."""

    roughness: float = 0.0
    waviness: float = 2.0
    coherence_length: float = COHERENCE_LENGTH


@dataclasses.dataclass(frozen=True)
class Pave:
    """A cobbled stretch between two distances [m]; stone length and height spread [m]."""

    begin: float
    end: float
    stone: float = 0.13
    height_std: float = 0.008


@dataclasses.dataclass(frozen=True)
class Obstacle:
    """A single obstacle: kind, distance of its beginning, length, height [m], and which track it lies on."""

    kind: str
    at: float
    length: float
    height: float
    side: str = "both"


@dataclasses.dataclass(frozen=True)
class Engine:
    """Order lines at the mount bases.

    Attributes
    ----------
    speed
        (time [s], crankshaft speed [rev/s]) points.
    orders
        Order -> amplitude of the base acceleration [m/s^2], vertical; lateral and fore-aft get the given shares.
    lateral_share, fore_aft_share
        Relative amplitudes.
    """

    speed: tuple[tuple[float, float], ...]
    orders: Mapping[float, float]
    lateral_share: float = 0.5
    fore_aft_share: float = 0.3


@dataclasses.dataclass(frozen=True)
class LaneChange:
    """One sine period of lateral acceleration: begin [s], duration [s], peak [m/s^2]."""

    begin: float
    duration: float
    peak: float


@dataclasses.dataclass(frozen=True)
class Disturbance:
    """A harmonic force on a body: place [m], axis, frequency [Hz], amplitude [N], phase [rad], from [s]."""

    body: str
    position: Array
    axis: str
    frequency: float
    amplitude: float
    phase: float = 0.0
    begin: float = 0.0


@dataclasses.dataclass(frozen=True)
class Scenario:
    """One field run.

    Attributes
    ----------
    vehicle_file
        Path of the cab's vehicle file as written in the scenario.
    duration, simulation_rate
        [s], [Hz].
    start_ns
        Stamp of the beginning [ns].
    speed
        (time [s], speed [m/s]) points.
    true_elements
        (mount, axis) -> the element the simulated vehicle really has where the vehicle file says otherwise.
    true_factors
        (mount, axis, parameter) -> factor on the value of the vehicle file.
    true_bodies
        body -> changes: ``mass`` [kg] and ``cg`` [m].
    sensor_errors
        Of every sensor; ``own_errors`` by sensor name replace them.
    truth_rate
        Sample rate of the truth file [Hz].
    """

    name: str
    seed: int
    vehicle_file: str
    duration: float
    description: str = ""
    simulation_rate: float = 1000.0
    start_ns: int = 1_700_000_000_000_000_000
    speed: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    road: RoadSpec = dataclasses.field(default_factory=RoadSpec)
    pave: tuple[Pave, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    engine: Engine | None = None
    lane_changes: tuple[LaneChange, ...] = ()
    payloads: tuple[Payload, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    true_elements: Mapping[tuple[str, str], ForceElement] = dataclasses.field(default_factory=dict)
    true_factors: Mapping[tuple[str, str, str], float] = dataclasses.field(default_factory=dict)
    true_bodies: Mapping[str, Mapping[str, Array | float]] = dataclasses.field(default_factory=dict)
    sensor_errors: SensorErrors = dataclasses.field(default_factory=SensorErrors)
    own_errors: Mapping[str, SensorErrors] = dataclasses.field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    truck: TruckData = dataclasses.field(default_factory=TruckData)
    truth_rate: float = 100.0

    def __post_init__(self) -> None:
        problems = []
        if not self.duration >= 1.0:
            problems.append(f"duration_s: {self.duration:g} s; allowed: 1 s or more")
        if not 200.0 <= self.simulation_rate <= 20000.0:
            problems.append(f"simulation_rate_hz: {self.simulation_rate:g} Hz; allowed: 200 to 20000 Hz")
        fastest = max([self.sensor_errors.rate, *(e.rate for e in self.own_errors.values())])
        if fastest > self.simulation_rate:
            problems.append(f"sensors rate_hz: {fastest:g} Hz; allowed: at most simulation_rate_hz {self.simulation_rate:g} Hz")
        if not 0.0 < self.truth_rate <= self.simulation_rate:
            problems.append(f"truth_rate_hz: {self.truth_rate:g} Hz; allowed: above 0 to simulation_rate_hz")
        if self.duration * self.simulation_rate > 2e7:
            problems.append("duration_s times simulation_rate_hz: more than 2e7 samples; make several runs")
        for i, o in enumerate(self.obstacles):
            if o.kind not in OBSTACLE_KINDS or o.side not in SIDES or not o.length > 0.0:
                problems.append(
                    f"obstacles[{i}]: kind {o.kind!r}, side {o.side!r}, length {o.length:g} m; "
                    f"allowed: {', '.join(OBSTACLE_KINDS)}; {', '.join(SIDES)}; length > 0"
                )
        for i, p in enumerate(self.pave):
            if not p.begin < p.end:
                problems.append(f"pave[{i}]: from {p.begin:g} m to {p.end:g} m; allowed: from before to")
        if problems:
            raise ConfigurationError(problems, where=self.name)
