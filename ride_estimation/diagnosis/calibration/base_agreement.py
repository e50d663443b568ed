# Copyright 2026 ride_estimation contributors
"""Whether the accelerometers at mount bases read what one frame does: evidence for and against errors of one of them.

A frame moves nearly as a rigid, twisting plate. Four triaxial accelerometers on it read more than its seven motions, and a fault
of one of them shows in what they have beyond these, however the body above answers: a body on two lateral springs side by
side cannot tell which of both base readings is too large.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import sensor_error_spectra
from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.runs.frame import null_directions, own_sensor, plate_motion
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


class BaseAgreement:
    """How well the base readings of a run agree with frames that move as rigid, twisting plates.

    Parameters
    ----------
    view
        Run seen through the calibrated model.

    Notes
    -----
    Along the d directions that a plate cannot move, the readings of a right model have noise, the tolerances of the sensors and
    what brackets move on their own, with a covariance that nobody knows. With the prior of Jeffreys for it, n samples with the
    matrix S of squares and products have the likelihood ``det(S)^(-n/2)``. What brackets move on their own is as coherent as
    what a fault makes: it is one pattern, and one sample, per octave.
    """

    def __init__(self, view: RunView) -> None:
        self._view = view

    @functools.cached_property
    def _reach(self) -> ComplexArray:
        """Return what unit readings have beyond plates, shape (F, d, nu)."""
        plant, base_from_input = self._view.plant, self._view.response.base_from_input
        sensors = plant.vehicle.sensors
        found = [np.zeros((len(base_from_input), 0, base_from_input.shape[2]), dtype=complex)]
        for base in dict.fromkeys(sensors[s.sensor].body for s in plant.inputs):
            mounts = [*own_sensor(plant, base)]
            if len(mounts) < 3:
                continue
            rows = np.concatenate([3 * plant.mounts.index(m) + np.arange(len(AXES)) for m in mounts])
            null = null_directions(plate_motion(np.array([plant.vehicle.mounts[m].position for m in mounts])))
            found.append(null.T @ base_from_input[:, rows])
        return np.concatenate(found, axis=1)

    @functools.cached_property
    def _octaves(self) -> list[IntArray]:
        """Return the bins of every octave of the band."""
        grid = self._view.grid
        octave = np.floor(np.log2(np.maximum(grid.frequency / grid.lower_hz, 1e-9)) + 1e-9)
        inside = (grid.frequency >= grid.lower_hz) & (grid.frequency <= grid.upper_hz)
        return [np.flatnonzero(inside & (octave == n)) for n in np.unique(octave[inside])]

    def _products(self, spectrum: ComplexArray) -> Array:
        """Return the squares and products of signals (F, d) in every octave, shape (octaves, d, d)."""
        return np.array([np.real(spectrum[bins].T @ spectrum[bins].conj()) for bins in self._octaves])

    @functools.cached_property
    def _measured(self) -> ComplexArray:
        return self._beyond(self._view.data.input_spectrum)

    def _beyond(self, inputs: ComplexArray) -> ComplexArray:
        return np.asarray((self._reach @ inputs[:, :, None])[:, :, 0])

    @functools.cached_property
    def _in_order(self) -> Array:
        """Return the squares and products that noise and tolerances of sensors in good order make, shape (octaves, d, d)."""
        view, plant, grid = self._view, self._view.plant, self._view.grid
        std = view.data.noise_scale * np.array([s.noise_std for s in plant.inputs])
        std = std * grid.omega[:, None] ** np.array([s.noise_slope for s in plant.inputs])
        out = np.zeros((len(self._octaves), *self._reach.shape[1:2] * 2))
        for i in range(len(plant.inputs)):
            out += grid.samples * self._products(self._reach[:, :, i] * std[:, i : i + 1])
        for sensor in dict.fromkeys(s.sensor for s in plant.inputs):
            installed = view.settings.tolerances.of(plant.vehicle.sensors[sensor])
            for kind in ("gain", "misalignment", "delay"):
                for component in range(1 if kind == "delay" else len(AXES)):
                    errors, _ = sensor_error_spectra(view, sensor, kind, component)
                    reading = np.zeros_like(view.data.input_spectrum)
                    for i, spectrum in errors.items():
                        reading[:, i] = spectrum
                    out += getattr(installed, kind) ** 2 * self._products(self._beyond(reading))
        return out

    def evidence(self, effects: Sequence[Effect]) -> float:
        """Return how much likelier the base readings are without some of their errors [nat].

        Parameters
        ----------
        effects
            Of a model; what they take from inputs counts.
        """
        errors = [e for e in effects if e.where is Where.INPUT]
        if not errors or not self._reach.shape[1]:
            return 0.0
        right = self._measured.copy()
        for e in errors:
            right += self._reach[:, :, e.index] * self._view.grid.spectrum(e.signal)[:, None]
        least = self._in_order
        logs = [np.linalg.slogdet(self._products(beyond) + least)[1] for beyond in (right, self._measured)]
        return float(0.5 * np.sum(logs[1] - logs[0]))
