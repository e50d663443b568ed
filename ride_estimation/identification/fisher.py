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
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.null_directions import names_in_words, null_directions_in_words
from ride_estimation.identification.sensitivities import Excitation, Sensitivities, sensitivities
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: an eigenvalue of the correlation-like scaled information below this share of the largest is a null direction
NULL_SHARE = 1e-9


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


def identifiability(
    vehicle: Vehicle, sensors: Sequence[Sensor], excitation: Excitation, known: Sequence[str] | Mapping[str, float] = ()
) -> Identifiability:
    """Return what the sensors can tell of the parameters under an excitation.

    Parameters
    ----------
    sensors
        Sensors that will be mounted (accelerometers, IMUs, displacement transducers, load cells).
    known
        Parameters known beforehand (``cab.mass`` where the cab was weighed): names where they are exact, or name ->
        relative standard deviation. A load cell's gain is exact unless stated.

    Raises
    ------
    InputDataError
        No sensor, unknown parameter name, or an excitation that is not positive.
    """
    return judge([sensitivities(vehicle, sensors, excitation)], [s.name for s in sensors], known)


def judge(
    runs: Sequence[Sensitivities], sensors: Sequence[str], known: Sequence[str] | Mapping[str, float]
) -> Identifiability:
    """Return what a selection of the sensors can tell in all runs together, some parameters being known.

    Parameters known with a standard deviation stay in the problem as nuisances with that prior, so that no bound is better
    than what it leans on.
    """
    names = runs[0].names
    given = {n: 0.0 for n in known} if not isinstance(known, Mapping) else dict(known)
    unknown = [n for n in given if n not in names]
    if unknown:
        raise InputDataError(f"unknown parameter {', '.join(unknown)}; parameters: {', '.join(names)}")
    gains = {n for n in names if n.endswith(".gain")}
    free = [i for i, n in enumerate(names) if n not in given and n not in gains]
    prior = [i for i, n in enumerate(names) if given.get(n, 0.0) > 0.0]
    order = np.array([*free, *prior], dtype=int)
    seen, total = np.zeros(order.size), np.zeros((order.size, order.size))
    for readings in runs:
        part, diagonal = _information(readings, set(sensors), order)
        total, seen = total + part, seen + diagonal
    size = len(free)
    found = _judge(tuple(names[i] for i in free), total[:size, :size], seen[:size])
    if not prior:
        return found.result
    return _widened(found, total, np.array([given[names[i]] for i in prior]))


def _information(readings: Sensitivities, sensors: set[str], order: NDArray[np.int_]) -> tuple[Array, Array]:
    """Return the information of some parameters and its diagonal if the base motion were known."""
    rows = np.array([i for i, name in enumerate(readings.rows) if name in sensors], dtype=int)
    if rows.size == 0:
        return np.zeros((order.size, order.size)), np.zeros(order.size)
    white = 1.0 / np.sqrt(readings.noise[rows])[:, None]
    basis, values, _ = np.linalg.svd(white * readings.transfer[:, rows], full_matrices=False)
    basis = basis * (values > 1e-12 * np.maximum(values[:, :1], 1e-300))[:, None, :]
    root = np.sqrt(readings.weight)[:, None, None, None]
    change = root * white * readings.derivative[:, order[:, None], rows]
    along = basis.conj().swapaxes(1, 2)[:, None] @ change
    flat = (change - basis[:, None] @ along).swapaxes(0, 1).reshape(order.size, -1)
    return np.asarray(np.real(flat.conj() @ flat.T)), np.asarray(np.sum(np.abs(change) ** 2, axis=(0, 2, 3)))


def _widened(found: _Judged, information: Array, std: Array) -> Identifiability:
    """Return the judgement with what the uncertainty of the known parameters adds: block inversion of the information."""
    size = len(found.result.names)
    cross, own = information[:size, size:], information[size:, size:]
    lean = found.covariance @ cross
    information = own - cross.T @ lean
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    # rounding must not turn no information into less than nothing
    rest = (vectors * np.maximum(values, 0.0)) @ vectors.T + np.diag(1.0 / std**2)
    covariance = found.covariance + lean @ np.linalg.solve(rest, lean.T)
    bound = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    finite = np.isfinite(found.result.relative_std)
    return dataclasses.replace(found.result, relative_std=np.where(finite, bound, math.inf))


@dataclasses.dataclass(frozen=True)
class _Judged:
    """A judgement and the covariance of the log parameters within the directions that are seen."""

    result: Identifiability
    covariance: Array


def _judge(names: tuple[str, ...], information: Array, seen: Array) -> _Judged:
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
        lost = names_in_words([n for n, b in zip(names, blind) if b])
        words.append("no parameter is observable" if blind.all() else f"not observable with these sensors: {lost}")
    seen_names = [n for n, b in zip(names, blind) if not b]
    values, vectors = np.linalg.eigh(scaled[np.ix_(~blind, ~blind)])
    directions = vectors[:, values < NULL_SHARE] / scale[~blind][:, None]
    words += null_directions_in_words(seen_names, directions)
    bound = np.where(taking_part, math.inf, std)
    return _Judged(Identifiability(names, bound, int(kept.sum()), tuple(words), information), covariance)
