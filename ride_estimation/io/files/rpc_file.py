# Copyright 2026 ride_estimation contributors
"""RPC III (``.rpc``, ``.rsp``, ``.drv``) through rpc3-file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel, MeasurementFile, even_time, require


def read_rpc(path: Path) -> MeasurementFile:
    """Read all channels; the format has no start time."""
    rpc3 = require("rpc3", "RPC III")
    found, _ = rpc3.read(str(path))
    channels = []
    for channel in found or ():
        values = np.asarray(channel.data, dtype=float)
        name = str(channel.name).strip()
        time = even_time(path, name, float(channel.x0), float(channel.dt), len(values))
        channels.append(FileChannel(name, str(channel.unit).strip(), time, values))
    return MeasurementFile(str(path), UNKNOWN_START_NS, tuple(channels))
