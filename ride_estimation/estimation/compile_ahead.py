# Copyright 2026 ride_estimation contributors
"""First start after an installation: several processes compile the kernels into the folder of compiled code.

:data:`~ride_estimation.estimation.kernel_list.KERNELS` lists what a drive of the bundled vehicle calls. Whatever is not listed
or listed in vain costs time only: numba compiles what is missing when it is called. Nothing happens where compiled code cannot be
kept, or where it was all compiled before. The process that asks only waits, so that a signal ends it at once: a compiler in the
middle of its work hears none for seconds, and fails in odd ways when it does.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ride_estimation.estimation.kernel_list import KERNELS
from ride_estimation.jit import COMPILED, cache_folder, compile_for, in_shares

#: most processes
_MOST = 8
#: the longest wait for them [s]
_LONGEST = 180.0
#: what it takes all processes together, for the person who waits [s]
_SECONDS = 20
_DONE = "all_compiled"


def compile_ahead(say: Callable[[str], None]) -> int:
    """Compile what is listed and is not compiled yet; return how many processes did it, 0 where there was nothing to do.

    Parameters
    ----------
    say
        Takes a sentence for the person who waits.
    """
    if not COMPILED:
        return 0
    folder = cache_folder("estimation")
    done = folder / _DONE
    if done.exists():
        return 0
    if not os.access(folder, os.W_OK):
        say(f"compiled code cannot be kept in {folder}: every start compiles anew, about {_SECONDS} s of processor time")
        return 0
    cores = min(len(os.sched_getaffinity(0)), _MOST) if hasattr(os, "sched_getaffinity") else 1
    say(f"compiling for this machine, once: about {_SECONDS} s of processor time, shared by {cores} process(es)")
    package = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))}
    processes = [
        subprocess.Popen(
            [sys.executable, "-P", "-m", "ride_estimation.estimation.compile_ahead", str(share), str(cores)],
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for share in range(cores)
    ]  # fmt: skip
    end = time.monotonic() + _LONGEST
    try:
        good = [process.wait(max(end - time.monotonic(), 0.0)) == 0 for process in processes]
    except subprocess.TimeoutExpired:
        good = [False]
    finally:
        for process in processes:
            process.kill()
    if all(good):
        done.touch()
    return cores


def compile_share(share: int, shares: int) -> None:
    """Compile one of several shares of the list, which cost about the same."""
    found: list[tuple[Any, str]] = []
    for name, arguments in KERNELS:
        module, _, function = name.partition(":")
        kernel: Any = getattr(importlib.import_module(f"ride_estimation.{module}"), function, None)
        if hasattr(kernel, "py_func"):
            found.append((kernel, arguments))
    # what compiling costs grows with the length of the function
    sizes = [len(kernel.py_func.__code__.co_code) for kernel, _ in found]
    for place in in_shares(sizes, shares)[share]:
        compile_for(*found[place])


if __name__ == "__main__":
    compile_share(int(sys.argv[1]), int(sys.argv[2]))
