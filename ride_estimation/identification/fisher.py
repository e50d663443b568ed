# Copyright 2026 ride_estimation contributors
"""What a sensor set can tell of a vehicle's parameters: Fisher information, null directions in words, Cramer-Rao bounds.

At each frequency line the sensors read ``y = T(theta) u + n``: u the unknown base motion (12 components for four mounts
whose frame may twist, 6 for a rigid frame), n white sensor noise. u is a nuisance at every line, so what it can explain
is projected out and nothing is known of the road:

``J_ij = sum over lines 2 Re tr(S_u T_i^H R^-1/2 (I - P) R^-1/2 T_j)``,  P the projector on the range of ``R^-1/2 T``.
"""

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

#: an eigenvalue of the correlation-like scaled information below this share of the largest is a null direction
NULL_SHARE = 1e-9
_STEP = 1e-5  # relative step of the derivative of T with respect to log parameters
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


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """What can be known.

    Attributes
    ----------
    names
        Parameters, P of them: ``<mount>.<axis>.stiffness`` / ``.damping``, ``<body>.mass``, ``<body>.inertia``.
    relative_std
        Cramer-Rao bound on each as a share of its value, ``inf`` where it takes part in a null direction, shape (P,).
    rank
        Rank of the information.
    null_directions
        Each in words.
    information
        Fisher information of the log parameters, shape (P, P).
    """

    names: tuple[str, ...]
    relative_std: Array
    rank: int
    null_directions: tuple[str, ...]
    information: Array


def parameter_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Return the parameters of :func:`identifiability`: stiffness and damping per mount and axis, mass, inertia."""
    assembly = assemble(vehicle)
    found = [f"{m}.{a}.{q}" for m, a in assembly.components for q in ("stiffness", "damping")]
    found += [f"{b}.mass" for b in vehicle.bodies]
    found += [f"{b.name}.inertia" for b in vehicle.bodies.values() if any(c in b.coordinates for c in COORDINATES[3:])]
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class Sensitivities:
    """Readings of a set of sensors per base motion, and their derivatives, at each frequency line.

    Attributes
    ----------
    names
        The P parameters.
    sensors
        The sensors, in row order.
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
    sensors: tuple[Sensor, ...]
    noise: Array
    weight: Array
    transfer: ComplexArray
    derivative: ComplexArray


def sensitivities(vehicle: Vehicle, sensors: Sequence[Sensor], excitation: Excitation) -> Sensitivities:
    """Evaluate what every sensor would read; a plan selects rows of it.

    Raises
    ------
    InputDataError
        No sensor, or an excitation that is not positive.
    """
    if not sensors:
        raise InputDataError("a plan needs at least one sensor")
    if min(excitation.roughness, excitation.speed, excitation.duration_s, excitation.rate_hz) <= 0.0:
        raise InputDataError("roughness, speed, duration and rate of the excitation must be positive")
    names = parameter_names(vehicle)
    lower, upper = excitation.band_hz
    frequency = np.geomspace(lower, min(upper, 0.45 * excitation.rate_hz), 60)
    assembly = assemble(vehicle)
    base_map = _base_map(assembly, excitation)
    transfer, derivative = [], []
    for f in frequency.tolist():
        transfer.append(_transfer(assembly, sensors, f, None, 0.0) @ base_map)
        derivative.append(
            [
                (_transfer(assembly, sensors, f, n, _STEP) - _transfer(assembly, sensors, f, n, -_STEP))
                @ (base_map / (2.0 * _STEP))
                for n in names
            ]
        )
    weight = 2.0 * excitation.duration_s * np.gradient(frequency) * excitation.displacement_psd(frequency)
    noise = _noise_density(sensors, excitation.rate_hz)
    return Sensitivities(names, tuple(sensors), noise, weight, np.array(transfer), np.array(derivative))


def identifiability(
    vehicle: Vehicle, sensors: Sequence[Sensor], excitation: Excitation, known: Sequence[str] = ()
) -> Identifiability:
    """Return what the sensors can tell of the parameters under an excitation.

    Parameters
    ----------
    sensors
        Sensors that will be mounted (accelerometers, displacement transducers, load cells).
    known
        Names of parameters that are known beforehand (``cab.mass`` where the cab was weighed).

    Raises
    ------
    InputDataError
        No sensor, unknown parameter name, or an excitation that is not positive.
    """
    return judge(sensitivities(vehicle, sensors, excitation), [s.name for s in sensors], known)


