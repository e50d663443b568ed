# Copyright 2026 ride_estimation contributors
"""Parquet: one column per channel, the unit in the heading ``name [unit]`` or in the metadata of the field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import TooLargeError, allowance
from ride_estimation.io.files.channels import (
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    TimeSource,
    require,
    split_heading,
    table_channels,
)


def read_parquet(path: Path, time: TimeSource) -> MeasurementFile:
    """Read the numeric columns of a Parquet file; parameters as :func:`~ride_estimation.io.files.csv_file.read_csv`."""
    require("pyarrow", "Parquet")
    parquet = require("pyarrow.parquet", "Parquet")
    file = parquet.ParquetFile(path)
    fields = [field for field in file.schema_arrow if _is_number(field.type)]
    limit = allowance(path.stat().st_size)
    # as doubles, and once more where the numbers of the time are compared
    parts = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
    if 8 * sum(part.num_rows for part in parts) * (len(fields) + 1) > limit:
        raise TooLargeError(limit)
    headings, columns = [], []
    for field in fields:
        values = file.read([field.name]).column(field.name).to_numpy().astype(float)
        name, unit = split_heading(field.name)
        metadata = field.metadata or {}
        headings.append((name, unit or metadata.get(b"unit", b"").decode("utf-8", "replace")))
        columns.append(values)
    if not columns:
        raise InputDataError(f"{path}: no numeric column")
    return MeasurementFile(str(path), UNKNOWN_START_NS, table_channels(path, headings, columns, time))


def _is_number(kind: Any) -> bool:
    """Return whether a column can be a channel; texts, lists and times are none."""
    types = require("pyarrow.types", "Parquet")
    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_decimal(kind))


def write_parquet(path: Path, channels: tuple[FileChannel, ...]) -> None:
    """Write channels that share one time base; the unit stands in the metadata of each field."""
    arrow = require("pyarrow", "Parquet")
    parquet = require("pyarrow.parquet", "Parquet")
    fields = [arrow.field("time", arrow.float64(), metadata={"unit": "s"})]
    fields += [arrow.field(c.name, arrow.float64(), metadata={"unit": c.unit}) for c in channels]
    columns = [arrow.array(channels[0].time_s), *(arrow.array(np.asarray(c.values, dtype=float)) for c in channels)]
    parquet.write_table(arrow.Table.from_arrays(columns, schema=arrow.schema(fields)), path)
