# Copyright 2026 ride_estimation contributors
"""Independent pieces of work on several threads: numpy, BLAS and FFT leave the interpreter free while they compute.

Threads need no copy of a run and no start of a process; results come in the order of the items, so that an answer does not
depend on how many threads there are.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import ctypes
import functools
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Value = TypeVar("Value")

#: ``mallopt`` of glibc: most heaps that threads allocate from
_M_ARENA_MAX = -8
_MOST = 4  # every thread holds matrices of its own, some hundred megabytes for a run of a minute


def _usable_threads() -> int:
    """Return how many threads make sense: one per core this process may use, four at most."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, _MOST)


@functools.cache
def allocate_from_one_heap() -> None:
    """Have threads share the heap of the process, where its C library is glibc.

    A heap per thread keeps what was freed in it from the others: a diagnosis of two minutes took 1.96 GB and takes 1.49 GB
    with one heap, in the same time.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # TypeError: no such name as None elsewhere than on POSIX
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def in_order(work: Callable[[Item], Value], items: Sequence[Item], threads: int) -> Iterator[Value]:
    """Yield the value of every item, in the order of the items, as soon as it is there.

    Parameters
    ----------
    work
        Function of an item that changes nothing others see.
    items
        What to work on.
    threads
        Number of threads, as :attr:`Settings.threads`: 0 is one per usable core, four at most; 1 works here.

    Raises
    ------
    Exception
        What the first item in order raised.
    """
    threads = threads or _usable_threads()
    if threads < 2 or len(items) < 2:
        yield from map(work, items)
        return
    allocate_from_one_heap()
    with concurrent.futures.ThreadPoolExecutor(min(threads, len(items))) as pool:
        yield from pool.map(work, items)
