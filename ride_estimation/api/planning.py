# Copyright 2026 ride_estimation contributors
"""What a sensor set will be able to tell, before the vehicle is instrumented."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ride_estimation.api.tables import dataframe, html_table
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.vehicle import Vehicle

if TYPE_CHECKING:  # whoever made a mistake in the vehicle file need not wait for the estimator to be imported
    from ride_estimation.api.predicted import Addition, PredictedReplay
    from ride_estimation.identification.sensor_plan import SensorPlan

#: what a test drive can be: option, least, largest, unit
RANGES = (("speed", 0.5, 60.0, "m/s"), ("duration", 1.0, 86400.0, "s"), ("rate", 20.0, 20000.0, "Hz"))

#: times smaller standard deviations that are worth a sensor
WORTH = 1.05

#: G_d(n0) at the geometric middle of each ISO 8608 class [m^3]
ROAD_CLASSES = {name: 16e-6 * 4.0**i for i, name in enumerate("ABCDEFGH")}


@dataclasses.dataclass(frozen=True, repr=False)
class Plan:
    """What the sensors of a vehicle can tell.

    Attributes
    ----------
    vehicle
        The vehicle.
    result
        Bounds on the parameters, additions ranked.
    replay
        What the estimator will state, from simulated drives; None where only the bounds were asked for.
    helpful
        What further motion sensors bring the estimator, best first.
    single
        What the most helpful one sensor of the best addition brings alone; None where that is one sensor, or no help.
    """

    vehicle: Vehicle
    result: SensorPlan
    replay: PredictedReplay | None = None
    helpful: tuple[Addition, ...] = ()
    single: Addition | None = None

    def to_dataframe(self) -> Any:
        """Return relative standard deviations per parameter as ``pandas.DataFrame``: the bound (inf: not identifiable) and, where
        drives were simulated, what the estimator will state, with its status.
        """
        present = self.result.present
        columns: dict[str, Any] = {"parameter": present.names, "bound": present.relative_std}
        if self.replay is not None:
            stated = {p.name: p for p in self.replay.parameters}
            columns["replay_std"] = [stated[n].relative_std if n in stated else math.inf for n in present.names]
            columns["replay_status"] = [stated[n].status if n in stated else "" for n in present.names]
        return dataframe(columns, "parameter")

    def __repr__(self) -> str:
        present = self.result.present
        return f"Plan({self.vehicle.name}: rank {present.rank} of {len(present.names)} parameters)"

    def _repr_html_(self) -> str:
        bounds = {n: _percent(std) for n, std in zip(self.result.present.names, self.result.present.relative_std.tolist())}
        if self.replay is None:
            return html_table(("parameter", "bound"), [[name, bound] for name, bound in bounds.items()], repr(self))
        stated = {p.name: (_percent(p.relative_std), p.words) for p in self.replay.parameters}
        rows = [[name, bound, *stated.get(name, ("", ""))] for name, bound in bounds.items()]
        return html_table(("parameter", "bound", "replay std", "status"), rows, repr(self))

    @property
    def helps(self) -> tuple[Addition, ...]:
        """Return the additions that help the estimator noticeably, best first."""
        now = len(self.replay.of_status("valid")) if self.replay is not None else 0
        return tuple(a for a in self.helpful if a.valid > now or a.improvement > WORTH)


def plan(
    vehicle: Vehicle | str | Path,
    *,
    road: str = "C",
    speed: float = 15.0,
    duration: float = 60.0,
    rate: float = 200.0,
    rigid_frame: bool = False,
    unknown_mass: bool = False,
    drives: bool = True,
    report: Callable[[float], None] = lambda share: None,
) -> Plan:
    """Tell which parameters the sensors of a vehicle can identify and which addition would help most.

    Parameters
    ----------
    vehicle
        A loaded vehicle, a vehicle file, or the name of a bundled one.
    road
        ISO 8608 class, A to H.
    speed, duration, rate
        Of the test drive [m/s], usable driving [s], sample rate [Hz].
    rigid_frame
        Assume that the frame does not twist.
    unknown_mass
        Ignore the force references of the vehicle file.
    drives
        Simulate drives and run the estimator on them, also with further sensors: tells what ``replay`` will state and which
        addition helps it most, and takes half a minute. Otherwise the bounds alone.
    report
        Called with the share of the drives that is done.

    Raises
    ------
    ConfigurationError
        Numbers outside of what is allowed, all at once.

    Examples
    --------
    >>> import ride_estimation as re
    >>> re.plan("single_imu", unknown_mass=True, drives=False)
    Plan(single_imu: rank 0 of 26 parameters)
    """
    known = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    given = {"speed": speed, "duration": duration, "rate": rate}
    wrong = [
        f"--{name} {given[name]:g}; allowed: {low:g} to {high:g} {unit}"
        for name, low, high, unit in RANGES if not low <= given[name] <= high
    ]  # fmt: skip
    if road not in ROAD_CLASSES:
        wrong.append(f"--road {road!r}; allowed: {', '.join(ROAD_CLASSES)}")
    if wrong:
        raise ConfigurationError(wrong)
    from ride_estimation.api.predicted import DRIVES, helpful_additions, most_helpful_sensor, predicted_replay
    from ride_estimation.identification import sensor_plan
    from ride_estimation.identification.sensitivities import Excitation

    excitation = Excitation(
        roughness=ROAD_CLASSES[road],
        speed=speed,
        duration_s=duration,
        rate_hz=rate,
        twist_share=0.0 if rigid_frame else 0.3,
    )
    found = sensor_plan.plan(known, excitation, known=() if unknown_mass else None)
    if not drives:
        return Plan(known, found)
    driven = dataclasses.replace(known, force_references=()) if unknown_mass else known
    proposed = sensor_plan.additions(driven)
    number = itertools.count(1)

    total = DRIVES + len(proposed) + max(map(len, proposed.values()), default=0)

    def one_more() -> None:
        report(min(next(number) / total, 1.0))

    replay = predicted_replay(driven, excitation, driven=one_more)
    helpful = helpful_additions(driven, excitation, proposed, replay, one_more)
    planned = Plan(known, found, replay, helpful)
    among = proposed[planned.helps[0].name] if planned.helps else ()
    if len(among) < 2:
        return planned
    return dataclasses.replace(planned, single=most_helpful_sensor(driven, excitation, among, replay, one_more))


def _percent(std: float) -> str:
    return f"{100.0 * std:.2g} %" if math.isfinite(std) else "not identifiable"
