# Copyright 2026 ride_estimation contributors
"""Diagnosis cases in the plane: a quarter car (axle accelerometer measured) and the cab of a planar machine.

Sized like the cab cases: the world's own linear plant, fitted by output error to the noise-free body accelerations, leaves
the wanted residual.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from worlds import hiding
from worlds.cab import GRAVITY
from worlds.chain import Chain, ChainRun, simulate_chain
from worlds.hiding import FORMS
from worlds.machine import Machine
from worlds.quarter_car import QuarterCar, drive_quarter_car, road_height
from worlds.roads import Road

STEP = 1e-3
CAUSES = ("none", *FORMS, "harmonic_disturbance", "mass_change", "sensor_delay", "sensor_gain")


@dataclasses.dataclass(frozen=True)
class PlaneCase:
    """``runs``: sensor name -> (N, 3) specific force, first fit, then validation; ``vehicle_text`` a vehicle file; ``forces``:
    true vertical force on the body at every mount (N, M) of every run.
    """

    cause: str
    location: str
    axis: str
    form: str
    size: float
    residual: float
    vehicle_text: str
    runs: tuple[dict[str, np.ndarray], ...]
    rate_hz: float
    forces: tuple[np.ndarray, ...]


def _linear_response(car: QuarterCar, k: float, c: float, axle: ChainRun) -> np.ndarray:
    """Return body acceleration of a linear body over the true axle motion."""
    plant = Chain(
        np.array([[car.sprung]]), np.array([[1.0]]), np.array([[1.0]]), np.array([k]), np.array([c]), np.array([np.inf])
    )
    fine = np.arange(2 * len(axle.time) - 1) * 0.5
    grid = np.arange(len(axle.time), dtype=float)
    z, zd = (np.interp(fine, grid, s[:, 1]) for s in (axle.q, axle.qd))
    return simulate_chain(plant, axle.step, z[:, None], zd[:, None]).qdd[:, 0]


def _residual(car: QuarterCar, seen: np.ndarray, run: ChainRun) -> float:
    """Return what the best linear body leaves of a seen body acceleration, share of its rms."""
    tension, x, v = run.tension[:, 0], run.deflection[:, 0], run.rate[:, 0]
    k, c = np.linalg.lstsq(np.column_stack([x, v]), tension, rcond=None)[0]
    logs = np.log([max(k, 0.1 * car.stiffness), max(c, 0.1 * car.damping)])

    def error(at: np.ndarray) -> np.ndarray:
        return (seen - _linear_response(car, *np.exp(at), run))[1000:]

    for _ in range(4):
        e = error(logs)
        jac = np.stack([(error(logs + 0.01 * d) - e) / 0.01 for d in np.eye(2)], axis=1)
        logs = logs - np.clip(np.linalg.lstsq(jac, e, rcond=None)[0], -0.5, 0.5)
    return float(np.std(error(logs)) / np.std(seen[1000:]))


def _delayed(values: np.ndarray, delay_s: float) -> np.ndarray:
    grid = np.arange(len(values)) * STEP
    return np.interp(grid - delay_s, grid, values)


def quarter_car_case(
    cause: str, seed: int, *, residual: float = 0.05, noise: float = 0.02, duration: float = 60.0, rate_hz: float = 200.0,
    validations: int = 1,
) -> PlaneCase:  # fmt: skip
    """Return a quarter-car case; for sensor causes the body accelerometer is the faulty one."""
    rng = np.random.default_rng([seed, 31])
    car = QuarterCar.random(rng)
    roads = [Road.random(rng, kind) for kind in ("any", *["any", "rough"][:validations])]
    heights = [road_height(road, duration, STEP, seed * 7 + i) for i, road in enumerate(roads)]
    plain = drive_quarter_car(car, *heights[0], STEP)
    x, v = plain.deflection[1500:, 0].std(), plain.rate[1500:, 0].std()
    form = str(rng.choice(FORMS[cause])) if cause in FORMS else ""
    u, frequency, when = float(rng.random()), float(rng.uniform(3.0, 20.0)), round(float(rng.uniform(0.4, 0.6)) * duration, 3)

    def changed(size: float) -> QuarterCar:
        if cause in FORMS:
            law = hiding.law_of(form, hiding.Site(car.stiffness, car.damping, car.sprung, x, v, car.stiffness * x), size, u, u)
            return dataclasses.replace(car, laws=(law,), damping=car.damping * hiding.damping_factor(form, size))
        if cause == "harmonic_disturbance":
            amplitude = size * car.sprung * plain.qdd[1500:, 0].std()
            return dataclasses.replace(car, disturbance=(amplitude, frequency, 0.001))
        if cause == "mass_change":
            return dataclasses.replace(car, mass_after=(when, car.sprung * (1.0 + 0.3 * size)))
        return car

    def sense(values: np.ndarray, size: float) -> np.ndarray:
        if cause == "sensor_delay":
            return _delayed(values, 0.01 * size)
        return values * (1.0 + 0.3 * size) if cause == "sensor_gain" else values

    def left(size: float) -> float:
        run = drive_quarter_car(changed(size), *heights[0], STEP, seed)
        return _residual(car, sense(run.qdd[:, 0], size), run)

    size, value = (0.0, 0.0) if cause == "none" else _solve(left, residual)
    rms = noise * plain.qdd[1500:, 0].std()
    every = slice(None, None, round(1.0 / (rate_hz * STEP)))
    runs, forces = [], []
    for i, (height, rate) in enumerate(heights):
        run = drive_quarter_car(changed(size), height, rate, STEP, seed)
        noise_rng = np.random.default_rng([seed, 32, i])
        data = {}
        for name, signal in (("body", sense(run.qdd[:, 0], size)), ("axle", run.qdd[:, 1])):
            full = np.zeros((len(run.time), 3))
            full[:, 2] = GRAVITY + signal
            data[name] = full[every] + noise_rng.normal(0.0, rms, full[every].shape)
        runs.append(data)
        forces.append(car.sprung * GRAVITY - run.tension[every, :1])
    place = "body" if cause in ("harmonic_disturbance", "mass_change", "sensor_delay", "sensor_gain") else "suspension"
    axis = {"mass_change": "", "sensor_delay": "", "none": ""}.get(cause, "z")
    text = quarter_car_text(car, rms, float(rng.normal(0, 0.15)), float(rng.normal(0, 0.25)))
    at = place if cause != "none" else ""
    return PlaneCase(cause, at, axis, form, size, value, text, tuple(runs), rate_hz, tuple(forces))


def _solve(left: Callable[[float], float], target: float) -> tuple[float, float]:
    """Return (size, residual) by bracketing; the largest size is 20."""
    low, high, size, value = 0.0, np.inf, 0.2, np.inf
    for _ in range(14):
        value = left(size)
        if abs(value / target - 1.0) < 0.04 or (size >= 20.0 and value < target):
            break
        low, high = (size, high) if value < target else (low, size)
        guess = size * float(np.clip(target / max(value, 1e-9), 0.2, 5.0))
        size = min(guess if low < guess < high else 0.5 * (low + min(high, 20.0)), 20.0)
    return size, value


def quarter_car_text(car: QuarterCar, noise_std: float, stiffness_off: float, damping_off: float) -> str:
    """Return a vehicle file: body on its suspension, the axle accelerometer as measured base; priors off in logarithm."""
    k, c = car.stiffness * np.exp(stiffness_off), car.damping * np.exp(damping_off)
    return f"""schema: ride_estimation/vehicle/1
