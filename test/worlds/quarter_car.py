# Copyright 2026 ride_estimation contributors
"""Quarter car with foreign laws, and the fire truck of document 002 (wheel envelope, sinusoidal disturbance, pitch truth).

Body on a suspension on an axle on a tyre on a road; vertical deviations from static equilibrium. Accelerometers on body and
axle read (0, 0, g + a). The vehicle file for the product either takes the axle motion as measured base (``one_mass``) or
describes both masses over a road (``two_mass``).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import GRAVITY
from worlds.chain import Chain, ChainRun, simulate_chain
from worlds.roads import Road, _band, _noise


@dataclasses.dataclass(frozen=True)
class QuarterCar:
    """Masses [kg], suspension and tyre stiffness [N/m] and damping [N s/m]; ``laws`` act in the suspension (link 0)."""

    sprung: float = 2500.0
    unsprung: float = 310.0
    stiffness: float = 3.0e5
    damping: float = 2.0e4
    tyre_stiffness: float = 1.0e6
    tyre_damping: float = 500.0
    laws: tuple[tuple[int, tuple[float, ...]], ...] = ()
    disturbance: tuple[float, float, float] = (0.0, 0.0, 0.0)  # amplitude N, frequency Hz, wander
    mass_after: tuple[float, float] | None = None  # time s, sprung mass

    @staticmethod
    def random(rng: np.random.Generator) -> QuarterCar:
        """Draw a plausible truck or car corner."""
        sprung = float(rng.uniform(300.0, 3000.0))
        bounce, zeta = rng.uniform(1.1, 2.2), rng.uniform(0.12, 0.4)
        stiffness = sprung * (2 * np.pi * bounce) ** 2
        unsprung = sprung * rng.uniform(0.09, 0.16)
        return QuarterCar(
            sprung, unsprung, stiffness, 2 * zeta * np.sqrt(stiffness * sprung), unsprung * (2 * np.pi * rng.uniform(8, 13)) ** 2,
            float(rng.uniform(100.0, 800.0)),
        )  # fmt: skip

    def chain(self) -> Chain:
        """Return the plane plant; coordinates body, axle; links suspension, tyre; input road height."""
        after = None
        if self.mass_after is not None:
            after = (self.mass_after[0], np.diag([self.mass_after[1], self.unsprung]))
        return Chain(
            np.diag([self.sprung, self.unsprung]),
            np.array([[1.0, -1.0], [0.0, 1.0]]),
            np.array([[0.0], [1.0]]),
            np.array([self.stiffness, self.tyre_stiffness]),
            np.array([self.damping, self.tyre_damping]),
            np.array([np.inf, (self.sprung + self.unsprung) * GRAVITY]),
            tuple((0, code, parameters) for code, parameters in self.laws),
            after,
        )


def road_height(road: Road, duration: float, step: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return road height and its rate under one wheel at half steps."""
    rng = np.random.default_rng(seed)
    half, n = 0.5 * step, 2 * round(duration / step) + 1
    size = 1 << int(np.ceil(np.log2(1.07 * n)))
    freq = np.fft.rfftfreq(size, half)
    f = np.maximum(freq, freq[1])
    density = np.sqrt(road.roughness * 0.1**road.waviness * road.speed ** (road.waviness - 1.0) / f**road.waviness)
    spectrum = _noise(freq, rng) * density * _band(freq, 0.2, road.top_frequency) * size / 2.0
    height, rate = np.fft.irfft(spectrum, size)[:n], np.fft.irfft(spectrum * 2j * np.pi * freq, size)[:n]
    t = np.arange(n) * half
    part = np.clip((t - road.standing_s) / road.ramp_s, 0.0, 1.0)
    envelope = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    slope = 30.0 * part**2 * (1.0 - part) ** 2 / road.ramp_s
    return envelope * height, slope * height + envelope * rate


def drive_quarter_car(car: QuarterCar, height: np.ndarray, rate: np.ndarray, step: float, seed: int = 0) -> ChainRun:
    """Integrate over a road height."""
    n = len(height)
    push = np.zeros((n, 2))
    amplitude, frequency, wander = car.disturbance
    if amplitude > 0.0:
        rng = np.random.default_rng(seed + 1)
        t = np.arange(n) * 0.5 * step
        phase = 2 * np.pi * frequency * (t + wander / (2 * np.pi * 0.05) * np.sin(2 * np.pi * 0.05 * t)) + rng.uniform(0, 6.28)
        push[:, 0] = amplitude * np.sin(phase)
    return simulate_chain(car.chain(), step, height[:, None], rate[:, None], push)


def measure_quarter_car(run: ChainRun, rate_hz: float, seed: int, noise_std: float) -> dict[str, np.ndarray]:
    """Return ``time``, triaxial ``body`` and ``axle`` specific force (N, 3) and the truth."""
    every = slice(None, None, round(1.0 / (rate_hz * run.step)))
    rng = np.random.default_rng(seed)
    out = {"time": run.time[every], "tension": run.tension[every], "deflection": run.deflection[every]}
    for j, name in enumerate(("body", "axle")):
        values = np.zeros((len(out["time"]), 3))
        values[:, 2] = GRAVITY + run.qdd[every, j]
        out[name] = values + rng.normal(0.0, noise_std, values.shape)
    return out


