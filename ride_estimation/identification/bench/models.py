# Copyright 2026 ride_estimation contributors
"""The ladder of overlay models, from a linear spring-damper to two Maxwell cells, cubic spring and friction."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.columns import FRICTION_BERG, FRICTION_DAHL, Layout

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Quantity:
    """One reported parameter: name, unit, meaning."""

    name: str
    unit: str
    meaning: str


@dataclasses.dataclass(frozen=True)
class BenchModel:
    """One rung of the ladder.

    Attributes
    ----------
    name
        Name on the command line and in reports.
    layout
        Columns of the force.
    meaning
        What the model says about the element, in words.
    """

    name: str
    layout: Layout
    meaning: str

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return the reported parameters: springs, damper, cells (k, c), friction (f, length)."""
        lay = self.layout
        found = []
        if lay.spring:
            found.append(Quantity("stiffness", "N/m", "rate of the elastic spring"))
        if lay.cubic:
            found.append(Quantity("cubic_stiffness", "N/m^3", "cubic rate of the elastic spring"))
        if lay.viscous:
            found.append(Quantity("damping", "N s/m", "viscous damping"))
        for i in range(1, lay.cells + 1):
            found.append(Quantity(f"cell_{i}_stiffness", "N/m", f"series spring of Maxwell cell {i}"))
            found.append(Quantity(f"cell_{i}_damping", "N s/m", f"series damper of Maxwell cell {i}"))
        if lay.friction == FRICTION_BERG:
            found.append(Quantity("friction", "N", "largest friction force"))
            found.append(Quantity("half_stroke", "m", "stroke from rest to half the largest friction force"))
        if lay.friction == FRICTION_DAHL:
            found.append(Quantity("friction", "N", "largest friction force"))
            found.append(Quantity("presliding", "m", "Dahl displacement: friction force over slope at rest"))
        return tuple(found)

    @property
    def parameter_count(self) -> int:
        """Return the number of fitted parameters without the force offset."""
        return self.layout.linear + self.layout.nonlinear

    @property
    def positive(self) -> NDArray[np.bool_]:
        """Return which linear coefficients may not be negative (all but the cubic rate), shape (P,)."""
        positive = np.ones(self.layout.linear, dtype=bool)
        if self.layout.cubic:
            positive[int(self.layout.spring)] = False
        return positive

    @property
    def physical_positive(self) -> NDArray[np.bool_]:
        """Return which reported parameters may not be negative (all but the cubic rate), shape (P + Q,)."""
        return np.array([q.name != "cubic_stiffness" for q in self.quantities])

    @property
    def with_memory(self) -> NDArray[np.bool_]:
        """Return which linear coefficients belong to cells and friction, shape (P,)."""
        return np.arange(self.layout.linear) >= self.layout.static

    @property
    def sensitivities(self) -> NDArray[np.int64]:
        """Return the coefficient each nonlinear parameter belongs to, shape (Q,)."""
        return np.arange(self.layout.static, self.layout.linear)

    def physical(self, theta: Array, coefficients: Array) -> Array:
        """Return the reported parameters from the searched ones, shape (P + Q,)."""
        lay = self.layout
        out = list(coefficients[: lay.static])
        for i in range(lay.cells):
            k = coefficients[lay.static + i]
            out += [k, k / np.exp(theta[i])]
        if lay.friction:
            out += [coefficients[-1], np.exp(theta[-1])]
        return np.asarray(out, dtype=float)

    def physical_jacobian(self, theta: Array, coefficients: Array) -> Array:
        """Return d(reported)/d(coefficients, theta), shape (P + Q, P + Q)."""
        lay = self.layout
        p = lay.linear
        jacobian = np.zeros((self.parameter_count, self.parameter_count))
        jacobian[np.arange(lay.static), np.arange(lay.static)] = 1.0
        row = lay.static
        for i in range(lay.cells):
            k, rate = coefficients[lay.static + i], np.exp(theta[i])
            jacobian[row, lay.static + i] = 1.0
            jacobian[row + 1, lay.static + i] = 1.0 / rate
            jacobian[row + 1, p + i] = -k / rate
            row += 2
        if lay.friction:
            jacobian[row, p - 1] = 1.0
            jacobian[row + 1, p + lay.nonlinear - 1] = np.exp(theta[-1])
        return jacobian

    def searched(self, values: Array) -> tuple[Array, Array]:
        """Return (theta, coefficients) from reported parameters; the inverse of :meth:`physical`."""
        lay = self.layout
        coefficients, theta = list(values[: lay.static]), []
        at = lay.static
        for _ in range(lay.cells):
            coefficients.append(values[at])
            theta.append(np.log(values[at] / values[at + 1]))
            at += 2
        if lay.friction:
            coefficients.append(values[at])
            theta.append(np.log(values[at + 1]))
        return np.asarray(theta, dtype=float), np.asarray(coefficients, dtype=float)


def _model(name: str, meaning: str, **layout: bool | int) -> BenchModel:
    return BenchModel(name, Layout(**layout), meaning)  # type: ignore[arg-type]


#: the ladder in order of complexity
LADDER: tuple[BenchModel, ...] = (
    _model("linear_spring", "force proportional to deflection, no loss"),
    _model("kelvin_voigt", "spring and viscous damper", viscous=True),
    _model("cubic", "spring with a cubic rate and viscous damper", cubic=True, viscous=True),
    _model("maxwell", "spring and one Maxwell cell: stiffer above a rate", cells=1),
    _model("friction", "spring and Berg friction: loss that does not depend on rate", friction=FRICTION_BERG),
    _model("dahl", "spring, viscous damper and Dahl friction", viscous=True, friction=FRICTION_DAHL),
    _model("berg_viscous", "spring, viscous damper and Berg friction", viscous=True, friction=FRICTION_BERG),
    _model("berg", "spring, one Maxwell cell and Berg friction", cells=1, friction=FRICTION_BERG),
    _model(
        "maxwell_dahl",
        "spring, viscous damper, one Maxwell cell and Dahl friction",
        viscous=True,
        cells=1,
        friction=FRICTION_DAHL,
    ),
    _model("cubic_dahl", "cubic spring, viscous damper and Dahl friction", cubic=True, viscous=True, friction=FRICTION_DAHL),
    _model("cubic_berg", "cubic spring, one Maxwell cell and Berg friction", cubic=True, cells=1, friction=FRICTION_BERG),
    _model("modified_berg", "cubic spring, two Maxwell cells and Berg friction", cubic=True, cells=2, friction=FRICTION_BERG),
    _model(
        "three_cell_berg",
        "cubic spring, three Maxwell cells and Berg friction",
        cubic=True,
        cells=3,
        friction=FRICTION_BERG,
    ),
)


def model_by_name(name: str) -> BenchModel:
    """Return a rung of the ladder.

    Raises
    ------
    InputDataError
        Unknown name.
    """
    for model in LADDER:
        if model.name == name:
            return model
    raise InputDataError(f"model {name!r} is unknown; allowed: {', '.join(m.name for m in LADDER)}")


#: rungs always shown below a model that was asked for by name
_BASELINES = ("linear_spring", "kelvin_voigt", "berg")


def ladder_for(name: str) -> tuple[BenchModel, ...]:
    """Return the rungs to fit: all for ``auto``, else those up to the named one that are simpler, and it last."""
    if name == "auto":
        return LADDER
    model = model_by_name(name)
    simpler = tuple(m for m in LADDER if m.parameter_count < model.parameter_count and m.name in _BASELINES)
    return (*simpler, model)
