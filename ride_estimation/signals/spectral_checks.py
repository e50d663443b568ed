# Copyright 2026 ride_estimation contributors
"""What the spectrum and the sign of a signal say about its chain: undersampled, mains hum, one-sided range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: block of the spectrum [samples], and fewest blocks it is judged from
_BLOCK, _LEAST_BLOCKS = 256, 8
#: part of the band next to half the sampling rate, and its share of the signal from which on more is expected beyond
_TOP, _TOP_SHARE = 0.8, 0.1
#: frequencies of the mains [Hz], and how far the mains stray from them [Hz] (EN 50160: 0.5 s means within 1 %; usually 0.05 Hz)
_MAINS_HZ, _STRAY_HZ = (50.0, 60.0), 0.06
#: shortest record in which a line of the mains can be told from an engine [s], and parts it must be alike in
_HUM_LEAST_S, _PARTS = 16.0, 4
#: power of a line over the mean of its neighbours that noise reaches once in a million frequencies
_LINE = 14.0
#: line that is worth a word, in standard deviations of the rest
_HUM_SHARE = 0.1
#: a symmetric signal would be on the other side of zero in more than this share of the samples
_OTHER_SIDE = 0.02


def undersampled_findings(values: Array, rate_hz: float, noise_std: float) -> list[str]:
    """Return a sentence where a good part of the signal is next to half the sampling rate: more of it is then folded back.

    An anti-alias filter leaves next to nothing there. The noise of the sensor, which is white, does not count.

    Parameters
    ----------
    values
        Shape (N, C), finite.
    rate_hz
        Sampling rate [Hz].
    noise_std
        Standard deviation of the noise of a sample [unit of the values].
    """
    count = len(values) // _BLOCK
    if count < _LEAST_BLOCKS:
        return []
    blocks = values[: count * _BLOCK].reshape(count, _BLOCK, -1)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    power = np.mean(np.abs(np.fft.rfft(blocks * np.hanning(_BLOCK)[None, :, None], axis=1)) ** 2, axis=0)[1:]
    total = power.sum(axis=0)
    # the same scale for the noise: its share of the variance of the blocks
    noise = total * np.minimum(noise_std**2 / np.maximum(blocks.var(axis=(0, 1)), 1e-300), 1.0)
    top = power[round(_TOP * len(power)) :].sum(axis=0) - (1.0 - _TOP) * noise
    share = top / np.maximum(total, 1e-300)
    worst = int(np.argmax(share))
    if share[worst] <= _TOP_SHARE or total[worst] <= 2.0 * noise[worst]:
        return []
    return [
        f"{100 * share[worst]:.0f} % of the signal in column {worst + 1} is above {_TOP * rate_hz / 2:.3g} Hz, next to half the "
        "sampling rate: undersampled, or without an anti-alias filter"
    ]


def hum_findings(values: Array, rate_hz: float) -> list[str]:
    """Return a sentence where a line at the frequency of the mains goes through the whole record with one phase.

    An engine near it wanders: within each quarter of the record the phase at the frequency found must be the same.

    Parameters
    ----------
    values
        Shape (N, C), finite.
    rate_hz
        Sampling rate [Hz].
    """
    count = len(values)
    if not rate_hz or count / rate_hz < _HUM_LEAST_S:
        return []
    spread = values.std(axis=0)
    centred = (values - values.mean(axis=0)) * np.hanning(count)[:, None]
    spectrum = np.abs(np.fft.rfft(centred, axis=0)) ** 2
    frequency = np.arange(len(spectrum)) * rate_hz / count
    for mains in (f for f in _MAINS_HZ if f < 0.5 * rate_hz - 1.5):
        near = np.flatnonzero(np.abs(frequency - mains) <= _STRAY_HZ + 1.0 / (count / rate_hz))
        away, step = np.abs(frequency - mains), rate_hz / count
        around = (away > 0.3 + 4.0 * step) & (away < 1.5 + 8.0 * step)
        if not len(near) or np.sum(around) < 8:
            continue
        floor = spectrum[around].mean(axis=0)
        line = spectrum[near].max(axis=0)
        # a Hann window gathers a line of amplitude a in one line of height (a N / 4)^2
        rms = np.sqrt(line / 2.0) * 4.0 / count
        for column in np.argsort(-rms / np.maximum(spread, 1e-300)):
            place = float(frequency[near[int(np.argmax(spectrum[near, column]))]])
            loud = line[column] > _LINE * max(float(floor[column]), 1e-300) and rms[column] > _HUM_SHARE * spread[column]
            if loud and _steady(values[:, column], rate_hz, mains):
                return [f"a steady line at {place:.2f} Hz, {rms[column]:.2g} rms in column {column + 1}: mains hum"]
    return []


def _steady(values: Array, rate_hz: float, mains: float) -> bool:
    """Return whether a line keeps its frequency: its phase runs through the parts of the record in equal steps."""
    pieces = np.array_split(values - values.mean(), 4 * _PARTS)
    start = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
    turned = [
        np.sum(piece * np.hanning(len(piece)) * np.exp(-2j * np.pi * mains * (first + np.arange(len(piece))) / rate_hz))
        for first, piece in zip(start, pieces)
    ]
    sizes = np.abs(turned)
    if sizes.min() < 0.5 * sizes.max():
        return False
    steps = np.angle(np.asarray(turned[1:]) / np.asarray(turned[:-1]))
    mean = np.angle(np.mean(np.exp(1j * steps)))
    off = np.abs(np.angle(np.exp(1j * (steps - mean))))
    return bool(off.max() < 0.5 and abs(mean) / (2.0 * np.pi) * rate_hz / len(pieces[0]) <= _STRAY_HZ)


def unipolar_findings(values: Array) -> list[str]:
    """Return a sentence per column that stays on one side of zero although it should not: rectified, or a range from zero up.

    A signal about as large as its mean crosses zero now and then (a Gaussian one in ``Phi(-mean / std)`` of its samples); one
    that never does although that share exceeds two per cent was cut at zero.

    Parameters
    ----------
    values
        Shape (N, C), finite.
    """
    found = []
    for i, column in enumerate(values.T if len(values) >= _BLOCK else ()):
        mean, spread = float(column.mean()), float(column.std())
        # Phi(-2.05) is two per cent
        if spread > 0.0 and abs(mean) < 2.05 * spread and np.mean(np.sign(mean) * column < -0.01 * spread) < 0.01 * _OTHER_SIDE:
            side = "below" if mean > 0.0 else "above"
            far = f"{abs(mean) / spread:.2g} standard deviations from its mean"
            found.append(f"column {i + 1} never goes {side} zero, {far}: one side of the signal is cut off (unipolar)")
    return found
