# Copyright 2026 ride_estimation contributors
"""Reading a YAML document field by field so that every mistake is found in one pass.

A field is addressed by its name without unit; the key in the file carries the unit (``stiffness_n_per_m``,
``stiffness_n_per_mm``) and the value comes out in SI.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypedDict, TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.io.bounded import read_text
from ride_estimation.io.yaml_text import Located, parse_yaml
from ride_estimation.text import shortened
from ride_estimation.units import si_unit, split_suffix, suffixes_of
from ride_estimation.vehicles.vehicle import Prior

Array = NDArray[np.float64]
Read = TypeVar("Read")

#: largest YAML file that is read [bytes]; the largest vehicle file has a hundredth of it
LARGEST_YAML = 4 << 20
#: longest value and longest mistake as messages show them [characters]
_LONGEST_VALUE = 120
_LONGEST_PROBLEM = 2000
#: a mistake that names its line already
_HAS_LINE = re.compile(r" \(line \d+\)$")
#: most unknown keys of one mapping that are named
_MOST_UNKNOWN = 20


def read_yaml(path: Path) -> Mapping[str, Any]:
    """Return the mapping a YAML file holds.

    Raises
    ------
    ConfigurationError
        Missing or unreadable file, broken YAML, duplicate keys, or a document that is no mapping.
    """
    try:
        text = read_text(path, LARGEST_YAML)
    except FileNotFoundError:
        raise ConfigurationError("the file does not exist", where=str(path)) from None
    except UnicodeDecodeError as error:
        why = f"it is not UTF-8 text ({error.reason} at byte {error.start})"
        raise ConfigurationError(f"the file cannot be read: {why}", where=str(path)) from error
    except OSError as error:
        raise ConfigurationError(f"the file cannot be read: {error.strerror or error}", where=str(path)) from error
    try:
        document, twice = parse_yaml(text)
    except ValueError as error:
        raise ConfigurationError(f"not valid YAML: {shortened(str(error))}", where=str(path)) from error
    if twice:
        raise ConfigurationError(map(shortened, twice), where=str(path))
    if document is None:
        raise ConfigurationError("the file is empty", where=str(path))
    if not isinstance(document, dict):
        raise ConfigurationError("the document must be a mapping of keys to values", where=str(path))
    return document


def shown(value: Any) -> str:
    """Return a value of a document as messages show it: as Python writes it, the middle left out where it is long."""
    return shortened(repr(value), _LONGEST_VALUE)


def as_number(value: Any) -> float | None:
    """Return a finite float, or None; ``4e5``, which YAML 1.1 calls a text, is a number here."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):  # a text, or an integer beyond every float
        return None
    return number if math.isfinite(number) else None


@dataclasses.dataclass(frozen=True)
class Field:
    """One key that a loader asked a document for: the source of the reference pages.

    Attributes
    ----------
    form
        What stands there: ``number``, ``quantity``, ``three numbers``, ``text``, ``true or false``, or empty (see the meaning).
    unit
        SI unit, empty where the value has none.
    default
        What holds where the key is absent, None where that is for the meaning to say.
    choices
        Allowed texts.
    """

    form: str = ""
    unit: str = ""
    required: bool = False
    default: Any = None
    lower: float = -math.inf
    upper: float = math.inf
    choices: tuple[str, ...] = ()
    meaning: str = ""


#: (path of the mapping, key) -> what is asked; None while nobody collects it
_asked: ContextVar[dict[tuple[str, str], Field] | None] = ContextVar("asked", default=None)


@contextlib.contextmanager
def recorded_fields() -> Iterator[dict[tuple[str, str], Field]]:
    """Collect every key that is asked for while the block runs, in the order of asking, keys in SI units."""
    found: dict[tuple[str, str], Field] = {}
    token = _asked.set(found)
    try:
        yield found
    finally:
        _asked.reset(token)


class Limits(TypedDict, total=False):
    """What a number of a document must be: given at all, between bounds in SI; and what it means, for the message."""

    required: bool
    lower: float
    upper: float
    meaning: str


