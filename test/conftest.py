# Copyright 2026 ride_estimation contributors
"""Environment of every test: one BLAS thread, no interactive plots, ROS confined to this machine and checking fields."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
# Must be set before any message package is imported: then a wrong type in a field is an error and not garbage.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"


@pytest.hookimpl(hookwrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is imported and collected stays: the garbage collector walks neither through it while it grows nor later."""
    gc.disable()
    yield
    gc.freeze()
    gc.enable()
