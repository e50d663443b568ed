# Copyright 2026 ride_estimation contributors
"""A six-degree-of-freedom cab on three-axis mounts: random vehicles, simulation, sensors, truth.

Axes: x forward, y left, z up, origin of the vehicle file; world and vehicle-file axes coincide at static equilibrium.
Mount law: in the axes of the chassis bracket, which tilt with the chassis (``axes_on_cab`` puts them on the cab instead).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, lfilter_zi

from worlds.kernel import STATE, integrate, place_brackets, rotation_of_quaternion
from worlds.laws import PARAMETERS
from worlds.roads import BaseMotion, Road, base_motion

GRAVITY = 9.80665
LAWS_PER_AXIS = 2
#: stages in which a slow load comes on
LOAD_STEPS = 60
AXES = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class Hidden:
    """Everything a linear rigid cab does not have; empty by default. Filled by :mod:`worlds.effects`.

    ``laws``: (mount index, axis index, law code, parameters). ``cross`` (M, 3, 3) extra stiffness. ``drift`` (M, 3, 4):
    relative change, start s, end s, share in the damping. ``mass_after``: (time s, mass, cg, inertia), reached after
    ``mass_over_s`` more seconds. ``push``: disturbance force (amplitude N, frequency Hz, wander, seed), arm point and direction.
    ``elastic``: (frequency Hz, damping ratio, shape at mounts (M, 3), {sensor: shape (3,)}), modal mass 1. ``suspended``:
    (mass, frequency Hz, damping ratio, point).
    """

    laws: tuple[tuple[int, int, int, tuple[float, ...]], ...] = ()
    cross: np.ndarray | None = None
    drift: np.ndarray | None = None
    mass_after: tuple[float, float, np.ndarray, np.ndarray] | None = None
    mass_over_s: float = 0.0
    push: tuple[float, float, float, int] | None = None
    push_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    push_direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    elastic: tuple[float, float, np.ndarray, Mapping[str, np.ndarray]] | None = None
    suspended: tuple[float, float, float, np.ndarray] | None = None


@dataclasses.dataclass(frozen=True)
class CabSensor:
    """One sensor: what the vehicle file says of it and what it really does.

    ``place`` is ``cab`` or a mount name (chassis side). ``kind`` ``accelerometer``, ``imu`` or ``displacement`` (``axis``).
    ``true_*`` None means as declared. ``bias_steps``: (time s, change).
    """

    name: str
    place: str
    position: np.ndarray
    kind: str = "accelerometer"
    axis: str = ""
    rotation: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(3))
    noise_std: float = 0.02
    gyro_noise_std: float = 0.001
    full_scale: float = 98.0
    true_position: np.ndarray | None = None
    true_rotation: np.ndarray | None = None
    gain: np.ndarray | float = 1.0
    bias: np.ndarray | float = 0.0
    delay_s: float = 0.0
    clip: float = np.inf
    quantum: float = 0.0


@dataclasses.dataclass(frozen=True)
class CabVehicle:
    """True cab: mass, CG, inertia about it, mounts (k, c per axis) and hidden effects."""

    mass: float
    cg: np.ndarray
    inertia: np.ndarray
    mount_names: tuple[str, ...]
    mounts: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    hidden: Hidden = dataclasses.field(default_factory=Hidden)
    axes_on_cab: bool = False

    @property
    def static_force(self) -> np.ndarray:
        """Return the static force on the cab per mount [N], (M, 3): vertical, split by the vertical stiffness."""
        arms = self.mounts - self.cg
        shape = np.column_stack([np.ones(len(arms)), arms[:, 1], -arms[:, 0]])
        k = self.stiffness[:, 2]
        q = np.linalg.solve(shape.T @ (k[:, None] * shape), np.array([self.mass * GRAVITY, 0.0, 0.0]))
        force = np.zeros((len(arms), 3))
        force[:, 2] = k * (shape @ q)
        return force

    def modes(self) -> np.ndarray:
        """Return the six undamped natural frequencies of small motion [Hz], gravity (pre-load) included."""
        m = np.zeros((6, 6))
        m[:3, :3], m[3:, 3:] = self.mass * np.eye(3), self.inertia
        k = np.zeros((6, 6))
        for i, arm in enumerate(self.mounts - self.cg):
            cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
            g = np.hstack([np.eye(3), -cross])
            k += g.T @ np.diag(self.stiffness[i]) @ g
            # weight carried at a point below the CG: moment arm x force changes with the angle
            f = self.static_force[i]
            k[3:, 3:] += -_sym(np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]]) @ cross)
        values = np.linalg.eigvals(np.linalg.solve(m, k))
        return np.sort(np.sqrt(np.maximum(values.real, 0.0))) / (2 * np.pi)


def _sym(a: np.ndarray) -> np.ndarray:
    return 0.5 * (a + a.T)


@dataclasses.dataclass(frozen=True)
class CabRun:
    """Truth on the integration grid.

    Forces are on the cab by the mount, cab axes, static share included. ``specific_force`` and ``angular_accel`` are body
    components at the CG; ``cg_accel`` the same with gravity removed. ``deflection`` in mount axes.
    """

    step: float
    time: np.ndarray
    vehicle: CabVehicle
    state: np.ndarray
    rotation: np.ndarray
    specific_force: np.ndarray
    angular_accel: np.ndarray
    elastic_accel: np.ndarray
    suspended_accel: np.ndarray
    force: np.ndarray
    deflection: np.ndarray
    rate: np.ndarray
    base: BaseMotion

    @property
    def angular_rate(self) -> np.ndarray:
        """Return the body-frame angular velocity [rad/s], (N, 3)."""
        return self.state[:, 10:13]

    @property
    def cg_accel(self) -> np.ndarray:
        """Return CG acceleration without gravity and angular acceleration, cab axes, (N, 6)."""
        up = self.rotation[:, 2, :]
        return np.hstack([self.specific_force - GRAVITY * up, self.angular_accel])

    def mass_properties(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return mass (N,), cg (N, 3) and inertia (N, 3, 3) at every step."""
        starts, *stages = mass_stages(self.vehicle)
        stage = np.searchsorted(starts, self.time, side="right")
        mass, cg, inertia = (np.asarray(values)[stage] for values in stages)
        return mass, cg, inertia

    @property
    def inertial_load(self) -> np.ndarray:
        """Return (m f_cg, J alpha + omega x J omega), cab axes, (N, 6): gravity included in the force."""
        mass, _, j = self.mass_properties()
        w = self.angular_rate
        moment = np.einsum("nij,nj->ni", j, self.angular_accel) + np.cross(w, np.einsum("nij,nj->ni", j, w))
        return np.hstack([mass[:, None] * self.specific_force, moment])


