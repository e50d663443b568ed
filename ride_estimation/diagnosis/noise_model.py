# Copyright 2026 ride_estimation contributors
"""What the residual of a right model may be: sensor noise, tilt of brackets that no sensor sees, and tolerated model error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.frame import tilt_uncertainty
from ride_estimation.diagnosis.model_run import ModelRun
from ride_estimation.diagnosis.noise import (
    deflection_filter,
    gross_power,
    over_band,
    residual_covariance,
    smoothed_power,
    whitening,
)
from ride_estimation.diagnosis.run_data import RunData

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class NoiseModel:
    """The noise of a run as one model propagates it; models that are compared share the one of the first of them.

    Parameters
    ----------
    data, model
        The run and the model whose transfer functions carry the noise of the base sensors.

    Attributes
    ----------
    disturbance
        Standard deviation per sample of input noise and of what is unknown of the tilt of brackets, shape (F, d).
    output_transfer, deflection_transfer
        How they reach outputs and deflections, static loads that turn with their bases included, shapes (F, ny, d), (F, P, d).
    power_ratio
        Power that a relative error of the model refers to, see :func:`noise.gross_power`, and what the unknown tilt adds to it,
        in the band over the measured one, at least one, shape (ny,).
    covariance
        Of the residual, shape (F, ny, ny).
    whitener
        Inverse square root of the covariance times the weight of the band, shape (F, ny, ny).
    filter
        Keeps of apparent deflections what is not noise.
    """

    def __init__(self, data: RunData, model: ModelRun) -> None:
        grid, r, plant, settings = data.grid, model.response, data.plant, data.settings
        std = data.noise_scale * np.array([s.noise_std for s in plant.inputs])
        std = std * grid.omega[:, None] ** np.array([s.noise_slope for s in plant.inputs])
        twice = (-1.0 / grid.omega**2)[:, None, None]
        turned = plant.static_tilt() * twice
        spectra = model.base_spectrum, data.input_spectrum, r.base_from_input * std[:, None, :]
        tilt, output, deflection = tilt_uncertainty(plant, r, *spectra, grid.samples, data.smoothing)
        self.disturbance: Array = np.concatenate([std, tilt], axis=1)
        self.output_transfer: ComplexArray = np.concatenate(
            [r.output_from_input + r.output_from_wrench @ turned, output], axis=2
        )
        of_input = r.deflection_from_base @ r.base_from_input
        self.deflection_transfer: ComplexArray = np.concatenate(
            [of_input + r.deflection_from_wrench @ turned, deflection], axis=2
        )
        gross = gross_power(
            smoothed_power(data.output_spectrum, grid.samples, data.smoothing),
            r.output_from_coordinate, model.coordinate_spectrum, grid.samples, data.smoothing,
            np.array([s.kind == "acceleration" for s in plant.outputs]),
        )
        of_outputs = self.output_transfer * self.disturbance[:, None, :]
        self.power_ratio = self._power_ratio(data, gross, of_outputs[:, :, len(plant.inputs) :])
        self.covariance = residual_covariance(
            data.noise_scale * np.array([s.noise_std for s in plant.outputs]),
            of_outputs,
            over_band(gross, grid.band_weight) if settings.over_band else gross,
            settings.adequacy,
        )
        self.whitener = whitening(self.covariance, grid.band_weight)
        # below the band the apparent deflection is integration drift; the body follows slow base motion
        self.filter = deflection_filter(
            model.deflection_spectrum, self.deflection_transfer * self.disturbance[:, None, :], grid.samples,
            max(3, data.smoothing // 2),
        )

    @staticmethod
    def _power_ratio(data: RunData, gross: Array, tilts: ComplexArray) -> Array:
        weight = data.grid.band_weight[:, None]
        level = np.sum(np.abs(data.output_spectrum * weight) ** 2, axis=0) / data.grid.samples
        unknown = np.sum(np.abs(tilts) ** 2, axis=2) / data.settings.adequacy**2
        total = np.sum((gross + unknown) * weight**2, axis=0)
        return np.asarray(np.maximum(total / np.maximum(level, 1e-300), 1.0))