name: quarter_car
bodies:
  body:
    mass_kg: {{value: {car.sprung:.9g}, relative_std: 0.01, source: weighed}}
    cg_m: [0.0, 0.0, 0.0]
    degrees_of_freedom: [z]
mounts:
  suspension:
    position_m: [0.0, 0.0, -0.5]
    body: body
    base: axle
    axes:
      z:
        kind: kelvin_voigt
        stiffness_n_per_m: {{value: {k:.9g}, relative_std: 0.3}}
        damping_n_s_per_m: {{value: {c:.9g}, relative_std: 0.5}}
sensors:
  body: {{kind: accelerometer, topic: /body/accel, body: body, position_m: [0, 0, 0], noise_m_per_s2: {noise_std:.6g}}}
  axle:
    kind: accelerometer
    topic: /axle/accel
    body: axle
    mount: suspension
    position_m: [0, 0, -0.5]
    noise_m_per_s2: {noise_std:.6g}
force_references:
  - {{kind: known_mass, body: body}}
"""


def machine_case(
    form: str | None, seed: int, *, size: float = 0.3, noise: float = 0.02, duration: float = 60.0, rate_hz: float = 200.0
) -> PlaneCase:
    """Return the cab of a planar machine (bounce and pitch, two mounts, no seat) with a law in one mount, or clean."""
    rng = np.random.default_rng([seed, 33])
    base = Machine(seat_mass=1e-3, damping=(6e3, 8e3, 4e3, 4.5e3, 1e-2), stiffness=(7e5, 9e5, 4.5e5, 5e5, 1.0))
    base = dataclasses.replace(
        base,
        stiffness=tuple(float(k * f) for k, f in zip(base.stiffness, rng.uniform(0.8, 1.2, 5))),
        damping=tuple(float(c * f) for c, f in zip(base.damping, rng.uniform(0.8, 1.2, 5))),
    )
    mount = int(rng.integers(2))
    roads = (Road(roughness=256e-6, speed=5.0), Road(roughness=400e-6, speed=4.0))
    heights = [road_height(road, duration, STEP, seed * 3 + i) for i, road in enumerate(roads)]
    plain = base.drive(*heights[0], STEP, roads[0].speed)
    link = 2 + mount
    hidden = base
    if form is not None:
        x, v = plain.deflection[1500:, link].std(), plain.rate[1500:, link].std()
        shape = float(rng.random())
        k, c = base.stiffness[link], base.damping[link]
        law = hiding.law_of(form, hiding.Site(k, c, base.cab_mass, float(x), float(v), float(k * x)), size, shape, shape)
        hidden = dataclasses.replace(base, laws=((link, *law),))
    places = {"cab_front": ("cab", 0.2), "cab_middle": ("cab", -0.5), "cab_rear": ("cab", -1.4)}
    places |= {"chassis_front": ("chassis", base.mount_x[0]), "chassis_rear": ("chassis", base.mount_x[1])}
    every = slice(None, None, round(1.0 / (rate_hz * STEP)))
    std = noise * plain.qdd[1500:, 2].std()
    (front, rear), weight = base.mount_x, base.cab_mass * GRAVITY
    static = weight * np.array([base.cab_x - rear, front - base.cab_x]) / (front - rear)
    runs, forces = [], []
    for i, (height, rate) in enumerate(heights):
        run = hidden.drive(height, rate, STEP, roads[i].speed)
        noise_rng = np.random.default_rng([seed, 34, i])
        data = {}
        for name, (body, x) in places.items():
            full = np.zeros((len(run.time), 3))
            pitch = run.q[:, 3] if body == "cab" else run.q[:, 1]
            full[:, 0] = -GRAVITY * np.sin(pitch)  # sensors lie in the plane of the CG: no lever for the fore-aft axis
            full[:, 2] = hidden.accelerometer(run, body, x)
            data[name] = full[every] + noise_rng.normal(0.0, std, full[every].shape)
        runs.append(data)
        forces.append(static - run.tension[every, 2:4])
    cause = next((c for c, forms in FORMS.items() if form in forms), "none")
    location = ("mount_front", "mount_rear")[mount] if form else ""
    text = machine_text(base, places, std, rng)
    axis = "z" if form else ""
    return PlaneCase(cause, location, axis, form or "", size, float("nan"), text, tuple(runs), rate_hz, tuple(forces))


def machine_text(machine: Machine, places: dict[str, tuple[str, float]], noise_std: float, rng: np.random.Generator) -> str:
    """Return a vehicle file of the machine's cab with measured chassis motion."""
    lines = [
        "schema: ride_estimation/vehicle/1", "name: machine_cab", "bodies:", "  cab:",
        f"    mass_kg: {{value: {machine.cab_mass:.9g}, relative_std: 0.01, source: weighed}}",
        f"    cg_m: [{machine.cab_x:g}, 0.0, 0.0]",
        f"    inertia_kg_m2: {{iyy: {machine.cab_inertia:.9g}, relative_std: 0.03}}",
        "    degrees_of_freedom: [z, pitch]", "mounts:",
    ]  # fmt: skip
    for i, name in enumerate(("mount_front", "mount_rear")):
        k = machine.stiffness[2 + i] * np.exp(rng.normal(0, 0.12))
        c = machine.damping[2 + i] * np.exp(rng.normal(0, 0.2))
        lines += [
            f"  {name}:",
            f"    position_m: [{machine.mount_x[i]:g}, 0.0, 0.0]",
            "    body: cab",
            "    base: chassis",
            "    axes:",
        ]
        lines.append(
            f"      z: {{kind: kelvin_voigt, stiffness_n_per_m: {{value: {k:.9g}, relative_std: 0.3}}, "
            f"damping_n_s_per_m: {{value: {c:.9g}, relative_std: 0.5}}}}"
        )
    lines.append("sensors:")
    for name, (body, x) in places.items():
        mount = f", mount: mount_{name.split('_')[1]}" if body == "chassis" else ""
        lines.append(
            f"  {name}: {{kind: accelerometer, topic: /{name}/accel, body: {body}{mount}, position_m: [{x:g}, 0.0, 0.0], "
            f"noise_m_per_s2: {noise_std:.6g}}}"
        )
    return "\n".join([*lines, "force_references:", "  - {kind: known_mass, body: cab}"]) + "\n"