def mass_stages(vehicle: CabVehicle) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the times (S,) at which the mass properties step on, and mass, cg and inertia before the first and after each."""
    hidden = vehicle.hidden
    if hidden.mass_after is None:
        return np.zeros(0), np.array([vehicle.mass]), vehicle.cg[None], vehicle.inertia[None]
    when, mass, cg, inertia = hidden.mass_after
    count = LOAD_STEPS if hidden.mass_over_s > 0.0 else 1
    share = np.arange(count + 1)[:, None] / count
    total = vehicle.mass + (mass - vehicle.mass) * share[:, 0]
    moment = vehicle.mass * vehicle.cg * (1.0 - share) + mass * np.asarray(cg) * share

    def about_origin(m: float, c: np.ndarray, j: np.ndarray) -> np.ndarray:
        return j + m * (c @ c * np.eye(3) - np.outer(c, c))

    first = about_origin(vehicle.mass, vehicle.cg, vehicle.inertia)
    last = about_origin(mass, np.asarray(cg), inertia)
    where = moment / total[:, None]
    inertias = [first + (last - first) * s - about_origin(m, c, np.zeros((3, 3))) for s, m, c in zip(share[:, 0], total, where)]
    return when + hidden.mass_over_s * share[1:, 0], total, where, np.array(inertias)


def simulate(vehicle: CabVehicle, base: BaseMotion) -> CabRun:
    """Integrate the cab over a base motion, starting at rest at static equilibrium."""
    hidden, m = vehicle.hidden, len(vehicle.mounts)
    n = (base.chassis.shape[0] - 1) // 2
    codes = np.zeros((m, 3, LAWS_PER_AXIS), np.int64)
    lawp = np.zeros((m, 3, LAWS_PER_AXIS, PARAMETERS))
    for mount, axis, code, parameters in hidden.laws:
        slot = int(np.count_nonzero(codes[mount, axis]))
        codes[mount, axis, slot] = code
        lawp[mount, axis, slot, : len(parameters)] = parameters
    drift = np.zeros((m, 3, 4)) if hidden.drift is None else np.asarray(hidden.drift, float)
    cross = np.zeros((m, 3, 3)) if hidden.cross is None else np.asarray(hidden.cross, float)
    starts, mass, cg, inertia = mass_stages(vehicle)
    switches = np.round(starts / base.step).astype(np.int64)
    shape, w2, zw = np.zeros((m, 3)), 0.0, 0.0
    if hidden.elastic is not None:
        w = 2 * np.pi * hidden.elastic[0]
        w2, zw, shape = w * w, 2 * hidden.elastic[1] * w, np.asarray(hidden.elastic[2], float)
    suspended, spring, damper, point = 0.0, 0.0, 0.0, np.zeros(3)
    if hidden.suspended is not None:
        suspended, f, zeta, point = hidden.suspended
        spring = suspended * (2 * np.pi * f) ** 2
        damper = 2 * zeta * np.sqrt(spring * suspended)
    bodies = (
        mass, cg, inertia, np.linalg.inv(inertia),
        GRAVITY, np.array(hidden.push_point, float), np.array(hidden.push_direction, float), np.array(point, float),
    )  # fmt: skip
    mount = (
        np.ascontiguousarray(vehicle.stiffness, float), np.ascontiguousarray(vehicle.damping, float),
        vehicle.static_force, cross, drift, vehicle.axes_on_cab,
    )  # fmt: skip
    extra = (w2, zw, shape, float(suspended), float(spring), float(damper))
    y = np.zeros(STATE)
    y[:3], y[6] = vehicle.cg, 1.0
    push = _push_signal(hidden, base)
    states, acc, force, deflection, rate = integrate(
        base.step, base.chassis, base.brackets, np.ascontiguousarray(vehicle.mounts, float), push, y, bodies, switches,
        mount, codes, lawp, extra, np.ascontiguousarray(vehicle.mounts, float),
    )  # fmt: skip
    return CabRun(
        base.step, np.arange(n + 1) * base.step, vehicle, states, _rotations(states[:, 6:10]), acc[:, :3], acc[:, 3:6],
        acc[:, 6], acc[:, 7], force, deflection, rate, base,
    )  # fmt: skip


def _push_signal(hidden: Hidden, base: BaseMotion) -> np.ndarray:
    """Return the disturbance force at half steps: a sine whose phase wanders slowly."""
    n = base.chassis.shape[0]
    if hidden.push is None:
        return np.zeros(n)
    amplitude, frequency, wander, seed = hidden.push
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.5 * base.step
    swing = sum(np.sin(2 * np.pi * rate * t + rng.uniform(0, 2 * np.pi)) / rate for rate in (0.031, 0.073, 0.113))
    phase = 2 * np.pi * frequency * t + 2 * np.pi * frequency * wander * swing / (2 * np.pi) + rng.uniform(0, 2 * np.pi)
    return amplitude * (1.0 + 0.05 * np.sin(2 * np.pi * 0.05 * t)) * np.sin(phase)


def _rotations(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q.T
    r = np.empty((len(q), 3, 3))
    r[:, 0, 0], r[:, 0, 1], r[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    r[:, 1, 0], r[:, 1, 1], r[:, 1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    r[:, 2, 0], r[:, 2, 1], r[:, 2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return r


def bracket_motion(base: BaseMotion, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position (N, M, 3), attitude (N, M, 3, 3) and body rate (N, M, 3) of the brackets at full steps."""
    rows = range(0, base.chassis.shape[0], 2)
    m = len(points)
    pos, rot, rate = np.empty((len(rows), m, 3)), np.empty((len(rows), m, 3, 3)), np.empty((len(rows), m, 3))
    seat, vel = np.ascontiguousarray(points, float), np.empty((m, 3))
    for out, row in enumerate(rows):
        place_brackets(base.chassis[row], base.brackets[row], seat, pos[out], vel, rot[out], rate[out])
    return pos, rot, rate


