# Copyright 2026 ride_estimation contributors
"""Tables of measured columns (CSV with a header) whose names carry the unit."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.units import split_suffix

Array = NDArray[np.float64]


def read_table(path: Path) -> dict[str, Array]:
    """Read a CSV file with a header into SI columns by name without unit suffix (``rise_mm`` -> ``rise`` in m).

    Raises
    ------
    InputDataError
        Missing or empty file, no header, a cell that is no finite number (row and column are named), unequal rows.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputDataError(f"{path}: cannot be read as a table: {error}") from error
    if len(rows) < 2:
        raise InputDataError(f"{path}: a header line and at least one row are needed")
    header = [cell.strip() for cell in rows[0]]
    columns: dict[str, list[float]] = {name: [] for name in header}
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise InputDataError(f"{path}: row {number} has {len(row)} cells, the header has {len(header)}")
        for name, cell in zip(header, row):
            columns[name].append(_number(path, number, name, cell))
    found = {}
    for name, values in columns.items():
        short, _, factor = split_suffix(name)
        found[short] = factor * np.array(values)
    return found


def column(table: dict[str, Array], path: Path, name: str) -> Array:
    """Return a column or say which there are."""
    if name not in table:
        raise InputDataError(f"{path}: no column {name!r} (with unit, such as {name}_m or {name}_n); it has {', '.join(table)}")
    return table[name]


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError as error:
        raise InputDataError(f"{path}: row {row}, column {name}: {cell!r} is not a number") from error
    if not np.isfinite(value):
        raise InputDataError(f"{path}: row {row}, column {name}: {cell!r} is not finite")
    return value
