# Copyright 2026 ride_estimation contributors
"""What the residual of a right model may be: sensor noise, tilt of brackets that no sensor sees, and tolerated model error."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.frame import tilt_uncertainty, turned
from ride_estimation.diagnosis.runs.model_run import ModelRun
from ride_estimation.diagnosis.runs.noise import (
    DeflectionFilter,
    deflection_filter,
    gross_power,
    over_band,
    residual_covariance,
    smoothed_power,
    whitening,
)
from ride_estimation.diagnosis.runs.run_data import RunData

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_SILENT = 1e-8  # share of the largest output that is rounding



class NoiseModel:
    """The noise of a run as one model propagates it; models that are compared share the one of the first of them.

    What is asked for is made when it is, and what is large and asked for once is not kept: a prediction needs the filter alone.

    Parameters
    ----------
    data, model
        The run and the model whose transfer functions carry the noise of the base sensors.

    Attributes
    ----------
    disturbance
        Standard deviation per sample of input noise and of what is unknown of the tilt of brackets, shape (F, d).
    """

    def __init__(self, data: RunData, model: ModelRun) -> None:
        self._data, self._model = data, model
        grid, r, plant, n = data.grid, model.response, data.plant, data.grid.samples
        std = data.noise_scale * np.array([s.noise_std for s in plant.inputs])
        std = std * grid.omega[:, None] ** np.array([s.noise_slope for s in plant.inputs])
        from_input = r.base_from_input
        spectra = model.base_spectrum, data.input_spectrum, from_input * std[:, None, :]
        tilt, turning = tilt_uncertainty(plant, *spectra, grid.omega, n, data.smoothing)
        self.disturbance: Array = np.concatenate([std, tilt], axis=1)
        base, wrench = turned(plant, turning, r.twice_integrated)
        self._base: Array = np.concatenate([from_input, base], axis=2)
        self._coordinates = r.coordinates(
            self._base, np.concatenate([plant.static_tilt() * r.twice_integrated, wrench], axis=2)
        )

    @property
    def output_transfer(self) -> ComplexArray:
        """Return how disturbances reach the outputs, static loads that turn with their bases included, shape (F, ny, d)."""
        return self._model.response.outputs(self._coordinates, self._base)

    @property
    def deflection_transfer(self) -> ComplexArray:
        """Return how disturbances reach the deflections, shape (F, P, d)."""
        return self._model.response.deflections(self._coordinates, self._base)

    @property
    def _gross(self) -> Array:
        data, model, n = self._data, self._model, self._data.grid.samples
        return gross_power(
            smoothed_power(data.output_spectrum, n, data.smoothing), model.response.output_from_coordinate,
            model.coordinate_spectrum, n, data.smoothing, np.array([s.kind != "displacement" for s in data.plant.outputs]),
        )

    @functools.cached_property
    def power_ratio(self) -> Array:
        """Return the power that a relative error of the model refers to, see :func:`noise.gross_power`, and what the unknown
        tilt adds to it, in the band over the measured one, at least one, shape (ny,).
        """
        data, weight = self._data, self._data.grid.band_weight[:, None]
        level = np.sum(np.abs(data.output_spectrum * weight) ** 2, axis=0) / data.grid.samples
        tilts = slice(len(data.plant.inputs), None)
        unknown = np.sum(np.abs(self.output_transfer[:, :, tilts] * self.disturbance[:, None, tilts]) ** 2, axis=2)
        total = np.sum((self._gross + unknown / data.settings.adequacy**2) * weight**2, axis=0)
        return np.asarray(np.maximum(total / np.maximum(level, 1e-300), 1.0))

    @functools.cached_property
    def covariance(self) -> ComplexArray:
        """Return the covariance of the residual, shape (F, ny, ny)."""
        data, gross = self._data, self._gross
        return residual_covariance(
            data.output_noise,
            self.output_transfer * self.disturbance[:, None, :],
            over_band(gross, data.grid.band_weight) if data.settings.over_band else gross,
            data.settings.adequacy,
        )

    @functools.cached_property
    def whitener(self) -> ComplexArray:
        """Return the inverse square root of the covariance times the weight of the band, shape (F, ny, ny)."""
        return whitening(self.covariance, self._data.grid.band_weight, self._data.plant.output_basis[0])

    def silent(self, plant: Plant) -> int:
        """Return how many of the first whitened channels no motion of the bodies of a plant reaches."""
        basis, silent = self._data.plant.output_basis
        reached = basis @ plant.motion_outputs
        return silent if np.all(np.abs(reached[:silent]) < _SILENT * np.abs(reached).max(initial=0.0)) else 0

    @functools.cached_property
    def filter(self) -> DeflectionFilter:
        """Return what keeps of apparent deflections what is not noise.

        Below the band the apparent deflection is integration drift; the body follows slow base motion.
        """
        return deflection_filter(
            self._model.deflection_spectrum, self.deflection_transfer * self.disturbance[:, None, :], self._data.grid.samples,
            max(3, self._data.smoothing // 2),
        )
