# Copyright 2026 ride_estimation contributors
"""The interface of every force element: a law from deflection and rate to force, with memory.

Sign: ``x`` is the deflection (body side minus base side, positive in extension), ``force`` is the tension in the
element. The force on the body by the element is therefore ``-force``.
"""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.terms import Term
from ride_estimation.errors import ConfigurationError, InputDataError

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Declaration of one parameter of an element.

    Attributes
    ----------
    name
        Name in signatures (a word, without unit).
    key
        Name in files, with the unit suffix of :mod:`ride_estimation.units`.
    unit
        SI unit as printed.
    lower, upper
        Closed bounds in SI.
    meaning
        One line for the person in the field.
    role
        ``stiffness``, ``damping``, ``friction`` (multiply the force), ``shape`` (anything else). Estimators scale all
        parameters of a role together.
    source
        Document and equation.
    """

    name: str
    key: str
    unit: str
    lower: float
    upper: float
    meaning: str
    role: str
    source: str


def parameter(
    unit: str,
    *,
    key: str,
    lower: float,
    upper: float,
    meaning: str,
    role: str = "shape",
    source: str = "",
    default: Any = dataclasses.MISSING,
) -> Any:
    """Declare a float field of a force element with unit, bounds and meaning."""
    metadata = {
        "unit": unit, "key": key, "lower": lower, "upper": upper, "meaning": meaning, "role": role, "source": source,
    }
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class ForceElement(abc.ABC):
    """A one-axis force element, frozen; concrete classes are final and live in one file each."""

    #: name of the element in vehicle files and reports
    KIND: ClassVar[str] = ""

    def __post_init__(self) -> None:
        problems = list(self._bound_problems())
        if problems:
            raise ConfigurationError(problems, where=self.KIND)

    def _bound_problems(self) -> Iterator[str]:
        for p in self.parameters():
            value = getattr(self, p.name)
            if not isinstance(value, (int, float)) or isinstance(value, bool) or not math.isfinite(value):
                yield f"{p.key}: {value!r} is not a finite number"
            elif not p.lower <= value <= p.upper:
                yield f"{p.key}: {value:g} {p.unit} is outside {p.lower:g} to {p.upper:g} {p.unit} ({p.meaning})"

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared parameters in order."""
        return tuple(
            Parameter(name=f.name, **f.metadata) for f in dataclasses.fields(cls) if "unit" in f.metadata
        )

    def values(self) -> Array:
        """Return the parameter values in declared order, shape (P,), SI."""
        return np.array([getattr(self, p.name) for p in self.parameters()], dtype=float)

    def replace(self, **changes: float) -> Self:
        """Return a copy with some parameters changed (bounds are checked again)."""
        return dataclasses.replace(self, **changes)

    def to_mapping(self) -> dict[str, Any]:
        """Return the YAML form: kind plus one key with unit suffix per parameter."""
        return {"kind": self.KIND, **{p.key: float(getattr(self, p.name)) for p in self.parameters()}}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Self:
        """Build the element from plain numbers under the declared keys; all mistakes are reported at once.

        Raises
        ------
        ConfigurationError
            Unknown or missing keys, values that are no numbers or out of bounds.
        """
        declared = {p.key: p for p in cls.parameters()}
        problems = [f"unknown key {k!r}; allowed: {', '.join(declared)}" for k in mapping if k not in declared and k != "kind"]
        given: dict[str, float] = {}
        required = {f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING}
        for key, p in declared.items():
            if key in mapping:
                value = mapping[key]
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    problems.append(f"{key}: {value!r} is not a number [{p.unit}]")
                else:
                    given[p.name] = float(value)
            elif p.name in required:
                problems.append(f"{key}: missing ({p.meaning}) [{p.unit}]")
        if problems:
            raise ConfigurationError(problems, where=cls.KIND)
        return cls(**given)

    @abc.abstractmethod
    def initial(self) -> Array:
        """Return the memory at rest, shape (S,)."""

    @abc.abstractmethod
    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ds/dt of the continuous part of the memory, shape (S,)."""

    @abc.abstractmethod
    def force(self, s: Array, x: float, v: float) -> float:
        """Return the tension [N] at deflection x [m] and rate v [m/s] with memory s; changes nothing."""

    def commit(self, s: Array, x: float, v: float) -> Array:
        """Return the memory after an accepted step that ended at (x, v): reversal points, contact."""
        return s

    @abc.abstractmethod
    def terms(self) -> tuple[Term, ...]:
        """Return the primitives this element is the sum of; what simulations and estimators evaluate."""

    @classmethod
    @abc.abstractmethod
    def example(cls) -> Self:
        """Return a typical element, for documentation and contract tests."""

    def response(self, time_s: Array, x: Array) -> Array:
        """Return the force [N] over a whole signal, starting at rest at the first sample.

        Parameters
        ----------
        time_s
            Uniform sample times [s], shape (N,).
        x
            Deflection [m], shape (N,); the rate is its central difference.

        Raises
        ------
        InputDataError
            Fewer than two samples, samples that are not finite, or times that are not uniform and increasing.
        """
        step = uniform_step(time_s, x)
        codes, params = kernel.pack_terms(self.terms())
        return kernel.response(codes, params, x, np.gradient(x, step), step)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return the first-harmonic complex stiffness K' + iK'' [N/m] in closed form, or None where there is none.

        Parameters
        ----------
        omega
            Angular frequency [rad/s].
        amplitude
            Deflection amplitude [m].
        """
        return None

    def loss_energy(self, omega: float, amplitude: float) -> float | None:
        """Return the energy lost per cycle [J], or None where there is no closed form."""
        stiffness = self.dynamic_stiffness(omega, amplitude)
        return None if stiffness is None else math.pi * amplitude**2 * stiffness.imag


def uniform_step(time_s: Array, x: Array) -> float:
    """Return the step [s] of a uniformly sampled signal.

    Raises
    ------
    InputDataError
        Shapes differ, fewer than two samples, values not finite, or steps that differ by more than 1 %.
    """
    if time_s.shape != x.shape or time_s.ndim != 1 or time_s.size < 2:
        raise InputDataError(f"time and deflection need one equal shape (N,), N >= 2; given {time_s.shape} and {x.shape}")
    if not (np.all(np.isfinite(time_s)) and np.all(np.isfinite(x))):
        raise InputDataError("time or deflection has samples that are not finite")
    steps = np.diff(time_s)
    step = float(time_s[-1] - time_s[0]) / (time_s.size - 1)
    if step <= 0.0 or float(np.max(np.abs(steps - step))) > 0.01 * step:
        raise InputDataError(
            f"time is not uniform and increasing: mean step {step:g} s, steps from {steps.min():g} to {steps.max():g} s"
        )
    return step
