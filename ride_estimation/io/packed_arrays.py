# Copyright 2026 ride_estimation contributors
"""Large lists of numbers inside a JSON document as base64 of their bytes: exact, smaller and much faster to write."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ride_estimation.errors import InputDataError

#: numbers from which a list is packed [-]; shorter ones stay readable
LEAST_PACKED = 64
#: byte order and type of the packed numbers
_FORM = np.dtype("<f8")
_DATA, _SHAPE = "float64_base64", "shape"
#: levels of lists a packed array may have; the states of the estimators have three
_MOST_LEVELS = 8


def pack(value: Any) -> Any:
    """Return a JSON value whose regular lists of many floating-point numbers are packed.

    Parameters
    ----------
    value
        Mappings, lists, numbers and texts.

    Raises
    ------
    InputDataError
        A number of a list that would be packed is not finite.
    """
    if isinstance(value, Mapping):
        return {key: pack(inner) for key, inner in value.items()}
    if not isinstance(value, (list, tuple)):
        return value
    try:
        numbers = np.array(value)
    except ValueError:  # lists of different lengths
        return [pack(inner) for inner in value]
    if numbers.dtype != np.float64 or numbers.size < LEAST_PACKED:
        return [pack(inner) for inner in value]
    if not np.isfinite(numbers).all():
        raise InputDataError("a list of numbers holds one that is not finite")
    return {_DATA: base64.b64encode(numbers.astype(_FORM).tobytes()).decode("ascii"), _SHAPE: list(numbers.shape)}


def unpack(value: Any) -> Any:
    """Return what :func:`pack` was given, tuples as lists.

    Raises
    ------
    InputDataError
        Packed numbers that are not what their shape says.
    """
    if isinstance(value, Mapping):
        return _array(value[_DATA], value[_SHAPE]) if set(value) == {_DATA, _SHAPE} else {k: unpack(v) for k, v in value.items()}
    return [unpack(inner) for inner in value] if isinstance(value, list) else value


def _array(data: Any, shape: Any) -> list[Any]:
    regular = isinstance(shape, list) and 0 < len(shape) <= _MOST_LEVELS and all(type(n) is int and n > 0 for n in shape)
    if not regular or not isinstance(data, str):
        raise InputDataError(f"packed numbers need base64 text and a shape of positive whole numbers, not {shape!r:.80}")
    try:
        content = base64.b64decode(data, validate=True)
    except ValueError as error:
        raise InputDataError(f"packed numbers are not base64 ({error})") from error
    if len(content) != _FORM.itemsize * math.prod(shape):
        raise InputDataError(f"packed numbers: {len(content)} bytes are not {shape} numbers of {_FORM.itemsize} bytes")
    found: list[Any] = np.frombuffer(content, dtype=_FORM).reshape(shape).tolist()
    return found