def _second_derivative(x: np.ndarray, h: float) -> np.ndarray:
    """Return the second derivative along axis 0, fourth order inside."""
    out = np.empty_like(x)
    out[2:-2] = (-x[4:] + 16 * x[3:-1] - 30 * x[2:-2] + 16 * x[1:-3] - x[:-4]) / (12 * h * h)
    out[:2], out[-2:] = out[2], out[-3]
    return out


def true_signal(run: CabRun, sensor: CabSensor, brackets: tuple[np.ndarray, ...] | None = None) -> np.ndarray:
    """Return what an ideal sensor at the true place reads, sensor axes, on the integration grid, shape (N, C)."""
    rotation = sensor.rotation if sensor.true_rotation is None else sensor.true_rotation
    position = sensor.position if sensor.true_position is None else sensor.true_position
    names = run.vehicle.mount_names
    if sensor.kind == "displacement":
        return run.deflection[:, names.index(sensor.place), AXES.index(sensor.axis)][:, None]
    if sensor.place == "cab":
        _, cg, _ = run.mass_properties()
        arm, w = position - cg, run.angular_rate
        body = run.specific_force + np.cross(run.angular_accel, arm) + np.cross(w, np.cross(w, arm))
        elastic = run.vehicle.hidden.elastic
        if elastic is not None and sensor.name in elastic[3]:
            body = body + run.elastic_accel[:, None] * np.asarray(elastic[3][sensor.name])
        if sensor.kind == "imu":
            return np.hstack([body @ rotation, w @ rotation])
        return body @ rotation
    i = names.index(sensor.place)
    pos, rot, _ = bracket_motion(run.base, run.vehicle.mounts) if brackets is None else brackets
    point = pos[:, i] + np.einsum("nij,j->ni", rot[:, i], position - run.vehicle.mounts[i])
    accel = _second_derivative(point, run.step)
    accel[:, 2] += GRAVITY
    return np.einsum("nji,nj->ni", rot[:, i], accel) @ rotation