def one_mass_yaml(car: QuarterCar, noise_std: float, stiffness_factor: float = 1.15, damping_factor: float = 0.8) -> str:
    """Return a vehicle file: the body on its suspension, the axle accelerometer as measured base."""
    return (
        "schema: ride_estimation/vehicle/1\nname: quarter_car\nbodies:\n"
        f"  body:\n    mass_kg: {{value: {car.sprung!r}, relative_std: 0.01, source: weighed}}\n    cg_m: [0.0, 0.0, 0.0]\n"
        "    degrees_of_freedom: [z]\n"
        "mounts:\n  suspension:\n    position_m: [0.0, 0.0, -0.5]\n    body: body\n    base: axle\n    axes:\n"
        f"      z: {{kind: kelvin_voigt, stiffness_n_per_m: {{value: {car.stiffness * stiffness_factor!r}, relative_std: 0.3}}, "
        f"damping_n_s_per_m: {{value: {car.damping * damping_factor!r}, relative_std: 0.5}}}}\n"
        "sensors:\n"
        "  body: {kind: accelerometer, topic: /body/accel, body: body, position_m: [0.0, 0.0, 0.0], "
        f"noise_m_per_s2: {noise_std!r}}}\n"
        f"  axle: {{kind: accelerometer, topic: /axle/accel, body: axle, mount: suspension, position_m: [0.0, 0.0, -0.5], "
        f"noise_m_per_s2: {noise_std!r}}}\n"
        "force_references:\n  - {kind: known_mass, body: body}\n"
    )


# ------------------------------------------------------------------------------------------------- fire truck, document 002


def wheel_envelope(
    distance: np.ndarray, height: float = 0.1, length: float = 0.1, radius: float = 0.5, start: float = 1.0
) -> np.ndarray:
    """Return the height of the centre of a rigid wheel rolling over a rectangular block, above its height on the flat [m]."""
    x = distance - start
    out = np.zeros_like(x)
    reach = np.sqrt(radius**2 - (radius - height) ** 2)
    before, after, on = (x > -reach) & (x < 0.0), (x > length) & (x < length + reach), (x >= 0.0) & (x <= length)
    out[before] = np.sqrt(radius**2 - x[before] ** 2) - (radius - height)
    out[after] = np.sqrt(radius**2 - (x[after] - length) ** 2) - (radius - height)
    out[on] = height
    return np.maximum(out, 0.0)


@dataclasses.dataclass(frozen=True)
class FireTruck:
    """Document 002 replayed: literature parameters, block of 10 x 10 cm at 5 km/h, optional disturbance and pitch.

    ``disturbance`` (force amplitude N, frequency Hz). ``rear`` adds a rear axle with pitch: the truth a quarter car lacks.
    """

    car: QuarterCar = dataclasses.field(default_factory=QuarterCar)
    speed: float = 5.0 / 3.6
    disturbance: tuple[float, float] = (0.0, 0.0)
    rear: bool = False
    duration: float = 10.0
    step: float = 2.5e-4
    start: float = 1.5  # m to the block

    def record(self, rate_hz: float = 400.0, noise_std: float = 0.02, seed: int = 0) -> tuple[np.ndarray, ...]:
        """Return times [s], height of the wheel centre path [m] and accelerations of body and front axle (N, 2) [m/s^2]."""
        run, path = self.run()
        every = slice(None, round(self.duration / self.step), round(1.0 / (rate_hz * self.step)))
        measured = run.qdd[every, :2]
        if self.rear:  # body above the front axle, which is 2 m before the CG
            measured = np.column_stack([run.qdd[every, 0] - 2.0 * run.qdd[every, 1], run.qdd[every, 2]])
        return run.time[every], path[every], measured + noise_std * np.random.default_rng(seed).standard_normal(measured.shape)

    def run(self) -> tuple[ChainRun, np.ndarray]:
        """Return the run and the height of the wheel centre path at full steps."""
        n = 2 * round(self.duration / self.step) + 1
        t = np.arange(n) * 0.5 * self.step
        front = wheel_envelope(t * self.speed, start=self.start)
        rate = np.gradient(front, 0.5 * self.step)
        push = np.zeros((n, 4 if self.rear else 2))
        amplitude, frequency = self.disturbance
        push[:, 0] = amplitude * np.sin(2 * np.pi * frequency * t + 0.7)
        if not self.rear:
            return simulate_chain(self.car.chain(), self.step, front[:, None], rate[:, None], push), front[::2]
        c = self.car
        a, b = 2.0, 1.8  # m from the CG to the axles
        behind = wheel_envelope(t * self.speed - (a + b), start=self.start)
        chain = Chain(
            np.diag([2.0 * c.sprung, 2.0 * c.sprung * a * b * 0.9, c.unsprung, c.unsprung]),
            np.array([[1.0, -a, -1.0, 0.0], [1.0, b, 0.0, -1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]),
            np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
            np.array([c.stiffness, 1.2 * c.stiffness, c.tyre_stiffness, c.tyre_stiffness]),
            np.array([c.damping, c.damping, c.tyre_damping, c.tyre_damping]),
            np.array([np.inf, np.inf, 28e3, 28e3]),
        )
        inputs = np.column_stack([front, behind])
        rates = np.column_stack([rate, np.gradient(behind, 0.5 * self.step)])
        return simulate_chain(chain, self.step, inputs, rates, push), front[::2]
