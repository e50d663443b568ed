# Copyright 2026 ride_estimation contributors
"""A body that bends or twists within the band."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Shape, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.runs.noise import smoothed_power
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_LOWEST_HZ = 4.0
#: damping ratios of modes on their mounts, the largest (welded cabs have 1 to 3 %, dampers at the corners of a body that twists
#: add a third of the critical damping), and how far from the peak of the residual, by which factor, a mode may lie
_RATIOS, _DAMPED, _REACH, _TRIALS = (0.02, 0.05, 0.1, 0.2, 0.4), 0.6, 1.25, 9
_OCTAVE = 2.0
_OF_STRUCTURES = 0.02  # damping ratio of welded structures
#: damping ratio beyond which the mounts must hold a mode, and the least share of that with which they answer it: 0.7 to 1.5 of
#: it on nine drawn and foreign cabs, a tenth where a sprung mass was taken for one
_UNAIDED, _ANSWERED = 0.15, 0.3
#: least share of the squared pattern in the accelerometers that no rigid motion shows: 0.3 to 0.9 of five drawn modes, 6e-5 where
#: an inertance in a mount was taken for one; an alignment error of one degree turns 3e-4 of a rigid pattern into that
_ELASTIC = 0.01
_MOST = 0.8  # of the squared frequency that mounts can give a mode: beyond, it is a motion on them
#: of a peak, where its residual is looked at: half of the width of a mode that its mounts damp, and of a light one beside another
_AROUND = (0.6, 0.15)


@final
class FlexibleMode(Cause):
    """An elastic mode of the body, driven by its mounts, seen by the accelerometers as a common pattern.

    A gyro reads the slope of the mode at its place, ``a / (i omega)`` of the modal acceleration a.
    """

    ID = "flexible_mode"
    QUESTION = "Does the body bend or twist instead of moving as one piece?"
    NEEDS = "more channels than rigid-body motion needs, excitation around the natural frequency"
    RIVALS = ("missing_degree_of_freedom", "wrong_sensor_position", "harmonic_disturbance")
    WOULD_REFUTE = "channels that agree with rigid-body motion around the suspected frequency"
    MEASURE_NEXT = "a hammer test of the body, or two more accelerometers at its corners"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and resonance of the residual."""
        out: list[Hypothesis] = []
        for body in dict.fromkeys(b for b, _ in view.plant.coordinates):
            rows, rates = (_channels(view, body, kind) for kind in ("acceleration", "rate"))
            if len(rows) <= len(view.plant.coordinate_rows(body)):
                continue
            rigid = view.plant.out_acceleration[rows]
            for peak, around in itertools.product(compliant_peaks(view, rows), _AROUND):
                frequency, damping, drive = _resonance(view, rows, peak, around)

                def columns(
                    view: RunView, shape: Shapes, r: list[int] = rows, g: list[int] = rates, w: Array = drive
                ) -> list[Column]:
                    f, z = float(shape["frequency"]), float(shape["damping"])
                    modal = _modal(view, f, z) @ w
                    signal = view.grid.signal(modal)
                    shown: list[Column] = [(Effect(Where.OUTPUT, i, signal),) for i in r]
                    if g:
                        slope = view.grid.signal(modal / (1j * view.grid.omega))
                        shown += [(Effect(Where.OUTPUT, i, slope),) for i in g]
                    return [*shown, _reaction(view, modal, w)]

                light = _RATIOS[0] if damping > _RATIOS[0] else _RATIOS[1]
                grid = tuple({"frequency": frequency * s, "damping": z} for s in (0.95, 1.0, 1.05) for z in (light, damping))
                given = float(view.state.stiffness @ drive**2), float(view.state.damping @ drive**2)

                def held(coefficients: Array, shape: Shapes, given: tuple[float, float] = given, a: Array = rigid) -> bool:
                    if _elastic_share(coefficients[: len(a)], a) < _ELASTIC:
                        return False
                    answered, damped = _mount_shares(given, shape, float(coefficients[-1]))
                    return float(shape["damping"]) <= _UNAIDED or answered >= _ANSWERED * damped

                bounds = (Shape("frequency", frequency, 0.7 * frequency, 1.4 * frequency), Shape("damping", 0.03, 0.004, _DAMPED))
                out.append(Hypothesis(self.ID, body, "", columns, grid, bounds, complexity=float(len(drive)), plausible=held))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return natural frequency [Hz] on the mounts and free of them, damping ratio and the channel that moves most.

        Free of the mounts is the mode that a finite-element model or a body on soft slings has: ``w_free^2 = w^2 - K`` with the
        stiffness K per modal mass that the mounts give it. Two kinds of evidence tell K: the forces with which the mounts answer
        the mode, and the damping that they give it beside the little of a structure. Where they differ, so open is the value.
        """
        f, z = float(fitted.shape["frequency"]), float(fitted.shape["damping"])
        rows = _channels(view, fitted.hypothesis.location, "acceleration")
        largest = int(np.argmax(np.abs(fitted.coefficients[: len(rows)])))
        (modal,) = fitted.hypothesis.columns(view, fitted.shape)[largest]
        rms, std = (float(np.std(modal.signal)) * c for c in (abs(fitted.coefficients[largest]), fitted.std(largest)))
        # at the largest damping the frequency is open by half the width of the resonance
        form = 1.0 if np.isclose(z, _DAMPED, rtol=0.01) else FORM**0.5
        w, spread = 2.0 * np.pi * f, fitted.spread("frequency", form * z * f)
        given = _given_by_mounts(view, fitted)
        shares = np.clip(_mount_shares(given, fitted.shape, float(fitted.coefficients[-1])), 0.0, _MOST)
        share = float(np.mean(shares))
        unsure = float(np.hypot(given[0] * fitted.std(len(fitted.coefficients) - 1) / w**2, 0.5 * np.ptp(shares)))
        free = f * float(np.sqrt(1.0 - share))
        slope = 0.5 * f**2 / free
        return (
            Reported("natural frequency", f, spread, "Hz"),
            Reported("natural frequency free of the mounts", free, float(np.hypot(slope * unsure, spread)), "Hz"),
            Reported("damping ratio", z, fitted.spread("damping", 0.4 * z), "-"),
            Reported(f"elastic rms at {view.plant.outputs[rows[largest]].name}", float(rms), float(std), "m/s^2"),
        )

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Leave the vehicle alone: bodies of a vehicle file are rigid."""
        f = float(fitted.shape["frequency"])
        return vehicle, (f"elastic mode of {fitted.hypothesis.location} at {f:.3g} Hz: a vehicle file has rigid bodies only",)


