# Copyright 2026 ride_estimation contributors
"""The interface of every force element: a law from deflection and rate to force, with memory.

Sign: ``x`` is the deflection (body side minus base side, positive in extension), ``force`` is the tension in the
element. The force on the body by the element is therefore ``-force``.
"""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements import terms as kernel
from ride_estimation.elements import vectorised
from ride_estimation.elements.terms import Term
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.jit import COMPILED

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


def series(
    unit: str, *, key: str, lower: float, upper: float, meaning: str, role: str = "shape", source: str = ""
) -> Any:
    """Declare a field that is a tuple of floats, all with one unit, bounds and meaning."""
    declared = {"unit": unit, "key": key, "lower": lower, "upper": upper, "meaning": meaning, "role": role, "source": source}
    return dataclasses.field(metadata={"series": declared})


def choice(*allowed: str, key: str, meaning: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a field that is one of some words."""
    return dataclasses.field(default=default, metadata={"choices": allowed, "key": key, "meaning": meaning})


@functools.cache
def _declared(element: type[ForceElement]) -> tuple[Parameter, ...]:
    return tuple(Parameter(name=f.name, **f.metadata) for f in dataclasses.fields(element) if "unit" in f.metadata)


@functools.cache
def _declared_series(element: type[ForceElement]) -> tuple[Parameter, ...]:
    return tuple(Parameter(name=f.name, **f.metadata["series"]) for f in dataclasses.fields(element) if "series" in f.metadata)


@dataclasses.dataclass(frozen=True)
class ForceElement(abc.ABC):
    """A one-axis force element, frozen; concrete classes are final and live in one file each."""

    #: name of the element in vehicle files and reports
    KIND: ClassVar[str] = ""
    #: order at which :meth:`response` converges with the step
    ORDER: ClassVar[int] = 2

    def __post_init__(self) -> None:
        problems = list(self._bound_problems())
        if problems:
            raise ConfigurationError(problems, where=self.KIND)

    def _bound_problems(self) -> Iterator[str]:
        for p in self.parameters():
            yield from _number_problems(p, p.key, getattr(self, p.name))
        for p in self.series_parameters():
            entries = getattr(self, p.name)
            if not isinstance(entries, tuple):
                yield f"{p.key}: {entries!r} is not a list of numbers [{p.unit}]"
                continue
            for i, value in enumerate(entries):
                yield from _number_problems(p, f"{p.key}[{i}]", value)
        for f in dataclasses.fields(self):
            if "choices" in f.metadata and getattr(self, f.name) not in f.metadata["choices"]:
                allowed = ", ".join(f.metadata["choices"])
                yield f"{f.metadata['key']}: {getattr(self, f.name)!r} is unknown; allowed: {allowed} ({f.metadata['meaning']})"

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared single-number parameters in order."""
        return _declared(cls)

    @classmethod
    def series_parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared list-valued parameters in order; unit, bounds and role hold for every entry."""
        return _declared_series(cls)

    def addressed(self) -> dict[str, tuple[Parameter, float]]:
        """Return every number of the element by its address: ``stiffness``, ``stiffnesses[1]``, ``elements[0].stiffness``."""
        found = {p.name: (p, float(getattr(self, p.name))) for p in self.parameters()}
        for p in self.series_parameters():
            found.update({f"{p.name}[{i}]": (p, float(v)) for i, v in enumerate(getattr(self, p.name))})
        return found

    def with_values(self, changes: Mapping[str, float]) -> Self:
        """Return a copy with the numbers at some addresses of :meth:`addressed` changed; bounds are checked again.

        Raises
        ------
        ConfigurationError
            Unknown address, or a value out of bounds.
        """
        known = self.addressed()
        unknown = [a for a in changes if a not in known]
        if unknown:
            raise ConfigurationError([f"unknown parameter {a!r}; known: {', '.join(known)}" for a in unknown], where=self.KIND)
        fields: dict[str, Any] = {}
        for address, value in changes.items():
            name, bracket, index = address.partition("[")
            if bracket:
                entries = list(fields.get(name, getattr(self, name)))
                entries[int(index[:-1])] = float(value)
                fields[name] = tuple(entries)
            else:
                fields[name] = float(value)
        return dataclasses.replace(self, **fields)

    def scaled(self, role: str, factor: float) -> Self:
        """Return a copy with every number of a role (``stiffness``, ``damping``, ``friction``) multiplied by a factor."""
        return self.with_values({a: factor * value for a, (p, value) in self.addressed().items() if p.role == role})

    def values(self) -> Array:
        """Return the parameter values in declared order, shape (P,), SI."""
        return np.array([getattr(self, p.name) for p in self.parameters()], dtype=float)

    def replace(self, **changes: float) -> Self:
        """Return a copy with some parameters changed (bounds are checked again)."""
        return dataclasses.replace(self, **changes)

    def to_mapping(self) -> dict[str, Any]:
        """Return the YAML form: kind plus one key with unit suffix per parameter."""
        mapping: dict[str, Any] = {"kind": self.KIND}
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if "unit" in f.metadata:
                mapping[f.metadata["key"]] = float(value)
            elif "series" in f.metadata:
                mapping[f.metadata["series"]["key"]] = [float(v) for v in value]
            elif "choices" in f.metadata:
                mapping[f.metadata["key"]] = str(value)
        return mapping

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Self:
        """Build the element from plain numbers under the declared keys; all mistakes are reported at once.

        Raises
        ------
        ConfigurationError
            Unknown or missing keys, values that are no numbers or out of bounds.
        """
        given: dict[str, Any] = {}
        problems: list[str] = []
        allowed: list[str] = []
        for f in dataclasses.fields(cls):
            declared = f.metadata.get("series", f.metadata)
            key = declared["key"]
            allowed.append(key)
            if key not in mapping:
                if f.default is dataclasses.MISSING:
                    unit = f" [{declared['unit']}]" if "unit" in declared else ""
                    problems.append(f"{key}: missing ({declared['meaning']}){unit}")
                continue
            value = mapping[key]
            if "choices" in f.metadata:
                given[f.name] = value
            elif "series" in f.metadata:
                if not isinstance(value, (list, tuple)) or not all(_is_number(v) for v in value):
                    problems.append(f"{key}: {value!r} is not a list of numbers [{declared['unit']}]")
                else:
                    given[f.name] = tuple(float(v) for v in value)
            elif not _is_number(value):
                problems.append(f"{key}: {value!r} is not a number [{declared['unit']}]")
            else:
                given[f.name] = float(value)
        problems += [f"unknown key {k!r}; allowed: {', '.join(allowed)}" for k in mapping if k not in allowed and k != "kind"]
        if problems:
            raise ConfigurationError(problems, where=cls.KIND)
        return cls(**given)

    def initial(self) -> Array:
        """Return the memory at rest at x = 0, shape (S,)."""
        return np.zeros(0)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ds/dt of the continuous part of the memory, shape (S,)."""
        return np.zeros_like(s)

    def is_passive(self) -> bool:
        """Return whether no closed path of the deflection from rest can yield energy."""
        return True

    def fastest_rate(self, peak_speed: float) -> float:
        """Return the fastest rate of the memory [1/s] while the deflection moves at up to ``peak_speed`` [m/s].

        An explicit Euler step h of :meth:`rate` is stable for ``fastest_rate h < 2``; the exact steps of :meth:`terms` have
        no such bound. See :func:`ride_estimation.elements.stability.require_explicit_step`.
        """
        return 0.0

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
        terms = self.terms()
        v = np.gradient(x, step, edge_order=2 if x.size > 2 else 1) if kernel.needs_rate(terms) else np.zeros_like(x)
        if not COMPILED:
            return vectorised.response(terms, x, v, step)
        codes, params = kernel.pack_terms(terms)
        return kernel.response(codes, params, x, v, step)

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


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number_problems(p: Parameter, key: str, value: Any) -> Iterator[str]:
    if not _is_number(value) or not math.isfinite(value):
        yield f"{key}: {value!r} is not a finite number [{p.unit}]"
    elif not p.lower <= value <= p.upper:
        yield f"{key}: {value:g} {p.unit} is outside {p.lower:g} to {p.upper:g} {p.unit} ({p.meaning})"


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
