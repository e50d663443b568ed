# Copyright 2026 ride_estimation contributors
"""Timing and data faults seen in real recordings, planted into a sequence of samples (stream, stamp_ns, values)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

Sample = tuple[int, int, tuple[float, ...]]
START_NS = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def truth(stream: int, time_s: np.ndarray) -> np.ndarray:
    """Three smooth signals below 15 Hz, different for every stream, shape (N, 3)."""
    phases = np.arange(3) + 0.7 * stream
    return np.stack([np.sin(2 * np.pi * 3.0 * time_s + p) + 0.3 * np.sin(2 * np.pi * 14.0 * time_s - p) for p in phases], axis=1)


def regular(
    streams: int,
    rates_hz: Sequence[float] | float,
    seconds: float,
    seed: int = 0,
    jitter_s: float = 0.0,
    offsets_s: Sequence[float] | None = None,
) -> list[Sample]:
    """Samples of several streams in the order of their stamps."""
    rng = np.random.default_rng(seed)
    rates = [rates_hz] * streams if isinstance(rates_hz, (int, float)) else list(rates_hz)
    samples: list[Sample] = []
    for stream, rate in enumerate(rates):
        offset = offsets_s[stream] if offsets_s is not None else 0.1 * stream / rate
        time = np.arange(round(seconds * rate)) / rate + offset + jitter_s * rng.standard_normal(round(seconds * rate))
        stamps = START_NS + np.round(time * 1e9).astype(np.int64)
        values = truth(stream, (stamps - START_NS) * 1e-9)
        samples += [(stream, int(s), tuple(v)) for s, v in zip(stamps, values.tolist())]
    return sorted(samples, key=lambda s: s[1])


def where(samples: Sequence[Sample], stream: int, from_s: float, to_s: float = math.inf) -> list[int]:
    """Places of the samples of a stream (-1: all streams) within a time."""
    return [
        i for i, (k, stamp, _) in enumerate(samples)
        if (stream in (-1, k)) and from_s <= (stamp - START_NS) / SECOND < to_s
    ]


def without(samples: Sequence[Sample], places: Sequence[int]) -> list[Sample]:
    """Lost samples: a gap, a sensor that stops or never speaks."""
    lost = set(places)
    return [s for i, s in enumerate(samples) if i not in lost]


def duplicated(samples: Sequence[Sample], places: Sequence[int]) -> list[Sample]:
    """Samples sent twice."""
    chosen = set(places)
    return [s for i, sample in enumerate(samples) for s in ((sample, sample) if i in chosen else (sample,))]


def swapped(samples: Sequence[Sample], places: Sequence[int]) -> list[Sample]:
    """Each chosen sample changes places with the next one of its stream."""
    result = list(samples)
    for i in places:
        j = next(j for j in range(i + 1, len(result)) if result[j][0] == result[i][0])
        result[i], result[j] = result[j], result[i]
    return result


def changed(
    samples: Sequence[Sample], places: Sequence[int], change: Callable[[Sample], Sample]
) -> list[Sample]:
    """Samples with another stamp or other values."""
    chosen = set(places)
    return [change(s) if i in chosen else s for i, s in enumerate(samples)]


def shifted(by_s: float) -> Callable[[Sample], Sample]:
    """A clock that is off."""
    return lambda s: (s[0], s[1] + round(by_s * SECOND), s[2])


def stamped(stamp_ns: int) -> Callable[[Sample], Sample]:
    """A stamp that means nothing."""
    return lambda s: (s[0], stamp_ns, s[2])


def valued(value: float) -> Callable[[Sample], Sample]:
    """NaN or infinity in one value."""
    return lambda s: (s[0], s[1], (s[2][0], value, s[2][2]))


def in_bursts(samples: Sequence[Sample], stream: int, length: int) -> list[Sample]:
    """A driver that hands over its samples in packets, stamps right: everyone else's samples come first."""
    result: list[Sample] = []
    packet: list[Sample] = []
    for sample in samples:
        if sample[0] != stream:
            result.append(sample)
            continue
        packet.append(sample)
        if len(packet) == length:
            result += packet
            packet = []
    return result + packet


def held_back(samples: Sequence[Sample], from_s: float, to_s: float) -> list[Sample]:
    """Return samples of which a gateway kept all of a time, to send them stream by stream afterwards."""
    inside = [START_NS + round(from_s * 1e9) <= stamp < START_NS + round(to_s * 1e9) for _, stamp, _ in samples]
    held = sorted((s for s, kept in zip(samples, inside) if kept), key=lambda s: s[0])
    first_after = max((i for i, kept in enumerate(inside) if kept), default=-1) + 1
    before = [s for s, kept in zip(samples[:first_after], inside) if not kept]
    return [*before, *held, *samples[first_after:]]
