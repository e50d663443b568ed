# Copyright 2026 ride_estimation contributors
"""Work for the pool of the fleet tests; in a module of its own because a new process imports it by name."""

import os
import time


def square(item: int) -> int:
    """Return the square; negative items raise, 13 takes the process with it."""
    if item == 13:
        time.sleep(0.3)  # the other process is at work by now
        os._exit(9)
    if item < 0:
        raise ValueError(f"no square of {item}")
    time.sleep(0.02)
    return item * item
