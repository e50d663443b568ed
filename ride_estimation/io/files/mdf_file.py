# Copyright 2026 ride_estimation contributors
"""MDF 3 and 4 (``.mf4``, ``.mdf``, ``.dat``) through asammdf."""

from __future__ import annotations

import contextlib
import datetime
import gc
import mmap
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.io.bag_source import READER_ERRORS
from ride_estimation.io.bounded import DamagedError, TooLargeError, allowance, unpack
from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel, MeasurementFile, require

#: a compressed block (DZBLOCK of ASAM MDF 4): from its name to its data [bytes], and where its kind and sizes stand
_DZ_HEAD, _DZ_FIELDS = 48, struct.Struct("<26xB5xQQ")
#: how the data of a compressed block are packed by kind; the others are the same with the bytes in another order
_DZ_KINDS = {0: "deflate", 1: "deflate", 2: "zstd", 3: "zstd", 4: "lz4", 5: "lz4"}
#: conversions that make texts of numbers, and channels whose values lie elsewhere, by the first digit of the version
_TEXTS = {"4": range(7, 12), "3": (11, 12), "2": (11, 12)}
_VARIABLE_LENGTH = 1


def read_mdf(path: Path) -> MeasurementFile:
    """Read all numeric channels with their own time base, conversions applied; texts are passed over unread."""
    asammdf = require("asammdf", "MDF")
    _check_compressed_blocks(path)
    channels = []
    with _opened(asammdf, path) as file:
        _check_length(file, path)
        for number, group in enumerate(file.groups):
            master, shared = file.masters_db.get(number), None
            for place, channel in enumerate(group.channels):
                if place == master or _is_text(channel, file.version):
                    continue
                signal = file.get(group=number, index=place)
                values = np.asarray(signal.samples)
                if values.ndim == 1 and values.dtype.kind in "iufb" and len(values):
                    times = np.asarray(signal.timestamps, dtype=float)
                    shared = shared if shared is not None and np.array_equal(shared, times) else times
                    channels.append(FileChannel(str(signal.name), str(signal.unit or ""), shared, values.astype(float)))
        start = file.header.start_time
    stamp = round(start.timestamp() * 1e6) * 1000 if isinstance(start, datetime.datetime) else 0
    return MeasurementFile(str(path), stamp if stamp > 0 else UNKNOWN_START_NS, tuple(channels))


def _is_text(channel: Any, version: str) -> bool:
    conversion = getattr(channel.conversion, "conversion_type", 0) if channel.conversion is not None else 0
    elsewhere = version[0] == "4" and channel.channel_type == _VARIABLE_LENGTH
    return elsewhere or conversion in _TEXTS.get(version[0], ())


def _check_length(file: Any, path: Path) -> None:
    """Refuse groups of more samples than the file can hold: a list may name one block a million times.

    Raises
    ------
    TooLargeError
        Records and channels together need more than :func:`~ride_estimation.io.bounded.allowance` says.
    """
    limit = allowance(path.stat().st_size)
    needed = 0
    for group in file.groups:
        needed += group.channel_group.cycles_nr * (group.channel_group.samples_byte_nr + 8 * len(group.channels))
    if needed > limit:
        raise TooLargeError(limit)


def _check_compressed_blocks(path: Path) -> None:
    """Refuse compressed blocks that unpack to more than they state, which asammdf would do.

    Raises
    ------
    TooLargeError
        Such a block, or all of them together are larger than :func:`~ride_estimation.io.bounded.allowance` says.
    """
    left = allowance(path.stat().st_size)
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(b"##DZ")
        while 0 <= at <= len(data) - _DZ_HEAD:
            kind, stated, packed_size = _DZ_FIELDS.unpack_from(data, at)
            begin = at + _DZ_HEAD
            with contextlib.suppress(DamagedError):  # asammdf says so, if it is a block at all
                left -= len(unpack(data[begin : begin + packed_size], _DZ_KINDS.get(kind, ""), min(stated, left)))
            at = data.find(b"##DZ", at + 4)


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
