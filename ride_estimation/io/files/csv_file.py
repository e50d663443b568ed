# Copyright 2026 ride_estimation contributors
"""CSV: a header ``name [unit]``, one time column; :mod:`ride_estimation.io.text_table` says which separators and encodings."""

from __future__ import annotations

import csv
import datetime
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.document import shown
from ride_estimation.io.files.channels import (
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    TimeSource,
    not_read,
    split_heading,
    table_channels,
    time_factor,
)
from ride_estimation.io.text_table import TextTable, read_text_table
from ride_estimation.text import table_cell

Array = NDArray[np.float64]

_TIME_OF_DAY = re.compile(r"\d\d?:\d\d:\d\d([.,]\d+)?")
_GERMAN_DATE = re.compile(r"^(\d\d)\.(\d\d)\.(\d\d\d\d)(?=[ T])")
_EPOCH = datetime.date(1970, 1, 1)
_HALF_A_DAY_S = 43200.0


def read_csv(path: Path, time: TimeSource) -> MeasurementFile:
    """Read a CSV file.

    Parameters
    ----------
    path
        Text file; a line of units below the header is understood. A column with a cell that is no number (status, marker,
        comment) is no channel; a time may be dates or times of day.
    time
        See :func:`~ride_estimation.io.files.channels.table_channels`.

    Raises
    ------
    InputDataError
        No table, unequal rows, no time.
    """
    found = read_text_table(path)
    rows = found.rows
    if len(rows) < 3:
        raise InputDataError(f"{path}: {'a header and at least two rows are needed' if rows else 'the file is empty'}")
    headings = [split_heading(cell) for cell in rows[0]]
    first = 1
    if not any(_is_number(cell, found) for cell in rows[1]) and any(cell.strip() for cell in rows[1]):
        headings = [(name, unit or cell.strip().strip("[]()")) for (name, unit), cell in zip(headings, rows[1])]
        first = 2
    kept: list[tuple[str, str]] = []
    columns: list[Array] = []
    unreadable: dict[str, str] = {}
    texts: list[tuple[int, str]] = []
    for heading, cells in zip(headings, zip(*rows[first:], strict=True), strict=True):
        try:
            columns.append(np.array([found.number(cell) if cell.strip() else np.nan for cell in cells]))
            kept.append(heading)
        except ValueError:
            clock = clock_seconds(cells) if time_factor(heading[0], "") is not None or heading[0] == time.channel else None
            if clock is not None:
                columns.append(clock)
                kept.append((heading[0], "s"))
                continue
            row = next(i for i, cell in enumerate(cells) if cell.strip() and not _is_number(cell, found))
            unreadable[heading[0]] = f"row {found.lines[row + first]}: {shown(cells[row])} is not a number"
            texts += _begins(cells, found)
    if not columns:
        raise InputDataError(f"{path}: no column of numbers{not_read(unreadable)}")
    try:
        channels = table_channels(path, kept, columns, time)
    except InputDataError as error:
        raise InputDataError(f"{error}{not_read(unreadable)}") from error
    seconds = channels[0].time_s if channels else np.zeros(0)
    events = tuple((float(seconds[row]), text) for row, text in texts if row < len(seconds))
    return MeasurementFile(str(path), UNKNOWN_START_NS, channels, unreadable, events)


def clock_seconds(cells: Sequence[str]) -> Array | None:
    """Return the times that cells say as dates and times of day [s], None where one of them does not; empty cells are NaN.

    Dates are as ISO 8601 or German (31.12.2026 23:59:59,5) and count from 1970 in UTC where they name no other zone; times of
    day alone (23:59:59.5) count from midnight and go on after the next.

    Examples
    --------
    >>> clock_seconds(["23:59:59.5", "", "00:00:00,5"])
    array([86399.5,     nan, 86400.5])
    """
    found = np.full(len(cells), np.nan)
    days, before = 0, -np.inf
    for place, text in enumerate(map(str.strip, cells)):
        if not text:
            continue
        try:
            if _TIME_OF_DAY.fullmatch(text):
                of_day = datetime.time.fromisoformat(text if text[2] == ":" else f"0{text}")
                seconds = datetime.datetime.combine(_EPOCH, of_day, datetime.UTC).timestamp()
                days += seconds < before - _HALF_A_DAY_S
                before = seconds
                found[place] = seconds + 2.0 * _HALF_A_DAY_S * days
                continue
            german = _GERMAN_DATE.match(text)
            moment = datetime.datetime.fromisoformat(
                f"{german[3]}-{german[2]}-{german[1]}{text[german.end() :]}" if german else text
            )
        except ValueError:
            return None
        found[place] = (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()
    return found


def _begins(cells: Sequence[str], table: TextTable) -> list[tuple[int, str]]:
    """Return where a text begins in a column, and the text: a marker may stand in one row or in all rows until the next."""
    found, before = [], ""
    for row, cell in enumerate(cells):
        text = cell.strip()
        if text and text != before and not _is_number(text, table):
            found.append((row, text))
        before = text
    return found


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
        return False
    return True