class Section:
    """One mapping of a document; every getter notes its mistake in ``problems`` and returns None (or the default).

    Parameters
    ----------
    mapping
        The YAML mapping.
    path
        Where it is in the document, for messages (``mounts.front_left``).
    problems
        Shared list that collects one sentence per mistake.
    line
        Of the file in which it begins, where that is known.
    """

    def __init__(self, mapping: Any, path: str, problems: list[str], line: int | None = None) -> None:
        self.path = path
        self.problems = problems
        self._used: set[str] = set()
        self._known: set[str] = set()
        own: Mapping[str, int] = mapping.lines if isinstance(mapping, Located) else {}
        self._lines: Mapping[str, int] = own if line is None else {**own, "": line}
        if not isinstance(mapping, Mapping):
            self.note("", f"a mapping of keys to values is needed; given {shown(mapping)}")
            mapping = {}
        self._mapping: Mapping[str, Any] = {str(key): value for key, value in mapping.items()}

    def __contains__(self, key: str) -> bool:
        return key in self._mapping

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the keys in file order."""
        return tuple(self._mapping)

    def where(self, key: str) -> str:
        """Return the full path of a key."""
        return ".".join(part for part in (self.path, shortened(key, _LONGEST_VALUE)) if part)

    def note(self, key: str, problem: str) -> None:
        """Add a mistake, with the line of the file where it is known."""
        where = self.where(key)
        self.problems.append(shortened(f"{where}: {problem}" if where else problem, _LONGEST_PROBLEM) + self._line(key))

    def _line(self, key: str) -> str:
        return f" (line {self._lines[key]})" if key in self._lines else ""

    def _ask(self, key: str, field: Field) -> None:
        """Record a key that is asked for; what says more about the same key stays."""
        asked = _asked.get()
        if asked is None:
            return
        base, printed, _ = split_suffix(key)
        si_key = base + suffixes_of(si_unit(printed))[0] if printed else key
        if field.form or (self.path, si_key) not in asked:
            asked[self.path, si_key] = field

    def raw(self, key: str, *, required: bool = False, meaning: str = "") -> Any:
        """Return the value as YAML gave it, None where absent."""
        self._ask(key, Field(required=required, meaning=meaning))
        self._used.add(key)
        self._known.add(key)
        value = self._mapping.get(key)
        if value is None and required:
            self.note(key, f"{'empty' if key in self._mapping else 'missing'}{f' ({meaning})' if meaning else ''}")
        return value

    def section(self, key: str, *, required: bool = False, meaning: str = "") -> Section | None:
        """Return a nested mapping."""
        value = self.raw(key, required=required, meaning=meaning)
        return None if value is None else Section(value, self.where(key), self.problems, self._lines.get(key))

    def sections(self, key: str, *, required: bool = False, meaning: str = "") -> dict[str, Section]:
        """Return the mappings inside a mapping, by name."""
        parent = self.section(key, required=required, meaning=meaning)
        if parent is None:
            return {}
        return {
            name: Section(parent.raw(name), parent.where(name), self.problems, parent._lines.get(name)) for name in parent.keys
        }

    def text(
        self, key: str, default: str | None = "", *, allowed: Iterable[str] | None = None, meaning: str = ""
    ) -> str | None:
        """Return a text; ``default=None`` makes it required; ``allowed`` lists the choices."""
        choices = None if allowed is None else tuple(allowed)
        self._ask(key, Field("text", "", default is None, default, choices=choices or (), meaning=meaning))
        value = self.raw(key, required=default is None, meaning=meaning)
        if value is None:
            return default
        if not isinstance(value, str):
            self.note(key, f"{shown(value)} is not a text" + (f"; allowed: {', '.join(choices)}" if choices else ""))
            return default
        if choices is not None and value not in choices:
            known = ", ".join(choices) or "none is declared"
            self.note(key, f"{shown(value)} is unknown; allowed: {known}{suggestion(value, choices)}")
            return default
        return value

    def flag(self, key: str, default: bool, *, meaning: str = "") -> bool:
        """Return true or false."""
        self._ask(key, Field("true or false", default=default, meaning=meaning))
        value = self.raw(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            self.note(key, f"{shown(value)} is not true or false")
            return default
        return value

    def unit_key(self, name: str, unit: str, *, required: bool = False, meaning: str = "") -> tuple[str, float] | None:
        """Return (key in the file, factor to SI) of the field ``name`` given in any unit of the dimension of ``unit``."""
        suffixes = suffixes_of(unit)
        allowed = tuple(name + suffix for suffix in suffixes)
        self._ask(allowed[0], Field("", unit, required, meaning=meaning))
        self._known.update(allowed)
        found = []
        for key in self._mapping:
            base, printed, factor = split_suffix(key)
            if key == name or (base == name and printed):
                self._used.add(key)
                if si_unit(printed) == unit:
                    found.append((key, factor))
                else:
                    given = f"unit {printed}" if printed else "no unit in the key"
                    self.note(key, f"{given}; allowed: {', '.join(allowed)}")
                    required = False
        if len(found) > 1:
            self.note(name, f"given more than once: {', '.join(key for key, _ in found)}")
        if not found:
            if required:
                self.note(allowed[0], f"missing{f' ({meaning})' if meaning else ''} [{unit}]")
            return None
        return found[0]

    def number(self, name: str, unit: str, **limits: Unpack[Limits]) -> float | None:
        """Return a plain number in SI."""
        return self._number(name, unit, None, limits)

    def number_or(self, name: str, unit: str, default: float, **limits: Unpack[Limits]) -> float:
        """Return a plain number in SI, ``default`` where it is absent or wrong."""
        found = self._number(name, unit, default, limits)
        return default if found is None else found

    def _number(self, name: str, unit: str, default: float | None, limits: Limits) -> float | None:
        def read(key: str, factor: float) -> float | None:
            value = as_number(self._mapping[key])
            if value is None:
                self.note(key, f"{shown(self._mapping[key])} is not a finite number [{unit}]")
                return None
            return value * factor

        return self._within(name, Field("number", unit, default=default), read, float, limits)

    def quantity(self, name: str, unit: str, **limits: Unpack[Limits]) -> Prior | None:
        """Return a number or ``{value, std | relative_std, range, source}`` in SI."""

        def read(key: str, factor: float) -> Prior | None:
            problems: list[str] = []
            found = quantity_from(self._mapping[key], self.where(key), unit, factor, problems)
            self.problems += [problem if _HAS_LINE.search(problem) else problem + self._line(key) for problem in problems]
            return found

        return self._within(name, Field("quantity", unit), read, lambda prior: prior.value, limits)

    def _within(
        self, name: str, field: Field, read: Callable[[str, float], Read | None], size: Callable[[Read], float], limits: Limits
    ) -> Read | None:
        """Return what stands under a key of some unit, None after noting that it is missing, unreadable or out of bounds."""
        required, meaning = limits.get("required", False), limits.get("meaning", "")
        lower, upper = limits.get("lower", -math.inf), limits.get("upper", math.inf)
        unit = field.unit
        asked = dataclasses.replace(field, required=required, lower=lower, upper=upper, meaning=meaning)
        self._ask(name + suffixes_of(unit)[0], asked)
        located = self.unit_key(name, unit, required=required, meaning=meaning)
        found = None if located is None else read(*located)
        if located is None or found is None:
            return None
        return None if self._bounded(located[0], size(found), unit, lower, upper) is None else found

    def plain(
        self, key: str, *, lower: float = -math.inf, upper: float = math.inf, positive: bool = False, meaning: str = ""
    ) -> float | None:
        """Return a number without unit."""
        self._ask(key, Field("number", lower=0.0 if positive else lower, upper=upper, meaning=meaning))
        value = self.raw(key)
        if value is None:
            return None
        number = as_number(value)
        if number is None:
            self.note(key, f"{shown(value)} is not a finite number")
            return None
        if positive and number <= 0.0:
            self.note(key, f"{number:g} must be positive")
            return None
        return self._bounded(key, number, "", lower, upper)

    def vector(self, name: str, unit: str, *, required: bool = False, limit: float = math.inf, meaning: str = "") -> Array | None:
        """Return three numbers in SI, shape (3,)."""
        field = Field("three numbers", unit, required, lower=-limit, upper=limit, meaning=meaning)
        self._ask(name + suffixes_of(unit)[0], field)
        located = self.unit_key(name, unit, required=required, meaning=meaning)
        if located is None:
            return None
        key, factor = located
        return self.three(key, self._mapping[key], unit, factor, limit)

    def three(self, key: str, value: Any, unit: str, factor: float, limit: float = math.inf) -> Array | None:
        """Return ``value`` as three finite numbers in SI, shape (3,)."""
        numbers = [as_number(v) for v in value] if isinstance(value, Sequence) and not isinstance(value, str) else []
        if len(numbers) != 3 or any(v is None for v in numbers):
            self.note(key, f"{shown(value)} is not a list of three finite numbers [{unit}]")
            return None
        vector = np.array(numbers, dtype=float) * factor
        if np.max(np.abs(vector)) > limit:
            worst = vector[np.argmax(np.abs(vector))]
            allowed = f"-{limit:g} to {limit:g} {unit}"
            self.note(key, f"{worst:g} {unit} is impossible; allowed: {allowed} (is the unit in the key right?)")
            return None
        return vector

    def finish(self) -> None:
        """Report the keys nobody asked for."""
        known = sorted(self._known)
        unknown = [key for key in self._mapping if key not in self._used]
        for key in unknown[:_MOST_UNKNOWN]:
            self.note(key, f"unknown key; allowed: {', '.join(known)}{suggestion(key, known)}")
        if len(unknown) > _MOST_UNKNOWN:
            self.note("", f"{len(unknown) - _MOST_UNKNOWN} more unknown keys")

    def _bounded(self, key: str, value: float, unit: str, lower: float, upper: float) -> float | None:
        if lower <= value <= upper:
            return value
        unit = f" {unit}" if unit else ""
        self.note(key, f"{value:g}{unit} is outside {lower:g} to {upper:g}{unit}")
        return None


def suggestion(word: str, choices: Iterable[str]) -> str:
    """Return `` (did you mean ...?)`` where one of the choices is close."""
    close = difflib.get_close_matches(word, list(choices), n=1, cutoff=0.75)
    return f" (did you mean {close[0]!r}?)" if close else ""


def quantity_from(value: Any, where: str, unit: str, factor: float, problems: list[str]) -> Prior | None:
    """Return a quantity of the file as a Prior in SI, or None after noting what is wrong with it.

    Parameters
    ----------
    value
        A number, or a mapping with ``value`` and any of ``std``, ``relative_std``, ``range``, ``source``.
    where
        Path for messages.
    unit, factor
        SI unit and factor from the unit of the file.
    problems
        List the mistakes are added to.
    """
    number = as_number(value)
    if number is not None:
        return Prior(number * factor)
    if not isinstance(value, Mapping):
        what = "a finite number or {value, std | relative_std, range, source}"
        problems.append(f"{where}: {shown(value)} is not {what} [{unit}]")
        return None
    before = len(problems)
    section = Section(value, where, problems)
    centre = section.plain("value", meaning="the number, in the unit of the key")
    if centre is None and "value" not in section:
        section.note("value", f"missing [{unit}]")
    std = section.plain("std", positive=True, meaning="standard deviation, in the unit of the key")
    relative = section.plain("relative_std", positive=True, meaning="standard deviation as a share of the value")
    if std is not None and relative is not None:
        section.note("", "std and relative_std are both given; one is allowed")
    bounds = section.raw("range", meaning="`[lowest, highest]` the number can be, in the unit of the key; estimates stay inside")
    low, high = -math.inf, math.inf
    if bounds is not None:
        pair = [as_number(v) for v in bounds] if isinstance(bounds, list) else []
        if len(pair) != 2 or pair[0] is None or pair[1] is None or pair[0] > pair[1]:
            section.note("range", f"{shown(bounds)} is not [lowest, highest]")
        else:
            low, high = pair[0], pair[1]
            if centre is not None and not low <= centre <= high:
                section.note("value", f"{centre:g} is outside its own range {low:g} to {high:g}")
    source = section.text("source", "", meaning="where the number comes from")
    section.finish()
    if len(problems) > before or centre is None:
        return None
    if relative is not None:
        std = relative * abs(centre)
    return Prior(
        centre * factor, None if std is None else std * factor, low * factor, high * factor, source or ""
    )