def judge(readings: Sensitivities, sensors: Sequence[str], known: Sequence[str]) -> Identifiability:
    """Return what a selection of the sensors of ``readings`` can tell, some parameters being known."""
    unknown = [k for k in known if k not in readings.names]
    if unknown:
        raise InputDataError(f"unknown parameter {', '.join(unknown)}; parameters: {', '.join(readings.names)}")
    owner = [s.name for s in readings.sensors for _ in range(_width(s))]
    rows = np.array([i for i, name in enumerate(owner) if name in set(sensors)], dtype=int)
    free = np.array([i for i, n in enumerate(readings.names) if n not in known], dtype=int)
    white = 1.0 / np.sqrt(readings.noise[rows])[:, None]
    seen, total = np.zeros(free.size), np.zeros((free.size, free.size))
    for weight, transfer, derivative in zip(readings.weight, readings.transfer, readings.derivative):
        basis, values, _ = np.linalg.svd(white * transfer[rows], full_matrices=False)
        basis = basis[:, values > 1e-12 * values[0]]
        change = white * derivative[np.ix_(free, rows)]
        seen += weight * np.sum(np.abs(change) ** 2, axis=(1, 2))
        flat = (change - basis @ (basis.conj().T @ change)).reshape(free.size, -1)
        total += weight * np.real(flat.conj() @ flat.T)
    return _judge(tuple(readings.names[i] for i in free), total, seen)


def _noise_density(sensors: Sequence[Sensor], rate_hz: float) -> Array:
    """Return the one-sided noise PSD of each channel, ``2 sigma^2 / fs`` [unit^2/Hz]."""
    return np.array([2.0 * s.noise_std**2 / rate_hz for s in sensors for _ in range(_width(s))])


def _width(sensor: Sensor) -> int:
    return 3 if sensor.kind in ("accelerometer", "imu", "force") else 1


def _base_map(assembly: Assembly, excitation: Excitation) -> ComplexArray:
    """Return the (C, U) map from unit independent base motions to component base displacements."""
    points = np.array([assembly.vehicle.mounts[m].position for m, _ in assembly.components])
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
        own = np.array([1.0 if a == 2 else excitation.lateral_share for a in axis])
        columns.append(excitation.twist_share * np.diag(own))
    mapped = np.hstack(columns) * assembly.prescribed[:, None]
    return np.asarray(mapped, dtype=complex)


def _transfer(assembly: Assembly, sensors: Sequence[Sensor], f: float, name: str | None, step: float) -> ComplexArray:
    """Return sensor readings per base displacement of each component, one parameter changed by ``exp(step)``."""
    omega = 2.0 * math.pi * f
    factor = math.exp(step)
    pairs = [equivalent(e, f, _AMPLITUDE) for e in assembly.elements]
    k, c = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    mass = assembly.mass_matrix
    if name is not None:
        owner, _, quantity = name.rpartition(".")
        if quantity in ("mass", "inertia"):
            mass = _scaled_mass(assembly, owner, quantity, factor)
        else:
            index = [f"{m}.{a}" for m, a in assembly.components].index(owner)
            (k if quantity == "stiffness" else c)[index] *= factor
    g = assembly.deflection_map
    dynamic = k + 1j * omega * c
    matrix = g.T @ (dynamic[:, None] * g) + assembly.geometric_stiffness - omega**2 * mass
    # gravity stiffness scales with the mass that makes it
    if name is not None and name.endswith(".mass"):
        matrix = matrix + (factor - 1.0) * assembly.geometric_stiffness
    motion = np.linalg.solve(matrix, g.T * (dynamic * assembly.prescribed))
    base = np.diag(assembly.prescribed.astype(float))
    deflection = g @ motion - base
    return np.vstack([_reading(assembly, s, omega, motion, base, deflection, dynamic) for s in sensors])


def _scaled_mass(assembly: Assembly, body: str, quantity: str, factor: float) -> Array:
    scale = np.ones(len(assembly.coordinates))
    for i, (owner, coordinate) in enumerate(assembly.coordinates):
        if owner == body and (coordinate in AXES) == (quantity == "mass"):
            scale[i] = math.sqrt(factor)
    return np.asarray(assembly.mass_matrix * np.outer(scale, scale))


