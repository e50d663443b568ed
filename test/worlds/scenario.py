# Copyright 2026 ride_estimation contributors
"""A complete case for a diagnosis: a cab with planted effects, a measured run, validation runs on other roads."""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import (
    CabVehicle,
    Measurement,
    measure,
    random_sensors,
    random_vehicle,
    simulate,
)
from worlds.calibration import BestLinear
from worlds.effects import Effect, Reference, combine, plant
from worlds.roads import BaseMotion, Road, base_motion
from worlds.vehicle_text import Belief

CALIBRATION_S = 24.0
WHOLE_RUN = ("mass_change", "parameter_drift")


@dataclasses.dataclass(frozen=True)
class Planted:
    """One effect with the size used and the residual of the best linear model it alone leaves."""

    cause: str
    location: str
    axis: str
    form: str
    size: float
    residual: float


@dataclasses.dataclass(frozen=True)
class Scenario:
    """``believed`` is the cab the vehicle file is written from (through ``belief``), ``fit`` and ``validation`` the runs."""

    planted: tuple[Planted, ...]
    believed: CabVehicle
    belief: Belief
    fit: Measurement
    validation: tuple[Measurement, ...]
    seed: int
    road_kind: str


def make_scenario(
    causes: tuple[str, ...],
    seed: int,
    *,
    residual: float = 0.05,
    noise: float = 0.02,
    duration: float = 60.0,
    validations: int = 1,
    rate_hz: float = 200.0,
    vehicle_kind: str = "any",
    road_kind: str | None = None,
    displacement: tuple[tuple[str, str], ...] = (),
    file_error: float = 0.0,
    turned: bool = False,
    form: str | None = None,
    follow: tuple[float, float] = (1.0, 0.0),
    step: float = 1e-3,
) -> Scenario:
    """Draw a vehicle, roads and places, plant the causes at the wanted residual and measure.

    Parameters
    ----------
    causes
        Empty or ``("none",)`` for a clean run; two for a pair, each calibrated alone.
    residual
        Of the best linear model over the fit road, per effect.
    noise
        Accelerometer noise as a share of the rms of the moving cab signals of the fit road.
    file_error
        Mass and inertia of the file are off by this many of their stated standard deviations (uniform).
    form
        Functional form of the first cause, drawn where None.
    follow
        How the brackets of the vehicle follow the twist of its frame, see ``roads.Road``.
    """
    rng = np.random.default_rng([seed, sum(map(ord, "".join(causes)))])
    vehicle = random_vehicle(rng, vehicle_kind)
    sensors = random_sensors(vehicle, rng, displacement=displacement, turned=turned)
    road_kind = road_kind or str(rng.choice(["any", "any", "rough", "bumps", "cobbles"]))
    others = [str(rng.choice(["any", "rough", "bumps"])) for _ in range(validations)]
    roads = [dataclasses.replace(Road.random(rng, kind), follow=follow) for kind in (road_kind, *others)]
    bases = [base_motion(road, vehicle.mounts, duration, step, seed * 10 + i) for i, road in enumerate(roads)]
    wanted = [c for c in causes if c != "none"]
    planted: list[tuple[Effect, float, float]] = []
    for number, cause in enumerate(wanted):
        base = bases[0] if cause in WHOLE_RUN else _cut(bases[0], min(CALIBRATION_S, duration))
        planted.append(_calibrated(cause, vehicle, sensors, base, rng, residual, form if number == 0 else None))
    true_vehicle, true_sensors, cg_off = vehicle, sensors, (0.0, 0.0, 0.0)
    if len(planted) == 1:
        true_vehicle, true_sensors, cg_off = planted[0][0].apply(planted[0][1])
    elif len(planted) == 2:
        true_vehicle, true_sensors, cg_off = combine(planted[0][0], planted[1][0])(planted[0][1], planted[1][1])
    elif len(planted) > 2:
        raise ValueError("at most two effects at once")
    fit = measure(simulate(true_vehicle, bases[0]), true_sensors, rate_hz, seed * 10 + 5, noise_share=noise)
    # the same sensors, the same noise in m/s^2, on the other roads
    validation = tuple(
        measure(simulate(true_vehicle, base), fit.sensors, rate_hz, seed * 10 + 6 + i) for i, base in enumerate(bases[1:])
    )
    belief = Belief(
        cg_off=cg_off,
        mass_off=float(file_error * 0.01 * rng.uniform(-1, 1)),
        inertia_off=float(file_error * 0.03),
    )
    facts = tuple(Planted(e.cause, e.location, e.axis, e.form, float(s), float(r)) for e, s, r in planted)
    return Scenario(facts, vehicle, belief, fit, validation, seed, road_kind)


def _calibrated(
    cause: str, vehicle: CabVehicle, sensors: tuple, base: BaseMotion, rng: np.random.Generator, target: float, form: str | None
) -> tuple[Effect, float, float]:
    """Plant a cause and size it; a place or form that cannot reach the residual is drawn again."""
    reference = Reference(vehicle, sensors, simulate(vehicle, base))
    best = BestLinear(vehicle, sensors, base, rate_hz=100.0 if base.chassis.shape[0] * base.step < 60.0 else 50.0)
    found: tuple[Effect, float, float] | None = None
    for _ in range(6):
        effect = plant(cause, reference, rng, form=form)
        size, value = best.size_for(effect, target)
        if found is None or abs(np.log(value / target)) < abs(np.log(found[2] / target)):
            found = (effect, size, value)
        if effect.fixed_size is not None or abs(np.log(value / target)) < 0.2:
            break
    if found is None:
        raise RuntimeError(f"no place found for {cause}")
    return found


def _cut(base: BaseMotion, duration: float) -> BaseMotion:
    rows = 2 * round(duration / base.step) + 1
    return dataclasses.replace(base, chassis=base.chassis[:rows], brackets=np.ascontiguousarray(base.brackets[:rows]))
