# Copyright 2026 ride_estimation contributors
"""What is known of a run before any model: its spectra, the stretch that is analysed, and how noisy its sensors are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import make_grid
from ride_estimation.diagnosis.model.measurement import Measurement
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.blocks import BRIDGED_S, fading, inside_window, make_blocks, stretches_of
from ride_estimation.diagnosis.runs.noise import gyro_noise_scale, noise_scale
from ride_estimation.signals.recording import run_title

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class RunData:
    """Measured channels of a plant on one frequency grid, without their means.

    Parameters
    ----------
    plant, measured, settings
        Channels, their samples, band and blocks.

    Attributes
    ----------
    output_mean, input_mean
        Mean readings, shapes (ny,) and (nu,).
    output_spectrum, input_spectrum
        Of the readings less their means, ends and long gaps faded, shapes (F, ny) and (F, nu).
    stretches
        Parts of the run between long gaps, first sample and the one after the last.
    slow_force, left_force
        Specific force that the bases share less its mean [m/s^2], below the kept bins and below the band, shape (N, 3) each.
    noise_scale, gyro_scale
        How much noisier the body accelerometers are than stated, and their gyros, by sensor.
    output_noise
        Standard deviation of one sample of every output as measured, shape (ny,).
    """

    def __init__(self, plant: Plant, measured: Measurement, settings: Settings) -> None:
        self.plant, self.measured, self.settings = plant, measured, settings
        self.grid = make_grid(len(measured.outputs), measured.rate_hz, settings.band_hz)
        self.stretches = stretches_of(measured.valid, measured.rate_hz)
        self.blocks = make_blocks(self.grid, measured.valid, self.stretches, settings)
        self.time_s = np.arange(self.grid.samples) / measured.rate_hz
        self._taper = fading(self.grid.samples, self.stretches, measured.rate_hz)
        self._inside = inside_window(self.grid, measured.valid, self.stretches, settings)
        inputs = plant.put_right(measured.inputs)
        self.output_mean = measured.outputs[measured.valid].mean(axis=0)
        self.input_mean = inputs[measured.valid].mean(axis=0)
        self.output_spectrum = self.grid.spectrum(self.tapered(measured.outputs - self.output_mean))
        inputs = self.tapered(inputs - self.input_mean)
        self.input_spectrum = self.grid.spectrum(inputs)
        self.slow_force, self.left_force = (self.grid.below(inputs @ plant.shared_base.T, flank) for flank in (False, True))
        self.noise_scale = self._noise_scale()
        self.gyro_scale = self._gyro_scale()
        stated = np.array([s.noise_std for s in plant.outputs])
        scale = [self.gyro_scale[s.sensor] if s.kind == "rate" else self.noise_scale for s in plant.outputs]
        self.output_noise: Array = np.array(scale) * stated

    def _noise_scale(self) -> float:
        rows = [i for i, s in enumerate(self.plant.outputs) if s.kind == "acceleration"]
        if not rows:
            return 1.0
        stated = np.array([self.plant.outputs[i].noise_std for i in rows])
        frequency = np.minimum(self.grid.frequency, self.grid.upper_hz)
        sensors = [self.plant.outputs[i].sensor for i in rows]
        return noise_scale(
            self.output_spectrum[:, rows], self.plant.out_acceleration[rows], stated, frequency, self.grid.samples, sensors
        )

    def _gyro_scale(self) -> dict[str, float]:
        plant, inside = self.plant, self.grid.frequency < self.grid.upper_hz
        seen = [i for i, s in enumerate(plant.outputs) if s.kind == "acceleration"]
        found = {}
        stated = np.array([s.noise_std for s in plant.outputs])
        for sensor in dict.fromkeys(s.sensor for s in plant.outputs if s.kind == "rate"):
            own = [i for i, s in enumerate(plant.outputs) if s.kind == "rate" and s.sensor == sensor]
            spectra = self.output_spectrum[inside][:, seen], self.output_spectrum[inside][:, own]
            maps, noise = (plant.out_acceleration[seen], plant.out_rate[own]), (self.noise_scale * stated[seen], stated[own])
            found[sensor] = gyro_noise_scale(spectra, maps, noise, self.grid.omega[inside], self.grid.samples)
        return found

    def with_plant(self, plant: Plant) -> RunData:
        """Return the run for a plant of the same channels."""
        return self if plant is self.plant else RunData(plant, self.measured, self.settings)

    @property
    def smoothing(self) -> int:
        """Return the number of bins within half a hertz."""
        return max(3, round(0.5 * self.grid.padded / self.grid.rate_hz))

    def tapered(self, signal: Array) -> Array:
        """Return a signal with the ends of every stretch faded in and out, shape (N, q)."""
        return signal * self._taper[:, None]

    def analysed(self, spectrum: ComplexArray) -> ComplexArray:
        """Return the spectrum of the analysed stretch of signals, shape (F, q)."""
        return self.grid.spectrum(self.grid.signal(spectrum) * self._inside[:, None])

    def inside(self, spectrum: ComplexArray) -> ComplexArray:
        """Return the spectrum of the analysed stretch of signals, scaled to the level of the whole run, shape (F, q).

        At both ends the fading of the recording excites the model; what it misses there says nothing about it.
        """
        level = np.sqrt(self.grid.samples / max(float(np.sum(self._inside**2)), 1.0))
        return self.grid.spectrum(self.grid.signal(spectrum) * (level * self._inside)[:, None])

    @property
    def gap_warning(self) -> str:
        """Return how much of a run with long gaps is analysed, empty for one without."""
        count = len(self.stretches) - 1
        if count < 1:
            return ""
        gaps = "a gap" if count == 1 else f"{count} gaps"
        return (
            f"{run_title(self.measured.name)}: {gaps} longer than {BRIDGED_S:g} s; "
            f"{self.blocks.count * self.settings.block_s:.0f} of {self.grid.duration_s:.0f} s are analysed"
        )

    @property
    def analysed_samples(self) -> NDArray[np.bool_]:
        """Return which samples lie within blocks, all where there are none, shape (N,)."""
        every = np.arange(self.blocks.count)
        return self.block_window(every) > 0.0 if len(every) else np.ones(self.grid.samples, dtype=bool)

    def block_window(self, blocks: NDArray[np.int64]) -> Array:
        """Return one within some blocks and zero elsewhere and inside gaps, shape (N,)."""
        ratio = self.grid.rate_hz / self.grid.decimated_rate_hz
        length = round(self.blocks.index.shape[1] * ratio)
        window = np.zeros(self.grid.samples)
        for first in np.round(self.blocks.index[blocks, 0] * ratio).astype(int):
            window[first : first + length] = 1.0
        return window * self.measured.valid
