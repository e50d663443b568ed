# Copyright 2026 ride_estimation contributors
"""JSON as every verb writes it: readable, valid (no NaN or infinity), arrays as lists."""

from __future__ import annotations

import enum
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


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


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document as indented JSON with a final newline."""
    path.write_text(json.dumps(jsonable(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
