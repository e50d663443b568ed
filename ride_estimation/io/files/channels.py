# Copyright 2026 ride_estimation contributors
"""What every measurement file is read to and written from: named channels with a unit and their own time base."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.units import SUFFIXES, si_unit

Array = NDArray[np.float64]

#: stamp of the first sample where a file does not say when it was recorded [ns]; zero would count as "no stamp"
UNKNOWN_START_NS = 1_000_000_000
#: latest start of a file that is believed [ns]: the year 2096
LATEST_START_NS = 4 * 10**18
#: other spellings of the units of the package, lower case
_ALIASES = {
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "m/s**2": "m/s^2", "ms-2": "m/s^2", "gn": "g", "g0": "g",
    "°/s": "deg/s", "dps": "deg/s", "°": "deg", "kph": "km/h", "kmh": "km/h", "sec": "s", "seconds": "s", "newton": "N",
    "bar(g)": "bar",
}  # fmt: skip
#: units that files write and keys of this package do not have, lower case -> (SI unit, factor)
_OF_FILES = {
    "mg": ("m/s^2", 9.80665e-3), "milli-g": ("m/s^2", 9.80665e-3), "cm/s^2": ("m/s^2", 0.01), "mm/s^2": ("m/s^2", 1e-3),
    "in/s^2": ("m/s^2", 0.0254), "ft/s^2": ("m/s^2", 0.3048), "cm": ("m", 0.01), "um": ("m", 1e-6), "µm": ("m", 1e-6),
    "in": ("m", 0.0254), "inch": ("m", 0.0254), "ft": ("m", 0.3048), "mph": ("m/s", 0.44704), "ft/s": ("m/s", 0.3048),
    "lbf": ("N", 4.4482216152605), "kip": ("N", 4448.2216152605), "kips": ("N", 4448.2216152605), "kgf": ("N", 9.80665),
    "dan": ("N", 10.0), "psi": ("Pa", 6894.757293168), "kpa": ("Pa", 1e3), "mpa": ("Pa", 1e6), "mbar": ("Pa", 100.0),
    "mv": ("V", 1e-3), "v": ("V", 1.0),
}  # fmt: skip
_TIME_NAMES = (
    "time", "t", "timestamp", "stamp", "zeit", "timestamps", "x_value", "datetime", "date_time", "date time", "zeitstempel",
)  # fmt: skip
_TIME_FACTORS = {
    "": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9,
}  # fmt: skip
#: largest time of a sample [s]: a century from the start of the file or from 1970; more does not fit a clock in nanoseconds
_LONGEST_S = 3.2e9
#: units a time may be in
TIME_UNITS = tuple(unit for unit in _TIME_FACTORS if unit)
#: what to do with a table whose columns belong to clocks that cannot be told apart
_SPLIT_IT = "make a file of each, with its own columns"
#: share of the steps between stamps that may be zero because the file rounds them
_MOST_ROUNDED = 0.9


@dataclasses.dataclass(frozen=True)
class FileChannel:
    """One channel of a measurement file.

    Attributes
    ----------
    name, unit
        As the file has them; the unit may be empty.
    time_s
        Seconds since the start of the file, rising, shape (N,).
    values
        In ``unit``, shape (N,); NaN where the file has no value.
    """

    name: str
    unit: str
    time_s: Array
    values: Array


@dataclasses.dataclass(frozen=True)
class MeasurementFile:
    """Channels of one file and when it starts.

    Attributes
    ----------
    name
        Path.
    start_ns
        Unix time of ``time_s`` zero [ns], :data:`UNKNOWN_START_NS` where the file does not tell.
    channels
        In the order of the file.
    unreadable
        Columns that hold no numbers: name -> what stands there.
    events
        Texts that such columns hold: seconds as of the channels, text.
    """

    name: str
    start_ns: int
    channels: tuple[FileChannel, ...]
    unreadable: Mapping[str, str] = dataclasses.field(default_factory=dict)
    events: tuple[tuple[float, str], ...] = ()


@dataclasses.dataclass(frozen=True)
class TimeSource:
    """Where the time of a table comes from.

    Attributes
    ----------
    channel
        Its column; empty: the one called time, t, timestamp, ...
    unit
        Of that column; empty: as its heading says, seconds where that says nothing.
    rate_hz
        Samples per second of a table without time, zero where there is one.
    """

    channel: str = ""
    unit: str = ""
    rate_hz: float = 0.0


def unit_factor(unit: str) -> tuple[str, float] | None:
    """Return (SI unit, factor to it) of a unit as files write it, None where it is not known.

    Examples
    --------
    >>> unit_factor("m/s²")
    ('m/s^2', 1.0)
    """
    plain = unit.strip().strip("[]()").strip()
    if plain.lower() in _OF_FILES:
        return _OF_FILES[plain.lower()]
    printed = _ALIASES.get(plain.lower(), plain)
    for known, factor in SUFFIXES.values():
        if known == printed or known.lower() == printed.lower():
            return si_unit(known), factor
    return None


def not_read(unreadable: Mapping[str, str]) -> str:
    """Return the end of a sentence that names columns without numbers, nothing where there are none."""
    return "; not read: " + "; ".join(f"column {name}, {why}" for name, why in unreadable.items()) if unreadable else ""


def split_heading(heading: str) -> tuple[str, str]:
    """Return (name, unit) of a heading such as ``force [N]`` or ``force (N)``."""
    text = heading.strip()
    for opening, closing in ("[]", "()"):
        if text.endswith(closing) and opening in text[1:]:
            name, _, unit = text[:-1].rpartition(opening)
            return name.strip(), unit.strip()
    return text, ""


def table_channels(
    path: Path, headings: list[tuple[str, str]], columns: list[Array], time: TimeSource
) -> tuple[FileChannel, ...]:
    """Return the channels of a table.

    Two columns of time with different numbers of values are two clocks side by side: every column belongs to the one on its
    left, and both begin together.

    Parameters
    ----------
    path
        For messages.
    headings
        (name, unit) per column.
    columns
        Shape (N,) each.
    time
        Where the time comes from.

    Raises
    ------
    InputDataError
        No time, a time that does not rise, or several clocks.
    """
    names = [name for name, _ in headings]
    if len({len(column) for column in columns}) > 1:
        raise InputDataError(f"{path}: its columns differ in length: damaged")
    if time.channel:
        found = [i for i, name in enumerate(names) if name == time.channel]
    else:
        found = [i for i, heading in enumerate(headings) if _time_unit(*heading) is not None]
    if not found and time.channel:
        raise InputDataError(f"{path}: no column {time.channel!r} for the time; it has {', '.join(names)}")
    clocks = _clocks_side_by_side(path, headings, columns, found)
    if clocks:
        return tuple(
            channel
            for first, beyond, count in clocks
            for channel in table_channels(
                path, headings[first:beyond], [column[:count] for column in columns[first:beyond]],
                dataclasses.replace(time, channel=names[first]),
            )
        )  # fmt: skip
    if found:
        place = found[0]
        seconds = _seconds(path, headings[place], columns[place], time.unit)
        _check_one_clock(path, headings, columns, found)
    elif time.rate_hz > 0.0:
        place, seconds = -1, np.arange(len(columns[0])) / time.rate_hz
    else:
        raise InputDataError(
            f"{path}: no time column (called {', '.join(_TIME_NAMES[:3])}); name it (channel map, time: {{channel: ...}}; "
            f"--time) or give the rate (rate_hz there; --rate). Columns: {', '.join(names)}"
        )
    name = names[place] if found else "time"
    check_time(path, name, seconds)
    return tuple(
        FileChannel(name, unit, seconds, values)
        for i, ((name, unit), values) in enumerate(zip(headings, columns, strict=True)) if i != place
    )  # fmt: skip


def _time_unit(name: str, unit: str) -> str | None:
    """Return the unit of a column that by its name is a time (``Time``, ``time_ms``, ``t [us]``), None for another column."""
    plain = name.strip().lower()
    # time2, Time_1: the clocks of a table of several; a letter and a digit may be anything (t2 a temperature)
    numbered = plain.rstrip("0123456789").rstrip("_ ")
    if plain in _TIME_NAMES or (numbered in _TIME_NAMES and len(numbered) > 1):
        return unit.strip().lower()
    base, _, suffix = plain.replace(" ", "_").rpartition("_")
    return suffix if base in _TIME_NAMES and suffix in _TIME_FACTORS and unit.strip().lower() in ("", suffix) else None


def time_factor(name: str, unit: str) -> float | None:
    """Return the factor to seconds of a column that by its name is a time, None for another column."""
    said = _time_unit(name, unit)
    return None if said is None else _TIME_FACTORS.get(said)


def _seconds(path: Path, heading: tuple[str, str], values: Array, said: str) -> Array:
    """Return a time column in seconds; equal stamps of an even clock that the file rounds are spread out again."""
    name, given = heading
    unit = said or _time_unit(name, given) or given.strip().lower()
    if unit not in _TIME_FACTORS:
        allowed = ", ".join(TIME_UNITS)
        raise InputDataError(f"{path}: the time {name!r} is in {unit!r}; allowed: {allowed} (channel map, time: {{unit: ...}})")
    seconds = values * _TIME_FACTORS[unit]
    steps = np.diff(seconds)
    equal = steps == 0.0
    if len(seconds) < 3 or not np.all(steps >= 0.0) or not equal.any() or np.mean(equal) > _MOST_ROUNDED:
        return seconds
    number = np.arange(len(seconds), dtype=np.float64)
    even = np.polynomial.Polynomial.fit(number, seconds, 1)(number)
    resolution = float(steps[~equal].min())
    # an even clock is never farther from its rounded stamps than one step of the rounding
    return even if np.max(np.abs(even - seconds)) <= resolution else seconds


def _clocks_side_by_side(
    path: Path, headings: list[tuple[str, str]], columns: list[Array], found: list[int]
) -> list[tuple[int, int, int]]:
    """Return the parts of a table that has several clocks, none where it has one: first column (the time), end, number of rows.

    Loggers that sample two groups at two rates write them side by side and leave the rest of the shorter one empty. Times of
    equal length that run differently may belong to any column: these are refused elsewhere.
    """
    filled = [_filled(column) for column in columns]
    if len({filled[place] for place in found}) < 2:
        return []
    what = f"{path}: two clocks in one table ({headings[found[0]][0]!r}, {headings[found[1]][0]!r})"
    if found[0] > 0:
        raise InputDataError(f"{what}, and a column before the first; {_SPLIT_IT}")
    parts = list(zip(found, [*found[1:], len(columns)]))
    for first, beyond in parts:
        longest = max(filled[first:beyond])
        if not np.all(np.isfinite(columns[first][: filled[first]])) or longest > filled[first]:
            raise InputDataError(f"{what}; {headings[first][0]!r} has no value in rows where a column beside it has; {_SPLIT_IT}")
    return [(first, beyond, filled[first]) for first, beyond in parts]


def _filled(column: Array) -> int:
    """Return how many rows a column has up to its last value."""
    there = np.flatnonzero(np.isfinite(column))
    return int(there[-1]) + 1 if there.size else 0


def _check_one_clock(path: Path, headings: list[tuple[str, str]], columns: list[Array], found: list[int]) -> None:
    """Refuse a table whose columns belong to several clocks: other time columns run differently, or the time ends early."""
    first = columns[found[0]]
    there = int(np.sum(np.isfinite(first)))
    what = f"{path}: two clocks in one table"
    for place in found[1:]:
        both = np.isfinite(first) & np.isfinite(columns[place])
        if int(np.sum(both)) != there or not _same_clock(first[both], columns[place][both]):
            raise InputDataError(f"{what} ({headings[found[0]][0]!r}, {headings[place][0]!r}); {_SPLIT_IT}")
    longest = max(int(np.sum(np.isfinite(column))) for column in columns)
    if 2 <= there < longest and np.all(np.isfinite(first[:there])):
        raise InputDataError(
            f"{what}: the time {headings[found[0]][0]!r} has {there} values, other columns have {longest}; {_SPLIT_IT}"
        )


def _same_clock(first: Array, second: Array) -> bool:
    """Return whether two time columns are one clock in units a thousand apart, from any beginning."""
    passed, other = first - first[:1], second - second[:1]
    if len(passed) < 2 or passed[-1] <= 0.0 or other[-1] <= 0.0:
        return False
    ratio = other[-1] / passed[-1]
    thousands = np.log10(ratio) / 3.0
    apart = float(np.max(np.abs(other / ratio - passed)))
    return bool(abs(thousands - round(thousands)) < 2e-3 and apart < 0.01 * passed[-1])


def even_time(path: Path, name: str, start: float, step: float, count: int) -> Array:
    """Return the time of evenly sampled values [s].

    Raises
    ------
    InputDataError
        A start or step that no clock has.
    """
    if not (abs(start) <= _LONGEST_S and step > 0.0 and step * count <= _LONGEST_S):
        raise InputDataError(f"{path}: {name!r} begins at {start:g} s with a step of {step:g} s, {count} samples: no time base")
    return np.asarray(start + step * np.arange(count), dtype=np.float64)


def check_time(path: Path, name: str, time: Array) -> None:
    """Refuse a time base that cannot be one.

    Raises
    ------
    InputDataError
        See :func:`no_time`.
    """
    reason = no_time(time)
    if reason:
        raise InputDataError(f"{path}: {name!r}: {reason}")


def no_time(time: Array) -> str:
    """Return why a time base [s] cannot be one, nothing where it can: too short, not finite, beyond a century, not rising."""
    if len(time) < 2:
        return f"{len(time)} samples; at least two are needed"
    if not np.all(np.isfinite(time)):
        return f"sample {int(np.argmin(np.isfinite(time)))} of the time is not finite"
    if np.max(np.abs(time)) > _LONGEST_S:
        return f"the time reaches {np.max(np.abs(time)):.3g} s, more than a century: it is in another unit"
    if np.any(np.diff(time) <= 0.0):
        return f"the time does not rise at sample {int(np.argmax(np.diff(time) <= 0.0)) + 1}"
    return ""


def require(module: str, what: str) -> Any:
    """Import a library of the extra ``files``.

    Raises
    ------
    InputDataError
        It is not installed; the message names the extra.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputDataError(f"{what} files need the extra 'files': pip install 'ride_estimation[files]'") from error