@dataclasses.dataclass(frozen=True)
class Measurement:
    """Measured-like run: sensor name -> (stamps [s], values); ``truth`` arrays on the uniform grid ``time``."""

    rate_hz: float
    time: np.ndarray
    stamps: Mapping[str, np.ndarray]
    data: Mapping[str, np.ndarray]
    truth: Mapping[str, np.ndarray]
    sensors: tuple[CabSensor, ...]
    run: CabRun
    signal_rms: float


def measure(
    run: CabRun,
    sensors: tuple[CabSensor, ...],
    rate_hz: float,
    seed: int,
    *,
    noise_share: float | None = None,
    anti_alias: float = 0.4,
    jitter_s: float = 0.0,
    phases_s: float = 0.0,
) -> Measurement:
    """Sample every sensor.

    Parameters
    ----------
    noise_share
        Noise standard deviation of every accelerometer as a share of the pooled rms of the moving part of the cab
        accelerometers (for displacement sensors: of the pooled deflection rms); None: each sensor's ``noise_std``.
    anti_alias
        Corner of a second-order Butterworth low-pass, the same in all sensors, as a share of the sample rate; 0: none. The
        truth of the measurement passes the same filter.
    jitter_s, phases_s
        Standard deviation of stamp jitter (true sampling times move with the stamp), largest phase between sensors.
    """
    rng = np.random.default_rng(seed)
    decimation = round(1.0 / (rate_hz * run.step))
    if abs(decimation * rate_hz * run.step - 1.0) > 1e-9:
        raise ValueError(f"rate {rate_hz} Hz must divide the integration rate {1 / run.step} Hz")
    keep = slice(0, None, decimation)
    time = run.time[keep]
    brackets = bracket_motion(run.base, run.vehicle.mounts) if any(s.place != "cab" for s in sensors) else None
    clean = {s.name: true_signal(run, s, brackets) for s in sensors}
    rms = pooled_rms([clean[s.name][:, :3] for s in sensors if s.place == "cab" and s.kind != "displacement"])
    defl_rms = pooled_rms([clean[s.name] for s in sensors if s.kind == "displacement"])
    data, stamps, used = {}, {}, []
    for declared in sensors:
        sensor = declared
        if noise_share is not None:
            scale = defl_rms if sensor.kind == "displacement" else rms
            sensor = dataclasses.replace(sensor, noise_std=noise_share * scale)
        used.append(sensor)
        signal = clean[sensor.name]
        if anti_alias > 0.0:
            b, a = butter(2, min(anti_alias * rate_hz * 2 * run.step, 0.99))
            signal = lfilter(b, a, signal, axis=0, zi=lfilter_zi(b, a)[:, None] * signal[:1])[0]
        when = time.copy()
        if phases_s > 0.0:
            when = when + rng.uniform(0.0, phases_s)
        if jitter_s > 0.0:
            when = when + np.clip(rng.normal(0.0, jitter_s, when.size), -4 * jitter_s, 4 * jitter_s)
        stamps[sensor.name] = when
        taken = when - sensor.delay_s
        if sensor.delay_s == 0.0 and jitter_s == 0.0 and phases_s == 0.0:
            values = signal[keep].copy()
        else:
            values = CubicSpline(run.time, signal, axis=0)(np.clip(taken, run.time[0], run.time[-1]))
        values = values * sensor.gain + sensor.bias
        noise = np.full(values.shape[1], sensor.noise_std)
        noise[3:] = sensor.gyro_noise_std
        values = values + rng.normal(size=values.shape) * noise
        if sensor.quantum > 0.0:
            values = np.round(values / sensor.quantum) * sensor.quantum
        data[sensor.name] = np.clip(values, -min(sensor.clip, sensor.full_scale), min(sensor.clip, sensor.full_scale))
    mass, cg, _ = run.mass_properties()

    def seen(values: np.ndarray) -> np.ndarray:
        """Return a true signal through the filter of the sensors: what any estimate could at best be."""
        if anti_alias > 0.0:
            b, a = butter(2, min(anti_alias * rate_hz * 2 * run.step, 0.99))
            zi = lfilter_zi(b, a).reshape(-1, *[1] * (values.ndim - 1))
            values = lfilter(b, a, values, axis=0, zi=zi * values[:1])[0]
        return values[keep]

    truth = {
        "time": time,
        "specific_force": seen(run.specific_force),
        "cg_accel": seen(run.cg_accel),
        "angular_rate": seen(run.angular_rate),
        "inertial_load": seen(run.inertial_load),
        "mount_force": seen(run.force),
        "deflection": seen(run.deflection),
        "deflection_rate": seen(run.rate),
        "mass": mass[keep],
        "cg": cg[keep],
        "rotation": run.rotation[keep],
    }
    return Measurement(rate_hz, time, stamps, data, truth, tuple(used), run, rms)


