# Copyright 2026 ride_estimation contributors
"""TDMS (LabVIEW, DIAdem, FlexLogger) through npTDMS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.files.channels import (
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    TimeSource,
    even_time,
    require,
    table_channels,
)


def read_tdms(path: Path, time: TimeSource) -> MeasurementFile:
    """Read all numeric channels; the time comes from the waveform properties, or from a time channel of the group.

    Parameters
    ----------
    path
        TDMS file.
    time
        For groups without waveform properties, see :func:`~ride_estimation.io.files.channels.table_channels`.
    """
    nptdms = require("nptdms", "TDMS")
    file = nptdms.TdmsFile.read(path)
    channels: list[FileChannel] = []
    start_ns = UNKNOWN_START_NS
    for group in file.groups():
        plain = []
        for channel in group.channels():
            values = np.asarray(channel[:])
            if values.ndim != 1 or values.dtype.kind not in "iufb" or not len(values):
                continue
            properties = channel.properties
            unit = str(properties.get("unit_string", "") or properties.get("NI_UnitDescription", ""))
            step = properties.get("wf_increment")
            if step:
                offset = float(properties.get("wf_start_offset", 0.0))
                seconds = even_time(path, str(channel.name), offset, float(step), len(values))
                channels.append(FileChannel(str(channel.name), unit, seconds, values.astype(float)))
                begin = properties.get("wf_start_time")
                if isinstance(begin, np.datetime64) and not np.isnat(begin):
                    start_ns = int(begin.astype("datetime64[ns]").astype(np.int64)) or start_ns
            else:
                plain.append((str(channel.name), unit, values.astype(float)))
        if plain:
            if len({len(values) for _, _, values in plain}) > 1:
                raise InputDataError(f"{path}: group {group.name!r}: channels without waveform properties differ in length")
            headings = [(name, unit) for name, unit, _ in plain]
            channels += table_channels(path, headings, [values for _, _, values in plain], time)
    return MeasurementFile(str(path), start_ns if start_ns > 0 else UNKNOWN_START_NS, tuple(channels))
