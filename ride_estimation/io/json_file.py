# Copyright 2026 ride_estimation contributors
"""JSON as every verb writes it: readable, valid (no NaN or infinity), arrays as lists."""

from __future__ import annotations

import contextlib
import enum
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.bounded import read_text


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


@contextlib.contextmanager
def written_last(path: Path, document: Mapping[str, Any]) -> Iterator[None]:
    """Remove a JSON file, let the block write the files that belong to it, then write it: a folder that has it is complete.

    Parameters
    ----------
    path
        File to write.
    document
        Its content; the block may still add to it.
    """
    path.unlink(missing_ok=True)
    yield
    write_json(path, document)
