# Copyright 2026 ride_estimation contributors
"""Spectrum of the acceleration that deforms the frame, followed during the run: windowed periodograms with a memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: length of a periodogram [s]; its window keeps steep spectra apart
_SEGMENT = 8.0
#: rate samples are averaged to before [Hz]
_RATE = 100.0
#: bins per octave
_PER_OCTAVE = 5
#: first bin, lines of the periodogram
_FIRST = 2
#: shortest segment a spectrum is made of [s]
_SHORTEST = 2.0
#: memory of the mean over periodograms [s]
_MEMORY = 10.0
#: time between two periodograms [s]
_INTERVAL = 0.5
#: duration of averaged spectra from which on their lowest lines are not those of their neighbours [s]
_RESOLVES_SLOW = 10.0
#: equivalent noise bandwidth of the window in lines
_BANDWIDTH = 1.5


class DeformationSpectrum:
    """One-sided density of the acceleration per axis.

    Parameters
    ----------
    freedom
        Independent channels of every axis, shape (3,).
    dt
        Tick [s].
    """

    def __init__(self, freedom: Array, dt: float) -> None:
        self._freedom = freedom
        self._group = max(1, round(1.0 / (_RATE * dt)))
        self._step = self._group * dt
        self._length = round(_SEGMENT / self._step)
        top = max(1.25 * _FIRST, 0.4 * self._length)
        count = max(1, int(np.floor(_PER_OCTAVE * np.log2(top / _FIRST))))
        edges = np.unique(np.round(_FIRST * 2.0 ** (np.arange(count + 1) / _PER_OCTAVE)).astype(int))
        self._first, self._lines = edges[:-1], np.diff(edges).astype(float)
        self._stop = int(edges[-1])
        resolution = 1.0 / (self._length * self._step)
        self.frequencies = np.sqrt((edges[:-1] - 0.5) * (edges[1:] - 0.5)) * resolution
        self.widths = self._lines * resolution
        #: duration of what was averaged [s], and whether all of it came from windows of full length
        self.averaged, self._resolved = 0.0, False
        self.interrupt()
        #: density [(m/s^2)^2/Hz], shape (F, 3), and how much stronger the last seconds were
        self.density = np.zeros((len(self.frequencies), 3))
        self.surge = np.ones(3)

    def interrupt(self) -> None:
        """Forget the samples, of which the next are no continuation; the spectrum stays."""
        self._buffer: Array | None = None
        self._left: Array | None = None
        self._means: list[Array] = []
        self._filled, self._fresh = 0, 0

    def add(self, samples: Array) -> bool:
        """Take samples (K, 3 M) of the projected acceleration; return whether the spectrum is new or has other samples."""
        pending = samples if self._left is None or not len(self._left) else np.concatenate([self._left, samples])
        whole = len(pending) // self._group
        self._left = pending[whole * self._group :].copy()
        if not whole:
            return False
        groups = pending[: whole * self._group].reshape(whole, self._group, -1)
        self._means.append(np.add.reduce(groups, axis=1) / self._group)
        self._filled = min(self._filled + whole, self._length)
        self._fresh += whole
        if self._fresh * self._step < _INTERVAL or (self._filled * self._step < _SHORTEST and not self._resolved):
            return False
        self._gather()
        if self._buffer is not None:
            self._renew(self._buffer)
        return True

    def _gather(self) -> None:
        """Put the averages of the last blocks into the buffer."""
        if not self._means:
            return
        means = np.concatenate(self._means)[-self._length :]
        self._means = []
        if self._buffer is None:
            self._buffer = np.zeros((self._length, means.shape[1]))
        self._buffer = np.concatenate([self._buffer[len(means) :], means])

    def _renew(self, buffer: Array) -> None:
        window = np.zeros(self._length)
        window[-self._filled :] = np.hanning(self._filled)
        used = buffer - buffer[-self._filled :].mean(axis=0)
        lines = np.abs(np.fft.rfft(used * window[:, None], axis=0)[: self._stop]) ** 2
        lines *= 2.0 * self._step / np.sum(window**2)
        bins = np.add.reduceat(lines, self._first, axis=0)[: len(self._lines)] / self._lines[:, None]
        fresh = bins.reshape(len(bins), -1, 3).sum(axis=1) / np.maximum(self._freedom, 1e-9)
        duration, whole = self._fresh * self._step, self._filled == self._length
        # a short window smears a steep spectrum: it counts until a longer one is there
        if whole or not self._resolved:
            self.averaged, self._resolved = self.averaged + duration if whole else duration, whole
            self.density += (1.0 - np.exp(-duration / min(_MEMORY, self.averaged))) * (fresh - self.density)
        recent = used[-min(self._filled, round(_SHORTEST / self._step)) :]
        power = np.mean(recent**2, axis=0).reshape(-1, 3).sum(axis=0) / np.maximum(self._freedom, 1e-9)
        self.surge = power / np.maximum(self.widths @ self.density, 1e-30)
        self._fresh = 0

    def history(self) -> tuple[Array, float, Array]:
        """Return what is remembered of the samples: averages (L, 3 M), their distance [s], ticks not yet averaged (K, 3 M)."""
        self._gather()
        if self._buffer is None:
            return np.zeros((0, 0)), self._step, np.zeros((0, 0))
        left = np.zeros((0, self._buffer.shape[1])) if self._left is None else self._left
        return self._buffer[self._length - self._filled :], self._step, left

    @property
    def spread(self) -> Array:
        """Return the relative standard deviation of the density, shape (F, 3)."""
        independent = self._lines / _BANDWIDTH
        segments = 1.0 + min(self.averaged, 2.0 * _MEMORY) / (_SEGMENT / 2.0) / 2.0
        return np.asarray(1.0 / np.sqrt(np.maximum(independent, 1.0)[:, None] * segments * np.maximum(self._freedom, 1.0)))

    def split(self, axis: int, white: float, noise: Array) -> tuple[Array, Array, float]:
        """Separate motion from noise: densities of the motion and of noise that is not white, (F,) each, and of white noise.

        Parameters
        ----------
        axis
            Which.
        white, noise
            Densities of white and of other noise that are stated [(m/s^2)^2/Hz]; noise of shape (F,).
        """
        measured, spread = self.density[:, axis], self.spread[:, axis]
        # a stated noise larger than what was ever measured is too large
        share = min(1.0, float(np.min(measured * (1.0 + 2.0 * spread) / (white + noise))))
        white, noise = share * white, share * noise
        if axis != 2:
            # frames deform less and less quickly towards low frequency: acceleration that does not fall there is gravity through
            # tilt that is not known of
            white = max(white, float(measured[0] - noise[0]))
        elif self.averaged >= _RESOLVES_SLOW:
            # the same of what sensors at an angle make of braking, which is slow; short spectra leak into their lowest lines
            slow = max(float(measured[0]) - white, 0.0)
            noise = noise + slow * (self.frequencies[0] / self.frequencies) ** 2
        signal = np.where(measured > (1.0 + 2.0 * spread) * (white + noise), measured - white - noise, 0.0)
        return signal, noise, white

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        self._gather()
        return {
            "buffer": None if self._buffer is None else self._buffer[self._length - self._filled :].tolist(),
            "left": None if self._left is None else self._left.tolist(), "fresh": self._fresh, "averaged": self.averaged,
            "density": self.density.tolist(), "resolved": self._resolved, "surge": self.surge.tolist(),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._buffer, self._left, self._means = None, None, []
        if saved["buffer"] is not None:
            kept = np.array(saved["buffer"], dtype=float)
            self._buffer = np.zeros((self._length, kept.shape[1]))
            self._filled = len(kept)
            self._buffer[self._length - self._filled :] = kept
        if saved["left"]:
            self._left = np.array(saved["left"], dtype=float)
        self._fresh, self.averaged = int(saved["fresh"]), float(saved["averaged"])
        self._resolved = bool(saved.get("resolved", self._filled == self._length))
        self.density, self.surge = np.array(saved["density"], dtype=float), np.array(saved["surge"], dtype=float)
