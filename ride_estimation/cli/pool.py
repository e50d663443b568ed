# Copyright 2026 ride_estimation contributors
"""One function over many items on a pool of processes that outlives the death of a process, or on an existing Dask cluster.

Nothing but the standard library is imported here: a new process reads this module before it does anything.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Generic, TypeVar

from ride_estimation.errors import InputDataError

Item = TypeVar("Item")
Value = TypeVar("Value")

DIED = "the process died (out of memory, or a crash in a library)"


@dataclasses.dataclass(frozen=True)
class Outcome(Generic[Item, Value]):
    """What became of one item: a value, or the reason why there is none."""

    item: Item
    value: Value | None
    error: str = ""


def run_on_pool(items: Sequence[Item], workers: int, work: Callable[[Item], Value]) -> Iterator[Outcome[Item, Value]]:
    """Yield the outcomes of all items as they finish, computed by processes on this machine.

    When a process dies, the items that were under way are tried again one by one, each in a process of its own, so that only
    the one to blame is lost.

    Parameters
    ----------
    items
        In any order.
    workers
        Number of processes.
    work
        Function of an item, importable by its module and name.
    """
    # one thread of linear algebra per process: more of them only get into each other's way
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    lost: list[Item] = []
    yield from _one_pool(items, workers, work, lost)
    for item in lost:
        died: list[Item] = []
        yield from _one_pool([item], 1, work, died)
        if died:
            yield Outcome(item, None, DIED)


def _one_pool(
    items: Sequence[Item], workers: int, work: Callable[[Item], Value], lost: list[Item]
) -> Iterator[Outcome[Item, Value]]:
    """Yield outcomes; after the death of a process go on with a new pool, what was under way goes to ``lost``."""
    remaining = list(reversed(items))
    context = multiprocessing.get_context("spawn")
    while remaining:
        under_way: dict[concurrent.futures.Future[Value], Item] = {}
        broken = False
        with concurrent.futures.ProcessPoolExecutor(max_workers=min(workers, len(remaining)), mp_context=context) as pool:
            while (remaining or under_way) and not broken:
                # only as many as there are processes, so that a death takes few items along
                while remaining and len(under_way) < workers and not broken:
                    item = remaining.pop()
                    try:
                        under_way[pool.submit(work, item)] = item
                    except BrokenProcessPool:
                        remaining.append(item)
                        broken = True
                done, _ = concurrent.futures.wait(under_way, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in done:
                    item = under_way.pop(future)
                    failure = future.exception()
                    if isinstance(failure, BrokenProcessPool):
                        lost.append(item)
                        broken = True
                    elif failure is not None:
                        yield Outcome(item, None, f"{type(failure).__name__}: {failure}")
                    else:
                        yield Outcome(item, future.result())
            lost.extend(under_way.values())


def run_on_cluster(items: Sequence[Item], address: str, work: Callable[[Item], Value]) -> Iterator[Outcome[Item, Value]]:
    """Yield the outcomes of all items as they finish on an existing Dask cluster.

    Parameters
    ----------
    items
        In any order.
    address
        Of the scheduler, ``tcp://host:port``.
    work
        Function of an item; the workers must have this package.

    Raises
    ------
    InputDataError
        The extra ``fleet`` is not installed, or no scheduler answers.
    """
    try:
        import distributed
    except ImportError as error:
        raise InputDataError("--scheduler needs the extra 'fleet': pip install 'ride_estimation[fleet]'") from error
    try:
        client: Any = distributed.Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputDataError(f"--scheduler {address}: no Dask scheduler answers ({error})") from error
    with client:
        futures = {client.submit(work, item, pure=False, retries=0): item for item in items}
        for future in distributed.as_completed(futures):
            failure = future.exception()
            item = futures[future]
            if failure is None:
                yield Outcome(item, future.result())
            else:
                yield Outcome(item, None, f"the cluster lost the run: {type(failure).__name__}: {failure}")
            future.release()