def pooled_rms(signals: list[np.ndarray]) -> float:
    """Return the rms of the moving parts of several signals taken together."""
    if not signals:
        return 0.0
    return float(np.sqrt(np.mean([np.mean((s - s.mean(axis=0)) ** 2) for s in signals])))


def random_vehicle(rng: np.random.Generator, kind: str = "any") -> CabVehicle:
    """Draw a cab. ``kind``: ``air`` (soft vertical, stiff horizontal), ``rubber`` (3 to 8 Hz bounce), ``any``."""
    if kind == "any":
        kind = str(rng.choice(["air", "air", "rubber"]))
    mass = float(rng.uniform(600.0, 1500.0))
    size = np.array([rng.uniform(1.6, 2.2), rng.uniform(1.9, 2.4), rng.uniform(1.6, 2.4)])
    gyration = size / np.sqrt(12.0) * rng.uniform(1.0, 1.3, 3)
    rx, ry, rz = gyration
    inertia = mass * np.diag([ry**2 + rz**2, rx**2 + rz**2, rx**2 + ry**2])
    products = rng.uniform(-0.04, 0.04, 3) * mass
    inertia += np.array([[0, products[0], products[1]], [products[0], 0, products[2]], [products[1], products[2], 0]])
    front, rear = rng.uniform(0.6, 1.0), -rng.uniform(0.6, 1.0)
    half_front, half_rear = rng.uniform(0.4, 0.6, 2)
    low = -rng.uniform(0.3, 0.7)
    mounts = np.array([[front, half_front, low], [front, -half_front, low], [rear, half_rear, low], [rear, -half_rear, low]])
    mounts[:, 2] += np.array([0.0, 0.0, 1.0, 1.0]) * rng.uniform(-0.1, 0.15)
    cg = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.04, 0.04), rng.uniform(-0.05, 0.05)])
    bounce = rng.uniform(1.2, 2.4) if kind == "air" else rng.uniform(3.0, 7.0)
    kz = mass * (2 * np.pi * bounce) ** 2 / 4.0 * np.array([1.0, 1.0, 1.0, 1.0])
    kz *= np.repeat(rng.uniform(0.8, 1.25, 2), 2)
    ratio = rng.uniform(4.0, 30.0, 2) if kind == "air" else rng.uniform(0.5, 2.0, 2)
    stiffness = np.column_stack([kz * ratio[0], kz * ratio[1], kz]) * rng.uniform(0.93, 1.07, (4, 3))
    zeta = np.array([rng.uniform(0.04, 0.15), rng.uniform(0.04, 0.15), rng.uniform(0.12, 0.35)])
    if kind == "rubber":
        zeta = rng.uniform(0.04, 0.12, 3)
    damping = 2.0 * zeta * np.sqrt(stiffness * mass / 4.0) * rng.uniform(0.9, 1.1, (4, 3))
    names = ("front_left", "front_right", "rear_left", "rear_right")
    return CabVehicle(mass, cg, inertia, names, mounts, stiffness, damping)


