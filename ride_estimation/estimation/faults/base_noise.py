# Copyright 2026 ride_estimation contributors
"""Noise and hum of a base sensor: quick signals, above the motion of a frame, that none of the other base sensors sees.

Power spectra of the readings, turned into body axes, are compared at every frequency with the largest of the other bases plus the
noise of the vehicle file. Noise raises a sensor at most frequencies, hum at one. How much more one bracket vibrates than the
others is its own affair: what counts for noise is the ratio now over that of the run so far. A noisy sensor is treated as
missing. A line of one frequency does not reach deflections, as they are a double integral; it is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.faults.left_out import BaseSensorTest
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: lowest frequency compared [Hz]
_LOWEST_HZ = 15.0
#: highest frequency compared, share of the tick rate
_HIGHEST = 0.495
#: least number of frequencies
_LEAST_LINES = 6
#: data taken at once [s]
_CHUNK = 1.0
#: memory of the spectra [s]
_MEMORY = 4.0
#: least data before anything is judged [s]
_LEAST = 2.0
#: ratio of the power to that of the others over the usual one that is noise
_NOISY = 3.0
#: the same below which it is none
_QUIET = 1.5
#: usual ratio before the run determines it
_USUAL = 2.0
#: time in which the run determines it [s]
_FIRST = 5.0
#: time over which it may change [s]
_RUN = 30.0
#: power of a line over that of the others at its frequency
_LINE = 20.0
#: power of a line over that of the sensor at the other frequencies
_PEAK = 10.0
#: chunks in a row that must agree, also for the end
_AGREE = 2


class BaseNoise(BaseSensorTest):
    """Judge quick signals of the accelerometers at the mount bases.

    Parameters
    ----------
    sensors
        At the bases.
    """

    def __init__(self, sensors: Sequence[Sensor]) -> None:
        super().__init__(sensors, "wiring and fixing", "by ")
        self._rotation = np.array([s.rotation for s in sensors]).reshape(-1, 3, 3)
        self._variance = np.array([s.noise_std**2 for s in sensors])[:, None]
        self.possible = len(sensors) >= 3 and all(s.triaxial for s in sensors)
        #: lines of one frequency of sensors that are used
        self.lines: dict[int, str] = {}
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; verdicts stay."""
        count = len(self._names)
        self.interrupt()
        self._spectra: Array = np.zeros((0, count, 3))
        self._age, self._usual = 0.0, np.full((count, 3), _USUAL)
        self._noisy, self._quiet, self._lined = (np.zeros(count, dtype=np.int64) for _ in range(3))

    @property
    def inconsistent(self) -> bool:
        """Return whether a sensor may have become noisy."""
        return bool((self._noisy > 0).any()) and not self.refused

    def judged(self, verdict: GateVerdict, streams: NDArray[np.int64]) -> GateVerdict:
        """Return the verdict on a block with what is known of the noise added to it.

        Parameters
        ----------
        verdict
            Of the other checks.
        streams
            Of the base sensors.
        """
        return self.without_refused(verdict, streams, _MEMORY)

    def interrupt(self) -> None:
        """Say that a block is missing."""
        self._waiting: list[Array] = []
        self._ticks = 0

    def gather(self, readings: Array) -> None:
        """Take a block at which every sensor spoke, sensor axes, shape (K, 3 N)."""
        self._waiting.append(readings)
        self._ticks += len(readings)

    def learn(self, dt: float) -> None:
        """Test what was gathered once it is a chunk."""
        if self._ticks * dt < _CHUNK:
            return
        readings = np.concatenate(self._waiting)
        self.interrupt()
        ticks, count = len(readings), len(self._names)
        frequency: Array = np.fft.rfftfreq(ticks, dt).astype(np.float64)
        chosen = (frequency >= _LOWEST_HZ) & (frequency <= _HIGHEST / dt)
        if chosen.sum() < _LEAST_LINES:
            return
        values = np.einsum("nij,knj->kni", self._rotation, readings.reshape(ticks, count, 3))
        window = np.hanning(ticks)[:, None, None]
        spectra = np.abs(np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)[chosen]) ** 2
        if len(spectra) != len(self._spectra):
            self._spectra, self._age = np.zeros_like(spectra), 0.0
        self._age += ticks * dt
        self._spectra = self._spectra + ticks * dt / min(self._age, _MEMORY) * (spectra - self._spectra)
        if self._age >= _LEAST:
            self._judge(frequency[chosen], float(np.sum(window**2)), ticks * dt)

    def _judge(self, frequency: Array, unit: float, duration: float) -> None:
        for n in range(len(self._names)):
            own = self._spectra[:, n]
            ratio = own / (np.delete(self._spectra, n, axis=1).max(axis=1) + unit * self._variance[n])
            broad = np.median(ratio, axis=0)
            over = broad / np.maximum(self._usual[n], 1.0)
            self._noisy[n] = self._noisy[n] + 1 if over.max() > _NOISY else 0
            self._quiet[n] = self._quiet[n] + 1 if over.max() < _QUIET else 0
            if self._noisy[n] >= _AGREE:
                self.refused.setdefault(n, f"noise of {self._level(own, unit):.2g} m/s^2 that the others do not show")
            elif self._quiet[n] >= _AGREE:
                self.refused.pop(n, None)
            if self._noisy[n] == 0 and n not in self.refused:
                self._usual[n] += duration / min(_FIRST + self._age, _RUN) * (broad - self._usual[n])
            self._find_lines(n, own, ratio, frequency)

    def _level(self, own: Array, unit: float) -> float:
        """Return the standard deviation of the white noise of the noisiest axis [m/s^2]."""
        # the median of a periodogram of white noise is log(2) times its mean
        return math.sqrt(float(np.median(own, axis=0).max()) / (unit * math.log(2.0)))

    def _find_lines(self, n: int, own: Array, ratio: Array, frequency: Array) -> None:
        peak, axis = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        line = n not in self.refused and ratio[peak, axis] > _LINE and own[peak, axis] > _PEAK * np.median(own[:, axis])
        self._lined[n] = self._lined[n] + 1 if line else 0
        if self._lined[n] >= _AGREE:
            self.lines[n] = f"a line of {frequency[peak]:.0f} Hz"
        elif not line:
            self.lines.pop(n, None)

    def messages(self) -> list[str]:
        """Return one sentence per sensor with noise or a line."""
        return super().messages() + [
            f"{self._names[n]} at the mount base shows {words} that none of the others does: electrical hum or a loose bracket"
            for n, words in sorted(self.lines.items())
        ]
