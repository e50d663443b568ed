# Copyright 2026 ride_estimation contributors
"""What a replay will state of a drive that has not taken place: the estimator itself, on a simulated drive."""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable, Mapping, Sequence

from ride_estimation.api.diagnosing import refusal
from ride_estimation.api.runs import Run
from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.identification.sensitivities import Excitation
from ride_estimation.sensors.measurement import SensorErrors
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.field_run import run_scenario
from ride_estimation.simulation.scenario import RoadSpec, Scenario
from ride_estimation.vehicles.two_axle_truck import TruckData
from ride_estimation.vehicles.vehicle import Vehicle

#: longer drives are predicted by their first minute [s]: the estimator has converged, and a plan answers in seconds
LONGEST_S = 60.0
#: accelerometers faster than this gain nothing in the band of the ride [Hz]
_FASTEST_HZ = 400.0
#: installation errors of the simulated sensors: half a per cent of gain as limit, a tenth of a degree, 1 mg
_INSTALLED = SensorErrors(gain_std=0.005 / math.sqrt(3.0), misalignment_std=math.radians(0.1), bias_std=0.01)
#: a frame that hardly twists: stiffness over that of the truck
_STIFF_FRAME = 30.0
#: road, noise and installation of the drives: what one drive happens to show differs by half from the next
_SEEDS = tuple(range(20, 27))
#: words for the kinds of motion sensors
_KINDS = {"imu": "IMU", "displacement": "displacement transducer along"}
#: how many drives a prediction takes
DRIVES = len(_SEEDS)


@dataclasses.dataclass(frozen=True)
class PredictedParameter:
    """What the estimator will state of a parameter.

    Attributes
    ----------
    name
        As in ``result.json``.
    relative_std
        Standard deviation over the value, median over the drives: some installations lean far more than others.
    status
        The one most drives end with.
    share
        Of the drives, how many end with it: less than one where the installation of the sensors decides.
    """

    name: str
    relative_std: float
    status: str
    share: float

    @property
    def words(self) -> str:
        """Return the status, with its share where drives differ."""
        return self.status if self.share == 1.0 else f"{self.status} ({100.0 * self.share:.0f} % of the drives)"


@dataclasses.dataclass(frozen=True)
class PredictedReplay:
    """What the estimator states after a simulated drive with these sensors.

    Attributes
    ----------
    duration_s
        Of a simulated drive [s].
    drives
        What the estimator states after each drive; empty where it refuses the layout.
    refusal
        Why it refuses, else empty.
    diagnosis
        Why a diagnosis refuses such a drive, else empty.
    """

    duration_s: float
    drives: tuple[tuple[Estimate, ...], ...]
    refusal: str = ""
    diagnosis: str = ""

    @property
    def parameters(self) -> tuple[PredictedParameter, ...]:
        """Return what all drives together predict; empty where the estimator refuses the layout."""
        return tuple(_of(same) for same in zip(*self.drives, strict=True))

    def of_status(self, *status: str) -> tuple[str, ...]:
        """Return the names of the parameters that end with one of some statuses."""
        return tuple(p.name for p in self.parameters if p.status in status)


@dataclasses.dataclass(frozen=True)
class Addition:
    """What the estimator will state with further sensors.

    Attributes
    ----------
    name
        What is added.
    valid
        Parameters that end ``valid``.
    improvement
        By how much the standard deviations fall: geometric mean over the parameters, 1 for no difference.
    """

    name: str
    valid: int
    improvement: float


def most_helpful_sensor(
    vehicle: Vehicle, excitation: Excitation, among: Sequence[Sensor], present: PredictedReplay,
    driven: Callable[[], None] = lambda: None,
) -> Addition:
    """Return what the most helpful one of some sensors brings alone.

    Parameters
    ----------
    vehicle, excitation, present, driven
        As of :func:`helpful_additions`.
    among
        The sensors, at least one.
    """
    proposed = {f"{_KINDS.get(s.kind, s.kind)} {s.axis} at {s.mount or s.body}".replace("  ", " "): (s,) for s in among}
    return helpful_additions(vehicle, excitation, proposed, present, driven)[0]


