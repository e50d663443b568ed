# Copyright 2026 ride_estimation contributors
"""Compile the kernels of the worlds; compiled code is kept per state of all their sources, because they inline each other."""

from __future__ import annotations

import hashlib
import os
import pathlib
import sys
from collections.abc import Callable
from typing import TypeVar

import numba
import numpy as np
from numba.core import caching, config

F = TypeVar("F", bound=Callable[..., object])

_HERE = pathlib.Path(__file__).parent
_SOURCES = ("laws.py", "kernel.py", "chain.py", "bench.py")


def compiled(function: F) -> F:
    """Return the function compiled with numba."""
    digest = hashlib.sha256(b"".join((_HERE / name).read_bytes() for name in _SOURCES))
    digest.update(f"{sys.implementation.cache_tag} {numba.__version__} {np.__version__}".encode())
    home = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache")
    before, usual = config.CACHE_DIR, caching.CompileResultCacheImpl._locator_classes
    config.CACHE_DIR = str(home / "ride_estimation_worlds" / digest.hexdigest()[:12])
    caching.CompileResultCacheImpl._locator_classes = [_OfTheSources, *usual]
    try:
        return numba.njit(cache=True)(function)
    finally:
        config.CACHE_DIR, caching.CompileResultCacheImpl._locator_classes = before, usual


_Provided = getattr(caching, "UserProvidedCacheLocator", None) or caching._UserProvidedCacheLocator


class _OfTheSources(_Provided):
    """Code is kept by what was compiled and not by where it lies: every further checkout would compile it again."""

    @classmethod
    def get_suitable_cache_subpath(cls, file: str) -> str:
        return "worlds"

    def get_source_stamp(self) -> str:
        return ""
