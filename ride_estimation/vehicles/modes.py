# Copyright 2026 ride_estimation contributors
"""Linear view of an assembly: matrices, state space, modes with energy shares and names, frequency responses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError
from ride_estimation.vehicles.assembly import Assembly
from ride_estimation.vehicles.tangent import equivalent

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: what engineers call a mode that is mostly this coordinate
MODE_NAMES = {"x": "fore-aft", "y": "lateral", "z": "bounce", "roll": "roll", "pitch": "pitch", "yaw": "yaw"}
#: share of the energy of a mode in one coordinate from which on it is called after that one alone
PURE_SHARE = 0.7
#: slower than this a motion counts as not held [Hz]; a swing of this period takes a quarter of an hour
NEUTRAL_HZ = 1e-3


@dataclasses.dataclass(frozen=True)
class LinearModel:
    """``M qdd + C qd + K q = B_k u + B_c ud + T theta_b``.

    Attributes
    ----------
    mass, damping, stiffness
        Shape (Q, Q); stiffness includes gravity.
    base_stiffness, base_damping
        Force per base displacement and velocity of each component, shape (Q, C), zero where the base is a body.
    tilt
        Force per base rotation, shape (Q, 3 M).
    """

    assembly: Assembly
    mass: Array
    damping: Array
    stiffness: Array
    base_stiffness: Array
    base_damping: Array
    tilt: Array

    def state_space(self) -> tuple[Array, Array]:
        """Return (A, B): state [q, qd], input [u, ud] of all components, shapes (2Q, 2Q) and (2Q, 2C)."""
        size = len(self.mass)
        inverse = np.linalg.inv(self.mass)
        a = np.block(
            [[np.zeros((size, size)), np.eye(size)], [-inverse @ self.stiffness, -inverse @ self.damping]]
        )
        b = np.vstack(
            [np.zeros((size, 2 * self.base_stiffness.shape[1])), inverse @ np.hstack([self.base_stiffness, self.base_damping])]
        )
        return a, b


@dataclasses.dataclass(frozen=True)
class Mode:
    """One mode.

    Attributes
    ----------
    frequency_hz
        Undamped natural frequency ``|lambda| / 2 pi`` [Hz].
    damping_ratio
        ``-Re lambda / |lambda|``; 1 for each real pole, negative for an unstable mode.
    label
        Name by the largest energy share, with the body where the vehicle has several.
    energy_share
        (body, coordinate) -> share of the kinetic energy, sum 1.
    shape
        Amplitude per coordinate, largest entry real and positive, shape (Q,).
    """

    frequency_hz: float
    damping_ratio: float
    label: str
    energy_share: dict[tuple[str, str], float]
    shape: ComplexArray

    @property
    def words(self) -> str:
        """Return the label, with the coordinate that has the second largest share where that one is large."""
        (_, first), *rest = sorted(self.energy_share.items(), key=lambda item: -item[1])
        return self.label if first >= PURE_SHARE or not rest else f"{self.label} with {MODE_NAMES[rest[0][0][1]]}"


def linearise(assembly: Assembly, frequency_hz: float = 2.0, amplitude: float = 1.0e-3) -> LinearModel:
    """Return the linear equivalent of an assembly for harmonic deflections.

    Parameters
    ----------
    frequency_hz, amplitude
        Where elements that depend on them are linearised [Hz], [m].

    Raises
    ------
    ConfigurationError
        Frequency or amplitude not greater than zero.
    """
    if not frequency_hz > 0.0 or not amplitude > 0.0:
        raise ConfigurationError(f"frequency_hz {frequency_hz:g} and amplitude {amplitude:g} m must be greater than zero")
    pairs = [equivalent(e, frequency_hz, amplitude) for e in assembly.elements]
    k = np.array([p[0] for p in pairs])
    c = np.array([p[1] for p in pairs])
    g = assembly.deflection_map
    return LinearModel(
        assembly=assembly,
        mass=assembly.mass_matrix,
        damping=g.T @ (c[:, None] * g),
        stiffness=g.T @ (k[:, None] * g) + assembly.geometric_stiffness,
        base_stiffness=g.T * (k * assembly.prescribed),
        base_damping=g.T * (c * assembly.prescribed),
        tilt=assembly.tilt_map.reshape(len(assembly.coordinates), -1),
    )


def modes(model: LinearModel) -> tuple[Mode, ...]:
    """Return the damped modes in order of frequency; each real pole is a mode of its own."""
    a, _ = model.state_space()
    values, vectors = np.linalg.eig(a)
    size = len(model.mass)
    found = []
    for value, vector in zip(values, vectors.T):
        if value.imag < -1e-9 * abs(value):
            continue
        magnitude = abs(value)
        ratio = -value.real / magnitude if magnitude > 0.0 else 0.0
        found.append(_mode(model, vector[:size], magnitude / (2.0 * math.pi), float(ratio)))
    return tuple(sorted(found, key=lambda mode: mode.frequency_hz))


def undamped_modes(model: LinearModel) -> tuple[Mode, ...]:
    """Return the modes of ``K q = omega^2 M q`` in order of frequency.

    A negative eigenvalue (static instability) appears with a negative frequency ``-sqrt(-lambda) / 2 pi``.
    """
    symmetric = 0.5 * (model.stiffness + model.stiffness.T)
    values, vectors = scipy.linalg.eigh(symmetric, model.mass)
    return tuple(
        _mode(model, v.astype(complex), float(np.sign(w) * math.sqrt(abs(w)) / (2.0 * math.pi)), 0.0)
        for w, v in zip(values, vectors.T)
    )


def toppling_motions(assembly: Assembly) -> tuple[str, ...]:
    """Return in words every motion at rest that runs away, because gravity is stronger than the mounts.

    A body whose CG lies above its mounts topples where ``m g h`` exceeds their stiffness against tilting; a body that rests on
    one point topples always.
    """
    found = []
    for mode in undamped_modes(linearise(assembly)):
        if mode.frequency_hz < -NEUTRAL_HZ:
            doubling = math.log(2.0) / (2.0 * math.pi * abs(mode.frequency_hz))
            found.append(f"{mode.label} topples: gravity is stronger than the mounts and doubles a tilt every {doubling:.2g} s")
    return tuple(found)


def unheld_motions(assembly: Assembly) -> tuple[str, ...]:
    """Return in words every motion at rest that nothing brings back: those that topple, and those without any stiffness."""
    neutral = [m for m in undamped_modes(linearise(assembly)) if abs(m.frequency_hz) <= NEUTRAL_HZ]
    return (*toppling_motions(assembly), *(f"{m.label} is free: no mount holds it" for m in neutral))


def _mode(model: LinearModel, shape: ComplexArray, frequency_hz: float, damping_ratio: float) -> Mode:
    energy = np.real(np.conj(shape) * (model.mass @ shape))
    share = energy / energy.sum()
    coordinates = model.assembly.coordinates
    body, coordinate = coordinates[int(np.argmax(share))]
    name = MODE_NAMES[coordinate]
    label = name if len({b for b, _ in coordinates}) == 1 else f"{body} {name}"
    largest = shape[int(np.argmax(np.abs(shape)))]
    return Mode(frequency_hz, damping_ratio, label, dict(zip(coordinates, share.tolist())), shape / largest)


def frequency_response(
    assembly: Assembly, frequency_hz: Array, amplitude: float = 1.0e-3, elements: tuple[ForceElement, ...] | None = None
) -> ComplexArray:
    """Return the receptance from base displacement of each component to q, shape (F, Q, C) [m/m].

    ``H(w) = (-w^2 M + G^T K*(w, A) G + K_g)^-1 G^T K*(w, A)``, with the complex stiffness of every element taken at
    each frequency, so that Maxwell branches and filters are exact and friction is its first harmonic.

    Parameters
    ----------
    frequency_hz
        Shape (F,), greater than zero.
    amplitude
        Deflection amplitude of the harmonic linearisation [m].
    """
    g = assembly.deflection_map
    used = assembly.elements if elements is None else elements
    result = np.zeros((len(frequency_hz), g.shape[1], g.shape[0]), dtype=complex)
    for number, f in enumerate(frequency_hz):
        omega = 2.0 * math.pi * float(f)
        pairs = [equivalent(e, float(f), amplitude) for e in used]
        stiffness = np.array([k + 1j * omega * c for k, c in pairs])
        dynamic = g.T @ (stiffness[:, None] * g) + assembly.geometric_stiffness - omega**2 * assembly.mass_matrix
        result[number] = np.linalg.solve(dynamic, g.T * (stiffness * assembly.prescribed))
    return result
