# Copyright 2026 ride_estimation contributors
"""JSON as every verb writes it: readable, valid (no NaN or infinity), arrays as lists."""

from __future__ import annotations

import contextlib
import enum
import glob
import json
import math
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import read_text

#: age from which an unfinished file is nobody's any more [s]
_LEFTOVER_S = 3600.0


def jsonable(value: Any) -> Any:
    """Return a value made of JSON types; numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {str(k): jsonable(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    if isinstance(value, enum.Enum):
        return jsonable(value.value)
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [jsonable(v) for v in value]
    return value if value is None else str(value)


def read_json(path: Path) -> dict[str, Any]:
    """Return the object a JSON file holds.

    Raises
    ------
    InputDataError
        No such file, not JSON, nested too deeply, or no object.
    """
    try:
        document = json.loads(read_text(path))
    except OSError as error:
        raise InputDataError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, RecursionError) as error:
        raise InputDataError(f"{path}: not a JSON file ({error})") from error
    if not isinstance(document, dict):
        raise InputDataError(f"{path}: not a JSON object but a {type(document).__name__}")
    return document


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document as indented JSON with a final newline, completely or not at all."""
    text = json.dumps(jsonable(document), indent=2, ensure_ascii=False, allow_nan=False)
    write_atomically(path, text + "\n")


def write_atomically(path: Path, text: str) -> None:
    """Replace a text file so that whoever reads it, also after a power failure, finds the old or the new one, never a part.

    The new text goes to the disk under another name in the same folder; then the name changes, and the folder is written too.

    Parameters
    ----------
    path
        File to write.
    text
        Written as UTF-8; what cannot be written so (lone surrogates of names from outside) is written as ``?``.
    """
    data = text.encode("utf-8", "replace")
    _remove_leftovers(path)
    handle, name = tempfile.mkstemp(prefix=f".{path.name[:100]}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise
    with contextlib.suppress(OSError):  # some file systems cannot open folders
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _remove_leftovers(path: Path) -> None:
    """Remove what writers that were killed left beside the file more than an hour ago."""
    for left in path.parent.glob(f".{glob.escape(path.name[:100])}.*.tmp"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _LEFTOVER_S:
                left.unlink()


def _umask() -> int:
    """Return the file mode mask; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
