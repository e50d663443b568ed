# Copyright 2026 ride_estimation contributors
"""One run seen through one state of the model: trajectories, whitened residual and the way any effect enters it."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.blocks import inside_window, make_blocks
from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.frame import tilt_doubt
from ride_estimation.diagnosis.injection import Injector
from ride_estimation.diagnosis.kinematics import (
    BodyMotion,
    base_correction,
    output_correction,
    transducer_correction,
    wrench_correction,
)
from ride_estimation.diagnosis.noise import (
    DeflectionFilter,
    deflection_filter,
    excess_inefficiency,
    gross_power,
    missing_forces,
    noise_scale,
    over_band,
    residual_covariance,
    smoothed_power,
    whitening,
)
from ride_estimation.diagnosis.plant import Plant, Signal
from ride_estimation.diagnosis.response import LinearResponse, respond
from ride_estimation.diagnosis.settings import Settings
from ride_estimation.diagnosis.spectra import edge_taper, make_grid
from ride_estimation.frames import AXES
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.recording import UniformRun

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]

#: largest number of passes over the terms of second order; a lightly damped mode that the vertical load modulates needs many
_KINEMATIC_PASSES = 8
_SETTLED = 0.25  # change of the outputs in one pass, as a share of the tolerated model error, at which the passes end


@dataclasses.dataclass(frozen=True)
class Measurement:
    """The measured run as arrays of the plant's channels.

    Attributes
    ----------
    outputs, inputs
        Gravity and offset still in them, shapes (N, ny) and (N, nu).
    valid
        False inside gaps of any used channel, shape (N,).
    output_limits, input_limits
        Values at which raw readings are cut, lower and upper ones, infinite where none are, shapes (2, ny) and (2, nu).
    """

    name: str
    rate_hz: float
    outputs: Array
    inputs: Array
    valid: BoolArray
    output_limits: Array
    input_limits: Array


def measurement(plant: Plant, run: UniformRun) -> Measurement:
    """Collect the plant's channels of a run, corrections of the sensors applied; gaps are bridged linearly and marked invalid."""
    run = corrected_run(run, {s: plant.vehicle.sensors[s].correction for s in plant.sensors})
    valid = np.ones(run.samples, dtype=bool)
    for sensor in plant.sensors:
        valid &= run.valid[sensor]

    def column(sensor: str, component: int) -> Array:
        data = np.asarray(run.data[sensor], dtype=float)
        values = data[:, component if data.shape[1] > 1 else 0].copy()
        good = np.isfinite(values) & run.valid[sensor]
        if not np.all(good) and np.any(good):
            index = np.arange(len(values))
            values = np.interp(index, index[good], values[good])
        return values

    outputs = np.stack([column(s.sensor, s.component) for s in plant.outputs], axis=1)
    inputs = np.stack([column(s.sensor, s.component) for s in plant.inputs], axis=1)

    def limits(signals: Sequence[Signal]) -> Array:
        free = np.array([[-np.inf], [np.inf]])
        found = [run.clipped_at.get(s.sensor) for s in signals]
        rows = [free if f is None else f[:, [s.component if f.shape[1] > 1 else 0]] for s, f in zip(signals, found)]
        return np.hstack(rows)

    return Measurement(run.name, run.rate_hz, outputs, inputs, valid, limits(plant.outputs), limits(plant.inputs))


@dataclasses.dataclass(frozen=True)
class ModelState:
    """What the model currently is: port parameters and accepted effects with their coefficients applied.

    Attributes
    ----------
    stiffness, damping
        Of every port, shape (P,).
    effects
        Accepted effects, less what ``held`` holds of them.
    held
        Equivalent stiffness and damping of the law forces of every port, part of the linear response, shape (2, P). A law
        may carry more of a port than its spring and dashpot; its force along an estimated deflection, fed back through the
        spring and dashpot alone, would then run away.
    """

    stiffness: Array
    damping: Array
    effects: tuple[Effect, ...] = ()
    held: Array | None = None

    @property
    def linear(self) -> tuple[Array, Array]:
        """Return stiffness and damping of the linear response, shape (P,) each."""
        if self.held is None:
            return self.stiffness, self.damping
        return self.stiffness + self.held[0], self.damping + self.held[1]


