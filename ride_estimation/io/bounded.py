# Copyright 2026 ride_estimation contributors
"""Limits on what a file may unpack to, so that a small hostile or damaged file cannot fill the memory.

A file may unpack to :data:`SPARE_BYTES` plus :data:`LARGEST_RATIO` times its own size. Recordings of accelerometers compress two-
to tenfold, covariances that are always zero up to a hundredfold.
"""

from __future__ import annotations

import bz2
import errno
import importlib
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError

#: what any file may unpack to, however small it is [bytes]
SPARE_BYTES = 64 << 20
#: what a file may unpack to beyond that, as multiple of its size
LARGEST_RATIO = 200
#: largest text file (vehicle, settings, scenario, state, result) that is read [bytes]; a real one has less than a hundredth
LARGEST_TEXT = 64 << 20


class TooLargeError(ValueError):
    """A file unpacks to more than :func:`allowance` says."""

    def __init__(self, limit: int) -> None:
        super().__init__(f"unpacks to more than {limit} bytes, which is refused")


class DamagedError(ValueError):
    """Compressed bytes that cannot be unpacked."""


def allowance(packed_bytes: int) -> int:
    """Return how many bytes a file or record of this size may unpack to."""
    return SPARE_BYTES + LARGEST_RATIO * packed_bytes


def zstd_module() -> Any:
    """Return the zstd module of Python 3.14 or its backport."""
    try:
        return importlib.import_module("compression.zstd")
    except ImportError:
        return importlib.import_module("backports.zstd")


def unpack(packed: bytes, compression: str, limit: int) -> bytes:
    """Return decompressed bytes, at most ``limit`` of them.

    Parameters
    ----------
    packed
        One or more frames.
    compression
        ``zstd``, ``lz4``, ``bz2`` or ``deflate``.
    limit
        Largest result [bytes].

    Raises
    ------
    TooLargeError
        More than that.
    DamagedError
        A frame that is damaged or cut off, or an unknown compression.
    """
    parts: list[bytes] = []
    size = 0
    rest = packed
    while rest:
        frame = _unpacker(compression)
        try:
            piece = frame.decompress(rest, limit - size + 1)
        except Exception as error:  # each library has its own: ZstdError, RuntimeError, OSError
            raise DamagedError(f"a compressed frame is damaged: {error}") from error
        size += len(piece)
        parts.append(piece)
        if size > limit:
            raise TooLargeError(limit)
        if not frame.eof:
            raise DamagedError("a compressed frame is cut off")
        rest = frame.unused_data or b""
    return parts[0] if len(parts) == 1 else b"".join(parts)


def unpack_what_is_there(packed: bytes, compression: str, limit: int) -> bytes:
    """Return the beginning of one frame, up to where it is damaged or cut off or longer than ``limit``."""
    frame, parts, size = _unpacker(compression), [], 0
    for start in range(0, len(packed), 4096):  # in pieces: an error late in the frame leaves what came before it
        try:
            piece = frame.decompress(packed[start : start + 4096], limit - size + 1)
        except Exception:  # each library has its own: ZstdError, RuntimeError, EOFError
            break
        size += len(piece)
        if size > limit:
            break
        parts.append(piece)
        if frame.eof:
            break
    return b"".join(parts)


def _unpacker(compression: str) -> Any:
    if compression == "zstd":
        return zstd_module().ZstdDecompressor()
    if compression == "lz4":
        return importlib.import_module("lz4.frame").LZ4FrameDecompressor()
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    if compression == "deflate":
        return zlib.decompressobj()
    raise DamagedError(f"compression {compression!r} is unknown")


def read_text(path: Path, limit: int = LARGEST_TEXT) -> str:
    """Return a text file of at most ``limit`` bytes; no more is read, whatever size the file states.

    Raises
    ------
    OSError, UnicodeDecodeError
        As ``Path.read_text``; a file that is too large is an ``OSError``.
    """
    with path.open("rb") as stream:
        data = stream.read(limit + 1)
    if len(data) > limit:
        raise OSError(errno.EFBIG, f"it has more than the {limit} bytes that are read", str(path))
    return data.decode("utf-8")


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of an ``.npz`` file; objects are refused, nothing in the file is executed.

    Raises
    ------
    InputDataError
        No such file, damaged, with objects in it, or larger unpacked than :func:`allowance` says.
    """
    try:
        limit = allowance(path.stat().st_size)
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > limit:
                raise InputDataError(f"{path}: unpacks to {size} bytes, more than the {limit} that are accepted")
            _check_headers(archive)
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except InputDataError:
        raise
    # numpy and zipfile raise many kinds on damaged files: BadZipFile, zlib.error, EOFError, SyntaxError...
    except Exception as error:
        raise InputDataError(f"{path}: not a readable npz file ({_words(error)})") from error


def _check_headers(archive: zipfile.ZipFile) -> None:
    """Compare the size each array claims with the bytes that are there; numpy would allocate what is claimed."""
    for entry in archive.infolist():
        with archive.open(entry) as stream:
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(stream)
            if dtype.hasobject:
                raise ValueError("holds Python objects, which are not loaded")
            claimed = float(dtype.itemsize)
            for length in shape:
                claimed *= length
            if claimed > entry.file_size:
                raise ValueError(f"{entry.filename} claims {claimed:.0f} bytes and has {entry.file_size}")


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
