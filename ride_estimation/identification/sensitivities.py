# Copyright 2026 ride_estimation contributors
"""What sensors on a vehicle read per unknown base motion, and how that changes with stiffness, damping, mass and inertia."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.tangent import equivalent
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_LINES = 40  # frequency lines, logarithmic
_STEP = 1e-5  # relative step of the derivative of the readings with respect to log parameters
_AMPLITUDE = 1e-3  # m, where elements that depend on amplitude are linearised


@dataclasses.dataclass(frozen=True)
class Excitation:
    """Base motion assumed for planning.

    Attributes
    ----------
    roughness
        Displacement PSD at 0.1 1/m of the road ``G_d(n0)`` [m^3] (ISO 8608 class C: 256e-6).
    speed
        [m/s].
    duration_s
        Usable driving [s].
    rate_hz
        Sample rate of the sensors [Hz].
    lateral_share
        Horizontal over vertical base motion amplitude.
    twist_share
        Share of the vertical motion that is independent at each mount; 0 is a rigid frame.
    band_hz
        Lower and upper frequency used.
    """

    roughness: float = 256e-6
    speed: float = 15.0
    duration_s: float = 60.0
    rate_hz: float = 200.0
    lateral_share: float = 0.3
    twist_share: float = 0.3
    band_hz: tuple[float, float] = (0.5, 30.0)

    def displacement_psd(self, frequency_hz: Array) -> Array:
        """Return the vertical base displacement PSD ``G_d(n0) (n / n0)^-2 / v`` [m^2/Hz] (ISO 8608, document 004 (1))."""
        return np.asarray(self.roughness * (frequency_hz / self.speed / 0.1) ** -2 / self.speed)


def parameter_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Return the parameters of :func:`identifiability`: stiffness and damping per mount and axis, mass, inertia."""
    assembly = assemble(vehicle)
    found = [f"{m}.{a}.{q}" for m, a in assembly.components for q in ("stiffness", "damping")]
    found += [f"{b}.mass" for b in vehicle.bodies]
    found += [f"{b.name}.inertia" for b in vehicle.bodies.values() if any(c in b.coordinates for c in COORDINATES[3:])]
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class AddedMass:
    """A weight fastened to a body: mass [kg], place in vehicle-file axes [m], shape (3,); CG of the body where None."""

    body: str
    mass: float
    position: Array | None = None


@dataclasses.dataclass(frozen=True)
class Sensitivities:
    """Readings of a set of sensors per base motion, and their derivatives, at each frequency line.

    Attributes
    ----------
    names
        The P parameters; those of the vehicle, then one gain per load cell.
    rows
        Name of the sensor of each of the R rows.
    noise
        One-sided noise density of each row [unit^2/Hz], shape (R,).
    weight
        Information per line of unit whitened sensitivity, ``2 T df S_u``, shape (F,).
    transfer
        Shape (F, R, U).
    derivative
        With respect to the log parameters, shape (F, P, R, U).
    """

    names: tuple[str, ...]
    rows: tuple[str, ...]
    noise: Array
    weight: Array
    transfer: ComplexArray
    derivative: ComplexArray


def sensitivities(
    vehicle: Vehicle, sensors: Sequence[Sensor], excitation: Excitation, added: AddedMass | None = None
) -> Sensitivities:
    """Evaluate what every sensor would read; a plan selects rows of it.

    Parameters
    ----------
    added
        Known weight on the vehicle during this run; its own effect on the stiffness by gravity is left out.

    Raises
    ------
    InputDataError
        No sensor, or an excitation that is not positive.
    """
    if not sensors:
        raise InputDataError("a plan needs at least one sensor")
    if min(excitation.roughness, excitation.speed, excitation.duration_s, excitation.rate_hz) <= 0.0:
        raise InputDataError("roughness, speed, duration and rate of the excitation must be positive")
    lower, upper = excitation.band_hz
    upper = min(upper, 0.45 * excitation.rate_hz)
    if upper <= lower:
        raise InputDataError(f"rate {excitation.rate_hz:g} Hz is too low: nothing is left above {lower:g} Hz")
    frequency = np.geomspace(lower, upper, _LINES)
    assembly = assemble(vehicle)
    base_map = _base_map(assembly, excitation)
    model = _linear(assembly, frequency, added)
    names = parameter_names(vehicle)
    transfer = _transfer(model, sensors) @ base_map
    derivative = []
    for name in names:
        above, below = (_transfer(_changed(model, name, step), sensors) for step in (_STEP, -_STEP))
        derivative.append((above - below) @ (base_map / (2.0 * _STEP)))
    rows = tuple(s.name for s in sensors for _ in range(_width(vehicle, s)))
    cells = [s.name for s in sensors if s.kind == "force"]
    derivative += [transfer * np.array([name == cell for name in rows])[None, :, None] for cell in cells]
    return Sensitivities(
        (*names, *(f"{cell}.gain" for cell in cells)), rows,
        np.concatenate([_noise_density(vehicle, s, excitation.rate_hz) for s in sensors]),
        2.0 * excitation.duration_s * np.gradient(frequency) * excitation.displacement_psd(frequency),
        transfer, np.stack(derivative, axis=1),
    )  # fmt: skip