def _reading(
    assembly: Assembly, sensor: Sensor, omega: float, motion: NDArray[Any], base: Array, deflection: NDArray[Any],
    dynamic: NDArray[Any],
) -> ComplexArray:
    """Return what one sensor reads per base displacement, shape (channels, C)."""
    vehicle = assembly.vehicle
    if sensor.kind in ("displacement", "force"):
        axes = [sensor.axis] if sensor.kind == "displacement" else list(AXES)
        rows = []
        for axis in axes:
            row = np.zeros(base.shape[0], dtype=complex)
            if (sensor.mount, axis) in assembly.components:
                index = assembly.components.index((sensor.mount, axis))
                row = deflection[index] if sensor.kind == "displacement" else -dynamic[index] * deflection[index]
            rows.append(row)
        return np.array(rows)
    if sensor.body in vehicle.bodies:
        point = assembly.point_map(sensor.body, sensor.position) @ motion
        tilt = vehicle.gravity * np.array([-point[4], point[3], np.zeros(base.shape[0])])
        return np.asarray(sensor.rotation.T @ (-(omega**2) * point[:3] + tilt))
    at_base = np.zeros((3, base.shape[0]), dtype=complex)
    for number, (mount, axis) in enumerate(assembly.components):
        if mount == sensor.mount and axis in AXES:
            at_base[AXES.index(axis)] = -(omega**2) * base[number]
    return np.asarray(sensor.rotation.T @ at_base)


def _judge(names: tuple[str, ...], information: Array, seen: Array) -> Identifiability:
    """Judge an information matrix; ``seen`` is its diagonal if the base motion were known, the scale of rounding."""
    diagonal = np.maximum(np.diag(information), 0.0)
    blind = diagonal <= NULL_SHARE * np.maximum(seen, 1e-300)
    scale = np.where(blind, 1.0, np.sqrt(np.where(blind, 1.0, diagonal)))
    scaled = np.where(blind[:, None] | blind[None, :], 0.0, information) / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    null = values < NULL_SHARE
    kept = ~null
    covariance = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T / np.outer(scale, scale)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    taking_part = np.max(np.abs(vectors[:, null]), axis=1) > 1e-3 if null.any() else np.zeros(len(names), dtype=bool)
    words = []
    if blind.any():
        words.append(f"the sensors tell nothing of {', '.join(n for n, b in zip(names, blind) if b)}")
    seen_names = [n for n, b in zip(names, blind) if not b]
    values, vectors = np.linalg.eigh(scaled[np.ix_(~blind, ~blind)])
    directions = vectors[:, values < NULL_SHARE] / scale[~blind][:, None]
    words += null_directions_in_words(seen_names, directions)
    return Identifiability(names, np.where(taking_part, math.inf, std), int(kept.sum()), tuple(words), information)


def null_directions_in_words(names: Sequence[str], directions: Array) -> list[str]:
    """Say which changes of the log parameters leave every signal as it is.

    The common scale of all masses, stiffnesses and dampings is looked for first; what remains is reduced to directions
    with few members.

    Parameters
    ----------
    directions
        Basis of the null space in log parameters, shape (P, K).
    """
    if directions.shape[1] == 0:
        return []
    basis, _ = np.linalg.qr(directions)
    found = []
    common = np.full(len(names), 1.0 / math.sqrt(len(names)))
    if np.linalg.norm(common - basis @ (basis.T @ common)) < 1e-3:
        groups = sorted({n.rpartition(".")[2] for n in names})
        found.append(f"{len(names)} parameters scale together without changing any signal: every {', every '.join(groups)}")
        remaining = basis - np.outer(common, common @ basis)
        left, size, _ = np.linalg.svd(remaining, full_matrices=False)
        basis = left[:, size > 1e-3]
    for direction in _few_members(basis.T):
        parts = sorted(((n, d) for n, d in zip(names, direction) if abs(d) > 0.05), key=lambda part: -abs(part[1]))
        listed = ", ".join(f"{n} {'up' if d > 0 else 'down'} {abs(d):.2g}" for n, d in parts[:6])
        more = f" and {len(parts) - 6} more" if len(parts) > 6 else ""
        found.append(f"only a combination is seen, these change together unnoticed: {listed}{more}")
    return found


def _few_members(rows: Array) -> Array:
    """Return the reduced row echelon form by full pivoting, each row scaled to a largest entry of 1."""
    reduced = rows.copy()
    for i in range(reduced.shape[0]):
        j = int(np.argmax(np.abs(reduced[i])))
        reduced[i] /= reduced[i, j]
        for other in range(reduced.shape[0]):
            if other != i:
                reduced[other] -= reduced[other, j] * reduced[i]
    return np.asarray(reduced / np.max(np.abs(reduced), axis=1, initial=1e-300)[:, None])
