# Copyright 2026 ride_estimation contributors
"""The layer rules, as imports are written and as they happen at run time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROS = ("rclpy", "sensor_msgs", "geometry_msgs", "diagnostic_msgs")
SCRIPT = """
import importlib, pkgutil, sys
for module in sys.argv[1:]:
    package = importlib.import_module(module)
    for info in pkgutil.walk_packages(getattr(package, "__path__", []), package.__name__ + "."):
        importlib.import_module(info.name)
    print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


def loaded_by(*modules: str) -> list[set[str]]:
    """Return the top-level packages loaded in a fresh interpreter after each module and everything below it."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *modules], capture_output=True, text=True, check=True, cwd=ROOT, timeout=120
    )
    return [set(line.split()) for line in done.stdout.splitlines()]


def test_importing_a_layer_loads_nothing_above_it() -> None:
    # one interpreter for all of them: what a layer may not load, those before it may not either
    forbidden = {
        "ride_estimation.diagnosis": {*ROS, "rosbags", "matplotlib"},
        "ride_estimation.io": {*ROS, "matplotlib"},
        "ride_estimation.cli": {*ROS},
    }
    for (module, names), loaded in zip(forbidden.items(), loaded_by(*forbidden), strict=True):
        assert "numpy" in loaded, "the subprocess did not import what it should"
        assert not loaded & names, module


def test_import_contracts_hold() -> None:
    lint_imports = Path(sys.executable).with_name("lint-imports")
    if not lint_imports.exists():
        pytest.skip("import-linter is not installed (pip install -e '.[lint]'); `make lint` runs it")
    done = subprocess.run([str(lint_imports)], capture_output=True, text=True, check=False, cwd=ROOT, timeout=120)
    assert done.returncode == 0, done.stdout


def test_the_run_time_check_would_see_a_violation() -> None:
    (loaded,) = loaded_by("ride_estimation.nodes.inputs")
    assert "sensor_msgs" in loaded
