# Copyright 2026 ride_estimation contributors
"""One run seen through one state of the model: whitened residual, corrected motion, and the way any effect enters it."""

from __future__ import annotations

import copy
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Where
from ride_estimation.diagnosis.runs.injection import Injector
from ride_estimation.diagnosis.runs.model_run import ModelRun, ModelState
from ride_estimation.diagnosis.runs.noise import excess_inefficiency, missing_forces, smoothed_power
from ride_estimation.diagnosis.runs.noise_model import NoiseModel
from ride_estimation.diagnosis.runs.run_data import RunData

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_BATCH = 32  # columns whose spectra are held at once: those of a general law at four mounts take a hundred megabytes


class RunView:
    """A run seen through a state of the model.

    Parameters
    ----------
    data, state
        What is tested, with what.
    noise
        Noise model of another view of the same run, so that two states are compared by the same measure; that of this state
        where None.
    scales
        Deflection and rate rms of the ports that shape parameters of laws refer to, where they come from another run.
    sees_outputs
        Correct the motion by the residual; False for predictions that may not see the measured outputs.

    Attributes
    ----------
    model, noise
        The simulated run and what its residual may be.
    residual_spectrum
        Measured less predicted outputs, shape (F, ny).
    coordinate_spectrum, deflection_spectrum, deflection, deflection_rate
        Motion, corrected by the residual where that may be seen, shapes (F, n), (F, P), (N, P), (N, P). A law is evaluated where
        a mount really is: the signals hold what it deflects below the band too, the spectra do not.
    block_dof
        Degrees of freedom of every block, shape (B,).
    """

    def __init__(
        self,
        data: RunData,
        state: ModelState,
        noise: NoiseModel | None = None,
        scales: Mapping[int, tuple[float, float]] | None = None,
        sees_outputs: bool = True,
    ) -> None:
        self.data, self.state, self.sees_outputs = data, state, sees_outputs
        self.plant, self.settings, self.grid, self.blocks = data.plant, data.settings, data.grid, data.blocks
        self.model = ModelRun(data, state)
        self.response = self.model.response
        self.noise = NoiseModel(data, self.model) if noise is None else noise
        self.residual_spectrum = data.output_spectrum - self.model.predicted_spectrum
        share = float(np.sum(self.grid.band_weight**2) / (self.grid.decimated / 2))
        self.block_dof = self.blocks.weight.sum(axis=1) * len(self.plant.outputs) * share
        self._correct_motion()
        self.scales = dict(scales) if scales is not None else self._port_scales()

    @functools.cached_property
    def _injector(self) -> Injector:
        return Injector(self.grid, self.response, self.noise.whitener, self.noise.silent(self.plant))

    @functools.cached_property
    def residual(self) -> Array:
        """Return the whitened rows of the residual, shape (B, ny * L), see :meth:`rows`."""
        return self.rows(self.residual_spectrum[:, :, None])[:, :, 0]

    @functools.cached_property
    def _white_residual(self) -> ComplexArray:
        """Return the whitened residual of the analysed stretch, shape (F, ny)."""
        return np.asarray((self.noise.whitener @ self.data.inside(self.residual_spectrum)[:, :, None])[:, :, 0])

    @functools.cached_property
    def inefficiency(self) -> float:
        """Return the nominal degrees of freedom per independent sample of what the model misses."""
        return excess_inefficiency(self._white_residual, self.grid.samples)

    @functools.cached_property
    def _force_power(self) -> Array:
        """Return the power of the known port forces per bin, shape (F, P)."""
        stiffness, damping = self.state.linear
        force = (stiffness + 1j * self.grid.omega[:, None] * damping) * self._filtered(self.model.deflection_spectrum)
        return smoothed_power(force, self.grid.samples, self.data.smoothing)

    def _filtered(self, deflection: ComplexArray, power: float = 1.0) -> ComplexArray:
        """Return a deflection spectrum (F, P) without what noise of the base sensors may be, from the band on."""
        return np.asarray(self.grid.low_flank[:, None] * self.noise.filter.apply(deflection, power))

    def _correct_motion(self) -> None:
        """Correct deflections and body motion by what the residual says about forces the model does not have.

        Unknown port forces have the spectrum of the known ones, at the level that explains the excess of the residual; laws
        are evaluated on the corrected deflection, which is the real one to first order whatever the cause is.
        """
        r = self.response
        self.coordinate_spectrum = self.model.coordinate_spectrum
        self.deflection_spectrum = self._filtered(self.model.deflection_spectrum)
        share = self._missing_share() if self.sees_outputs else 0.0
        if share > 0.0:
            wrench = -self.missing_forces(self.residual_spectrum, share) @ self.plant.port_map
            moved = (r.coordinate_from_wrench @ wrench[:, :, None])[:, :, 0]
            self.deflection_spectrum = self.deflection_spectrum + moved @ self.plant.port_map.T
            self.coordinate_spectrum = self.coordinate_spectrum + moved
        self._slow = self.model.slow_deflection, self.model.slow_rate
        self._set_motion()

    def _missing_share(self) -> float:
        """Return the share of the power of the port forces that the model does not have, 0 to 1."""
        white_from_port = self._injector.transfer(Where.PORT, single=True)
        expected = float(np.sum(np.sum(np.abs(white_from_port) ** 2, axis=1) * self._force_power))
        degrees = float(np.sum(self.grid.band_weight**2)) * len(self.plant.outputs)
        excess = float(np.sum(np.abs(self._white_residual) ** 2)) / self.grid.samples - degrees
        return float(np.clip(excess / max(expected, 1e-300), 0.0, 1.0))

    def _set_motion(self) -> None:
        """Form the signals of deflections and their rates, with what lies below the band."""
        spectrum = self.deflection_spectrum
        rate = self.grid.signal(1j * self.grid.omega[:, None] * spectrum)
        self.deflection, self.deflection_rate = self.grid.signal(spectrum) + self._slow[0], rate + self._slow[1]

    @property
    def strokes(self) -> tuple[Array, Array]:
        """Return deflections and rates within the blocks, shape (samples, P) each.

        At the faded ends the motion is that of the fading, several times what the mounts ever do.
        """
        inside = self.data.analysed_samples
        return self.deflection[inside], self.deflection_rate[inside]

    def refined_motion(self, port: int) -> tuple[Array, Array]:
        """Return deflection and rate of a port as densely as :attr:`FrequencyGrid.refinement` asks for."""
        grid, spectrum = self.grid, self.deflection_spectrum[:, port]
        fine = np.arange(grid.refinement * grid.samples) / grid.refinement
        slow = (np.interp(fine, np.arange(grid.samples), s[:, port]) for s in self._slow)
        fast = (grid.refined(s) for s in (spectrum, 1j * grid.omega * spectrum))
        x, v = (a + b for a, b in zip(fast, slow))
        return x, v

    def missing_forces(self, residual: ComplexArray, share: float) -> ComplexArray:
        """Return the port forces (F, P) that a residual (F, ny) asks for if they have a share of the power of the known ones."""
        seen = self.data.analysed(residual) * self.grid.low_flank[:, None]
        return missing_forces(seen, self.response.output_from_port, share * self._force_power, self.noise.covariance)

    def _port_scales(self) -> dict[int, tuple[float, float]]:
        """Return deflection and rate rms of every port, see :attr:`strokes`."""
        x, v = (np.sqrt(np.mean(s**2, axis=0)) for s in self.strokes)
        return {p: (float(max(x[p], 1e-15)), float(max(v[p], 1e-15))) for p in range(len(self.plant.ports))}

    def rows(self, output_spectrum: NDArray[Any], single: bool = False) -> Array:
        """Return whitened rows of output spectra (F, ny, q) as blocks, channel after channel, shape (B, ny * L, q).

        Parameters
        ----------
        single
            Transform in single precision, for rows that are kept in that.
        """
        white: NDArray[Any] = self.noise.whitener @ output_spectrum
        return self._dealt(white.astype(np.complex64) if single else white)

    def port_rows(self, ports: Sequence[int], forces: ComplexArray) -> Array:
        """Return whitened rows of tensions in ports, one force spectrum (F, q) each, in single precision, see :meth:`push`."""
        transfer = self._injector.transfer(Where.PORT, single=True)[:, :, ports]
        return self._dealt(transfer * forces.astype(np.complex64)[:, None, :])

    def _dealt(self, white: NDArray[Any]) -> Array:
        """Return whitened spectra (F, channels, q) as blocks, channel after channel, shape (B, channels * L, q)."""
        signal = self.grid.decimated_signal(white)
        blocks, length = self.blocks.index.shape
        first = int(self.blocks.index[0, 0]) if blocks else 0
        if blocks and np.all(self.blocks.weight == 1.0) and self.blocks.index[-1, -1] == first + blocks * length - 1:
            picked = signal[first : first + blocks * length].reshape(blocks, length, *signal.shape[1:])
        else:
            picked = signal[self.blocks.index] * self.blocks.weight[:, :, None, None].astype(signal.dtype)
        return np.ascontiguousarray(picked.swapaxes(1, 2)).reshape(blocks, -1, signal.shape[2])

    def push(self, columns: Sequence[Column], single: bool = False) -> Array:
        """Return the whitened rows of columns of effects, shape (B, R, q); see :meth:`rows`.

        Those of forces alone are the last rows of every block: no force reaches the others.
        """
        if len(columns) <= _BATCH:
            return self._dealt(self._injector.whitened(columns, single))
        blocks, length = self.blocks.index.shape
        out = np.zeros((blocks, self._injector.reached(columns) * length, len(columns)), dtype=np.float32 if single else float)
        for first in range(0, len(columns), _BATCH):
            part = slice(first, first + _BATCH)
            rows = self._dealt(self._injector.whitened(columns[part], single))
            out[:, out.shape[1] - rows.shape[1] :, part] = rows
        return out

    def with_deflection_noise(self, seed: int) -> RunView:
        """Return the view with one realisation of the error that the measured base motion leaves in the deflections."""
        rng = np.random.default_rng(seed)
        white = rng.standard_normal((self.grid.samples, self.noise.disturbance.shape[1]))
        disturbance = self.grid.spectrum(white) * self.noise.disturbance
        error = np.einsum("fij,fj->fi", self.noise.deflection_transfer, disturbance)
        return self._deflected(self._filtered(error, 0.5))

    def with_port_forces(self, ports: Sequence[int], forces: Array) -> RunView:
        """Return the view with deflections moved by further port forces, shape (N, ports); full rotation left out."""
        wrench = -self.grid.spectrum(forces) @ self.plant.port_map[list(ports)]
        spectrum = (self.response.coordinate_from_wrench @ wrench[:, :, None])[:, :, 0] @ self.plant.port_map.T
        return self._deflected(self._filtered(spectrum), self.model.slow_from_ports(ports, forces))

    def _deflected(self, further: ComplexArray, slow: Array | None = None) -> RunView:
        """Return the view with its deflections moved by a spectrum, shape (F, P), and by what lies below the band, (N, P)."""
        other = copy.copy(self)
        other.deflection_spectrum = self.deflection_spectrum + further
        if slow is not None:
            other._slow = self._slow[0] + slow, self._slow[1] + self.model.slow_rate_of(slow)
        other._set_motion()
        return other

    def rotation_wrench(self, axes: str) -> Array:
        """Return what full rotation adds to the linear wrench when the mount axes turn with ``axes``, shape (N, n)."""
        return self.model.rotation_wrench(axes, self.deflection, self.deflection_rate)

    def port_index(self, mount: str, axis: str) -> int:
        """Return the row of a port."""
        return [(p.mount, p.axis) for p in self.plant.ports].index((mount, axis))