def _noise_density(vehicle: Vehicle, sensor: Sensor, rate_hz: float) -> Array:
    """Return the one-sided noise PSD of each channel, ``2 sigma^2 / fs`` [unit^2/Hz]."""
    width = _width(vehicle, sensor)
    std = [sensor.noise_std] * min(width, 3) + [sensor.gyro_noise_std] * (width - 3)
    return np.asarray(2.0 * np.square(std) / rate_hz)


def _width(vehicle: Vehicle, sensor: Sensor) -> int:
    if sensor.kind == "imu" and sensor.body in vehicle.bodies:
        return 6
    return 3 if sensor.kind == "imu" else int(np.count_nonzero(sensor.measured))


def _base_map(assembly: Assembly, excitation: Excitation) -> ComplexArray:
    """Return the (C, U) map from unit independent base motions to component base displacements."""
    mounts = [assembly.vehicle.mounts[m] for m, _ in assembly.components]
    points = np.array([m.position for m in mounts])
    centre = points.mean(axis=0)
    axis = [COORDINATES.index(a) for _, a in assembly.components]
    rigid = np.array(
        [point_motion_matrix(p - centre)[a] if a < 3 else np.eye(6)[a] for p, a in zip(points, axis)]
    )
    span = max(float(np.max(np.abs(points - centre))), 1.0)
    lateral = excitation.lateral_share
    scale = np.array([lateral, lateral, 1.0, 1.0 / span, 1.0 / span, lateral / span])
    columns = [rigid * scale]
    if excitation.twist_share > 0.0:
        # mounts on one base at one place move together however much the base twists
        places = [(m.base, tuple(np.round(m.position, 3).tolist()), a) for m, a in zip(mounts, axis)]
        together = np.array([[a == b for b in dict.fromkeys(places)] for a in places], dtype=float)
        own = np.array([1.0 if a == 2 else lateral for a in axis])
        columns.append(excitation.twist_share * own[:, None] * together)
    mapped = np.hstack(columns) * assembly.prescribed[:, None]
    return np.asarray(mapped, dtype=complex)


@dataclasses.dataclass(frozen=True)
class _Linear:
    """The vehicle at F lines: angular frequency (F,), stiffness and damping (F, C), mass, added mass, stiffness by gravity."""

    assembly: Assembly
    omega: Array
    stiffness: Array
    damping: Array
    mass: Array
    added: Array
    gravity: Array


def _linear(assembly: Assembly, frequency: Array, added: AddedMass | None) -> _Linear:
    pairs = np.array([[equivalent(e, float(f), _AMPLITUDE) for e in assembly.elements] for f in frequency])
    extra = np.zeros_like(assembly.mass_matrix)
    if added is not None:
        place = assembly.vehicle.bodies[added.body].cg if added.position is None else added.position
        rows = assembly.point_map(added.body, place)[:3]
        extra = added.mass * rows.T @ rows
    return _Linear(
        assembly, 2.0 * math.pi * frequency, pairs[:, :, 0], pairs[:, :, 1], assembly.mass_matrix, extra,
        assembly.geometric_stiffness,
    )  # fmt: skip


