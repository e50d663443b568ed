# Copyright 2026 ride_estimation contributors
"""Whether the accelerometers of a body fit one rigid body, and whether exchanged topics, axes or units would make them fit.

With mean m and covariance C of all channels y, the residual projector ``P = I - H H^+`` of the layout and Q of what is at rest,
where all read the same gravity, the mean squared residual of a hypothesis M (exchange of two sensors, of axes and signs of one,
another unit of one) is ``tr(P M C M^T) + |Q M m|^2``: every hypothesis is tried.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.sensors.layout import measured_channels, motion_rows, residual_projection
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording

Array = NDArray[np.float64]

#: residual over its expected value below which nothing is looked for (both as root mean square)
LEAST_RATIO = 3.0
#: share of the mean squared residual a hypothesis must leave at most to be named, and within which others are its rivals
NAMED_SHARE = 0.2
_RIVAL = 3.0
_LONGEST_S = 120.0
_RATE_HZ = 200.0
_G = 9.80665  # m/s^2 of a reading of one g


@dataclasses.dataclass(frozen=True)
class Mistake:
    """What was mixed up when a run was recorded: topics of two sensors, or axes, signs or the unit of one.

    Attributes
    ----------
    sensors
        The one sensor, or the two whose topics are exchanged.
    words
        What it is.
    order, factor
        True value i of the one sensor is ``factor[i]`` times its reading ``order[i]``.
    """

    sensors: tuple[str, ...]
    words: str
    order: tuple[int, ...] = (0, 1, 2)
    factor: tuple[float, ...] = (1.0, 1.0, 1.0)

    @property
    def turn(self) -> Array:
        """Return the map from readings of the one sensor to true values, shape (3, 3)."""
        return np.asarray(np.array(self.factor)[:, None] * np.eye(3)[list(self.order)])


@dataclasses.dataclass(frozen=True)
class Contradiction:
    """How much the accelerometers of a body contradict each other, and which mistake would explain it.

    Attributes
    ----------
    ratio
        Root mean square of what no rigid motion explains over that of the noise.
    mistake
        What leaves least of it.
    left
        Share of the mean square that it leaves.
    rivals
        What leaves hardly more.
    """

    ratio: float
    mistake: Mistake
    left: float
    rivals: tuple[Mistake, ...]


def contradiction(signals: Array, rows: Array, body: Sequence[Sensor], others: Sequence[Sensor]) -> Contradiction | None:
    """Return the contradiction between the accelerometers of a body that a mistake explains, None where none does.

    Parameters
    ----------
    signals
        Readings of ``body`` and ``others``, shape (N, 3 S).
    rows
        Motions that contradict nothing, shape (3 bodies, r).
    body
        Accelerometers of the body.
    others
        Accelerometers elsewhere, whose topic may have been exchanged with one of the body.
    """
    measured, own = measured_channels(body), 3 * len(body)
    if int(measured.sum()) - int(np.linalg.matrix_rank(rows)) < 3:
        return None
    mean, covariance = signals.mean(axis=0), np.atleast_2d(np.cov(signals, rowvar=False, bias=True))
    in_motion = residual_projection(rows)
    at_rest = residual_projection(measured[:, None].astype(float) * np.vstack([s.rotation.T for s in body]))

    def left(mistake: Array) -> float:
        moving, still = mistake[:own] @ covariance @ mistake[:own].T, at_rest @ mistake[:own] @ mean
        return float(np.sum(in_motion * moving) + still @ still)

    expected = float(np.diag(in_motion) @ np.repeat([s.noise_std**2 for s in body], 3))
    present = left(np.eye(len(mean)))
    if present <= LEAST_RATIO**2 * expected:
        return None
    tried = sorted(((left(m), found) for m, found in _hypotheses(body, others)), key=lambda entry: entry[0])
    best, mistake = tried[0]
    if best > NAMED_SHARE * present:
        return None
    rivals = tuple(other for value, other in tried[1:4] if value < _RIVAL * best)
    return Contradiction(float(np.sqrt(present / expected)), mistake, best / present, rivals)


def consistency_findings(recording: Recording, body: Sequence[Sensor], others: Sequence[Sensor], cg: Array) -> list[str]:
    """Return a sentence where exchanged topics, axes or units explain why the accelerometers contradict each other.

    Parameters
    ----------
    recording
        The run.
    body
        Accelerometers of the body.
    others
        Accelerometers elsewhere, whose topic may have been exchanged with one of the body.
    cg
        Centre of gravity of the body [m], shape (3,).
    """
    body = [s for s in body if s.name in recording.channels and s.coupling == "dc"]
    others = [s for s in others if s.name in recording.channels and s.coupling == "dc"]
    signals = _at_common_times([recording.channels[s.name] for s in (*body, *others)]) if body else None
    found = None if signals is None else contradiction(signals, motion_rows(body, cg), body, others)
    if found is None:
        return []
    text = (
        f"{found.mistake.words} would explain {100.0 * (1.0 - found.left):.0f} % of the contradiction between the accelerometers "
        f"({found.ratio:.0f} times their noise)"
    )
    return [text + (f"; so would: {'; '.join(r.words for r in found.rivals)}" if found.rivals else "")]


def _at_common_times(channels: Sequence[Channel]) -> Array | None:
    """Return the first three values of all channels at common times, shape (N, 3 S), None where they have none in common."""
    tidy = []
    for channel in channels:
        good = np.all(np.isfinite(channel.values), axis=1) & (channel.stamp_ns > 0)
        stamps, places = np.unique(channel.stamp_ns[good], return_index=True)
        if len(stamps) < 16:
            return None
        tidy.append((stamps, channel.values[good][places, :3]))
    start, end = max(s[0] for s, _ in tidy), min(s[-1] for s, _ in tidy)
    count = int(min((end - start) * 1e-9, _LONGEST_S) * _RATE_HZ)
    if count < 16:
        return None
    time = np.arange(count) / _RATE_HZ
    columns = [np.interp(time, (stamps - start) * 1e-9, values[:, i]) for stamps, values in tidy for i in range(3)]
    return np.stack(columns, axis=1)


def _hypotheses(body: Sequence[Sensor], others: Sequence[Sensor]) -> Iterator[tuple[Array, Mistake]]:
    """Yield (matrix on the stacked channels, mistake) of every exchange of two sensors and of axes and unit of one."""
    everyone = [*body, *others]
    size = 3 * len(everyone)
    for i, sensor in enumerate(body):
        for j in (j for j in range(i + 1, len(everyone)) if everyone[j].axes == sensor.axes):
            order = np.arange(size)
            order[3 * i : 3 * i + 3], order[3 * j : 3 * j + 3] = np.arange(3 * j, 3 * j + 3), np.arange(3 * i, 3 * i + 3)
            names = (sensor.name, everyone[j].name)
            yield np.eye(size)[order], Mistake(names, f"exchanged topics of {' and '.join(names)}")
        for mistake in (*(_other_axes(sensor.name) if sensor.triaxial else ()), *_other_units(sensor.name)):
            matrix = np.eye(size)
            matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mistake.turn
            yield matrix, mistake


def _other_axes(name: str) -> Iterator[Mistake]:
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            if order != (0, 1, 2) or min(signs) < 0.0:
                axes = ", ".join(f"{'+' if sign > 0.0 else '-'}{'xyz'[k]}" for k, sign in zip(order, signs))
                yield Mistake((name,), f"axes of {name} that are really {axes}", order, signs)


def _other_units(name: str) -> Iterator[Mistake]:
    for factor, words in ((_G, "in g instead of m/s^2"), (1.0 / _G, "multiplied by g once too often")):
        yield Mistake((name,), f"readings of {name} {words}", factor=(factor,) * 3)