class Scene:
    """A run seen through a model state.

    Parameters
    ----------
    plant, data, state, settings
        What is tested, with what.
    like
        A scene of the same run whose noise (residual covariance, whitening, filter of deflections) is used instead of that of
        this model state, so that two states are compared by the same measure.
    scales
        Deflection and rate rms of the ports that shape parameters of laws refer to, where they come from another run.
    smooth
        Correct the motion by the residual; False for predictions that may not see the measured outputs.
    """

    def __init__(
        self,
        plant: Plant,
        data: Measurement,
        state: ModelState,
        settings: Settings,
        like: Scene | None = None,
        scales: Mapping[int, tuple[float, float]] | None = None,
        smooth: bool = True,
    ) -> None:
        self.plant, self.data, self.state, self.settings = plant, data, state, settings
        self.sees_outputs = smooth
        self.grid = make_grid(len(data.outputs), data.rate_hz, settings.band_hz)
        self.blocks = make_blocks(self.grid, data.valid, settings)
        self.time_s = np.arange(self.grid.samples) / data.rate_hz
        self._taper = edge_taper(self.grid.samples, data.rate_hz)
        self._inside = inside_window(self.grid, data.valid, settings)
        self._prepare()
        self.response: LinearResponse = respond(plant, *state.linear, self.grid.omega)
        self._simulate()
        self._disturb(like)
        self._whiten(like)
        self._smooth_motion(smooth, like)
        self.scales = dict(scales) if scales is not None else self._port_scales()

    # ------------------------------------------------------------------ preparation
    def _prepare(self) -> None:
        good = self.data.valid
        inputs = self.plant.put_right(self.data.inputs)
        self.output_mean = self.data.outputs[good].mean(axis=0)
        self.input_mean = inputs[good].mean(axis=0)
        window = self._taper[:, None]
        self.measured_spectrum = self.grid.spectrum((self.data.outputs - self.output_mean) * window)
        self.noise_scale = self._measured_noise_scale()
        self.input_signal = (inputs - self.input_mean) * window
        self.input_spectrum = self.grid.spectrum(self.input_signal)

    def _measured_noise_scale(self) -> float:
        """Return how much noisier the body accelerometers are than stated."""
        rows = [i for i, s in enumerate(self.plant.outputs) if s.kind == "acceleration"]
        if not rows:
            return 1.0
        stated = np.array([self.plant.outputs[i].noise_std for i in rows])
        frequency = np.minimum(self.grid.frequency, self.grid.upper_hz)
        sensors = [self.plant.outputs[i].sensor for i in rows]
        return noise_scale(
            self.measured_spectrum[:, rows], self.plant.out_acceleration[rows], stated, frequency, self.grid.samples, sensors
        )

    def _base_acceleration(self) -> None:
        """Split effects and form base accelerations with the full bracket rotation."""
        spectrum = self.input_spectrum.copy()
        for effect in self.state.effects:
            if effect.where is Where.INPUT:
                spectrum[:, effect.index] += self.grid.spectrum(effect.signal)
        base = np.einsum("fij,fj->fi", self.response.base_from_input, spectrum)
        slope = np.einsum("ij,fj->fi", self.plant.slope, spectrum) / (-self.grid.omega**2)[:, None]
        self.slope = self.grid.signal(slope)
        self.slope_rate = self.grid.signal(1j * self.grid.omega[:, None] * slope)
        direct = self.plant.base_direct + self.plant.lever_motion(self.plant.slope)
        specific = self.grid.signal(np.einsum("ij,fj->fi", direct, spectrum))
        specific[:, 2::3] += self.plant.vehicle.gravity
        self.base_spectrum = base + self.grid.spectrum(base_correction(self.plant, specific, self.slope))

    def _simulate(self) -> None:
        """Run the model: linear response to the base, to accepted effects, and to second-order kinematics."""
        self._base_acceleration()
        r, grid = self.response, self.grid
        iw = 1j * grid.omega[:, None]
        wrench = np.zeros((len(grid.omega), len(self.plant.coordinates)), dtype=complex)
        extra_output = np.zeros((len(grid.omega), len(self.plant.outputs)), dtype=complex)
        for effect in self.state.effects:
            if effect.where is Where.PORT:
                wrench -= np.outer(grid.spectrum(effect.signal), self.plant.port_map[effect.index])
            elif effect.where is Where.WRENCH:
                wrench[:, effect.index] += grid.spectrum(effect.signal)
            elif effect.where is Where.OUTPUT:
                extra_output[:, effect.index] += grid.spectrum(effect.signal)
        second_order = np.zeros_like(wrench)
        enough = (_SETTLED * self.settings.adequacy) ** 2 * float(np.sum(np.abs(self.measured_spectrum) ** 2))
        size = np.inf
        for _ in range(_KINEMATIC_PASSES):
            q = np.einsum("fij,fj->fi", r.coordinate_from_base, self.base_spectrum)
            q += np.einsum("fij,fj->fi", r.coordinate_from_wrench, wrench + second_order)
            x = q @ self.plant.port_map.T - (self.base_spectrum / (-grid.omega**2)[:, None]) @ self.plant.port_base.T
            self.motion = BodyMotion(grid.signal(q), grid.signal(iw * q), grid.signal(iw**2 * q))
            # integration drift below the band stretches the base and must not reach the products of full rotation
            real = x * grid.low_flank[:, None]
            self.deflection, self.deflection_rate = grid.signal(real), grid.signal(iw * real)
            before, second_order = second_order, grid.spectrum(self.tapered(self.rotation_wrench("base")))
            change = np.einsum("fij,fj->fi", r.output_from_wrench, second_order - before)
            size, last = float(np.sum(np.abs(change) ** 2)), size
            if size < enough or not size < last:
                break
        self.coordinate_spectrum, self.deflection_spectrum = q, x
        outputs = np.einsum("fij,fj->fi", r.output_from_coordinate, q)
        outputs += (self.base_spectrum / (-grid.omega**2)[:, None]) @ self.plant.out_base.T
        beyond = output_correction(self.plant, self.motion)
        beyond += transducer_correction(self.plant, self.motion, self._mount_deflection()[0], self.slope)
        self.output_rectified = beyond.mean(axis=0)
        ideal = outputs + grid.spectrum((beyond - self.output_rectified) * self._taper[:, None])
        #: what ideal sensors would show, before accepted measurement effects
        self.ideal_spectrum = ideal
        self.predicted_spectrum = ideal + extra_output
        self.ideal_output = grid.signal(ideal)

    def block_window(self, blocks: NDArray[np.int64]) -> Array:
        """Return one within some blocks and zero elsewhere and inside gaps, shape (N,)."""
        ratio = self.grid.rate_hz / self.grid.decimated_rate_hz
        length = round(self.blocks.index.shape[1] * ratio)
        window = np.zeros(self.grid.samples)
        for first in np.round(self.blocks.index[blocks, 0] * ratio).astype(int):
            window[first : first + length] = 1.0
        return window * self.data.valid

    def tapered(self, signal: Array) -> Array:
        """Return a signal with its ends faded in and out, shape (N, q)."""
        return signal * self._taper[:, None]

    def inside(self, spectrum: ComplexArray) -> ComplexArray:
        """Return the spectrum of the analysed stretch of signals, scaled to the level of the whole run, shape (F, q).

        At both ends the model has not forgotten its start and the fading of the recording excites it; what it misses there
        says nothing about it.
        """
        level = np.sqrt(self.grid.samples / max(float(np.sum(self._inside**2)), 1.0))
        return self.grid.spectrum(self.grid.signal(spectrum) * (level * self._inside)[:, None])

    def rotation_wrench(self, axes: str) -> Array:
        """Return what full rotation adds to the linear wrench when the mount axes turn with ``axes``, shape (N, n)."""
        size = 3 * len(self.plant.mounts)
        modulus = (np.zeros(size), np.zeros(size))
        stiffness, damping = self.state.linear
        for p, i in self._translations():
            modulus[0][i], modulus[1][i] = stiffness[p], damping[p]
        relative = self._mount_deflection()
        return wrench_correction(self.plant, self.motion, relative, (self.slope, self.slope_rate), modulus, axes)

    def _translations(self) -> list[tuple[int, int]]:
        """Return (port, column among three axes per mount) of the ports along x, y and z."""
        plant = self.plant
        return [
            (p, 3 * plant.mounts.index(port.mount) + AXES.index(port.axis))
            for p, port in enumerate(plant.ports) if port.axis in AXES
        ]

    def _mount_deflection(self) -> tuple[Array, Array]:
        """Return deflection and rate of all axes of all mounts, zero where there is no port, (N, 3 M) each."""
        d, v = (np.zeros((self.grid.samples, 3 * len(self.plant.mounts))) for _ in range(2))
        for p, i in self._translations():
            d[:, i], v[:, i] = self.deflection[:, p], self.deflection_rate[:, p]
        return d, v

    def _disturb(self, like: Scene | None) -> None:
        """Collect what is wrong with the measured base motion: sensor noise, and tilt of brackets that no sensor sees."""
        if like is not None:
            self.disturbance: Array = like.disturbance
            self.noise_transfer: ComplexArray = like.noise_transfer
            self._deflection_noise: ComplexArray = like._deflection_noise
            return
        grid, r, plant = self.grid, self.response, self.plant
        std = self.noise_scale * np.array([s.noise_std for s in plant.inputs])
        std = std * grid.omega[:, None] ** np.array([s.noise_slope for s in plant.inputs])
        twice = (-1.0 / grid.omega**2)[:, None, None]
        turned = plant.static_tilt() * twice
        spectra = self.base_spectrum, self.input_spectrum, r.base_from_input * std[:, None, :]
        doubt, output, deflection = tilt_doubt(plant, r, *spectra, grid.samples, self._smoothing)
        #: standard deviation per sample of input noise and of what is unknown of the tilt of brackets, (F, nu + q)
        self.disturbance = np.concatenate([std, doubt], axis=1)
        #: how they reach the outputs and the deflections: static loads that turn with their bases included
        self.noise_transfer = np.concatenate([r.output_from_input + r.output_from_wrench @ turned, output], axis=2)
        of_input = r.deflection_from_base @ r.base_from_input
        self._deflection_noise = np.concatenate([of_input + r.deflection_from_wrench @ turned, deflection], axis=2)

    @property
    def _smoothing(self) -> int:
        """Return the number of bins within half a hertz."""
        return max(3, round(0.5 * self.grid.padded / self.grid.rate_hz))

    def _whiten(self, like: Scene | None) -> None:
        #: what a relative error of the model refers to in every channel, see :func:`noise.gross_power`, shape (F, ny)
        self.gross_power: Array = like.gross_power if like is not None else gross_power(
            smoothed_power(self.measured_spectrum, self.grid.samples, self._smoothing),
            self.response.output_from_coordinate, self.coordinate_spectrum, self.grid.samples, self._smoothing,
            np.array([s.kind == "acceleration" for s in self.plant.outputs]),
        )
        level = np.sum(np.abs(self.measured_spectrum * self.grid.band_weight[:, None]) ** 2, axis=0) / self.grid.samples
        tilts = (self.noise_transfer * self.disturbance[:, None, :])[:, :, len(self.plant.inputs) :]
        doubt = np.sum(np.abs(tilts) ** 2, axis=2) / self.settings.adequacy**2
        gross = np.sum((self.gross_power + doubt) * self.grid.band_weight[:, None] ** 2, axis=0)
        #: that power, and what doubt about the base adds to it, in the band over the measured one, at least one, shape (ny,)
        self.gross_ratio: Array = np.maximum(gross / np.maximum(level, 1e-300), 1.0)
        if like is None:
            self.noise_covariance = residual_covariance(
                self.noise_scale * np.array([s.noise_std for s in self.plant.outputs]),
                self.noise_transfer * self.disturbance[:, None, :],
                over_band(self.gross_power, self.grid.band_weight) if self.settings.over_band else self.gross_power,
                self.settings.adequacy,
            )
            self.whitener = whitening(self.noise_covariance, self.grid.band_weight)
        else:
            self.noise_covariance, self.whitener = like.noise_covariance, like.whitener
        self._injector = Injector(self.grid, self.response, self.whitener)
        self.residual_spectrum = self.measured_spectrum - self.predicted_spectrum
        self.residual = self.rows(self.residual_spectrum[:, :, None])[:, :, 0]
        share = float(np.sum(self.grid.band_weight**2) / (self.grid.decimated / 2))
        #: degrees of freedom of every block
        self.block_dof = self.blocks.weight.sum(axis=1) * len(self.plant.outputs) * share

    def _smooth_motion(self, correct: bool, like: Scene | None) -> None:
        """Correct deflections and body motion by what the residual says about forces the model does not have.

        Unknown port forces have the spectrum of the known ones, at the level that explains the excess of the residual; laws
        are evaluated on the corrected deflection, which is the real one to first order whatever the cause is.
        """
        grid, r, n = self.grid, self.response, self.grid.samples
        stiffness, damping = self.state.linear
        modulus = stiffness + 1j * grid.omega[:, None] * damping
        # below the band the apparent deflection is integration drift; the body follows slow base motion
        self._filter: DeflectionFilter = like._filter if like is not None else deflection_filter(
            self.deflection_spectrum, self._deflection_noise * self.disturbance[:, None, :], n, max(3, self._smoothing // 2)
        )
        self.deflection_spectrum = grid.low_flank[:, None] * self._filter.apply(self.deflection_spectrum)
        self._force_power = smoothed_power(modulus * self.deflection_spectrum, n, self._smoothing)
        signal = (r.output_from_port * self._force_power[:, None, :]) @ np.conj(np.swapaxes(r.output_from_port, 1, 2))
        white_signal = self.whitener @ signal @ np.conj(np.swapaxes(self.whitener, 1, 2))
        expected = float(np.real(np.trace(white_signal, axis1=1, axis2=2)).sum())
        white = np.einsum("fij,fj->fi", self.whitener, self.inside(self.residual_spectrum))
        degrees = float(np.sum(grid.band_weight**2)) * len(self.plant.outputs)
        #: nominal degrees of freedom per independent sample of what the model misses
        self.inefficiency = excess_inefficiency(white, n)
        excess = float(np.sum(np.abs(white) ** 2)) / n - degrees
        #: share of the port force power that the model does not have
        self.missing_share = float(np.clip(excess / max(expected, 1e-300), 0.0, 1.0))
        if correct and self.missing_share > 0.0:
            force = self.missing_forces(self.residual_spectrum, self.missing_share)[:, :, None]
            self.deflection_spectrum = self.deflection_spectrum + (r.deflection_from_port @ force)[:, :, 0]
            wrench = -(self.plant.port_map.T @ force)
            self.coordinate_spectrum = self.coordinate_spectrum + (r.coordinate_from_wrench @ wrench)[:, :, 0]
        self.deflection = grid.signal(self.deflection_spectrum)
        self.deflection_rate = grid.signal(1j * grid.omega[:, None] * self.deflection_spectrum)

    def missing_forces(self, residual: ComplexArray, share: float) -> ComplexArray:
        """Return the port forces (F, P) that a residual (F, ny) asks for if they have a share of the power of the known ones."""
        seen = self.grid.spectrum(self.grid.signal(residual) * self._inside[:, None]) * self.grid.low_flank[:, None]
        return missing_forces(seen, self.response.output_from_port, share * self._force_power, self.noise_covariance)

    def _port_scales(self) -> dict[int, tuple[float, float]]:
        """Return deflection and rate rms of every port without the faded ends."""
        trim = round(self.settings.trim_s * self.data.rate_hz)
        inner = slice(trim, -trim) if self.grid.samples > 4 * trim else slice(None)
        x = np.sqrt(np.mean(self.deflection[inner] ** 2, axis=0))
        v = np.sqrt(np.mean(self.deflection_rate[inner] ** 2, axis=0))
        return {p: (float(max(x[p], 1e-15)), float(max(v[p], 1e-15))) for p in range(len(self.plant.ports))}

    # ------------------------------------------------------------------ entry points
    def rows(self, output_spectrum: NDArray[Any], single: bool = False) -> Array:
        """Return whitened rows of output spectra (F, ny, q) as blocks, shape (B, L * ny, q).

        Parameters
        ----------
        single
            Compute in single precision, for scores of many columns.
        """
        white: NDArray[Any] = self.whitener
        if single:
            white, output_spectrum = white.astype(np.complex64), output_spectrum.astype(np.complex64)
        return self._dealt(white @ output_spectrum)

    def _dealt(self, white: NDArray[Any]) -> Array:
        """Return whitened spectra (F, ny, q) as blocks, shape (B, L * ny, q)."""
        signal = self.grid.decimated_signal(white)
        blocks, length = self.blocks.index.shape
        first = int(self.blocks.index[0, 0]) if blocks else 0
        if blocks and np.all(self.blocks.weight == 1.0) and self.blocks.index[-1, -1] == first + blocks * length - 1:
            return np.ascontiguousarray(signal[first : first + blocks * length]).reshape(blocks, -1, signal.shape[2])
        picked = signal[self.blocks.index] * self.blocks.weight[:, :, None, None].astype(signal.dtype)
        return np.asarray(picked.reshape(blocks, -1, signal.shape[2]))

    def push(self, columns: Sequence[Column], single: bool = False) -> Array:
        """Return the whitened rows of columns of effects, shape (B, L * ny, q); see :meth:`rows`."""
        return self._dealt(self._injector.whitened(columns, single))

    def with_deflection_noise(self, seed: int) -> Scene:
        """Return the scene with one realisation of the error that the measured base motion leaves in the deflections."""
        rng = np.random.default_rng(seed)
        white = rng.standard_normal((self.grid.samples, self.disturbance.shape[1]))
        noise = self.grid.spectrum(white) * self.disturbance
        error = np.einsum("fij,fj->fi", self._deflection_noise, noise)
        return self._deflected(self.grid.low_flank[:, None] * self._filter.apply(error, 0.5))

    def with_port_forces(self, ports: Sequence[int], forces: Array) -> Scene:
        """Return the scene with deflections moved by further port forces, shape (N, ports); full rotation left out."""
        spectrum = np.einsum("fij,fj->fi", self.response.deflection_from_port[:, :, list(ports)], self.grid.spectrum(forces))
        return self._deflected(self.grid.low_flank[:, None] * self._filter.apply(spectrum))

    def _deflected(self, further: ComplexArray) -> Scene:
        """Return the scene with its deflections moved by a spectrum, shape (F, P)."""
        other = copy.copy(self)
        other.deflection_spectrum = self.deflection_spectrum + further
        other.deflection = self.grid.signal(other.deflection_spectrum)
        other.deflection_rate = self.grid.signal(1j * self.grid.omega[:, None] * other.deflection_spectrum)
        return other

    def port_index(self, mount: str, axis: str) -> int:
        """Return the row of a port."""
        return [(p.mount, p.axis) for p in self.plant.ports].index((mount, axis))
