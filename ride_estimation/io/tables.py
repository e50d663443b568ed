# Copyright 2026 ride_estimation contributors
"""Tables of measured columns (CSV with a header) whose names carry the unit."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.text_table import TextTable, read_text_table
from ride_estimation.units import si_unit, split_suffix, suffixes_of

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Table:
    """Columns in SI by name without unit suffix (``rise_mm`` -> ``rise`` in m).

    Attributes
    ----------
    path
        Where it was read, for messages.
    columns
        Values in SI, all of one length.
    units
        SI unit by name, empty where the name had no suffix.
    """

    path: Path
    columns: Mapping[str, Array]
    units: Mapping[str, str]

    def column(self, name: str, unit: str = "") -> Array:
        """Return a column.

        Parameters
        ----------
        name
            Without unit suffix.
        unit
            SI unit it must have; any by default.

        Raises
        ------
        InputDataError
            No such column, or one of no or of another unit.
        """
        if name not in self.columns:
            such = f" (such as {name}{suffixes_of(unit)[0]})" if unit else ""
            raise InputDataError(f"{self.path}: no column {name!r}{such}; it has {', '.join(self.headings())}")
        if unit and self.units[name] != unit:
            is_in = f"is in {self.units[name]}" if self.units[name] else "has no unit in its name"
            allowed = " or ".join(f"{name}{suffix}" for suffix in suffixes_of(unit))
            raise InputDataError(f"{self.path}: column {name!r} {is_in}; needed is {unit}: {allowed}")
        return self.columns[name]

    def headings(self) -> list[str]:
        """Return the names with their SI units."""
        return [f"{name} [{unit}]" if unit else name for name, unit in self.units.items()]


def read_table(path: Path) -> Table:
    """Read a CSV file with a header line, see :mod:`ride_estimation.io.text_table`.

    Raises
    ------
    InputDataError
        Missing or empty file, no header, a cell that is no finite number (row and column are named), unequal rows, one quantity
        in two columns.
    """
    found = read_text_table(path)
    if len(found.rows) < 2:
        raise InputDataError(f"{path}: a header line and at least one row are needed")
    header = [cell.strip() for cell in found.rows[0]]
    columns, units = {}, {}
    for place, name in enumerate(header):
        short, unit, factor = split_suffix(name)
        if short in columns:
            raise InputDataError(f"{path}: two columns are called {short!r} when their units are left away")
        values = [_number(found, number, name, row[place]) for number, row in zip(found.lines[1:], found.rows[1:])]
        columns[short], units[short] = factor * np.array(values), si_unit(unit)
    return Table(path, columns, units)


def _number(table: TextTable, row: int, name: str, cell: str) -> float:
    try:
        value = table.number(cell)
    except ValueError as error:
        raise InputDataError(f"{table.path}: row {row}, column {name}: {cell!r} is not a number") from error
    if not np.isfinite(value):
        raise InputDataError(f"{table.path}: row {row}, column {name}: {cell!r} is not finite")
    return value
