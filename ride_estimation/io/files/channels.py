# Copyright 2026 ride_estimation contributors
"""What every measurement file is read to and written from: named channels with a unit and their own time base."""

from __future__ import annotations

import dataclasses
import importlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.units import SUFFIXES, si_unit

Array = NDArray[np.float64]

#: stamp of the first sample where a file does not say when it was recorded [ns]; zero would count as "no stamp"
UNKNOWN_START_NS = 1_000_000_000
#: other spellings of the units of the package, lower case
_ALIASES = {
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "m/s**2": "m/s^2", "ms-2": "m/s^2", "gn": "g", "g0": "g",
    "°/s": "deg/s", "dps": "deg/s", "°": "deg", "kph": "km/h", "kmh": "km/h", "sec": "s", "seconds": "s", "newton": "N",
    "bar(g)": "bar",
}  # fmt: skip
_TIME_NAMES = ("time", "t", "timestamp", "time_s", "stamp", "zeit", "timestamps")
_TIME_FACTORS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


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
    """

    name: str
    start_ns: int
    channels: tuple[FileChannel, ...]


def unit_factor(unit: str) -> tuple[str, float] | None:
    """Return (SI unit, factor to it) of a unit as files write it, None where it is not known.

    Examples
    --------
    >>> unit_factor("m/s²")
    ('m/s^2', 1.0)
    """
    plain = unit.strip().strip("[]()").strip()
    printed = _ALIASES.get(plain.lower(), plain)
    for known, factor in SUFFIXES.values():
        if known == printed or known.lower() == printed.lower():
            return si_unit(known), factor
    return None


def split_heading(heading: str) -> tuple[str, str]:
    """Return (name, unit) of a heading such as ``force [N]`` or ``force (N)``."""
    text = heading.strip()
    for opening, closing in ("[]", "()"):
        if text.endswith(closing) and opening in text[1:]:
            name, _, unit = text[:-1].rpartition(opening)
            return name.strip(), unit.strip()
    return text, ""


def table_channels(
    path: Path, headings: list[tuple[str, str]], columns: list[Array], time_name: str = "", rate_hz: float = 0.0
) -> tuple[FileChannel, ...]:
    """Return the channels of a table whose columns share one time base.

    Parameters
    ----------
    path
        For messages.
    headings
        (name, unit) per column.
    columns
        Shape (N,) each.
    time_name
        Column with the time; by default the first one called time, t, timestamp, ...
    rate_hz
        Samples per second of a table without time column.

    Raises
    ------
    InputDataError
        No time, or a time that does not rise.
    """
    names = [name for name, _ in headings]
    wanted = [n for n in names if n == time_name] if time_name else [n for n in names if n.lower() in _TIME_NAMES]
    if not wanted and time_name:
        raise InputDataError(f"{path}: no column {time_name!r} for the time; it has {', '.join(names)}")
    if wanted:
        place = names.index(wanted[0])
        unit = headings[place][1]
        if unit not in _TIME_FACTORS:
            raise InputDataError(f"{path}: the time {wanted[0]!r} is in {unit!r}; allowed: s, ms, us, ns")
        time = columns[place] * _TIME_FACTORS[unit]
    elif rate_hz > 0.0:
        place, time = -1, np.arange(len(columns[0])) / rate_hz
    else:
        raise InputDataError(
            f"{path}: no time column (called {', '.join(_TIME_NAMES[:3])}); name it in the channel map (time: {{channel: ...}}) "
            f"or give rate_hz there. Columns: {', '.join(names)}"
        )
    check_time(path, wanted[0] if wanted else "time", time)
    return tuple(
        FileChannel(name, unit, time, values)
        for i, ((name, unit), values) in enumerate(zip(headings, columns, strict=True)) if i != place
    )  # fmt: skip


def check_time(path: Path, name: str, time: Array) -> None:
    """Refuse a time base that cannot be one.

    Raises
    ------
    InputDataError
        Fewer than two samples, not finite, or not rising.
    """
    if len(time) < 2:
        raise InputDataError(f"{path}: {name!r} has {len(time)} samples; at least two are needed")
    if not np.all(np.isfinite(time)):
        raise InputDataError(f"{path}: {name!r}: sample {int(np.argmin(np.isfinite(time)))} of the time is not finite")
    if np.any(np.diff(time) <= 0.0):
        raise InputDataError(f"{path}: {name!r}: the time does not rise at sample {int(np.argmax(np.diff(time) <= 0.0)) + 1}")


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
