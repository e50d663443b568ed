# Copyright 2026 ride_estimation contributors
"""Plant one cause of interface.md section 4, or an effect no library lists, in a cab world.

An :class:`Effect` knows its cause, place, axis and form and turns a size into a changed vehicle, changed sensors and changed
beliefs. Size is dimensionless; :mod:`worlds.calibration` finds the one that leaves a wanted residual of the best linear
model, so that causes are comparable.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from worlds import hiding
from worlds.cab import AXES, CabRun, CabSensor, CabVehicle, rotation_of_degrees, true_signal
from worlds.hiding import FORMS

Sensors = tuple[CabSensor, ...]
Changed = tuple[CabVehicle, Sensors, tuple[float, float, float]]


@dataclasses.dataclass(frozen=True)
class Effect:
    """A planted effect.

    ``apply(size)`` returns (vehicle, sensors, offset of the believed CG [m]). ``largest`` bounds the size; ``mean_counts``:
    the residual counts constant offsets too; ``fixed_size``: difficulty is not set by the residual (a soft mount leaves none
    in a linear model with free mounts).
    """

    cause: str
    location: str
    axis: str
    form: str
    apply: Callable[[float], Changed]
    largest: float = 10.0
    mean_counts: bool = False
    fixed_size: float | None = None


@dataclasses.dataclass(frozen=True)
class Reference:
    """The run without effect: what sizes are relative to."""

    vehicle: CabVehicle
    sensors: Sensors
    run: CabRun

    def moving(self, values: np.ndarray) -> np.ndarray:
        """Return rms over time about the mean, first axis, of the part after two seconds."""
        return np.std(values[round(2.0 / self.run.step) :], axis=0)

    @property
    def deflection(self) -> np.ndarray:
        """Return deflection rms (M, 3) [m]."""
        return self.moving(self.run.deflection)

    @property
    def rate(self) -> np.ndarray:
        """Return deflection rate rms (M, 3) [m/s]."""
        return self.moving(self.run.rate)

    @property
    def force(self) -> np.ndarray:
        """Return rms of the spring and damper force (M, 3) [N]."""
        return self.moving(self.vehicle.stiffness * self.run.deflection + self.vehicle.damping * self.run.rate)


OUTSIDE = (*hiding.OUTSIDE, "cross_coupling")
OTHER = (
    "harmonic_disturbance", "mass_change", "cg_offset", "parameter_drift", "one_soft_mount", "flexible_mode",
    "missing_degree_of_freedom",
)  # fmt: skip
SENSOR_CAUSES = (
    "sensor_delay", "sensor_gain", "sensor_bias", "sensor_misalignment", "sensor_clipping", "wrong_sensor_position",
)  # fmt: skip
CAUSES = (*FORMS, *OTHER, *SENSOR_CAUSES)


def plant(
    cause: str,
    reference: Reference,
    rng: np.random.Generator,
    *,
    form: str | None = None,
    mount: str | None = None,
    axis: str | None = None,
    sensor: str | None = None,
    chassis_share: float = 0.25,
) -> Effect:
    """Return an effect of a cause at a random or given place.

    Parameters
    ----------
    cause
        An id of :data:`CAUSES`, ``outside:<name>`` of :data:`OUTSIDE`, or ``none``.
    form, mount, axis, sensor
        Fixed choices; None: drawn. ``mount`` may be ``all``.
    chassis_share
        Share of sensor faults planted on chassis-side sensors.
    """
    if cause == "none":
        return Effect("none", "", "", "", lambda size: (reference.vehicle, reference.sensors, (0.0, 0.0, 0.0)))
    if cause in FORMS or cause in ("outside:levelling", "outside:inerter"):
        return _law_effect(cause, reference, rng, form, mount, axis)
    if cause in SENSOR_CAUSES:
        return _sensor_effect(cause, reference, rng, form, sensor, axis, chassis_share)
    builders = {
        "harmonic_disturbance": _harmonic, "mass_change": _mass_change, "cg_offset": _cg_offset,
        "parameter_drift": _drift, "one_soft_mount": _soft_mount, "flexible_mode": _flexible,
        "missing_degree_of_freedom": _suspended, "outside:cross_coupling": _cross,
    }  # fmt: skip
    if cause not in builders:
        raise ValueError(f"unknown cause {cause!r}; known: none, {', '.join(CAUSES)}, outside:{', outside:'.join(OUTSIDE)}")
    return builders[cause](reference, rng, mount, axis)


def combine(first: Effect, second: Effect) -> Callable[[float, float], Changed]:
    """Return a function of two sizes that plants both effects (laws and sensor faults add up)."""

    def apply(size_1: float, size_2: float) -> Changed:
        v1, s1, c1 = first.apply(size_1)
        v2, s2, c2 = second.apply(size_2)
        base, none = v1.hidden, v2.hidden
        changes = {
            f.name: getattr(none, f.name)
            for f in dataclasses.fields(none)
            if f.name != "laws" and repr(getattr(none, f.name)) != repr(f.default)
        }
        hidden = dataclasses.replace(base, laws=base.laws + none.laws, **changes)
        plain = second.apply(0.0)[0]
        stiffness, damping = v1.stiffness * v2.stiffness / plain.stiffness, v1.damping * v2.damping / plain.damping
        vehicle = dataclasses.replace(v1, hidden=hidden, stiffness=stiffness, damping=damping)
        sensors = tuple(_merge_sensor(a, b) for a, b in zip(s1, s2))
        return vehicle, sensors, tuple(a + b for a, b in zip(c1, c2))  # type: ignore[return-value]

    return apply


def _merge_sensor(a: CabSensor, b: CabSensor) -> CabSensor:
    default = CabSensor(b.name, b.place, b.position)
    names = ("true_position", "true_rotation", "gain", "bias", "delay_s", "clip")
    changes = {n: getattr(b, n) for n in names if repr(getattr(b, n)) != repr(getattr(default, n))}
    return dataclasses.replace(a, **changes)


def _choose_place(reference: Reference, rng: np.random.Generator, mount: str | None, axis: str | None, all_share: float):
    names = reference.vehicle.mount_names
    if axis is None:
        axis = str(rng.choice(AXES, p=[0.2, 0.2, 0.6]))
    if mount is None:
        mount = "all" if rng.random() < all_share else str(rng.choice(names))
    chosen = range(len(names)) if mount == "all" else [names.index(mount)]
    return mount, axis, list(chosen), AXES.index(axis)


def _law_effect(
    cause: str, ref: Reference, rng: np.random.Generator, form: str | None, mount: str | None, axis: str | None
) -> Effect:
    if cause.startswith("outside:"):
        form = cause.split(":")[1]
    form = form or str(rng.choice(FORMS[cause]))
    location, axis, chosen, a = _choose_place(ref, rng, mount, axis, 0.25)
    u, w = float(rng.random()), float(rng.random())

    def law(size: float, i: int) -> tuple[int, tuple[float, ...]]:
        site = hiding.Site(
            float(ref.vehicle.stiffness[i, a]), float(ref.vehicle.damping[i, a]), ref.vehicle.mass, float(ref.deflection[i, a]),
            float(ref.rate[i, a]), float(ref.force[i, a]), upright=a == 2,
        )
        return hiding.law_of(form, site, size, u, w)

    def apply(size: float) -> Changed:
        added = tuple((i, a, *law(size, i)) for i in chosen)
        hidden = dataclasses.replace(ref.vehicle.hidden, laws=ref.vehicle.hidden.laws + added)
        damping = ref.vehicle.damping.copy()
        damping[chosen, a] *= hiding.damping_factor(form, size)
        return dataclasses.replace(ref.vehicle, hidden=hidden, damping=damping), ref.sensors, (0.0, 0.0, 0.0)

    return Effect(cause, location, axis, form, apply, largest=hiding.LARGEST.get(form, 5.0))


def _changed(ref: Reference, **hidden: object) -> Changed:
    return (
        dataclasses.replace(ref.vehicle, hidden=dataclasses.replace(ref.vehicle.hidden, **hidden)),
        ref.sensors,
        (0.0, 0.0, 0.0),
    )  # type: ignore[arg-type]


def _harmonic(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    axis = axis or str(rng.choice(AXES, p=[0.2, 0.2, 0.6]))
    direction = tuple(float(axis == b) for b in AXES)
    point = tuple(float(p) for p in ref.vehicle.cg + rng.uniform(-0.7, 0.7, 3) * np.array([1.0, 0.7, 0.5]))
    frequency, wander, seed = float(rng.uniform(3.0, 24.0)), float(rng.uniform(0.0005, 0.004)), int(rng.integers(1 << 31))
    scale = 0.5 * ref.vehicle.mass * float(ref.moving(ref.run.specific_force).max())

    def apply(size: float) -> Changed:
        return _changed(ref, push=(size * scale, frequency, wander, seed), push_point=point, push_direction=direction)

    return Effect("harmonic_disturbance", "cab", axis, "wandering_sine", apply)


def _mass_change(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    vehicle = ref.vehicle
    point = vehicle.cg + rng.uniform(-0.6, 0.6, 3) * np.array([1.0, 0.6, 0.5])
    sign = 1.0 if rng.random() < 0.7 else -0.5
    when = float(rng.uniform(0.4, 0.6)) * ref.run.time[-1]
    when = round(when / ref.run.step) * ref.run.step

    def apply(size: float) -> Changed:
        added = sign * 0.3 * size * vehicle.mass
        mass = vehicle.mass + added
        cg = (vehicle.mass * vehicle.cg + added * point) / mass
        inertia = vehicle.inertia.copy()
        for m, r in ((vehicle.mass, vehicle.cg - cg), (added, point - cg)):
            inertia = inertia + m * (r @ r * np.eye(3) - np.outer(r, r))
        return _changed(ref, mass_after=(when, mass, cg, inertia))

    return Effect("mass_change", "cab", "", "step", apply, largest=3.0)


def _cg_offset(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    axis = axis or str(rng.choice(AXES))
    sign = float(rng.choice([-1.0, 1.0]))

    def apply(size: float) -> Changed:
        offset = [0.0, 0.0, 0.0]
        offset[AXES.index(axis)] = sign * 0.2 * size
        return ref.vehicle, ref.sensors, (offset[0], offset[1], offset[2])

    return Effect("cg_offset", "cab", axis, "believed_cg", apply, largest=3.0)


def _drift(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    location, axis, chosen, a = _choose_place(ref, rng, mount, axis or str(rng.choice(AXES, p=[0.15, 0.15, 0.7])), 0.5)
    sign, share = float(rng.choice([-1.0, 1.0])), float(rng.choice([0.0, 1.0]))
    start, end = 0.1 * ref.run.time[-1], ref.run.time[-1] * float(rng.uniform(0.7, 1.0))

    def apply(size: float) -> Changed:
        drift = np.zeros((*ref.vehicle.mounts.shape, 4))
        amount = np.expm1(sign * 0.5 * size)
        for i in chosen:
            drift[i, a] = (amount, start, end, share)
        return _changed(ref, drift=drift)

    return Effect("parameter_drift", location, axis, "cosine_ramp", apply, largest=4.0)


def _soft_mount(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    location, axis, chosen, a = _choose_place(ref, rng, mount, axis or "z", 0.0)

    def apply(size: float) -> Changed:
        stiffness, damping = ref.vehicle.stiffness.copy(), ref.vehicle.damping.copy()
        stiffness[chosen[0], a] *= np.exp(-size)
        return dataclasses.replace(ref.vehicle, stiffness=stiffness, damping=damping), ref.sensors, (0.0, 0.0, 0.0)

    size = float(-np.log(1.0 - rng.uniform(0.3, 0.6)))
    return Effect("one_soft_mount", location, axis, "softer_than_its_file", apply, largest=2.5, fixed_size=size)


def _flexible(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    kind = str(rng.choice(["torsion", "bending", "roof_sway"]))
    frequency, zeta = float(rng.uniform(9.0, 22.0)), float(rng.uniform(0.01, 0.05))
    cg = ref.vehicle.cg

    def shape(point: np.ndarray) -> np.ndarray:
        x, y, z = point - cg
        if kind == "torsion":
            return np.array([0.0, -1.2 * x * (z + 0.2), 2.4 * x * y])
        if kind == "bending":
            return np.array([0.0, 0.0, 2.0 * (x * x - 0.35)])
        return np.array([0.0, 1.2 * (z * z - 0.15), 0.3 * y * z])

    def apply(size: float) -> Changed:
        unit = size / np.sqrt(ref.vehicle.mass)
        at_mounts = unit * np.array([shape(p) for p in ref.vehicle.mounts])
        at_sensors = {s.name: unit * shape(s.position) for s in ref.sensors if s.place == "cab"}
        return _changed(ref, elastic=(frequency, zeta, at_mounts, at_sensors))

    return Effect("flexible_mode", "cab", "", kind, apply)


def _suspended(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    frequency, zeta = float(rng.uniform(1.5, 12.0)), float(rng.uniform(0.08, 0.4))
    point = ref.vehicle.cg + rng.uniform(-0.5, 0.5, 3) * np.array([1.0, 0.8, 0.3])

    def apply(size: float) -> Changed:
        return _changed(ref, suspended=(0.2 * size * ref.vehicle.mass, frequency, zeta, point))

    return Effect("missing_degree_of_freedom", "cab", "z", "sprung_mass", apply, largest=1.5)


def _cross(ref: Reference, rng: np.random.Generator, mount: str | None, axis: str | None) -> Effect:
    names = ref.vehicle.mount_names
    mount = mount or str(rng.choice(names))
    i = names.index(mount)
    a, b = (0, 2) if rng.random() < 0.5 else (1, 2)

    def apply(size: float) -> Changed:
        cross = np.zeros((len(names), 3, 3))
        cross[i, a, b] = cross[i, b, a] = 0.9 * np.tanh(size) * np.sqrt(ref.vehicle.stiffness[i, a] * ref.vehicle.stiffness[i, b])
        return _changed(ref, cross=cross)

    return Effect("outside:cross_coupling", mount, "", f"{AXES[a]}{AXES[b]}", apply, largest=3.0)


def _sensor_effect(
    cause: str, ref: Reference, rng: np.random.Generator, form: str | None, sensor: str | None, axis: str | None, chassis: float
) -> Effect:
    candidates = [s for s in ref.sensors if s.kind != "displacement"]
    on_cab = [s.name for s in candidates if s.place == "cab"]
    elsewhere = [s.name for s in candidates if s.place != "cab"]
    # a position error of a bracket sensor is a rotation of the bracket away from nothing: plant it on the cab
    use_cab = not elsewhere or cause == "wrong_sensor_position" or rng.random() >= chassis
    name = sensor or str(rng.choice(on_cab if use_cab else elsewhere))
    index = [s.name for s in ref.sensors].index(name)
    old = ref.sensors[index]
    signal = true_signal(ref.run, old)
    moving = ref.moving(signal)
    if axis is None and cause in ("sensor_gain", "sensor_bias", "sensor_misalignment", "wrong_sensor_position"):
        axis = AXES[int(rng.choice(3, p=moving[:3] / moving[:3].sum()))] if cause == "sensor_gain" else str(rng.choice(AXES))
    a = AXES.index(axis) if axis else 0
    sign = float(rng.choice([-1.0, 1.0]))
    rest = np.abs(signal.mean(axis=0)).max()
    peak = float((np.abs(signal[round(2.0 / ref.run.step) :]).max(axis=0)).max() - rest)

    def change(size: float) -> CabSensor:
        if cause == "sensor_delay":
            return dataclasses.replace(old, delay_s=0.01 * size)
        if cause == "sensor_gain":
            gain = np.ones(signal.shape[1])
            gain[a] = np.exp(sign * 0.3 * size)
            # about the rest value: the offset at rest was trimmed away when the sensor was installed
            return dataclasses.replace(old, gain=gain, bias=(1.0 - gain) * signal[0])
        if cause == "sensor_bias":
            bias = np.zeros(signal.shape[1])
            bias[a] = sign * size * moving.max()
            return dataclasses.replace(old, bias=bias)
        if cause == "sensor_misalignment":
            turn = [0.0, 0.0, 0.0]
            turn[a] = sign * 15.0 * size
            # Rs true = Rs declared x small turn about a sensor axis
            return dataclasses.replace(old, true_rotation=old.rotation @ rotation_of_degrees(np.array(turn)))
        if cause == "sensor_clipping":
            return dataclasses.replace(old, clip=rest + peak * max(0.9 * np.exp(-size), 0.02))
        offset = np.zeros(3)
        offset[a] = sign * 0.3 * size
        return dataclasses.replace(old, true_position=old.position + offset)

    def apply(size: float) -> Changed:
        sensors = tuple(change(size) if i == index else s for i, s in enumerate(ref.sensors))
        return ref.vehicle, sensors, (0.0, 0.0, 0.0)

    return Effect(cause, name, axis or "", cause, apply, largest=6.0, mean_counts=cause == "sensor_bias")
