# Copyright 2026 ride_estimation contributors
"""Base sensors that a test leaves out: what is said of each, and what that means for a block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.sensors.sensor import Sensor

DISAGREES = "disagrees with the other sensors at the mount bases"


class BaseSensorTest:
    """A test of the base sensors of a body that leaves out those it isolates.

    Parameters
    ----------
    sensors
        At the bases.
    check
        What people should check, in words.
    link
        What joins the words on a sensor to the sentence about it.
    """

    def __init__(self, sensors: Sequence[Sensor], check: str, link: str = "") -> None:
        self._names, self._check, self._link = tuple(s.name for s in sensors), check, link
        #: sensors that are left out, by their place among the sensors, with what is said of each
        self.refused: dict[int, str] = {}
        self._reported: frozenset[int] = frozenset()

    def without_refused(self, verdict: GateVerdict, streams: NDArray[np.int64], spoiled: float) -> GateVerdict:
        """Return the verdict on a block without the sensors that are left out.

        Parameters
        ----------
        verdict
            Of the other tests.
        streams
            Of the base sensors.
        spoiled
            How long before it was isolated a sensor may have spoiled what was learned [s].
        """
        new = [int(streams[n]) for n in self.refused if n not in self._reported]
        self._reported = frozenset(self.refused)
        return verdict.with_refused([int(streams[n]) for n in self.refused], new, spoiled)

    def messages(self) -> list[str]:
        """Return one sentence per sensor that is left out."""
        return [
            f"{self._names[n]} is not used: it {DISAGREES} {self._link}{words}: check its {self._check}"
            for n, words in sorted(self.refused.items())
        ]