def _changed(model: _Linear, name: str, step: float) -> _Linear:
    """Return the vehicle with one parameter changed by ``exp(step)``."""
    owner, _, quantity = name.rpartition(".")
    factor = math.exp(step)
    if quantity in ("mass", "inertia"):
        mass = _scaled_mass(model.assembly, owner, quantity, factor)
        gravity = model.gravity if quantity == "inertia" else _gravity_of(model.assembly.vehicle, owner, factor)
        return dataclasses.replace(model, mass=mass, gravity=gravity)
    column = np.array([f"{m}.{a}" == owner for m, a in model.assembly.components])
    scale = np.where(column, factor, 1.0)
    if quantity == "stiffness":
        return dataclasses.replace(model, stiffness=model.stiffness * scale)
    return dataclasses.replace(model, damping=model.damping * scale)


def _gravity_of(vehicle: Vehicle, body: str, factor: float) -> Array:
    """Return the stiffness by gravity with one mass changed: every mass makes its own part of it."""
    changed = vehicle.bodies[body]
    changed = dataclasses.replace(changed, mass=dataclasses.replace(changed.mass, value=changed.mass.value * factor))
    return assemble(dataclasses.replace(vehicle, bodies={**vehicle.bodies, body: changed})).geometric_stiffness


def _transfer(model: _Linear, sensors: Sequence[Sensor]) -> ComplexArray:
    """Return sensor readings per base displacement of each component, shape (F, R, C)."""
    assembly, g = model.assembly, model.assembly.deflection_map
    dynamic = model.stiffness + 1j * model.omega[:, None] * model.damping
    inertia = model.omega[:, None, None] ** 2 * (model.mass + model.added)
    matrix = np.matmul(g.T * dynamic[:, None, :], g) + model.gravity - inertia
    motion = np.linalg.solve(matrix, g.T * (dynamic * assembly.prescribed)[:, None, :])
    base = np.diag(assembly.prescribed.astype(float))
    deflection = g @ motion - base
    return np.concatenate([_reading(assembly, s, model.omega, motion, base, deflection, dynamic) for s in sensors], axis=1)


def _scaled_mass(assembly: Assembly, body: str, quantity: str, factor: float) -> Array:
    scale = np.ones(len(assembly.coordinates))
    for i, (owner, coordinate) in enumerate(assembly.coordinates):
        if owner == body and (coordinate in AXES) == (quantity == "mass"):
            scale[i] = math.sqrt(factor)
    return np.asarray(assembly.mass_matrix * np.outer(scale, scale))


def _reading(
    assembly: Assembly, sensor: Sensor, omega: Array, motion: NDArray[Any], base: Array, deflection: NDArray[Any],
    dynamic: NDArray[Any],
) -> ComplexArray:
    """Return what one sensor reads per base displacement, shape (F, channels, C)."""
    vehicle, lines, count = assembly.vehicle, len(omega), base.shape[0]
    if sensor.kind in ("displacement", "force"):
        axes = [sensor.axis] if sensor.kind == "displacement" else list(AXES)
        rows = np.zeros((lines, len(axes), count), dtype=complex)
        for number, axis in enumerate(axes):
            if (sensor.mount, axis) in assembly.components:
                index = assembly.components.index((sensor.mount, axis))
                factor = 1.0 if sensor.kind == "displacement" else -dynamic[:, index, None]
                rows[:, number] = factor * deflection[:, index]
        return rows
    squared = -(omega[:, None, None] ** 2)
    if sensor.body in vehicle.bodies:
        point = assembly.point_map(sensor.body, sensor.position) @ motion
        tilt = vehicle.gravity * np.stack([-point[:, 4], point[:, 3], np.zeros((lines, count))], axis=1)
        felt = sensor.rotation.T @ (squared * point[:, :3] + tilt)
        if sensor.kind == "imu":
            felt = np.concatenate([felt, sensor.rotation.T @ (1j * omega[:, None, None] * point[:, 3:])], axis=1)
        return np.asarray(felt[:, sensor.measured])
    at_base = np.zeros((3, count))
    for number, (mount, axis) in enumerate(assembly.components):
        if mount == sensor.mount and axis in AXES:
            at_base[AXES.index(axis)] = base[number]
    return np.asarray((squared * (sensor.rotation.T @ at_base)[sensor.measured[:3]]).astype(complex))
