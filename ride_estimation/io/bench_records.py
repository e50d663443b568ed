# Copyright 2026 ride_estimation contributors
"""Read bench records of displacement and force: CSV, npz, MATLAB files and bags, units stated by column name or option."""

from __future__ import annotations

import csv
import dataclasses
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.oscillator import OscillatorRecord
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.steady_cycles import OperatingPoints, operating_points
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.files.formats import read_measurement_file
from ride_estimation.io.matlab_file import read_matlab
from ride_estimation.io.text_table import decoded
from ride_estimation.units import SUFFIXES

Array = NDArray[np.float64]

#: names a column may have, without unit
SYNONYMS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "timestamp", "tout"),
    "displacement": ("displacement", "disp", "deflection", "stroke", "travel", "x", "dist", "position"),
    "force": ("force", "load", "f", "forc", "fz"),
}
#: unit names that may be stated, by quantity -> factor to SI
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "displacement": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "cm": 1e-2, "in": 0.0254},
    "force": {"N": 1.0, "kN": 1e3, "daN": 10.0, "kgf": 9.80665, "lbf": 4.4482216152605, "kip": 4448.2216152605},
}


@dataclasses.dataclass(frozen=True)
class ReadOptions:
    """How columns and units of a record are found.

    Attributes
    ----------
    time, displacement, force
        Column names (or 1-based numbers of a CSV without header); empty: found by name.
    time_unit, displacement_unit, force_unit
        Units; empty: from the column name.
    rate_hz
        Sample rate where the record has no time column.
    zero
        ``auto``, ``mean``, ``start`` or ``none``: what deflection counts as zero.
    sign
        ``tension`` (force positive in extension) or ``compression`` (both positive in compression: no change), or
        ``opposed`` (the force column has the opposite sign of the displacement).
    mount, axis
        Joint ``<mount>_<axis>`` of a bag.
    accept_stiffness
        Accept an implausible secant stiffness.
    """

    time: str = ""
    displacement: str = ""
    force: str = ""
    time_unit: str = ""
    displacement_unit: str = ""
    force_unit: str = ""
    rate_hz: float = 0.0
    zero: str = "auto"
    sign: str = "tension"
    mount: str = ""
    axis: str = ""
    accept_stiffness: bool = False


def read_bench_record(path: Path, options: ReadOptions | None = None) -> BenchRecord:
    """Read and check one record.

    Parameters
    ----------
    path
        ``.csv``/``.txt``/``.tsv``, ``.npz``, ``.mat``, or a bag (folder, ``.mcap``, ``.db3``, ``.bag``).
    options
        Columns and units.

    Raises
    ------
    InputDataError
        Missing file, columns not found, units not stated, or what :func:`check_record` refuses.
    """
    options = options or ReadOptions()
    path = Path(path)
    noticed: list[str] = []
    columns = _columns(path, options.mount, options.axis, noticed)
    record = _assemble(path.name or str(path), columns, options, noticed)
    return check_record(record, allow_stiffness_outside=options.accept_stiffness)


def _columns(path: Path, mount: str = "", axis: str = "", noticed: list[str] | None = None) -> dict[str, Array]:
    """Read all numeric columns of a file; add to ``noticed`` what had to be done for it."""
    if not path.exists():
        raise InputDataError(f"{path}: no such file")
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in (".mcap", ".db3", ".bag"):
        from ride_estimation.io.bags_bench import read_bag_columns

        columns, warnings = read_bag_columns(path, mount, axis)
        if noticed is not None:
            noticed += warnings
        return columns
    if suffix == ".npz":
        return _npz_columns(path)
    if suffix in (".mf4", ".mdf", ".dat", ".rpc", ".rsp", ".drv", ".tdms", ".parquet"):
        return _measured_columns(path)
    return _mat_columns(path) if suffix == ".mat" else _csv_columns(path)


