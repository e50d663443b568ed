# Copyright 2026 ride_estimation contributors
"""A candidate explanation: what a cause would add to the model at one place, as columns with a few shape parameters."""

from __future__ import annotations

import abc
import dataclasses
import enum
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.vehicles.vehicle import Vehicle

if TYPE_CHECKING:
    from ride_estimation.diagnosis.model.plant import Plant
    from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]

#: share of the energy of an effect that a law of the right cause but of another form than the real one leaves, 7 % of its size
FORM = 0.005
#: factor inside of a bound within which a shape parameter lies at it
INSIDE = 1.01

Shapes = Mapping[str, float]


class Sign(enum.IntEnum):
    """Physically possible sign of a coefficient."""

    ANY = 0
    POSITIVE = 1
    NEGATIVE = -1


class Law(enum.Enum):
    """What the force of a mount depends on."""

    ELASTIC = "deflection"  #: a mount has no one spring rate with it
    VISCOUS = "rate"
    SLIDING = "reversals of the deflection"
    RELAXING = "past deflection"


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """One cause at one place.

    Attributes
    ----------
    cause, location, axis
        As in ``diagnosis.json``.
    columns
        Builds the columns on a view for given shape parameters.
    grid
        Shape parameters tried by the screening.
    shapes
        Bounds of the shape parameters that the full fit refines.
    signs
        Possible sign of every coefficient; fewer entries than columns are repeated.
    complexity
        Parameters beyond columns and shapes, of columns that were themselves drawn from the data.
    ports
        Ports of a law whose columns come in equal sets, one per port, in this order; the screening then computes every
        port's columns once.
    variant
        Tells apart hypotheses of one cause and place, such as the side of a stop.
    essential
        Columns without which the hypothesis means nothing.
    largest
        Size of the first coefficient beyond which the hypothesis means nothing.
    plausible
        Whether coefficients are possible numbers with their shape parameters.
    inner
        Shape parameters at whose lower bound it means nothing: what fits best there has another form.
    cornered
        Its columns hold a characteristic of any form where the shape has ``corners``.
    run_bound
        The cause belongs to one run (a disturbance, a change at some instant): another run needs its own coefficients.
    absorbed
        Calibration bends stiffness and CG until they take up much of it: its numbers mean something once it is fitted.
    shows_in_means
        Mean readings or strained tolerances alone are evidence for it, also beside another cause.
    seen_in_readings
        The readings themselves show it: it is fitted whatever its score on the residual of a model that it bends.
    only_alone
        It is so like what calibration adjusts that beside another cause it is no explanation.
    moves_cg
        It moves the CG of its body, which then is that of the vehicle file within its tolerance.
    places_cg
        Its coefficient is how far the CG of its body lies off its place along its axis [m]; the plant of its model holds it.
    simulated
        Columns that the model is simulated with, where they are not those of the regression: the noise of the base sensors
        moves a simulated load, but tells nothing of its size.
    fault
        Of the coefficients: what a faulty sensor reads over what it would read without the fault, shape (6, 6) in the order of
        :data:`plant.CHANNELS`.
    """

    cause: str
    location: str
    axis: str
    columns: Callable[[RunView, Shapes], list[Column]]
    grid: tuple[Shapes, ...] = ({},)
    shapes: tuple[Shape, ...] = ()
    signs: tuple[Sign, ...] = (Sign.ANY,)
    complexity: float = 0.0
    ports: tuple[int, ...] = ()
    variant: str = ""
    essential: tuple[int, ...] = ()
    largest: float = float("inf")
    plausible: Callable[[Array, Shapes], bool] = lambda coefficients, shape: True
    run_bound: bool = False
    absorbed: bool = False
    shows_in_means: bool = False
    seen_in_readings: bool = False
    only_alone: bool = False
    moves_cg: bool = False
    places_cg: bool = False
    simulated: Callable[[RunView, Shapes], list[Column]] | None = None
    fault: Callable[[Array], Array] | None = None
    inner: tuple[str, ...] = ()
    cornered: bool = False

    def forces(self, view: RunView, shape: Shapes) -> list[Column]:
        """Return the columns that the model is simulated with."""
        return (self.simulated or self.columns)(view, shape)

    def possible(self, shape: Shapes) -> bool:
        """Return whether no shape parameter lies where the hypothesis means nothing."""
        return all(shape[s.name] > INSIDE * s.lower for s in self.shapes if s.name in self.inner)

    def meaningful(self, coefficients: Array, shape: Shapes) -> bool:
        """Return whether every essential column is used and coefficients and shape have sizes that they can have."""
        used = all(coefficients[i] != 0.0 for i in self.essential)
        used &= self.possible(shape) and bool(np.all(np.abs(coefficients[:1]) <= self.largest))
        return used and self.plausible(coefficients, shape)

    @property
    def key(self) -> tuple[str, str, str]:
        """Return (cause, location, axis)."""
        return self.cause, self.location, self.axis

    def column_signs(self, count: int) -> tuple[Sign, ...]:
        """Return the sign of each of ``count`` columns."""
        return tuple(self.signs[i % len(self.signs)] for i in range(count))


@dataclasses.dataclass(frozen=True)
class Reported:
    """A quantity an engineer can check."""

    name: str
    value: float
    std: float
    unit: str


@dataclasses.dataclass(frozen=True)
class Fitted:
    """A hypothesis with its numbers on one view.

    Attributes
    ----------
    coefficients, covariance
        Of the columns, shape (q,) and (q, q).
    shape
        Shape parameters.
    shape_std
        Their standard deviations; that of every one where the fit stated them.
    """

    hypothesis: Hypothesis
    coefficients: Array
    covariance: Array
    shape: Shapes
    shape_std: Shapes = dataclasses.field(default_factory=dict)

    def part(self, place: int) -> slice:
        """Return which coefficients belong to one of the ports of the hypothesis."""
        count = len(self.coefficients) // len(self.hypothesis.ports)
        return slice(count * place, count * (place + 1))

    def std(self, index: int) -> float:
        """Return the standard deviation of one coefficient."""
        return float(np.sqrt(max(self.covariance[index, index], 0.0)))

    def beyond(self, plant: Plant) -> Array:
        """Return the coefficients less what the plant of a model holds of them, shape (q,)."""
        h = self.hypothesis
        return self.coefficients - (plant.named_cg.get((h.location, h.axis), 0.0) if h.places_cg else 0.0)

    def spread(self, name: str, form: float) -> float:
        """Return the standard deviation of a shape parameter: that of its fit and what another form leaves open of it."""
        return math.hypot(self.shape_std.get(name, 0.0), form)


class Cause(abc.ABC):
    """A physical or measurement cause, one concrete final class per file of ``causes``."""

    ID: ClassVar[str]
    QUESTION: ClassVar[str]
    NEEDS: ClassVar[str]
    RIVALS: ClassVar[tuple[str, ...]]
    WOULD_REFUTE: ClassVar[str]
    MEASURE_NEXT: ClassVar[str] = ""
    #: what the force of a law depends on, None of a cause that is no law of a mount
    LAW: ClassVar[Law | None] = None

    @abc.abstractmethod
    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return the candidate explanations this run allows; empty where its needs are not met."""

    @abc.abstractmethod
    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the numbers an engineer can check."""

    @abc.abstractmethod
    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Return the vehicle with the cause built in, and remarks on what a vehicle file cannot hold."""
