# Copyright 2026 ride_estimation contributors
"""What can happen to the signal of a sensor, as a plant of the table of faults: kind, size and axes of an error."""

from __future__ import annotations

import dataclasses

import numpy as np
from replay.fault_run import BEGIN, LENGTH, RATE, Message, Plant, World
from scipy.spatial.transform import Rotation


@dataclasses.dataclass(frozen=True)
class SignalFault:
    """An error of one accelerometer.

    Attributes
    ----------
    kind
        ``stuck``, ``gain`` (of the motion, the mean stays), ``inverted`` (mean and motion), ``saturated`` (at ``size`` standard
        deviations about the mean), ``spikes`` (of ``size``, 1 % of the samples), ``noise`` (``size`` times that of the file),
        ``hum`` (of ``size``), ``late`` (by ``size`` seconds), ``drifts`` (its clock, by ``size``), ``offset``, ``turned`` (by
        ``size`` degrees about its first axis among ``axes``), ``swapped`` (the next two of its axes) or ``exchanged``.
    victim, partner
        Sensor, and the one it is exchanged with.
    axes
        Of the sensor.
    size
        See ``kind``.
    frequency_hz
        Of a hum; mains would be on the limit of what a hundred samples a second tell.
    """

    kind: str
    victim: str
    axes: tuple[int, ...] = (0, 1, 2)
    size: float = 0.0
    partner: str = ""
    frequency_hz: float = 47.0

    def values(self, w: World, begin: float, rng: np.random.Generator) -> np.ndarray:
        """Return what the sensor says during the whole run, shape (N, 3), were the error always there."""
        values, time = w.measurement.data[self.victim], w.measurement.time
        chosen = np.isin(np.arange(3), self.axes)
        mean, spread, size = values.mean(axis=0), values.std(axis=0), self.size
        new = values.copy()
        if self.kind == "stuck":
            new[:] = values[round(begin * RATE)]
        elif self.kind == "gain":
            new = mean + size * (values - mean)
        elif self.kind == "inverted":
            new = -values
        elif self.kind == "saturated":
            new = np.clip(values, mean - size * spread, mean + size * spread)
        elif self.kind == "spikes":
            new += size * (rng.random(values.shape) < 0.01) * rng.choice([-1.0, 1.0], values.shape)
        elif self.kind == "noise":
            new += size * w.sensor(self.victim).noise_std * rng.standard_normal(values.shape)
        elif self.kind == "hum":
            new += size * np.sin(2.0 * np.pi * self.frequency_hz * time)[:, None]
        elif self.kind in ("late", "drifts"):
            late = size if self.kind == "late" else size * time
            new = np.column_stack([np.interp(time - late, time, column) for column in values.T])
        elif self.kind == "offset":
            new += size
        elif self.kind == "turned":
            return values @ Rotation.from_rotvec(np.radians(size) * np.eye(3)[self.axes[0]]).as_matrix()
        elif self.kind == "swapped":
            order = [0, 1, 2]
            first, second = (self.axes[0] + 1) % 3, (self.axes[0] + 2) % 3
            order[first], order[second] = second, first
            return np.asarray(values[:, order])
        elif self.kind == "exchanged":
            return np.asarray(w.measurement.data[self.partner])
        else:
            raise ValueError(self.kind)
        return np.where(chosen, new, values)

    def plant(self, begin: float = BEGIN, end: float = LENGTH) -> Plant:
        """Return the error during a time as a plant."""

        def changed(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
            values = {self.victim: self.values(w, begin, rng)}
            if self.partner:
                values[self.partner] = w.measurement.data[self.victim]
            return with_values(messages, values, begin, end)

        return changed


def with_values(messages: list[Message], values: dict[str, np.ndarray], begin: float, end: float) -> list[Message]:
    """Return the messages with other values of some sensors within a time."""
    first = messages[0].stamp_ns
    counts, out = dict.fromkeys(values, 0), []
    for m in messages:
        if m.sensor not in values:
            out.append(m)
            continue
        there = begin <= (m.stamp_ns - first) * 1e-9 < end
        row, counts[m.sensor] = counts[m.sensor], counts[m.sensor] + 1
        out.append(dataclasses.replace(m, values=tuple(values[m.sensor][row].tolist())) if there else m)
    return out
