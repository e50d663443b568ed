# Copyright 2026 ride_estimation contributors
"""Residual of the best linear model of a world, and the effect size that leaves a wanted one.

The linear model is the world's own cab (full rotation) with free stiffness and damping; it is fitted by output error with
the sensitivities of the cab without effect (Gauss-Newton). Nothing of the product is used.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import CabSensor, CabVehicle, bracket_motion, simulate, true_signal
from worlds.effects import Effect
from worlds.roads import BaseMotion


@dataclasses.dataclass
class BestLinear:
    """Best linear fit of cab accelerometer signals over one base motion.

    ``rate_hz`` of the comparison; the first second is left out. Signals are noise-free.
    """

    vehicle: CabVehicle
    sensors: tuple[CabSensor, ...]
    base: BaseMotion
    rate_hz: float = 100.0

    def __post_init__(self) -> None:
        self._every = round(1.0 / (self.rate_hz * self.base.step))
        self._clean = self._signals(self.vehicle, self.sensors, self.base)
        moving = self._clean - self._clean.mean(axis=0)
        self.signal_rms = float(np.sqrt(np.mean(moving**2)))
        self._jacobian = np.stack([self._sensitivity(j) for j in range(2 * self.vehicle.stiffness.size)], axis=-1)

    def _scaled(self, log_factors: np.ndarray) -> CabVehicle:
        k, c = np.exp(log_factors).reshape(2, *self.vehicle.stiffness.shape)
        return dataclasses.replace(self.vehicle, stiffness=self.vehicle.stiffness * k, damping=self.vehicle.damping * c)

    def _signals(self, vehicle: CabVehicle, sensors: tuple[CabSensor, ...], base: BaseMotion) -> np.ndarray:
        """Return the stacked declared-axes cab signals (N, 3 n)."""
        run = simulate(vehicle, base)
        out = [
            _ideal(run, s)[round(1.0 / base.step) :: self._every]
            for s in sensors
            if s.place == "cab" and s.kind != "displacement"
        ]
        return np.hstack(out)

    def _sensitivity(self, j: int) -> np.ndarray:
        step = np.zeros(2 * self.vehicle.stiffness.size)
        step[j] = 0.02
        return (self._signals(self._scaled(step), self.sensors, self.base) - self._clean) / 0.02

    def _equivalent(self, vehicle: CabVehicle) -> np.ndarray:
        """Return log factors of the linear spring and damper nearest to the true mount forces (statistical linearisation)."""
        factors = np.stack([vehicle.stiffness / self.vehicle.stiffness, vehicle.damping / self.vehicle.damping])
        touched = {(i, a) for i, a, _, _ in vehicle.hidden.laws}
        if vehicle.hidden.drift is not None:
            touched |= {(int(i), int(a)) for i, a in np.argwhere(vehicle.hidden.drift[:, :, 0] != 0.0)}
        if touched:
            run = simulate(vehicle, self.base)
            after = slice(round(1.0 / self.base.step), None)
            for i, a in touched:
                x, v = run.deflection[after, i, a], run.rate[after, i, a]
                # force on the cab in its axes stands for the tension: tilt and cross terms are small
                force = -run.force[after, i, a]
                k, c, _ = np.linalg.lstsq(np.column_stack([x, v, np.ones_like(x)]), force, rcond=None)[0]
                factors[:, i, a] = k / self.vehicle.stiffness[i, a], c / self.vehicle.damping[i, a]
        return np.log(np.clip(factors, 0.1, 10.0)).ravel()

    def residual(self, effect: Effect, size: float) -> float:
        """Return rms of what the best linear model leaves over rms of the signal, for an effect of a size."""
        vehicle, sensors, cg_off = effect.apply(size)
        measured = self._signals(vehicle, sensors, self.base)
        seen = _seen_base(vehicle, sensors, self.base)
        model_vehicle = dataclasses.replace(self.vehicle, cg=self.vehicle.cg + np.array(cg_off))
        declared = tuple(
            dataclasses.replace(s, true_position=None, true_rotation=None, gain=1.0, bias=0.0, delay_s=0.0, clip=np.inf)
            for s in sensors
        )
        columns = self._jacobian.shape[-1]

        def flat(x: np.ndarray) -> np.ndarray:
            if not effect.mean_counts:
                x = x - x.mean(axis=0)
            return x.reshape(-1, *x.shape[2:])

        matrix = flat(self._jacobian)
        normal = matrix.T @ matrix
        normal += 1e-7 * np.trace(normal) / columns * np.eye(columns)

        def error_at(logs: np.ndarray) -> np.ndarray:
            factors = np.exp(logs).reshape(2, *self.vehicle.stiffness.shape)
            stiffness, damping = model_vehicle.stiffness * factors[0], model_vehicle.damping * factors[1]
            trial = dataclasses.replace(model_vehicle, stiffness=stiffness, damping=damping)
            return flat(measured - self._signals(trial, declared, seen))

        logs = self._equivalent(vehicle)
        error = error_at(logs)
        best = float(np.sqrt(np.mean(error**2)))
        step = np.linalg.solve(normal, matrix.T @ error)
        for _ in range(6):
            trial = np.clip(logs + step, -2.0, 2.0)
            candidate = error_at(trial)
            value = float(np.sqrt(np.mean(candidate**2)))
            if not value < best:
                step = 0.3 * step
                continue
            settled = value > 0.99 * best
            best, logs, error = value, trial, candidate
            if settled:
                break
            step = np.linalg.solve(normal, matrix.T @ error)
        return best / self.signal_rms

    def size_for(self, effect: Effect, target: float, tolerance: float = 0.05) -> tuple[float, float]:
        """Return (size, residual) with the residual within a relative tolerance of the target where it can be reached."""
        if effect.cause == "none":
            return 0.0, 0.0
        if effect.fixed_size is not None:
            return effect.fixed_size, 0.0
        low, high = 0.0, np.inf
        size = min(0.2, 0.3 * effect.largest)
        value = np.inf
        for _ in range(14):
            value = self.residual(effect, size)
            if not np.isfinite(value) or abs(value / target - 1.0) <= tolerance:
                if np.isfinite(value):
                    return size, value
                value = 1e3 * target
            if value < target:
                low = size
                if size >= effect.largest:
                    return size, value
            else:
                high = size
            guess = size * float(np.clip(target / max(value, 1e-9), 0.2, 5.0))
            if np.isfinite(high) and not low < guess < high:
                guess = 0.5 * (low + high)
            size = min(guess, effect.largest)
        return size, value


def _ideal(run: object, sensor: CabSensor) -> np.ndarray:
    """Return the noise-free reading with gain, bias, delay and clipping of the sensor."""
    values = true_signal(run, sensor)  # type: ignore[arg-type]
    if sensor.delay_s > 0.0:
        n, h = len(values), run.step  # type: ignore[attr-defined]
        grid = np.arange(n) * h
        values = np.stack([np.interp(grid - sensor.delay_s, grid, column) for column in values.T], axis=1)
    return np.clip(values * sensor.gain + sensor.bias, -sensor.clip, sensor.clip)


def _is_faulty(sensor: CabSensor) -> bool:
    scaled = np.any(np.asarray(sensor.gain) != 1.0) or np.any(np.asarray(sensor.bias) != 0.0)
    return bool(scaled or sensor.true_rotation is not None or sensor.delay_s > 0.0 or np.isfinite(sensor.clip))


def _seen_base(vehicle: CabVehicle, sensors: tuple[CabSensor, ...], base: BaseMotion) -> BaseMotion:
    """Return the base motion as faulty chassis-side sensors report it (their error, integrated above 0.3 Hz, added)."""
    faulty = [s for s in sensors if s.place != "cab" and s.kind != "displacement" and _is_faulty(s)]
    if not faulty:
        return base
    frames = bracket_motion(base, vehicle.mounts)
    holder = _Holder(base, vehicle, base.step)
    brackets = base.brackets.copy()
    rows = brackets.shape[0]
    for sensor in faulty:
        right = dataclasses.replace(sensor, true_rotation=None)
        true = true_signal(holder, right, frames)  # type: ignore[arg-type]
        seen = true_signal(holder, sensor, frames)  # type: ignore[arg-type]
        grid = np.arange(len(seen)) * base.step
        if sensor.delay_s > 0.0:
            seen = np.stack([np.interp(grid - sensor.delay_s, grid, column) for column in seen.T], axis=1)
        seen = np.clip(seen * sensor.gain + sensor.bias, -sensor.clip, sensor.clip)
        error = (seen - true) @ sensor.rotation.T
        error = error - error.mean(axis=0)
        spectrum = np.fft.rfft(error, axis=0)
        f = np.fft.rfftfreq(len(error), base.step)
        s = 2j * np.pi * np.maximum(f, f[1])
        weight = (1.0 / (1.0 + (0.3 / np.maximum(f, f[1])) ** 4))[:, None]
        velocity = np.fft.irfft(spectrum * weight / s[:, None], len(error), axis=0)
        shift = np.fft.irfft(spectrum * weight / s[:, None] ** 2, len(error), axis=0)
        i = vehicle.mount_names.index(sensor.place)
        half = np.arange(rows) * 0.5 * base.step
        for a in range(3):
            brackets[:, i, a] += np.interp(half, grid, shift[:, a])
            brackets[:, i, 3 + a] += np.interp(half, grid, velocity[:, a])
    return dataclasses.replace(base, brackets=brackets)


@dataclasses.dataclass(frozen=True)
class _Holder:
    """What :func:`worlds.cab.true_signal` needs for chassis-side sensors."""

    base: BaseMotion
    vehicle: CabVehicle
    step: float
