# Copyright 2026 ride_estimation contributors
"""What a search for causes leaves: the calibrated and the extended model of a run, and all it takes to judge them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.calibration.linear_model import Calibrated
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import Splits
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.prediction import Model
from ride_estimation.diagnosis.search.selection import Selection, Selector
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


def within_tolerance(adjustables: Sequence[Adjustable], coefficients: Array) -> Array:
    """Return coefficients with installation tolerances cut at three standard deviations.

    What lies beyond is a fault and not calibration: the plain model that the gain is measured against may not hide it.
    """
    limit = np.array([
        3.0 * a.prior_std if a.kind in ("gain", "misalignment", "position", "delay", "bandwidth", "cg", "inertia") else np.inf
        for a in adjustables
    ])
    # a coefficient is what comes on top of the part that the plant already holds, its offset with the sign turned
    held = np.array([a.offset if np.isfinite(b) else 0.0 for a, b in zip(adjustables, limit)])
    return np.asarray(np.clip(coefficients, held - limit, held + limit))


def plain_model(calibrated: Calibrated) -> Model:
    """Return the calibrated model without causes, to predict other runs with."""
    state = ModelState(calibrated.view.state.stiffness, calibrated.view.state.damping)
    return Model(state, calibrated.adjustables, within_tolerance(calibrated.adjustables, calibrated.fit.coefficients))


def model_of(fit: FullFit) -> Model:
    """Return the model that a fit found, to predict other runs with."""
    state = ModelState(fit.view.state.stiffness, fit.view.state.damping, held=fit.view.state.held)
    coefficients = fit.coefficients[: fit.regression.count]
    return Model(state, fit.adjustables, coefficients, fit.fitted, fit.view.scales, fit.view.plant)


@dataclasses.dataclass(frozen=True)
class Work:
    """Everything the conclusion needs."""

    vehicle: Vehicle
    calibrated: Calibrated
    splits: Splits
    selector: Selector
    selection: Selection
    settings: Settings

    @property
    def plant(self) -> Plant:
        """Return the calibrated plant."""
        return self.calibrated.view.plant

    @property
    def data(self) -> RunData:
        """Return the run."""
        return self.calibrated.view.data

    @property
    def baseline(self) -> Model:
        """Return the calibrated model."""
        return plain_model(self.calibrated)

    @property
    def extended(self) -> Model:
        """Return the extended model, the calibrated one where nothing was accepted."""
        fit = self.selection.accepted
        return self.baseline if fit is None else model_of(fit)

    def stated(self) -> Work:
        """Return the same with the standard deviations that are stated, see :meth:`fitting.FullFitter.stated`."""
        fit = self.selection.accepted
        if fit is None:
            return self
        return dataclasses.replace(self, selection=dataclasses.replace(self.selection, accepted=self.selector.fitter.stated(fit)))
