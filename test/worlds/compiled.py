# Copyright 2026 ride_estimation contributors
"""Compile the kernels of the worlds; compiled code is kept per state of all their sources, because they inline each other."""

from __future__ import annotations

import hashlib
import os
import pathlib
from collections.abc import Callable
from typing import TypeVar

import numba
from numba.core import config

F = TypeVar("F", bound=Callable[..., object])

_HERE = pathlib.Path(__file__).parent
_SOURCES = ("laws.py", "kernel.py", "chain.py", "bench.py")


def compiled(function: F) -> F:
    """Return the function compiled with numba."""
    digest = hashlib.sha256(b"".join((_HERE / name).read_bytes() for name in _SOURCES)).hexdigest()[:12]
    home = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache")
    before = config.CACHE_DIR
    config.CACHE_DIR = str(home / "ride_estimation_worlds" / digest)
    try:
        return numba.njit(cache=True)(function)
    finally:
        config.CACHE_DIR = before
