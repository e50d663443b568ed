# Copyright 2026 ride_estimation contributors
"""The ROS 2 nodes; the only place of rclpy."""

from __future__ import annotations

import os

# Before numpy is loaded: the matrices of an estimator are small, more threads of the linear algebra only wait for each other (on
# a busy machine 40 ms instead of 0.01 ms for one matrix exponential), and their number must not decide the last bit of a result.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
