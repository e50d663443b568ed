# Copyright 2026 ride_estimation contributors
"""Standard deviations of white-box parameters: which curves, cells, contact points and slopes the records really tell."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_model import Load, WhiteBox
from ride_estimation.identification.bench.uncertainty import effective_samples, repeatable_energy

Array = NDArray[np.float64]

#: relative step of the differences, far above rounding and far below the curvature of the residual
_STEP = 1.0e-3
#: singular value over the largest below which the records say nothing about a direction
_OBSERVABLE = 1.0e-6
#: share of a quantity in such directions from which it counts as not observable
_UNTOLD_SHARE = 1.0e-3


def white_box_std(box: WhiteBox, loads: Sequence[Load]) -> dict[str, float]:
    """Return standard deviations in SI of every reported quantity; infinite where the records do not tell one.

    All parameters move together, the coefficients of both curves too, and neither the price on rough curves nor the constructed
    height counts as a measurement: where a height is only constructed, its standard deviation says so. The correlation of the
    residual reduces the number of independent samples, and what of it repeats with the motion is added as in
    :func:`~ride_estimation.identification.bench.uncertainty.uncertainty`: force the model lacks may hide in a parameter.
    """
    names, values = _parameters(box)
    largest = float(box.basis.knots[-1])
    force = max(float(load.force.max()) for load in loads)
    curve = [*np.full(box.static.size, force), *np.full(box.height.size, max(float(box.height.max()), 1.0))]
    scales = np.array(
        [largest if n.endswith("contact_point") else max(abs(v), 1e-12) for n, v in zip(names, values, strict=True)] + curve
    )
    start = np.concatenate([values, box.static, box.height])
    base = _residual(box, loads)
    jacobian = np.empty((base.size, scales.size))
    for i, scale in enumerate(scales):
        moved = start.copy()
        moved[i] += _STEP * scale
        jacobian[:, i] = (_residual(_with(box, names, moved), loads) - base) / _STEP
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    observable = s > _OBSERVABLE * s[0]
    variance = float(base @ base) / effective_samples(base) + _missing(box, loads)
    inside, outside = vt[observable] / s[observable][:, None], vt[~observable]
    end = box.basis(np.array([largest]))[0]
    weights = dict(zip(names, np.eye(scales.size), strict=False))
    n = len(names)
    for name, first in (("static_force_at_reference", n), ("hysteresis_height_at_reference", n + box.static.size)):
        weights[name] = np.zeros(scales.size)
        weights[name][first : first + end.size] = end
    found = {}
    for name, weight in weights.items():
        scaled = weight * scales
        lost = float(np.linalg.norm(outside @ scaled)) > _UNTOLD_SHARE * float(np.linalg.norm(scaled))
        found[name] = np.inf if lost else float(np.sqrt(variance) * np.linalg.norm(inside @ scaled))
    return found


def _residual(box: WhiteBox, loads: Sequence[Load]) -> Array:
    """Return modelled minus measured force of all records, each record weighing the same."""
    parts = [
        (box.force(load) - load.force)[load.picked] / (load.scale * np.sqrt(load.picked.size)) for load in loads
    ]
    return np.concatenate(parts)


def _missing(box: WhiteBox, loads: Sequence[Load]) -> float:
    """Return the energy of the residual that repeats with the motion, each record weighing the same."""
    total = 0.0
    for load in loads:
        states = np.column_stack([load.travel, np.gradient(load.travel), load.friction])[load.picked]
        total += repeatable_energy((box.force(load) - load.force)[load.picked] / load.scale, states) / load.picked.size
    return total


def _parameters(box: WhiteBox) -> tuple[list[str], Array]:
    names = ["dahl_lowest_slope", "dahl_highest_slope", "dahl_exponent", "entry"]
    values = [*box.slopes, box.smooth]
    for n, i in enumerate(active_cells(box), 1):
        names += [f"cell_{n}_contact_point", f"cell_{n}_stiffness", f"cell_{n}_corner"]
        values += [box.contacts[i], box.stiffness[i], box.rates[i]]
    return names, np.asarray(values, dtype=float)


def active_cells(box: WhiteBox) -> list[int]:
    """Return the cells that carry force, by contact point."""
    return [int(i) for i in np.argsort(box.contacts) if box.stiffness[i] > 0.0]


def _with(box: WhiteBox, names: Sequence[str], values: Array) -> WhiteBox:
    at = dict(zip(names, values, strict=False))
    contacts, stiffness, rates = box.contacts.copy(), box.stiffness.copy(), box.rates.copy()
    for n, i in enumerate(active_cells(box), 1):
        contacts[i], stiffness[i], rates[i] = at[f"cell_{n}_contact_point"], at[f"cell_{n}_stiffness"], at[f"cell_{n}_corner"]
    curves = values[len(names) :]
    return dataclasses.replace(
        box,
        static=curves[: box.static.size],
        height=curves[box.static.size :],
        slopes=np.array([at["dahl_lowest_slope"], at["dahl_highest_slope"], at["dahl_exponent"]]),
        smooth=float(at["entry"]),
        contacts=contacts,
        stiffness=stiffness,
        rates=rates,
    )
