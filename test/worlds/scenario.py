# Copyright 2026 ride_estimation contributors
"""A complete case for a diagnosis: a cab with planted effects, a measured run, validation runs on other roads."""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import (
    CabSensor,
    CabVehicle,
    Measurement,
    measure,
    random_sensors,
    random_vehicle,
    rotation_of_degrees,
    simulate,
)
from worlds.calibration import BestLinear
from worlds.effects import Effect, Reference, combine, plant
from worlds.roads import BaseMotion, Road, base_motion
from worlds.vehicle_text import Belief

CALIBRATION_S = 24.0
WHOLE_RUN = ("mass_change", "parameter_drift")


#: one standard deviation of the errors of a good installation, written down here: worlds know nothing of the product
#: [m/s^2, -, rad, m, s, m]
_INSTALLED = {"bias": 0.02, "gain": 0.003, "misalignment": 0.004, "position": 0.004, "delay": 1.7e-4, "travel_zero": 0.001}


@dataclasses.dataclass(frozen=True)
class Planted:
    """One effect with the size used and the residual of the best linear model it alone leaves."""

    cause: str
    location: str
    axis: str
    form: str
    size: float
    residual: float
    magnitudes: dict[str, float] = dataclasses.field(default_factory=dict)  #: part of the name of a stated number -> true one


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
    installation: float = 0.0,
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
    installation
        Errors of every sensor (gain, rotation, place, offset, delay) in standard deviations of a good installation.
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
    if installation > 0.0:
        true_sensors = _installed(true_sensors, np.random.default_rng([seed, 9]), installation)
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
    facts = tuple(
        Planted(e.cause, e.location, e.axis, e.form, float(s), float(r), _magnitudes(e, float(s), vehicle, true_sensors))
        for e, s, r in planted
    )
    return Scenario(facts, vehicle, belief, fit, validation, seed, road_kind)


def _installed(sensors: tuple[CabSensor, ...], rng: np.random.Generator, scale: float) -> tuple[CabSensor, ...]:
    """Return sensors with the errors of a good installation on top of what was planted."""
    def drawn(*shape: int) -> np.ndarray:
        # beyond three standard deviations an installation is not good: such an error is a fault, and naming it no false alarm
        return scale * np.clip(rng.standard_normal(shape), -3.0, 3.0)

    out = []
    for s in sensors:
        channels = 1 if s.kind == "displacement" else 3
        gain = 1.0 + _INSTALLED["gain"] * drawn(channels)
        turn = rotation_of_degrees(np.degrees(_INSTALLED["misalignment"] * drawn(3)))
        offset = _INSTALLED["position"] * drawn(3)
        bias = (_INSTALLED["bias"] if channels == 3 else _INSTALLED["travel_zero"]) * drawn(channels)
        late = _INSTALLED["delay"] * float(drawn())
        if channels == 1:
            out.append(dataclasses.replace(s, gain=s.gain * gain, bias=s.bias + bias, delay_s=s.delay_s + late))
            continue
        place = s.position if s.true_position is None else s.true_position
        rotation = s.rotation if s.true_rotation is None else s.true_rotation
        # a bracket reads at its own place: an error of it would be a rotation of the bracket about nothing
        out.append(dataclasses.replace(
            s, gain=s.gain * gain, bias=s.bias + bias, delay_s=s.delay_s + late, true_rotation=rotation @ turn,
            true_position=place + offset if s.place == "cab" else s.true_position,
        ))
    return tuple(out)


def _magnitudes(e: Effect, size: float, plain: CabVehicle, sensors: tuple[CabSensor, ...]) -> dict[str, float]:
    """Return the true numbers that a diagnosis states of an effect, by a part of their name."""
    vehicle, _, cg_off = e.apply(size)
    hidden, axis = vehicle.hidden, "xyz".find(e.axis) if e.axis else 0
    sensor = next((s for s in sensors if s.name == e.location), None)
    if sensor is not None:
        gain, bias = np.broadcast_to(sensor.gain, 3), np.broadcast_to(sensor.bias, 3)
        turn = np.eye(3) if sensor.true_rotation is None else sensor.rotation.T @ sensor.true_rotation
        moved = np.zeros(3) if sensor.true_position is None else sensor.true_position - sensor.position
        skew = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return {
            "sensor_gain": {"gain error": float(gain[axis] - 1.0)}, "sensor_delay": {"delay": sensor.delay_s},
            "sensor_bias": {"offset": float(bias[axis])},
            "sensor_misalignment": {"angle": float(np.degrees(np.arcsin(np.clip(skew[axis], -1.0, 1.0))))},
            "wrong_sensor_position": {"position error": float(moved[axis])},
            "sensor_clipping": {"clipping level": float(sensor.clip)},
        }.get(e.cause, {})
    if e.cause == "mass_change" and hidden.mass_after is not None:
        return {"added mass": float(hidden.mass_after[1] - plain.mass)}
    if e.cause == "cg_offset":
        return {"CG offset": float(cg_off[axis])}
    if e.cause == "flexible_mode" and hidden.elastic is not None:
        return {"natural frequency free": float(hidden.elastic[0])}
    if e.cause == "missing_degree_of_freedom" and hidden.suspended is not None:
        return {"moving mass": float(hidden.suspended[0]), "natural frequency": float(hidden.suspended[1])}
    if e.cause == "harmonic_disturbance" and hidden.push is not None:
        return {"frequency": float(hidden.push[1])}
    if e.cause == "coulomb_friction" and hidden.laws:
        place = {"bouc_wen": 0, "jenkins_chain": 1}.get(e.form)
        return {} if place is None or len(hidden.laws) > 1 else {"friction level": float(hidden.laws[0][3][place])}
    return {}


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