def helpful_additions(
    vehicle: Vehicle, excitation: Excitation, proposed: Mapping[str, Sequence[Sensor]], present: PredictedReplay,
    driven: Callable[[], None] = lambda: None,
) -> tuple[Addition, ...]:
    """Return what further sensors bring the estimator on one simulated drive, the most helpful first.

    Parameters
    ----------
    vehicle, excitation
        As of :func:`predicted_replay`.
    proposed
        Sensors by the name of the addition.
    present
        What is predicted without them; its first drive is the one that is repeated.
    driven
        Called after every drive.
    """
    without = {p.name: p for p in dataclasses.replace(present, drives=present.drives[:1]).parameters}
    found = []
    for name, new in proposed.items():
        more = dataclasses.replace(vehicle, sensors={**vehicle.sensors, **{s.name: s for s in new}})
        after = predicted_replay(more, excitation, _SEEDS[:1], driven)
        both = [(without[p.name].relative_std, p.relative_std) for p in after.parameters if p.name in without]
        known = [math.log(before / now) for before, now in both if 0.0 < now < math.inf and 0.0 < before < math.inf]
        found.append(Addition(name, len(after.of_status("valid")), math.exp(statistics.fmean(known)) if known else 1.0))
    return tuple(sorted(found, key=lambda a: (-a.valid, -a.improvement)))


def predicted_replay(
    vehicle: Vehicle, excitation: Excitation, seeds: Sequence[int] = _SEEDS, driven: Callable[[], None] = lambda: None
) -> PredictedReplay:
    """Simulate drives of a two-axle truck that carries the vehicle, and run the estimator on what its sensors read.

    The vehicle is the one of its file; the sensors have the installation errors of good workshop practice. What comes out
    obeys the estimator's own tolerances, rules of status and refusals.

    Parameters
    ----------
    vehicle
        Bodies, mounts, sensors.
    excitation
        Road, speed, duration, sample rate; ``twist_share`` 0 stands for a frame that does not twist.
    seeds
        One drive each.
    driven
        Called after every drive.
    """
    duration = min(excitation.duration_s, LONGEST_S)
    usual = TruckData()
    stiffer = 1.0 if excitation.twist_share > 0.0 else _STIFF_FRAME
    truck = dataclasses.replace(
        usual, torsion_stiffness=stiffer * usual.torsion_stiffness, bending_stiffness=stiffer * usual.bending_stiffness
    )
    errors = dataclasses.replace(_INSTALLED, rate=min(excitation.rate_hz, _FASTEST_HZ))
    drives: list[tuple[Estimate, ...]] = []
    untested = ""
    for seed in seeds:
        scenario = Scenario(
            name="plan", seed=seed, vehicle_file="", duration=duration, speed=((0.0, excitation.speed),),
            road=RoadSpec(excitation.roughness), sensor_errors=errors, truck=truck,
        )  # fmt: skip
        recording = run_scenario(scenario, vehicle).recording
        untested = untested if drives else refusal(Run(recording, vehicle))
        try:
            drives.append(run_offline(recording, Pipeline(vehicle), smoothing=False).parameters)
        except RideEstimationError as error:
            return PredictedReplay(duration, (), str(error), untested)
        driven()
    return PredictedReplay(duration, tuple(drives), diagnosis=untested)


def _of(same: tuple[Estimate, ...]) -> PredictedParameter:
    """Return what several drives state of one parameter."""
    relative = statistics.median(p.std / abs(p.value) if p.value and math.isfinite(p.std) else math.inf for p in same)
    states = sorted(p.status.value for p in same)
    status = statistics.mode(states)
    return PredictedParameter(same[0].name, relative, status, states.count(status) / len(states))
