# Copyright 2026 ride_estimation contributors
"""The commands run where neither ROS nor any extra is installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: ROS, the extras, and what tests alone may use
ABSENT = (
    "rclpy", "geometry_msgs", "sensor_msgs", "diagnostic_msgs", "asammdf", "nptdms", "rpc3", "pyarrow", "distributed", "dask",
    "shtab", "mujoco", "rainflow", "hypothesis", "pandas",
)  # fmt: skip
PROGRAM = """
import sys
for name in {absent!r}:
    sys.modules[name] = None  # importing it now is an ImportError
from ride_estimation.cli.main import main, verb_helps, work_of
for verb in verb_helps():
    work_of(verb)
sys.exit(main(["plan", "--vehicle", "truck_cab", "--bounds-only"]) or main(["calibrate", {run!r}, "--vehicle", "truck_cab"]))
"""


def test_no_command_needs_ros_or_an_extra() -> None:
    program = PROGRAM.format(absent=ABSENT, run=str(ROOT / "bags" / "standing"))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "bounce" in done.stdout and "cab_front_left" in done.stdout
