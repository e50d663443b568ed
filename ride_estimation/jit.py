# Copyright 2026 ride_estimation contributors
"""The one place of numba: compiled kernels where it is installed, the same plain Python where it is not.

Set ``RIDE_ESTIMATION_DISABLE_JIT=1`` to force plain Python.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

#: True where kernels are compiled
COMPILED: bool = importlib.util.find_spec("numba") is not None and os.environ.get("RIDE_ESTIMATION_DISABLE_JIT") != "1"


def compile_kernel(function: F) -> F:
    """Compile a numeric function of floats and arrays, cached on disk; return it unchanged without numba."""
    if not COMPILED:
        return function
    import numba

    compiled: F = numba.njit(cache=True, error_model="numpy")(function)
    return compiled


def compile_lean_kernel(function: F) -> F:
    """Compile like :func:`compile_kernel` for a function that allocates nothing, without reference counting of arrays.

    Counting references of array arguments costs more than a force law; a function that creates no array needs none.
    """
    if not COMPILED:
        return function
    import numba

    compiled: F = numba.njit(cache=True, error_model="numpy", _nrt=False)(function)
    return compiled


def inline_kernel(function: F) -> F:
    """Mark a function that allocates nothing for inlining into its compiled callers."""
    if not COMPILED:
        return function
    import numba

    compiled: F = numba.njit(cache=True, error_model="numpy", _nrt=False, inline="always")(function)
    return compiled
