# Copyright 2026 ride_estimation contributors
"""The one place of numba: compiled kernels where it is installed, the same plain Python where it is not.

Compiled code is cached on disk, below ``RIDE_ESTIMATION_CACHE`` or the user's cache folder, in a folder named after the
sources of all kernels: numba compares only the file a kernel stands in, and a kernel has those of other files built in.

Set ``RIDE_ESTIMATION_DISABLE_JIT=1`` to force plain Python.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

#: True where kernels are compiled
COMPILED: bool = importlib.util.find_spec("numba") is not None and os.environ.get("RIDE_ESTIMATION_DISABLE_JIT") != "1"

#: folders whose kernels may be built into those of any other folder (the lower layers)
_SHARED = ("", "signals", "elements", "excitation", "sensors", "vehicles")
_OWN_FOLDER = re.compile("[0-9a-f]{16}")
_KEEP_S = 14 * 86400.0  # compiled code of other versions is removed when it was not used for this long


def compile_kernel(function: F) -> F:
    """Compile a numeric function of floats and arrays, cached on disk; return it unchanged without numba."""
    return _compile(function)


def compile_lean_kernel(function: F) -> F:
    """Compile like :func:`compile_kernel` for a function that allocates nothing, without reference counting of arrays.

    Counting references of array arguments costs more than a force law; a function that creates no array needs none.
    """
    return _compile(function, _nrt=False)


def inline_kernel(function: F) -> F:
    """Mark a function that allocates nothing for inlining into its compiled callers."""
    return _compile(function, _nrt=False, inline="always")


def _compile(function: F, **options: Any) -> F:
    if not COMPILED:
        return function
    import numba
    from numba.core import config

    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder(_folder_of(function)))
    try:
        compiled: F = numba.njit(cache=True, error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = before
    return compiled


def _folder_of(function: Callable[..., Any]) -> str:
    parts = function.__module__.split(".")
    return parts[1] if parts[0] == "ride_estimation" and len(parts) > 2 else ""


@functools.cache
def cache_folder(folder_name: str) -> Path:
    """Return where the compiled code of a folder's kernels is kept, for exactly the present kernel sources.

    Parameters
    ----------
    folder_name
        Folder of the package the kernels stand in.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    root = Path(os.environ.get("RIDE_ESTIMATION_CACHE") or Path(home) / "ride_estimation")
    folder = root / _digest_of_kernels(folder_name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for old in root.iterdir():
            # only what was made here: the folder may be one the user keeps other things in
            if old != folder and _OWN_FOLDER.fullmatch(old.name) and time.time() - old.stat().st_mtime > _KEEP_S:
                shutil.rmtree(old, ignore_errors=True)
    except OSError:
        # a read-only home: numba then compiles in memory at every start
        return folder
    return folder


def _digest_of_kernels(folder_name: str) -> str:
    package = Path(__file__).parent
    digest = hashlib.sha256()
    paths: list[Path] = []
    for name in sorted({*_SHARED, folder_name}):
        paths += (package / name).rglob("*.py") if name else package.glob("*.py")
    for path in sorted(paths):
        source = path.read_bytes()
        if b"ride_estimation.jit import" in source:
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(source)
    return digest.hexdigest()[:16]
