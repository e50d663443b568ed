# Copyright 2026 ride_estimation contributors
"""Parquet: one column per channel, the unit in the heading ``name [unit]`` or in the metadata of the field."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.files.channels import (
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    require,
    split_heading,
    table_channels,
)


def read_parquet(path: Path, time_name: str = "", rate_hz: float = 0.0) -> MeasurementFile:
    """Read the numeric columns of a Parquet file; parameters as :func:`~ride_estimation.io.files.csv_file.read_csv`."""
    require("pyarrow", "Parquet")
    parquet = require("pyarrow.parquet", "Parquet")
    table = parquet.read_table(path)
    headings, columns = [], []
    for field in table.schema:
        try:
            values = np.asarray(table.column(field.name).to_numpy(), dtype=float)
        except (TypeError, ValueError):
            continue  # texts are no channels
        name, unit = split_heading(field.name)
        metadata = field.metadata or {}
        headings.append((name, unit or metadata.get(b"unit", b"").decode("utf-8", "replace")))
        columns.append(values)
    if not columns:
        raise InputDataError(f"{path}: no numeric column")
    return MeasurementFile(str(path), UNKNOWN_START_NS, table_channels(path, headings, columns, time_name, rate_hz))


def write_parquet(path: Path, channels: tuple[FileChannel, ...]) -> None:
    """Write channels that share one time base; the unit stands in the metadata of each field."""
    arrow = require("pyarrow", "Parquet")
    parquet = require("pyarrow.parquet", "Parquet")
    fields = [arrow.field("time", arrow.float64(), metadata={"unit": "s"})]
    fields += [arrow.field(c.name, arrow.float64(), metadata={"unit": c.unit}) for c in channels]
    columns = [arrow.array(channels[0].time_s), *(arrow.array(np.asarray(c.values, dtype=float)) for c in channels)]
    parquet.write_table(arrow.Table.from_arrays(columns, schema=arrow.schema(fields)), path)
