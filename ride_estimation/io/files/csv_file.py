# Copyright 2026 ride_estimation contributors
"""CSV: a header ``name [unit]``, one time column; :mod:`ride_estimation.io.text_table` says which separators and encodings."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.files.channels import (
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    split_heading,
    table_channels,
    unit_factor,
)
from ride_estimation.io.text_table import TextTable, read_text_table
from ride_estimation.text import table_cell

Array = NDArray[np.float64]


def read_csv(path: Path, time_name: str = "", rate_hz: float = 0.0) -> MeasurementFile:
    """Read a CSV file.

    Parameters
    ----------
    path
        Text file; a second line of units is understood.
    time_name, rate_hz
        See :func:`~ride_estimation.io.files.channels.table_channels`.

    Raises
    ------
    InputDataError
        No table, unequal rows, a cell that is no number (row and column are named).
    """
    found = read_text_table(path)
    rows = found.rows
    if len(rows) < 3:
        raise InputDataError(f"{path}: {'a header and at least two rows are needed' if rows else 'the file is empty'}")
    headings = [split_heading(cell) for cell in rows[0]]
    first = 1
    if not any(_is_number(cell, found) for cell in rows[1]):
        headings = [(name, unit or cell.strip().strip("[]()")) for (name, unit), cell in zip(headings, rows[1])]
        first = 2
    table = np.empty((len(rows) - first, len(headings)))
    for number, row in enumerate(rows[first:]):
        try:
            table[number] = [found.number(cell) if cell.strip() else np.nan for cell in row]
        except ValueError:
            table[number] = [_number(found, number + first, headings[i][0], cell) for i, cell in enumerate(row)]
    columns = [np.ascontiguousarray(column) for column in table.T]
    return MeasurementFile(str(path), UNKNOWN_START_NS, table_channels(path, headings, columns, time_name, rate_hz))


def write_csv(path: Path, channels: tuple[FileChannel, ...]) -> None:
    """Write channels that share one time base; numbers come back bit by bit."""
    headings = ["time [s]", *(table_cell(f"{c.name} [{c.unit}]" if c.unit else c.name) for c in channels)]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(headings)
        writer.writerows(zip(channels[0].time_s.tolist(), *(c.values.tolist() for c in channels)))


def _is_number(cell: str, table: TextTable) -> bool:
    try:
        table.number(cell)
    except ValueError:
        return unit_factor(cell) is None and not cell.strip()
    return True


def _number(table: TextTable, row: int, name: str, cell: str) -> float:
    if not cell.strip():
        return float("nan")
    try:
        return table.number(cell)
    except ValueError as error:
        raise InputDataError(f"{table.path}: row {table.lines[row]}, column {name}: {cell!r} is not a number") from error
