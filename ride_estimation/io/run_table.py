# Copyright 2026 ride_estimation contributors
"""One table with a row per run, as CSV or Parquet; units in the headings."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import replacing
from ride_estimation.text import printable, table_cell

Cell = str | float | None


def write_run_table(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Cell]]) -> None:
    """Write a table; the ending of the path says the format (``.csv`` or ``.parquet``).

    Parameters
    ----------
    path
        File to write.
    columns
        Headings in order.
    rows
        Cells by heading; missing ones stay empty.

    Raises
    ------
    InputDataError
        Unknown ending, or the extra ``files`` is needed for Parquet.
    """
    if path.suffix == ".csv":
        with replacing(path) as new, new.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow([table_cell(column) for column in columns])
            writer.writerows([table_cell(row.get(column)) for column in columns] for row in rows)
        return
    if path.suffix != ".parquet":
        raise InputDataError(f"{path}: a table of runs is written as .csv or .parquet")
    arrow, parquet = require_parquet()
    arrays = {}
    for column in columns:
        cells = [printable(cell) if isinstance(cell, str) else cell for cell in (row.get(column) for row in rows)]
        text = any(isinstance(cell, str) for cell in cells)
        arrays[column] = arrow.array(cells, arrow.string() if text else arrow.float64())
    with replacing(path) as new:
        parquet.write_table(arrow.table(arrays), new)


def require_parquet() -> tuple[Any, Any]:
    """Return pyarrow and its Parquet module, or say which extra is missing."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise InputDataError("Parquet files need the extra 'files': pip install 'ride_estimation[files]'") from error
    return pyarrow, pyarrow.parquet
