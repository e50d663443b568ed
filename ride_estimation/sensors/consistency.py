# Copyright 2026 ride_estimation contributors
"""Whether the accelerometers of a body fit one rigid body, and whether exchanged topics or axes would make them fit.

With second moments C of all channels y and the residual projector ``P = I - H H^+`` of the layout, the mean squared residual
of a hypothesis M (exchange of two sensors, or of axes and signs of one) is ``tr(P M C M^T)``: every hypothesis is tried.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.sensors.layout import measured_channels, motion_rows
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


def consistency_findings(recording: Recording, body: Sequence[Sensor], others: Sequence[Sensor], cg: Array) -> list[str]:
    """Return a sentence where exchanged topics or axes explain why the accelerometers contradict each other.

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
    rows = motion_rows(body, cg)
    measured = measured_channels(body)
    spare = int(measured.sum()) - int(np.linalg.matrix_rank(rows)) if len(rows) else 0
    if spare < 3:
        return []
    moments = _second_moments([recording.channels[s.name] for s in (*body, *others)])
    if moments is None:
        return []
    own = 3 * len(body)
    projector = np.diag(measured.astype(float)) - rows @ np.linalg.pinv(rows)
    noise = np.repeat([s.noise_std**2 for s in body], 3)
    expected = float(np.diag(projector) @ noise)
    present = float(np.trace(projector @ moments[:own, :own]))
    if present <= LEAST_RATIO**2 * expected:
        return []
    tried = [(float(np.trace(projector @ (m @ moments @ m.T)[:own, :own])), words) for m, words in _hypotheses(body, others)]
    tried.sort(key=lambda entry: entry[0])
    best, words = tried[0]
    if best > NAMED_SHARE * present:
        return []
    rivals = [w for value, w in tried[1:4] if value < _RIVAL * best]
    text = (
        f"{words} would explain {100.0 * (1.0 - best / present):.0f} % of the contradiction between the accelerometers "
        f"({np.sqrt(present / expected):.0f} times their noise)"
    )
    return [text + (f"; so would: {'; '.join(rivals)}" if rivals else "")]


def _second_moments(channels: Sequence[Channel]) -> Array | None:
    """Return E[y y^T] of the first three values of all channels at common times, None where they have none in common."""
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
    signals = np.vstack(columns)
    return np.asarray(signals @ signals.T / count)


def _hypotheses(body: Sequence[Sensor], others: Sequence[Sensor]) -> Iterator[tuple[Array, str]]:
    """Yield (matrix on the stacked channels, words) of every exchange of two sensors and of the axes of one."""
    everyone = [*body, *others]
    size = 3 * len(everyone)
    for i in range(len(body)):
        for j in (j for j in range(i + 1, len(everyone)) if everyone[j].axes == everyone[i].axes):
            order = np.arange(size)
            order[3 * i : 3 * i + 3], order[3 * j : 3 * j + 3] = np.arange(3 * j, 3 * j + 3), np.arange(3 * i, 3 * i + 3)
            yield np.eye(size)[order], f"exchanged topics of {everyone[i].name} and {everyone[j].name}"
        for turn, words in _signed_permutations() if everyone[i].triaxial else ():
            matrix = np.eye(size)
            matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turn
            yield matrix, f"axes of {everyone[i].name} that are really {words}"


def _signed_permutations() -> Iterator[tuple[Array, str]]:
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if not np.array_equal(turn, np.eye(3)):
                yield turn, ", ".join(f"{'+' if sign > 0.0 else '-'}{'xyz'[k]}" for k, sign in zip(order, signs))
