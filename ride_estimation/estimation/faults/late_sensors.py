# Copyright 2026 ride_estimation contributors
"""Sensors whose readings are late behind their stamps, by a delay that the fault tests found: put right, not left out.

A delay is the one error of a sensor that its readings can be freed of without a guess at what they mean: they are put back in
time, as with ``delay_s`` of the vehicle file. What is not known of it takes the place of the delay that the installation states.
The test is linear in the delay, so a large one is found roughly first: as soon as the test knows what is left better than that,
it is taken too, and everything goes on.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from ride_estimation.estimation.faults.hints import Hint
from ride_estimation.estimation.sensor_errors.sensor_faults import FaultTest
from ride_estimation.signals.correction import LONGEST_DELAY
from ride_estimation.vehicles.vehicle import Vehicle

#: least share of the deviations that a delay explains: 0.90 to 1.00 in 40 drives with a sensor late by 3 to 15 ms, 0.42 where one
#: became late while driving, whose average over the run is the delay of no time
_EXPLAINED = 0.8
#: share of the uncertainty that a refined delay may have at most
_BETTER = 0.8
#: how often a sensor may be found late beyond tolerance: that of one that became so while driving is an average first; what
#: is found again and again is no constant delay
_OFTEN = 3
#: share of a step that remains open: the slope of averages of 20 ms stands for a shift of the readings
_LINEAR = 0.05


@dataclasses.dataclass(frozen=True)
class Delay:
    """Delay of a sensor beyond its vehicle file, its standard deviation [s], and how often it was found beyond tolerance."""

    seconds: float
    std: float
    times: int


class LateSensors:
    """Delays found in a run.

    Parameters
    ----------
    vehicle
        With the delays that are known.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._found: dict[str, Delay] = {}

    def find(self, tests: Sequence[FaultTest]) -> bool:
        """Return whether a test found a sensor late beyond tolerance, and knows by how much.

        Parameters
        ----------
        tests
            Of the sensors of the body and of those at the bases.
        """
        for test in tests:
            fault = test.judge()
            if fault is None or fault.kind != "delay" or fault.rivals or fault.explained < _EXPLAINED:
                continue
            known, before = test.delay_of(fault.sensor), self._found.get(fault.sensor, Delay(0.0, 0.0, 0))
            if known is None or before.times >= _OFTEN:
                continue
            step, std, settled = known
            after = Delay(before.seconds + step, _std(step, std), before.times + 1)
            if settled and abs(self._whole(fault.sensor, after)) <= LONGEST_DELAY:
                self._found[fault.sensor] = after
                return True
        return False

    def refine(self, tests: Sequence[FaultTest]) -> bool:
        """Return whether a test knows what is left of a delay that was found roughly; it goes on without that."""
        for (name, found), test in itertools.product(self._found.items(), tests):
            known = test.delay_of(name)
            if known is None:
                continue
            step, std = known[0], _std(*known[:2])
            if std < _BETTER * found.std:
                test.put_back(name, step)
                self._found[name] = Delay(found.seconds + step, std, found.times)
                return True
        return False

    def _whole(self, name: str, delay: Delay) -> float:
        return self._vehicle.sensors[name].correction.delay + delay.seconds

    def delays(self) -> dict[str, float]:
        """Return the whole delay of every sensor that one was found of, its file's included [s]."""
        return {name: self._whole(name, d) for name, d in self._found.items()}

    def vehicle(self) -> Vehicle:
        """Return the vehicle with what is not known of the delays in the installation of its sensors."""
        sensors = dict(self._vehicle.sensors)
        for name, d in self._found.items():
            own = dataclasses.replace(sensors[name].stated_installation, delay=d.std)
            sensors[name] = dataclasses.replace(sensors[name], installation=own)
        return dataclasses.replace(self._vehicle, sensors=sensors)

    def hints(self) -> tuple[Hint, ...]:
        """Return the delays as hints."""
        words = self.messages()
        return tuple(Hint("sensor_delay", n, "", d.seconds, d.std, "s", w) for (n, d), w in zip(self._found.items(), words))

    def messages(self) -> list[str]:
        """Return one sentence per sensor."""
        return [
            f"{name} is {1e3 * abs(d.seconds):.1f} +- {1e3 * d.std:.1f} ms {'late' if d.seconds > 0.0 else 'early'}: its "
            f"readings are put back by that delay; state delay_ms: {1e3 * self._whole(name, d):.1f} in the vehicle file"
            for name, d in self._found.items()
        ]

    def save(self) -> dict[str, list[Any]]:
        """Return the delays as a mapping that JSON can hold."""
        return {name: list(dataclasses.astuple(d)) for name, d in self._found.items()}

    def load(self, saved: Mapping[str, Any]) -> None:
        """Continue from :meth:`save`."""
        known = {name: saved[name] for name in self._vehicle.sensors if name in saved}
        self._found = {name: Delay(float(seconds), float(std), int(times)) for name, (seconds, std, times) in known.items()}


def _std(step: float, std: float) -> float:
    """Return the standard deviation of a delay found by a step with its own [s]."""
    return math.hypot(std, _LINEAR * step)