def random_sensors(
    vehicle: CabVehicle,
    rng: np.random.Generator,
    *,
    cab_sensors: int = 4,
    chassis: bool = True,
    displacement: tuple[tuple[str, str], ...] = (),
    noise_std: float = 0.02,
    turned: bool = False,
) -> tuple[CabSensor, ...]:
    """Draw a layout: triaxials near the cab corners (one lifted), one at each mount base, displacement transducers."""
    corners = np.array(
        [[0.8, 0.6, -0.35], [0.8, -0.6, -0.35], [-0.8, 0.6, -0.35], [-0.8, -0.6, 0.9], [0.0, 0.0, 1.0], [0.3, 0.0, -0.4]]
    )
    places = ("front_left", "front_right", "rear_left", "rear_right", "roof", "floor")
    out = []
    for i in range(cab_sensors):
        position = np.round(corners[i] + rng.uniform(-0.12, 0.12, 3), 3)
        rotation = random_mounting(rng) if turned else np.eye(3)
        out.append(CabSensor(f"cab_{places[i]}", "cab", position, rotation=rotation, noise_std=noise_std))
    if chassis:
        for name, point in zip(vehicle.mount_names, vehicle.mounts):
            rotation = random_mounting(rng) if turned else np.eye(3)
            out.append(CabSensor(f"chassis_{name}", name, point.copy(), rotation=rotation, noise_std=noise_std, full_scale=196.0))
    for mount, axis in displacement:
        point = vehicle.mounts[vehicle.mount_names.index(mount)]
        out.append(CabSensor(f"displacement_{mount}_{axis}", mount, point.copy(), kind="displacement", axis=axis, noise_std=5e-5))
    return tuple(out)


def random_mounting(rng: np.random.Generator) -> np.ndarray:
    """Return one of the right-angle mountings, tilted by up to 4 degrees."""
    turns = np.array([rng.integers(0, 4) * 90.0, 0.0, rng.integers(0, 4) * 90.0]) + rng.uniform(-4.0, 4.0, 3)
    return rotation_of_degrees(np.round(turns, 2))


def rotation_of_degrees(rpy: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of roll, pitch, yaw [deg] (turn about x, then y, then z of the fixed axes)."""
    r, p, y = np.radians(rpy)
    rx = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    ry = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    rz = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]])
    return rz @ ry @ rx


def attitude(run: CabRun) -> np.ndarray:
    """Return the cab attitude recomputed one step at a time from the quaternion (oracle for the vectorised form)."""
    out = np.empty((len(run.time), 3, 3))
    for i, state in enumerate(run.state):
        rotation_of_quaternion(state[6:10], out[i])
    return out


def drive(vehicle: CabVehicle, road: Road, duration: float, seed: int, *, step: float = 5e-4) -> CabRun:
    """Synthesise the base motion of a road and integrate the cab over it."""
    return simulate(vehicle, base_motion(road, vehicle.mounts, duration, step, seed))
