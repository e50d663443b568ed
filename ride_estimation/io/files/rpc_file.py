# Copyright 2026 ride_estimation contributors
"""RPC III (``.rpc``, ``.rsp``, ``.drv``) through rpc3-file."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np

from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel, MeasurementFile, even_time, require


def read_rpc(path: Path) -> MeasurementFile:
    """Read all channels; the format has no start time."""
    rpc3 = require("rpc3", "RPC III")
    with contextlib.redirect_stderr(io.StringIO()):  # it draws a bar of progress
        found, _ = rpc3.read(str(path))
    channels = []
    for channel in found or ():
        values = np.asarray(channel.data, dtype=float)
        name = str(channel.name).strip()
        time = even_time(path, name, float(channel.x0), float(channel.dt), len(values))
        channels.append(FileChannel(name, str(channel.unit).strip(), time, values))
    return MeasurementFile(str(path), UNKNOWN_START_NS, tuple(channels))


def write_rpc(path: Path, channels: tuple[FileChannel, ...]) -> None:
    """Write channels of one even time base as 32-bit numbers; the format keeps no start time."""
    rpc3 = require("rpc3", "RPC III")
    step = float(channels[0].time_s[-1] - channels[0].time_s[0]) / (len(channels[0].time_s) - 1)
    found = [rpc3.Channel(c.name, c.unit, step, np.asarray(c.values)) for c in channels]
    whole = path.with_name(f"{path.name}.rpc")  # it adds this ending to names of others, .drv among them
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            rpc3.write(str(whole), found, datatype=float, overwrite=True)
        whole.replace(path)
    finally:
        whole.unlink(missing_ok=True)
