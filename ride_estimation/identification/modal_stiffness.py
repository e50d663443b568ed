# Copyright 2026 ride_estimation contributors
"""Mount stiffness from rigid-body modes (document 000 eq. (6)-(11), corrected) and how far measured modes can be reached."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import MODE_NAMES, linearise, undamped_modes
from ride_estimation.vehicles.tangent import equivalent
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: a mode that misses its measured frequency by more than this after the fit is "not reachable"
REACHED = 0.01
#: change of log frequency per log stiffness below which an axis is not observable: 10 % of stiffness would be 1 % of frequency
LEAST_SLOPE = 0.1
#: frequency [Hz] and amplitude [m] at which elements that depend on them count, those of the eigenvalue problem
_AT_HZ, _AT_AMPLITUDE = 2.0, 1.0e-3


def equivalent_stiffness(frequency_hz: float, mass: float, mounts: int) -> float:
    """Return the stiffness per mount ``k = m (2 pi f)^2 / n`` [N/m] of a translational mode (eq. (6)-(8) inverted)."""
    if frequency_hz <= 0.0 or mass <= 0.0 or mounts < 1:
        raise InputDataError(
            f"frequency {frequency_hz:g} Hz, mass {mass:g} kg, {mounts} mounts; allowed: all of them greater than zero"
        )
    return mass * (2.0 * math.pi * frequency_hz) ** 2 / mounts


@dataclasses.dataclass(frozen=True)
class UncoupledModes:
    """Closed-form modes and why they may not hold.

    Attributes
    ----------
    frequency_hz
        By mode name: fore-aft, lateral, bounce, roll, pitch, yaw.
    limitations
        Conditions of the closed form the layout breaks; empty where it is exact up to gravity.
    """

    frequency_hz: dict[str, float]
    limitations: tuple[str, ...]


def uncoupled_modes(mass: float, inertia: ArrayLike, arms: ArrayLike, stiffness: ArrayLike) -> UncoupledModes:
    """Return the six uncoupled rigid-body frequencies (document 000 eq. (6)-(11), yaw (11) corrected).

    ``f_x = sqrt(sum k_x / m) / 2 pi`` ..., ``f_yaw = sqrt(sum (k_x a_y^2 + k_y a_x^2) / J_z) / 2 pi``. They hold only when the
    mounts lie level with the CG and symmetric about it; otherwise the eigenvalue problem is the answer.

    Parameters
    ----------
    mass
        [kg].
    inertia
        Jxx, Jyy, Jzz about the CG [kg m^2], shape (3,).
    arms
        Mounts minus CG [m], shape (M, 3).
    stiffness
        k_x, k_y, k_z per mount [N/m], shape (M, 3).
    """
    j, a, k = np.asarray(inertia, float), np.asarray(arms, float), np.asarray(stiffness, float)
    if mass <= 0.0 or np.any(j <= 0.0) or a.shape != k.shape or a.ndim != 2 or a.shape[1] != 3:
        raise InputDataError("mass and inertia must be positive, arms and stiffness both of shape (mounts, 3)")
    rotational = np.array(
        [
            np.sum(k[:, 1] * a[:, 2] ** 2 + k[:, 2] * a[:, 1] ** 2) / j[0],
            np.sum(k[:, 0] * a[:, 2] ** 2 + k[:, 2] * a[:, 0] ** 2) / j[1],
            np.sum(k[:, 0] * a[:, 1] ** 2 + k[:, 1] * a[:, 0] ** 2) / j[2],
        ]
    )
    squared = np.concatenate([k.sum(axis=0) / mass, rotational])
    names = ("fore-aft", "lateral", "bounce", "roll", "pitch", "yaw")
    limitations = []
    span = float(np.max(np.abs(a[:, :2])))
    height = float(np.max(np.abs(a[:, 2])))
    if height > 0.01 * span:
        limitations.append(f"mounts lie up to {height:.3g} m off the CG plane: roll and pitch couple with lateral and fore-aft")
    for axis, plane in ((2, 0), (2, 1), (0, 1), (1, 0)):
        centre = float(np.sum(k[:, axis] * a[:, plane]) / np.sum(k[:, axis]))
        if abs(centre) > 0.01 * span:
            limitations.append(f"the centre of k_{AXES[axis]} lies {centre:.3g} m off the CG along {AXES[plane]}: modes couple")
    return UncoupledModes(dict(zip(names, (np.sqrt(squared) / (2.0 * math.pi)).tolist())), tuple(limitations))


@dataclasses.dataclass(frozen=True)
class ModeRow:
    """One line of a mode table: name, measured and model frequency [Hz], error of the model in percent."""

    name: str
    measured_hz: float
    model_hz: float
    error_percent: float


def compare_modes(measured_hz: Mapping[str, float], model_hz: Mapping[str, float]) -> tuple[ModeRow, ...]:
    """Return the error of each model mode against its measurement, like Table 3 of document 000."""
    missing = set(measured_hz) - set(model_hz)
    if missing:
        raise InputDataError(f"the model has no mode named {', '.join(sorted(missing))}; it has {', '.join(sorted(model_hz))}")
    return tuple(
        ModeRow(name, value, model_hz[name], 100.0 * (model_hz[name] / value - 1.0)) for name, value in measured_hz.items()
    )


def labelled_frequencies(vehicle: Vehicle) -> dict[str, float]:
    """Return the undamped frequencies of a one-body vehicle by mode name [Hz], each name given to one mode.

    Names go to modes by the assignment with the largest total share of kinetic energy, so that two coupled modes never
    carry the same name.
    """
    found = undamped_modes(linearise(assemble(vehicle)))
    keys = [key for key in found[0].energy_share]
    share = np.array([[mode.energy_share[key] for key in keys] for mode in found])
    rows, columns = scipy.optimize.linear_sum_assignment(-share)
    return {MODE_NAMES[keys[c][1]]: found[r].frequency_hz for r, c in zip(rows, columns)}


@dataclasses.dataclass(frozen=True)
class StiffnessFit:
    """Result of fitting mount stiffness to measured modes.

    Attributes
    ----------
    factors
        Group (an axis; with ``front_rear`` ``<axis> front`` and ``<axis> rear``) -> factor on the stiffness of its mounts;
        1 where the measured modes do not tell it.
    not_identifiable
        Groups whose factor the measured modes do not tell.
    modes
        Comparison after the fit.
    reachable
        True where every measured mode is met within 1 %.
    statement
        The result in words.
    """

    factors: dict[str, float]
    not_identifiable: tuple[str, ...]
    modes: tuple[ModeRow, ...]
    reachable: bool
    statement: str


def _groups(vehicle: Vehicle, front_rear: bool) -> dict[str, list[tuple[str, str]]]:
    """Return which elements (mount, axis) share a factor: those along or about one axis, front and rear apart where asked."""
    middle = float(np.mean([m.position[0] for m in vehicle.mounts.values()]))
    groups: dict[str, list[tuple[str, str]]] = {}
    for axis in COORDINATES:
        for mount in vehicle.mounts.values():
            if axis in mount.elements:
                end = (" front" if mount.position[0] > middle else " rear") if front_rear and axis in AXES else ""
                groups.setdefault(axis + end, []).append((mount.name, axis))
    return groups


def fit_stiffness(vehicle: Vehicle, measured_hz: Mapping[str, float], *, front_rear: bool = False) -> StiffnessFit:
    """Scale the stiffness of all mounts per axis so that the modes of a one-body vehicle meet measured ones.

    Least squares on log frequency with labels by energy share; document 000 tunes by hand. Stiffness about an axis has its own
    factor; ``front_rear`` gives the front and the rear mounts factors of their own, as Table 4 of the document has. A group
    that no measured mode depends on, that fewer modes than groups leave open, or that runs off without bringing them nearer,
    keeps the stiffness of the vehicle file.

    Parameters
    ----------
    measured_hz
        Frequencies by mode name [Hz]; at least one.

    Raises
    ------
    InputDataError
        Unknown mode name or frequency that is not positive.
    """
    if not measured_hz:
        raise InputDataError("no measured mode given; at least one is needed")
    wrong = [f"{name} {value:g} Hz" for name, value in measured_hz.items() if not value > 0.0]
    if wrong:
        raise InputDataError(f"measured modes: {', '.join(wrong)}; allowed: frequencies greater than zero")
    compare_modes(measured_hz, labelled_frequencies(vehicle))
    groups = _groups(vehicle, front_rear)
    axes = list(groups)

    def misfit(log_factors: Array) -> Array:
        found = labelled_frequencies(_scaled(vehicle, groups, dict(zip(axes, np.exp(log_factors)))))
        return np.array([math.log(max(found[name], 1e-3) / value) for name, value in measured_hz.items()])

    def slopes(log_factors: Array) -> Array:
        steps = 1e-3 * np.eye(len(axes))
        return np.stack([(misfit(log_factors + s) - misfit(log_factors - s)) / 2e-3 for s in steps], axis=1)

    free = _observable(slopes(np.zeros(len(axes))))
    if not np.any(free):
        raise InputDataError(f"the modes {', '.join(measured_hz)} depend on the stiffness of no axis")

    found = _searched(misfit, free)
    lost = free & (np.linalg.norm(slopes(found), axis=0) < LEAST_SLOPE)
    if np.any(lost) and not np.all(lost[free]):
        # stiffness that has run to where no mode depends on it brings them no nearer: it is not observable either
        free &= ~lost
        found = _searched(misfit, free)
    factors = dict(zip(axes, np.exp(found).tolist()))
    rows = compare_modes(measured_hz, labelled_frequencies(_scaled(vehicle, groups, factors)))
    missed = [row for row in rows if abs(row.error_percent) > 100.0 * REACHED]
    if missed:
        worst = max(missed, key=lambda row: abs(row.error_percent))
        statement = (
            "not reachable: with this geometry, mass and inertia no common stiffness per axis meets all measured modes; "
            f"{len(missed)} of {len(rows)} stay off, worst {worst.name} at {worst.model_hz:.3g} Hz instead of "
            f"{worst.measured_hz:.3g} Hz ({worst.error_percent:+.1f} %). Check mount positions, CG height and inertia"
        )
    else:
        statement = f"all measured modes ({len(rows)}) are met within {100 * REACHED:.0f} %"
    not_identifiable = tuple(axis for axis, seen in zip(axes, free) if not seen)
    return StiffnessFit(factors, not_identifiable, rows, not missed, statement)


def _searched(misfit: Callable[[Array], Array], free: NDArray[np.bool_]) -> Array:
    """Return the logarithms of the factors that meet the modes best, zero where an axis is not free."""

    def spread(inner: Array) -> Array:
        full = np.zeros(len(free))
        full[free] = inner
        return full

    count = int(np.sum(free))
    fits = (
        scipy.optimize.least_squares(
            lambda inner: misfit(spread(inner)), np.full(count, start), bounds=(-7.0, 7.0), diff_step=1e-5
        )
        for start in (0.0, 0.7, -0.7)
    )
    return spread(min(fits, key=lambda r: float(r.cost)).x)


def _observable(slopes: Array) -> NDArray[np.bool_]:
    """Return which axes the modes tell: taken one after the other, those that move a mode in a way the others do not.

    ``slopes`` (modes, axes) are changes of log frequency per log stiffness; half where one axis alone carries a mode.
    """
    observable = np.zeros(slopes.shape[1], dtype=bool)
    rest = slopes.copy()
    for _ in range(min(slopes.shape)):
        size = np.linalg.norm(rest, axis=0)
        place = int(np.argmax(size))
        if size[place] < LEAST_SLOPE:
            break
        observable[place] = True
        direction = rest[:, place] / size[place]
        rest = rest - np.outer(direction, direction @ rest)
    return observable


def _scaled(vehicle: Vehicle, groups: Mapping[str, list[tuple[str, str]]], factors: Mapping[str, float]) -> Vehicle:
    return vehicle.replace_elements(
        {
            (mount, axis): vehicle.mounts[mount].elements[axis].scaled("stiffness", factor)
            for group, factor in factors.items()
            for mount, axis in groups[group]
        }
    )


def closed_form_modes(vehicle: Vehicle) -> UncoupledModes:
    """Return the closed-form modes of a one-body vehicle, with what limits them.

    Raises
    ------
    InputDataError
        More than one body, not all six degrees of freedom, or a mount without an element along one of its three axes.
    """
    if len(vehicle.bodies) != 1:
        raise InputDataError(f"the closed form is that of one body; the vehicle has {', '.join(vehicle.bodies)}")
    (body,) = vehicle.bodies.values()
    if len(body.coordinates) != len(COORDINATES):
        has = ", ".join(body.coordinates)
        raise InputDataError(f"the closed form needs all six degrees of freedom of {body.name}; it has {has}")
    arms = np.array([m.position - body.cg for m in vehicle.mounts.values()])
    missing = [f"{m.name} {axis}" for m in vehicle.mounts.values() for axis in AXES if axis not in m.elements]
    if missing:
        raise InputDataError(f"the closed form needs a stiffness along each axis of each mount; none at {', '.join(missing)}")
    rates = np.array(
        [[equivalent(m.elements[axis], _AT_HZ, _AT_AMPLITUDE)[0] for axis in AXES] for m in vehicle.mounts.values()]
    )
    return uncoupled_modes(body.mass.value, np.diag(body.inertia), arms, rates)
