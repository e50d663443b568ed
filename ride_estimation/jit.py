# Copyright 2026 ride_estimation contributors
"""The one place of numba: compiled kernels where it is installed, the same plain Python where it is not.

Compiled code is cached on disk, below ``RIDE_ESTIMATION_CACHE`` or the user's cache folder, in a folder named after the
sources of all kernels: numba compares only the file a kernel stands in, and a kernel has those of other files built in. Where the
package is installed does not matter: what a workspace and a virtual environment have in common is compiled once.

Set ``RIDE_ESTIMATION_DISABLE_JIT=1`` to force plain Python.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import stat
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

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


def compile_sum_kernel(function: F) -> F:
    """Compile a function that allocates nothing and whose sums may be added up in any order.

    Multiplication and addition become one operation, and a sum is kept in as many parts as the processor adds at once; the result
    differs in the last digits from that of plain Python. Infinities and NaN go through unchanged.
    """
    return _compile(function, _nrt=False, fastmath={"reassoc", "contract", "nsz"})


def compile_fused_kernel(function: F) -> F:
    """Compile a recursion that allocates nothing: multiplication and addition become one operation, rounded once."""
    return _compile(function, _nrt=False, fastmath={"contract"})


def inline_kernel(function: F) -> F:
    """Mark a function that allocates nothing for inlining into its compiled callers."""
    return _compile(function, _nrt=False, inline="always")


class _Kernel:
    """A function compiled when it is first used: importing numba takes longer than finding a mistake in the input.

    Stands for numba's dispatcher everywhere, also where another kernel calls it.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self._function, self._options = function, options

    @functools.cached_property
    def _dispatcher(self) -> Any:
        import numba
        from numba.core import config

        _watch_compiler()
        _share_among_installations()
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_folder(_folder_of(self._function)))
        try:
            return numba.njit(cache=True, error_model="numpy", **self._options)(self._function)
        finally:
            config.CACHE_DIR = before

    def __call__(self, *arguments: Any) -> Any:
        return self._dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._dispatcher, name)


#: kernels being compiled now, the outermost first
_compiled_now: list[Any] = []


def compiling() -> bool:
    """Return whether a kernel is being compiled at this moment, for whoever shows what takes the time."""
    return bool(_compiled_now)


@functools.cache
def _watch_compiler() -> None:
    """Have numba say when it begins and ends to compile."""
    events = _numba("core.event")

    class Watch(events.Listener):  # type: ignore[misc, name-defined]  # numba has no types
        def on_start(self, event: Any) -> None:
            _compiled_now.append(event)

        def on_end(self, event: Any) -> None:
            _compiled_now.pop()

    events.register("numba:compile", Watch())


@functools.cache
def _share_among_installations() -> None:
    """Have numba keep the code of this package by the names of its sources, not by where they lie.

    The folder that :func:`cache_folder` returns stands for the sources; with the path in it, every further installation of the
    same sources would compile everything again. Without the names that are used here numba goes on as it does.
    """
    caching = _numba("core.caching")
    usual: Any = getattr(caching, "UserProvidedCacheLocator", None) or getattr(caching, "_UserProvidedCacheLocator", None)
    cache: Any = getattr(caching, "CompileResultCacheImpl", None)
    if usual is None or not hasattr(cache, "_locator_classes"):
        return
    package = os.path.dirname(os.path.abspath(__file__))

    class OfThePackage(usual):  # type: ignore[misc]  # numba has no types
        @classmethod
        def from_function(cls, function: Callable[..., Any], file: str) -> Any:
            inside = os.path.abspath(file).startswith(package + os.sep)
            return super().from_function(function, file) if inside else None

        @classmethod
        def get_suitable_cache_subpath(cls, file: str) -> str:
            return os.path.relpath(os.path.dirname(os.path.abspath(file)), package)

        def get_source_stamp(self) -> str:
            return ""  # the folder is of exactly these sources

    cache._locator_classes = [OfThePackage, *cache._locator_classes]


def _compile(function: F, **options: Any) -> F:
    return cast(F, _Kernel(function, options)) if COMPILED else function


def _folder_of(function: Callable[..., Any]) -> str:
    parts = function.__module__.split(".")
    return parts[1] if parts[0] == "ride_estimation" and len(parts) > 2 else ""


