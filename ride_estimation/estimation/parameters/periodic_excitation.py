# Copyright 2026 ride_estimation contributors
"""Excitation that only repeats itself, as by an engine that idles, adds no information however long it lasts.

A line of one frequency determines two numbers per direction, and its misfit (a delay, an angle) is the same every time: it does
not scatter, so it appears exact, and half an hour of it replaces what a road has taught. It differs from a road by the
correlation of the last seconds with those before them at the best shift: one for what is periodic, small for what is random.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: length of the segment that is compared [s]
_SEGMENT = 2.0
#: longest shift beyond its own length [s]
_SHIFT = 1.5
#: samples per second that are compared: a line stays a line when it is sampled rarely
_RATE = 50.0
#: correlation from which on a segment repeats what was before: nine tenths of its power
_REPEATS = 0.9


class PeriodicExcitation:
    """Whether the excitation repeats itself."""

    def __init__(self) -> None:
        self._past = np.zeros((0, 3))
        self._skipped = 0

    def observe(self, accel: Array, dt: float) -> bool:
        """Take the acceleration of the body, shape (K, 3), a tick apart [s]; return whether its last seconds repeat."""
        every = max(round(1.0 / (_RATE * dt)), 1)
        step = every * dt
        own = round(_SEGMENT / step)
        longest = own + round(_SHIFT / step)
        self._past = np.vstack([self._past, accel[(-self._skipped) % every :: every]])[-(own + longest) :]
        self._skipped = (self._skipped + len(accel)) % every
        if len(self._past) < own + longest:
            return False
        last = self._past[-own:]
        earlier = np.lib.stride_tricks.sliding_window_view(self._past[:-own], own, axis=0)
        size = np.sum(last**2) * np.einsum("kaj,kaj->k", earlier, earlier)
        alike = np.einsum("kaj,ja->k", earlier, last)
        return bool(np.max(alike / np.sqrt(np.maximum(size, 1e-300))) > _REPEATS)
