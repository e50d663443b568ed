# Copyright 2026 ride_estimation contributors
"""One cab with six degrees of freedom on two roads, and one of every cause hidden in it at a stated place and size.

The sizes are such that the calibrated model without them misses 2 to 5 % of the signal. A soft mount and an offset leave nothing
in the band.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from worlds.cab import CabSensor, CabVehicle, Measurement, measure, random_sensors, random_vehicle, simulate
from worlds.effects import Effect, Reference, plant
from worlds.roads import BaseMotion, Road, base_motion
from worlds.vehicle_text import Belief

SECONDS, RATE_HZ, STEP, NOISE = 30.0, 100.0, 1e-3, 0.01
SEED = 71


@dataclasses.dataclass(frozen=True)
class Hidden:
    """A cause at a place; ``seed`` draws what is not stated (the shape of a law, the place of a load)."""

    cause: str
    size: float
    mount: str | None = None
    axis: str | None = None
    form: str | None = None
    sensor: str | None = None
    seed: int = 1

    @property
    def label(self) -> str:
        """Return what tells the case from others in one word."""
        return f"{self.cause}-{self.form}" if self.form else self.cause


HIDDEN = (
    Hidden("coulomb_friction", 0.45, "front_left", "z", "jenkins_chain"),
    Hidden("viscoelasticity", 0.75, "all", "z", "fractional"),
    Hidden("stiffness_nonlinearity", 1.0, "rear_right", "z", "hollow_rubber"),
    Hidden("damping_nonlinearity", 0.45, "all", "z", "blow_off"),
    Hidden("bump_stop", 1.3, "rear_left", "z", "foam_one_side", seed=2),
    Hidden("backlash", 0.12, "all", "x", "soft_play"),
    Hidden("harmonic_disturbance", 0.07, axis="z"),
    Hidden("mass_change", 0.09),
    Hidden("cg_offset", 0.45, axis="z"),
    Hidden("parameter_drift", 0.155, "all", "z"),
    Hidden("one_soft_mount", 0.6, "rear_left", "z"),
    Hidden("flexible_mode", 0.85),
    Hidden("missing_degree_of_freedom", 2.1),
    Hidden("sensor_delay", 0.26, sensor="cab_front_left"),
    Hidden("sensor_gain", 0.35, axis="z", sensor="cab_front_right"),
    Hidden("sensor_bias", 0.13, axis="z", sensor="cab_rear_left"),
    Hidden("sensor_misalignment", 0.53, axis="x", sensor="cab_rear_right"),
    Hidden("sensor_clipping", 0.65, sensor="cab_front_left"),
    Hidden("wrong_sensor_position", 0.64, axis="z", sensor="cab_rear_right"),
)


@functools.cache
def cab_on_roads() -> tuple[CabVehicle, tuple[CabSensor, ...], tuple[BaseMotion, BaseMotion]]:
    """Return the healthy cab, its sensors and the base motion of the fitted and of the other road."""
    rng = np.random.default_rng(SEED)
    vehicle = random_vehicle(rng, "air")
    sensors = random_sensors(vehicle, rng)
    roads = (Road.random(rng, "rough"), Road.random(rng, "rough"))
    first, other = (base_motion(road, vehicle.mounts, SECONDS, STEP, SEED + i) for i, road in enumerate(roads))
    return vehicle, sensors, (first, other)


@functools.cache
def reference() -> Reference:
    """Return the run without effect."""
    vehicle, sensors, (first, _) = cab_on_roads()
    return Reference(vehicle, sensors, simulate(vehicle, first))


def effect_of(case: Hidden) -> Effect:
    """Return the effect of a case."""
    rng = np.random.default_rng([SEED, case.seed])
    return plant(case.cause, reference(), rng, form=case.form, mount=case.mount, axis=case.axis, sensor=case.sensor)


def driven(case: Hidden | None) -> tuple[Measurement, Measurement, Belief]:
    """Return the measurement of both roads with a case hidden, or of the healthy cab, and what its file believes."""
    vehicle, sensors, (first, other) = cab_on_roads()
    cg_off = (0.0, 0.0, 0.0)
    if case is not None:
        vehicle, sensors, cg_off = effect_of(case).apply(case.size)
    fit = measure(simulate(vehicle, first), sensors, RATE_HZ, SEED, noise_share=NOISE)
    # the same sensors, the same noise in m/s^2, on the other road
    return fit, measure(simulate(vehicle, other), fit.sensors, RATE_HZ, SEED + 1), Belief(cg_off=cg_off)
