# Copyright 2026 ride_estimation contributors
"""CSV: a header ``name [unit]``, one time column, comma, semicolon or tab; decimal comma where semicolons separate."""

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

Array = NDArray[np.float64]


def read_csv(path: Path, time_name: str = "", rate_hz: float = 0.0) -> MeasurementFile:
    """Read a CSV file.

    Parameters
    ----------
    path
        Text file; lines that begin with ``#`` are passed over, a second line of units is understood.
    time_name, rate_hz
        See :func:`~ride_estimation.io.files.channels.table_channels`.

    Raises
    ------
    InputDataError
        No table, unequal rows, a cell that is no number (row and column are named).
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip() and line[0] != "#"]
    except (OSError, UnicodeDecodeError) as error:
        raise InputDataError(f"{path}: cannot be read as text: {error}") from error
    if len(lines) < 3:
        raise InputDataError(f"{path}: a header and at least two rows are needed")
    separator = max(";\t,", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=separator))
    headings = [split_heading(cell) for cell in rows[0]]
    first = 1
    if len(rows[1]) == len(headings) and not any(_is_number(cell, separator) for cell in rows[1]):
        headings = [(name, unit or cell.strip().strip("[]()")) for (name, unit), cell in zip(headings, rows[1])]
        first = 2
    table = np.empty((len(rows) - first, len(headings)))
    for number, row in enumerate(rows[first:]):
        if len(row) != len(headings):
            raise InputDataError(f"{path}: row {number + first + 1} has {len(row)} cells, the header has {len(headings)}")
        try:
            table[number] = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError:
            table[number] = [_number(path, number + first + 1, headings[i][0], cell, separator) for i, cell in enumerate(row)]
    columns = [np.ascontiguousarray(column) for column in table.T]
    return MeasurementFile(str(path), UNKNOWN_START_NS, table_channels(path, headings, columns, time_name, rate_hz))


def write_csv(path: Path, channels: tuple[FileChannel, ...]) -> None:
    """Write channels that share one time base; numbers come back bit by bit."""
    headings = ["time [s]", *(f"{c.name} [{c.unit}]" if c.unit else c.name for c in channels)]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(headings)
        writer.writerows(zip(channels[0].time_s.tolist(), *(c.values.tolist() for c in channels)))


def _is_number(cell: str, separator: str) -> bool:
    try:
        float(cell.replace(",", ".") if separator == ";" else cell)
    except ValueError:
        return unit_factor(cell) is None and not cell.strip()
    return True


def _number(path: Path, row: int, name: str, cell: str, separator: str) -> float:
    text = cell.strip()
    if not text:
        return float("nan")
    try:
        return float(text.replace(",", ".") if separator == ";" else text)
    except ValueError as error:
        raise InputDataError(f"{path}: row {row}, column {name}: {cell!r} is not a number") from error
