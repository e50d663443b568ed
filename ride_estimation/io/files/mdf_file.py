# Copyright 2026 ride_estimation contributors
"""MDF 3 and 4 (``.mf4``, ``.mdf``, ``.dat``) through asammdf."""

from __future__ import annotations

import datetime
import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.io.bag_source import READER_ERRORS
from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel, MeasurementFile, require


def read_mdf(path: Path) -> MeasurementFile:
    """Read all numeric channels with their own time base, conversions applied."""
    asammdf = require("asammdf", "MDF")
    channels = []
    with _opened(asammdf, path) as file:
        for number, group in enumerate(file.groups):
            master = file.masters_db.get(number)
            for place in range(len(group.channels)):
                if place == master:
                    continue
                signal = file.get(group=number, index=place)
                values = np.asarray(signal.samples)
                if values.ndim == 1 and values.dtype.kind in "iufb" and len(values):
                    times = np.asarray(signal.timestamps, dtype=float)
                    channels.append(FileChannel(str(signal.name), str(signal.unit or ""), times, values.astype(float)))
        start = file.header.start_time
    stamp = round(start.timestamp() * 1e6) * 1000 if isinstance(start, datetime.datetime) else 0
    return MeasurementFile(str(path), stamp if stamp > 0 else UNKNOWN_START_NS, tuple(channels))


def _opened(asammdf: Any, path: Path) -> Any:
    """Return an open file; what asammdf cannot open prints a traceback where it is destroyed, beside the error: here, unseen."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        try:
            return asammdf.MDF(path)
        except READER_ERRORS as error:
            words = " ".join(str(error).split()) or type(error).__name__
        gc.collect()
        raise ValueError(words)
    finally:
        sys.unraisablehook = hook


def write_mdf(path: Path, groups: tuple[tuple[FileChannel, ...], ...], start_ns: int) -> None:
    """Write an MDF 4.10 file, one channel group per time base.

    Parameters
    ----------
    path
        File to write.
    groups
        Channels that share a time base.
    start_ns
        Unix time of second zero [ns].
    """
    asammdf = require("asammdf", "MDF")
    with asammdf.MDF(version="4.10") as file:
        file.header.start_time = datetime.datetime.fromtimestamp(start_ns * 1e-9, tz=datetime.UTC)
        for group in groups:
            signals = [asammdf.Signal(samples=c.values, timestamps=c.time_s, name=c.name, unit=c.unit) for c in group]
            file.append(signals, comment="ride_estimation", common_timebase=True)
        file.save(path, overwrite=True)