def _channels(view: RunView, body: str, kind: str) -> list[int]:
    """Return the output channels of a kind on a body."""
    outputs, sensors = view.plant.outputs, view.plant.vehicle.sensors
    return [i for i, s in enumerate(outputs) if s.kind == kind and sensors[s.sensor].body == body]


def compliant_peaks(view: RunView, rows: list[int], count: int = 4) -> list[float]:
    """Return the frequencies where a body answers its mounts most beyond rigid motion, above 4 Hz.

    Power of the residual beyond its noise over that of the mount forces: the residual alone has the peaks of the road.

    Parameters
    ----------
    rows
        Channels of the body.
    """
    grid = view.grid
    f, samples = grid.frequency, grid.samples
    width = max(round(0.6 / float(f[1] - f[0])), 1) | 1
    noise = np.real(np.diagonal(view.noise.covariance, axis1=1, axis2=2))[:, rows]
    residual = smoothed_power(view.data.inside(view.residual_spectrum[:, rows]), samples, width)
    force = smoothed_power(_port_forces(view), samples, width).sum(axis=1)
    answer = np.sum(np.maximum(residual - noise, 0.0), axis=1) / np.maximum(force, 1e-12 * float(force.max()))
    answer = np.where((f > _LOWEST_HZ) & (grid.band_weight > 0.9), answer, 0.0)
    out: list[float] = []
    for _ in range(count):
        if not np.any(answer > 0.0):
            break
        peak = float(f[int(np.argmax(answer))])
        out.append(peak)
        answer = np.where(np.abs(f - peak) < 0.2 * peak, 0.0, answer)
    return out


def _port_forces(view: RunView) -> ComplexArray:
    """Return the forces of springs and dampers along the estimated deflections, shape (F, P)."""
    stiffness, damping = view.state.stiffness, view.state.damping
    return np.asarray((stiffness + 1j * view.grid.omega[:, None] * damping) * view.deflection_spectrum)


def _modal(view: RunView, frequency_hz: float, ratio: float) -> ComplexArray:
    """Return the acceleration of a unit mode driven by every port force, shape (F, P)."""
    return _gain(view.grid.omega, frequency_hz, ratio)[:, None] * _port_forces(view)


def _gain(omega: Array, frequency_hz: float, ratio: float) -> ComplexArray:
    """Return the acceleration of a unit mode over the force that drives it, shape (F,)."""
    w0 = 2.0 * np.pi * frequency_hz
    return np.asarray(-(omega**2) / (w0**2 - omega**2 + 2j * ratio * w0 * omega))


def _reaction(view: RunView, modal: ComplexArray, weights: Array) -> Column:
    """Return the mount forces that the elastic motion of the mounting points causes.

    By reciprocity a mode moves a mounting point by as much as a force there drives the mode.
    """
    omega = view.grid.omega
    stretch = (-modal / omega**2)[:, None] * weights
    force = (view.state.stiffness + 1j * omega[:, None] * view.state.damping) * stretch
    return tuple(Effect(Where.PORT, p, view.grid.signal(force[:, p])) for p in range(len(weights)))