def _measured_columns(path: Path) -> dict[str, Array]:
    """Return the channels of a measurement file on the time base of the first, which all of them must share."""
    found = read_measurement_file(path).channels
    time = found[0].time_s
    other = [c.name for c in found if not np.array_equal(c.time_s, time)]
    if other:
        raise InputDataError(f"{path}: {', '.join(other)} has another time base than {found[0].name}; resample to one")
    return {"time_s": time, **{f"{c.name} [{c.unit}]" if c.unit else c.name: c.values for c in found}}


def read_operating_points(path: Path) -> OperatingPoints | None:
    """Read a table of harmonic tests; None where the file is no such table.

    Columns: ``frequency_hz``, ``amplitude_<m, mm>``, ``stiffness_<n_per_m, n_per_mm>`` and ``loss_energy_<j, n_mm>``.

    Raises
    ------
    InputDataError
        A table with a column missing or values that cannot be.
    """
    path = Path(path)
    if path.is_dir() or path.suffix.lower() not in (".csv", ".txt", ".tsv", ".npz"):
        return None
    columns = _columns(path)
    named = {_table_name(c): c for c in columns}
    if "frequency" not in named or "amplitude" not in named:
        return None
    missing = [n for n in ("stiffness", "loss_energy") if n not in named]
    if missing:
        raise InputDataError(
            f"{path}: a table of harmonic tests also needs {', '.join(missing)}; available: {', '.join(columns)}"
        )
    values = {}
    for name, column in named.items():
        if name in _TABLE_UNITS:
            suffix = column.strip().lower()[len(name) + 1 :]
            if suffix not in _TABLE_UNITS[name]:
                raise InputDataError(
                    f"{path}: column {column!r} needs its unit: {', '.join(f'{name}_{u}' for u in _TABLE_UNITS[name])}"
                )
            values[name] = columns[column] * _TABLE_UNITS[name][suffix]
            if not np.all(np.isfinite(values[name])):
                raise InputDataError(f"{path}: column {column!r} has values that are not finite")
    return operating_points(2.0 * np.pi * values["frequency"], values["amplitude"], values["stiffness"], values["loss_energy"])


_TABLE_UNITS: dict[str, dict[str, float]] = {
    "frequency": {"hz": 1.0},
    "amplitude": {"m": 1.0, "mm": 1e-3},
    "stiffness": {"n_per_m": 1.0, "n_per_mm": 1e3},
    "loss_energy": {"j": 1.0, "n_m": 1.0, "n_mm": 1e-3},
}


def _table_name(column: str) -> str:
    lower = column.strip().lower()
    return next((n for n in _TABLE_UNITS if lower == n or lower.startswith(n + "_")), lower)


def read_oscillator_record(path: Path, names: str, rate_hz: float, time: str) -> OscillatorRecord:
    """Read excitation and response of an oscillator.

    Parameters
    ----------
    path
        Record.
    names
        ``INPUT,OUTPUT`` columns.
    rate_hz
        Sample rate [Hz]; 0: from the time column.
    time
        Column of time in s; empty: found by name.

    Raises
    ------
    InputDataError
        Columns not found, no rate.
    """
    path = Path(path)
    columns = _columns(path)
    wanted = [n.strip() for n in names.split(",")]
    if len(wanted) != 2 or any(n not in columns for n in wanted) or wanted[0] == wanted[1]:
        raise InputDataError(f"{path}: --oscillator needs INPUT,OUTPUT; given {names!r}; available: {', '.join(columns)}")
    if rate_hz <= 0.0:
        problems: list[str] = []
        found, factor = _quantity("time", columns, time, "", problems)
        if found is None:
            raise InputDataError(f"{path}: {problems[0]}; or state --rate HZ")
        steps = np.diff(columns[found]) * factor
        if not np.all(np.isfinite(steps)) or np.any(steps <= 0.0) or np.ptp(steps) > 0.05 * np.mean(steps):
            raise InputDataError(f"{path}: time column {found!r} is not uniform and increasing")
        rate_hz = 1.0 / float(np.mean(steps))
    u, y = (np.ascontiguousarray(columns[n], dtype=float) for n in wanted)
    return OscillatorRecord(path.name, 1.0 / rate_hz, u, y)


