# Copyright 2026 ride_estimation contributors
"""LabVIEW measurement files (``.lvm``, text). Source: National Instruments, Specification for the LabVIEW Measurement File."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.document import shown
from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel, MeasurementFile, check_time, even_time
from ride_estimation.io.text_table import decoded

_END = "***End_of_Header***"


def read_lvm(path: Path) -> MeasurementFile:
    """Read the channels of a file of one segment; the column of comments is passed over.

    Raises
    ------
    InputDataError
        No such file, several segments, a cell that is no number (the line is named), or a time that does not rise.
    """
    lines = decoded(path).splitlines()
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if not lines or not lines[0].startswith("LabVIEW Measurement") or len(ends) < 2:
        raise InputDataError(f"{path}: no LabVIEW measurement file: two headers that end with {_END} are needed")
    if len(ends) > 2:
        raise InputDataError(f"{path}: {len(ends) - 1} segments; write the file with one header only (Multi_Headings No)")
    separator = "," if any(line.startswith("Separator,") for line in lines[: ends[0]]) else "\t"
    said = {cells[0]: cells[1:] for cells in (line.split(separator) for line in lines[: ends[1]])}
    point = (said.get("Decimal_Separator") or ["."])[0].strip() or "."
    heading = [cell.strip() for cell in lines[ends[1] + 1].split(separator)] if len(lines) > ends[1] + 1 else []
    columns = [i for i, name in enumerate(heading) if name not in ("X_Value", "Comment", "")]
    rows = [(i + 1, line.split(separator)) for i, line in enumerate(lines) if i > ends[1] + 1 and line.strip()]
    if len(rows) < 2 or not columns:
        raise InputDataError(f"{path}: at least one channel and two rows are needed")
    table = np.array([[_number(path, line, cells, i, point) for i in range(max(columns) + 1)] for line, cells in rows])
    channels = []
    for number, i in enumerate(columns):
        x = max((j for j in range(i) if heading[j] == "X_Value"), default=-1)
        if x >= 0 and np.any(np.isfinite(table[:, x])):
            time = table[:, x]
            check_time(path, heading[i], time)
        else:
            start, step = (_number(path, 0, said.get(key, []), number, point) for key in ("X0", "Delta_X"))
            time = even_time(path, heading[i], start, step, len(rows))
        units = said.get("Y_Unit_Label", [])
        channels.append(FileChannel(heading[i], units[number].strip() if number < len(units) else "", time, table[:, i]))
    return MeasurementFile(str(path), UNKNOWN_START_NS, tuple(channels))


def _number(path: Path, line: int, cells: list[str], place: int, point: str) -> float:
    """Return the number in a cell, NaN where it is empty or missing."""
    cell = cells[place].strip() if place < len(cells) else ""
    try:
        return float(cell.replace(point, ".")) if cell else float("nan")
    except ValueError as error:
        raise InputDataError(f"{path}: row {line}: {shown(cell)} is not a number") from error