@contextmanager
def recorded_calls() -> Iterator[set[tuple[str, str]]]:
    """Collect which kernels Python calls and with what: ``module:function`` below the package and the arguments in the words of
    :func:`compile_for`. Only first calls in a process are seen; nothing without numba.
    """
    found: set[tuple[str, str]] = set()
    if not COMPILED:
        yield found
        return
    Dispatcher: Any = _numba("core.dispatcher").Dispatcher
    usual = Dispatcher._compile_for_args

    def note(self: Any, *args: Any, **kws: Any) -> Any:
        codes = [_code_of(self.typeof_pyval(a)) for a in args]
        package, _, module = self.py_func.__module__.partition(".")
        if package == "ride_estimation" and all(codes):
            found.add((f"{module}:{self.py_func.__qualname__}", " ".join(codes)))
        return usual(self, *args, **kws)

    Dispatcher._compile_for_args = note
    try:
        yield found
    finally:
        Dispatcher._compile_for_args = usual


def _code_of(kind: Any) -> str:
    """Return the code of a type of numba: ``f i b`` for numbers, with dimensions and layout for arrays; empty for others."""
    types = _numba("core.types")
    letters = {types.float64: "f", types.int64: "i", types.boolean: "b"}
    if isinstance(kind, types.Array):
        letter = letters.get(kind.dtype, "")
        return f"{letter}{kind.ndim}{kind.layout}" if letter and kind.mutable and kind.aligned else ""
    return letters.get(kind, "")


def _numba(module: str) -> Any:
    return importlib.import_module(f"numba.{module}".rstrip("."))


def compile_for(function: Any, arguments: str) -> None:
    """Compile a kernel for arguments, or load its compiled code; nothing without numba.

    Parameters
    ----------
    function
        What :func:`compile_kernel` made.
    arguments
        One code per argument, with spaces between: ``f``, ``i``, ``b`` for a float, an integer, a bool; for an array of those
        with the number of dimensions and the layout behind, as in ``f2C``.
    """
    if not COMPILED:
        return
    types = _numba("core.types")
    scalars = {"f": types.float64, "i": types.int64, "b": types.boolean}
    signature = tuple(scalars[c] if len(c) == 1 else types.Array(scalars[c[0]], int(c[1]), c[2]) for c in arguments.split())
    function.compile(signature)


def in_shares(sizes: Sequence[int], shares: int) -> list[list[int]]:
    """Return the numbers of things of some sizes in as many shares of about the same sum, the largest first."""
    found: list[list[int]] = [[] for _ in range(shares)]
    sums = [0] * shares
    for place in sorted(range(len(sizes)), key=lambda i: -sizes[i]):
        least = sums.index(min(sums))
        found[least].append(place)
        sums[least] += sizes[place]
    return found


def _machine_key() -> str:
    """Return what compiled code depends on beside its sources: Python, its libraries, the processor; empty without numba."""
    if not COMPILED:
        return ""
    numpy, llvm = (importlib.import_module(name) for name in ("numpy", "llvmlite.binding"))
    return f"{sys.implementation.cache_tag} {_numba('').__version__} {numpy.__version__} {llvm.get_host_cpu_name()}"


@functools.cache
def cache_folder(folder_name: str) -> Path:
    """Return where the compiled code of a folder's kernels is kept, for exactly the present kernel sources and this machine.

    What lies there is executed. A folder of another user, or one that everybody may write to, is not used: the path returned
    then cannot exist, and numba compiles in memory, as where the folder cannot be written.

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
        if not (_is_own(root) and _is_own(folder)):
            return Path(os.devnull) / folder.name
        os.utime(folder)
        for old in root.iterdir():
            # only what was made here: the folder may be one the user keeps other things in
            if old != folder and _OWN_FOLDER.fullmatch(old.name) and time.time() - old.stat().st_mtime > _KEEP_S:
                shutil.rmtree(old, ignore_errors=True)
    except OSError:
        # a read-only home: numba then compiles in memory at every start
        return folder
    return folder


def _is_own(folder: Path) -> bool:
    """Return whether only this user (or a group of theirs) can have put something into a folder."""
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & stat.S_IWOTH


def _digest_of_kernels(folder_name: str) -> str:
    package = Path(__file__).parent
    digest = hashlib.sha256(_machine_key().encode())
    paths: list[Path] = []
    for name in sorted({*_SHARED, folder_name}):
        paths += (package / name).rglob("*.py") if name else package.glob("*.py")
    for path in sorted(paths):
        source = path.read_bytes()
        if b"ride_estimation.jit import" in source:
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(source)
    return digest.hexdigest()[:16]