def _npz_columns(path: Path) -> dict[str, Array]:
    return {k: np.atleast_1d(v).astype(float).squeeze() for k, v in read_arrays(path).items() if v.dtype.kind in "fiu"}


def _mat_columns(path: Path) -> dict[str, Array]:
    return {k: v.astype(float).ravel() for k, v in read_matlab(path).items() if v.ndim == 2 and 1 in v.shape and v.size > 1}


def _csv_columns(path: Path) -> dict[str, Array]:
    try:
        text = decoded(path)
    except InputDataError as error:
        raise InputDataError(f"{path}: not a readable text file ({error}); allowed: csv, npz, mat, bag") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputDataError(f"{path}: the file is empty")
    sample = lines[min(len(lines) - 1, 2)]
    delimiter = next((d for d in (";", "\t", ",") if d in sample), None)
    try:
        rows = [line.split() for line in lines] if delimiter is None else list(csv.reader(lines, delimiter=delimiter))
    except csv.Error as error:
        raise InputDataError(f"{path}: not a readable table ({error})") from error
    if delimiter in (";", "\t"):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    header = [] if _is_numeric(rows[0]) else [cell.strip() for cell in rows[0]]
    body = rows[1:] if header else rows
    if header and len(body) > 1 and not any(map(_is_filled_number, body[0])) and any(map(_is_filled_number, body[1])):
        units, body = [cell.strip().strip("[]()") for cell in body[0]], body[1:]  # a line of units below the header
        header = [f"{name} [{unit}]" if unit and not _split_unit(name)[1] else name for name, unit in zip(header, units)]
    width = len(header) if header else len(body[0]) if body else 0
    while header and header[-1] == "":
        header.pop()
    names = header or [str(i + 1) for i in range(width)]
    wrong = [i for i, row in enumerate(body) if len(row) < len(names)]
    if wrong:
        raise InputDataError(
            f"{path}: {len(wrong)} rows have fewer than {len(names)} cells, "
            f"the first at data row {wrong[0] + 1}: {body[wrong[0]]}"
        )
    return {name: _column(path, name, [row[i] for row in body]) for i, name in enumerate(names)}


def _is_filled_number(cell: str) -> bool:
    return bool(cell.strip()) and _is_numeric([cell])


def _is_numeric(row: list[str]) -> bool:
    try:
        [float(cell) for cell in row if cell.strip()]
    except ValueError:
        return False
    return True


def _column(path: Path, name: str, cells: list[str]) -> Array:
    """Return one column; a text in a column that is otherwise numbers is a mistake, a column of texts is no signal."""
    values = np.full(len(cells), np.nan)
    texts: list[int] = []
    for i, cell in enumerate(cells):
        if cell.strip():
            try:
                values[i] = float(cell)
            except ValueError:
                texts.append(i)
    if texts and len(texts) < 0.5 * len(cells):
        raise InputDataError(f"{path}: {cells[texts[0]]!r} in data row {texts[0] + 1} of column {name!r} is not a number")
    return values


def _assemble(where: str, columns: Mapping[str, Array], options: ReadOptions, warnings: list[str]) -> BenchRecord:
    problems: list[str] = []
    displacement, x_factor = _quantity("displacement", columns, options.displacement, options.displacement_unit, problems)
    force, f_factor = _quantity("force", columns, options.force, options.force_unit, problems)
    if options.rate_hz > 0.0:
        time: str | None = None
        t_factor = 1.0
    else:
        time, t_factor = _quantity("time", columns, options.time, options.time_unit or "", problems)
        if time is None:
            problems[-1] += "; or state --rate HZ"
    if not problems and displacement == force:
        problems.append(f"displacement and force are both read from column {displacement!r}")
    if problems or displacement is None or force is None:
        raise InputDataError(f"{where}: " + "\n  - ".join(problems))
    x, f = columns[displacement] * x_factor, columns[force] * f_factor
    if x.ndim != 1 or f.ndim != 1:
        raise InputDataError(f"{where}: columns {displacement!r} and {force!r} must be one-dimensional")
    t = np.arange(x.size) / options.rate_hz if time is None else columns[time] * t_factor
    if options.sign == "opposed":
        f = -f
    x = _zeroed(where, x, options.zero, warnings)
    return BenchRecord(where, np.asarray(t, dtype=float), x, np.asarray(f, dtype=float), tuple(warnings))