def _given_by_mounts(view: RunView, fitted: Fitted) -> tuple[float, float]:
    """Return the squared drive of a mode times stiffness and damping of every port, what a unit of reaction gives the mode."""
    grid, state = view.grid, view.state
    columns = fitted.hypothesis.columns(view, fitted.shape)
    # far below the resonance the ends of a run are more than its motion
    near = np.abs(np.log(grid.frequency / float(fitted.shape["frequency"]))) < np.log(_OCTAVE)
    omega = grid.omega[near]
    stretch = -grid.spectrum(columns[0][0].signal)[near] / omega**2
    total = np.zeros(2)
    for effect in columns[-1]:
        stiffness, damping = state.stiffness[effect.index], state.damping[effect.index]
        of_unit = (stiffness + 1j * omega * damping) * stretch
        force = grid.spectrum(effect.signal)[near]
        drive = float(np.real(np.vdot(of_unit, force))) / max(float(np.sum(np.abs(of_unit) ** 2)), 1e-300)
        total += np.array([stiffness, damping]) * drive**2
    return float(total[0]), float(total[1])


def _elastic_share(pattern: Array, rigid: Array) -> float:
    """Return the share of a squared pattern, shape (R,), that no combination of rigid motions, shape (R, C), shows."""
    rest = pattern - rigid @ np.linalg.lstsq(rigid, pattern, rcond=None)[0]
    return float(rest @ rest) / max(float(pattern @ pattern), 1e-300)


def _mount_shares(given: tuple[float, float], shape: Shapes, reaction: float) -> tuple[float, float]:
    """Return the share of the squared frequency that mounts give a mode as they answer it and as they damp it.

    Parameters
    ----------
    given
        Squared drive of the mode times stiffness and damping of every port.
    reaction
        Coefficient of :func:`_reaction`.
    """
    stiffness, damping = given
    w = 2.0 * np.pi * float(shape["frequency"])
    damped = 2.0 * max(float(shape["damping"]) - _OF_STRUCTURES, 0.0) / w * stiffness / max(damping, 1e-300)
    return -stiffness * reaction / w**2, damped


def _resonance(view: RunView, rows: list[int], peak_hz: float, around: float) -> tuple[float, float, Array]:
    """Return frequency [Hz], damping ratio and drive of the mode that leaves least of the residual around a peak.

    What the mounts that it moves add makes a mode stiffer and more damped: driven with another phase than that of the residual
    no weights fit it. The weights are in units of this run's modal acceleration: on another road the same mode is driven harder
    or less.
    """
    near = np.abs(view.grid.frequency - peak_hz) < around * peak_hz
    omega, forces, residual = view.grid.omega[near], _port_forces(view)[near], view.residual_spectrum[near][:, rows]
    target = np.vstack([residual.real, residual.imag])
    pattern = np.linalg.eigh(target.T @ target)[1][:, -1]

    def drive(trial: tuple[float, float]) -> tuple[Array, float]:
        return _drive_weights(_gain(omega, *trial)[:, None] * forces, target, pattern)

    trials = [(peak_hz * s, z) for z in _RATIOS for s in np.geomspace(1.0 / _REACH, _REACH, _TRIALS)]
    frequency, ratio = min(trials, key=lambda trial: drive(trial)[1])
    weights = drive((frequency, ratio))[0]
    size = float(np.std(view.grid.signal(_modal(view, frequency, ratio) @ weights)))
    return frequency, ratio, np.asarray(weights / max(size, 1e-300))


def _drive_weights(modal: ComplexArray, target: Array, pattern: Array) -> tuple[Array, float]:
    """Return how much every port drives a mode and the share of the residual around a peak that it leaves.

    Alternating least squares of the pattern in the channels and of the drive.

    Parameters
    ----------
    modal
        Acceleration of a unit mode driven by every port force around the peak, shape (F, P).
    target
        Real and imaginary part of the residual there, shape (2 F, C).
    pattern
        What to begin with, shape (C,).
    """
    scale = np.sqrt(np.mean(np.abs(modal) ** 2, axis=0)) + 1e-300
    stacked = np.vstack([modal.real, modal.imag]) / scale
    normal = stacked.T @ stacked
    normal += 1e-3 * np.trace(normal) / len(normal) * np.eye(len(normal))
    towards = np.linalg.solve(normal, stacked.T @ target)
    weights = np.zeros(stacked.shape[1])
    left = 1.0
    for _ in range(6):
        weights = towards @ pattern / max(float(pattern @ pattern), 1e-300)
        drive = stacked @ weights
        pattern = target.T @ drive / max(float(drive @ drive), 1e-300)
        left = 1.0 - float(pattern @ pattern) * float(drive @ drive) / max(float(np.sum(target**2)), 1e-300)
    return np.asarray(weights / scale), left
