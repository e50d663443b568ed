# Copyright 2026 ride_estimation contributors
"""Standard deviations of white-box parameters: which cells, contact points and slopes the records really tell."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_model import Load, WhiteBox
from ride_estimation.identification.bench.jounce_search import curves_free_residual
from ride_estimation.identification.bench.uncertainty import effective_samples, std_from_jacobian

Array = NDArray[np.float64]

#: relative step of the differences, far above rounding and far below the curvature of the residual
_STEP = 1.0e-3


def white_box_std(box: WhiteBox, loads: Sequence[Load]) -> dict[str, float]:
    """Return standard deviations in SI of slopes, exponent, entry, contact points, corners and stiffnesses.

    The two curves are eliminated, so their uncertainty is in the result; the residual's correlation reduces the number of
    independent samples. Directions the records do not tell at all get an infinite standard deviation.
    """
    names, values = _parameters(box)
    largest = float(box.basis.knots[-1])
    scales = np.array(
        [largest if n.endswith("contact_point") else max(abs(v), 1e-12) for n, v in zip(names, values, strict=True)]
    )
    residual = curves_free_residual(box, loads)
    base = residual(box)
    columns = []
    for i, scale in enumerate(scales):
        moved = values.copy()
        moved[i] += _STEP * scale
        columns.append((residual(_with(box, names, moved)) - base) / _STEP)
    jacobian = np.stack(columns, axis=1)
    variance = float(base @ base) / effective_samples(base)
    relative = std_from_jacobian(jacobian, variance)
    return {n: float(r * scale) for n, r, scale in zip(names, relative, scales, strict=True)}


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
    at = dict(zip(names, values, strict=True))
    contacts, stiffness, rates = box.contacts.copy(), box.stiffness.copy(), box.rates.copy()
    for n, i in enumerate(active_cells(box), 1):
        contacts[i], stiffness[i], rates[i] = at[f"cell_{n}_contact_point"], at[f"cell_{n}_stiffness"], at[f"cell_{n}_corner"]
    return dataclasses.replace(
        box,
        slopes=np.array([at["dahl_lowest_slope"], at["dahl_highest_slope"], at["dahl_exponent"]]),
        smooth=float(at["entry"]),
        contacts=contacts,
        stiffness=stiffness,
        rates=rates,
    )