def _zeroed(where: str, x: Array, zero: str, warnings: list[str]) -> Array:
    finite = x[np.isfinite(x)]
    if finite.size == 0 or zero == "none":
        return x
    if zero == "start":
        return np.asarray(x - float(finite[0]))
    middle = 0.5 * (finite.max() + finite.min())
    half = 0.5 * float(np.ptp(finite))
    if zero == "mean":
        return np.asarray(x - float(np.mean(finite)))
    # a record whose zero lies at or beyond its edge but that does not start at rest there is one with a transducer offset
    if half > 0.0 and abs(middle) > half * 1.02 and abs(finite[0]) > 0.05 * half:
        warnings.append(
            f"{where}: displacement runs from {finite.min():g} to {finite.max():g} m and never passes zero: its mean was "
            "subtracted (--zero none keeps it)"
        )
        return x - float(np.mean(finite))
    return x


def _split_unit(name: str) -> tuple[str, str]:
    """Return (bare lower-case name, unit) of a column name: ``force_kn``, ``Force [kN]``, ``Force (kN)``."""
    bracket = re.fullmatch(r"\s*(.*?)\s*[\[(]\s*([^\])]+?)\s*[\])]\s*", name)
    if bracket:
        return bracket.group(1).lower().replace(" ", "_"), bracket.group(2)
    lower = name.strip().lower().replace(" ", "_")
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        if lower.endswith(suffix) and len(lower) > len(suffix):
            return lower[: -len(suffix)], SUFFIXES[suffix][0]
    # units that only records of others have (displacement_in, force_kip); a name before it that says nothing may be all name
    base, _, unit = lower.rpartition("_")
    for quantity, names in SYNONYMS.items():
        if base in names and unit in UNITS[quantity]:
            return base, unit
    return lower, ""


def _quantity(
    quantity: str, columns: Mapping[str, Array], wanted: str, stated: str, problems: list[str]
) -> tuple[str | None, float]:
    """Find one column and its factor to SI; add a problem where it cannot be found or has no unit."""
    available = ", ".join(columns) or "none"
    if wanted:
        if wanted not in columns:
            problems.append(f"{quantity}: no column {wanted!r}; available: {available}")
            return None, 1.0
        found = wanted
    else:
        matches = [c for c in columns if _split_unit(c)[0] in SYNONYMS[quantity]]
        if len(matches) != 1:
            what = "no column looks like it" if not matches else f"several columns could be it ({', '.join(matches)})"
            problems.append(f"{quantity}: {what}; name it with --{quantity}; available: {available}")
            return None, 1.0
        found = matches[0]
    own = _split_unit(found)[1].lower()
    foreign = [q for q, units in UNITS.items() if q != quantity and own in {u.lower() for u in units}]
    if own and foreign and own not in {u.lower() for u in UNITS[quantity]}:
        problems.append(f"{quantity}: column {found!r} is a {foreign[0]} by the unit in its name; available: {available}")
        return None, 1.0
    unit = stated or _split_unit(found)[1] or ("s" if quantity == "time" else "")
    table = {u.lower(): f for u, f in UNITS[quantity].items()}
    if not unit:
        problems.append(
            f"{quantity}: the unit of column {found!r} is not stated; name the column e.g. {quantity}_"
            f"{'mm' if quantity == 'displacement' else 'kn'} or pass --{quantity}-unit ({', '.join(UNITS[quantity])})"
        )
        return None, 1.0
    if unit.lower() not in table:
        problems.append(f"{quantity}: unit {unit!r} of column {found!r} is unknown; allowed: {', '.join(UNITS[quantity])}")
        return None, 1.0
    return found, table[unit.lower()]
