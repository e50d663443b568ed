# Copyright 2026 ride_estimation contributors
"""Which gyros of a run can be used: those of bodies whose rates belong to the turning that the other readings show.

A gyro in deg/s, with an inverted or with exchanged axes is no hidden property of the vehicle, and its rates are so far off
that a model bends to them. Where the accelerometers of a body show how it turns, :class:`GyroCheck` judges, as it does for the
estimator. Elsewhere (a single IMU) the model of the vehicle file does, driven by the measured base motion: its resonances may be
off, so only what no wrong stiffness does is found, ``M = <w p^T> <p p^T>^-1`` of measured rates w and predicted ones p with a
diagonal outside 0.2 to 5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.linear_model import file_parameters
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import CHANNELS, Plant
from ride_estimation.diagnosis.runs.model_run import ModelRun, ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.estimation.faults.gyro_check import GyroCheck, wrong_rates
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.guided import point_rows

Array = NDArray[np.float64]

_BLOCK_S = 1.0
#: smallest and largest factor between rates of a gyro in good order and those of a model whose stiffness is unknown
_FACTORS = (0.2, 5.0)
#: rates over their noise from which a model is asked about a gyro
_TURNING = 3.0


def wrong_gyros(plant: Plant, run: UniformRun, settings: Settings) -> dict[str, str]:
    """Return the gyros among the outputs whose rates cannot be used, sensor -> what is wrong with them.

    Parameters
    ----------
    plant
        With all gyros that could be used.
    run, settings
        What was measured, and the band.
    """
    out = {s: "they are cut at the end of their range" for s in plant.columns if _cut(plant, s, run)}
    left: list[str] = []
    for body in dict.fromkeys(b for b, _ in plant.coordinates):
        of_body = [s.sensor for s in plant.outputs if s.kind == "rate" and plant.vehicle.sensors[s.sensor].body == body]
        gyros = [g for g in dict.fromkeys(of_body) if g not in out]
        found = _by_accelerometers(plant, body, gyros, run) if gyros else {}
        if found is None:
            left += gyros
        else:
            out |= found
    return out | (_by_model(plant, left, run, settings) if left else {})


def _cut(plant: Plant, sensor: str, run: UniformRun) -> bool:
    """Return whether used angular rates of a sensor are cut: what is missing of them nothing puts back."""
    limits = run.clipped_at.get(sensor)
    rows = [s.component for s in plant.outputs if s.sensor == sensor and s.kind == "rate"]
    return limits is not None and bool(np.any(np.isfinite(limits[:, rows])))


def _by_accelerometers(plant: Plant, body: str, gyros: Sequence[str], run: UniformRun) -> dict[str, str] | None:
    """Return the wrong gyros of a body, None where its accelerometers do not show how it turns."""
    vehicle = plant.vehicle
    moving = dict.fromkeys(s.sensor for s in plant.outputs if s.kind != "displacement")
    sensors = [vehicle.sensors[n] for n in moving if vehicle.sensors[n].body == body]
    names = [s.name for s in sensors]
    six = tuple((body, c) for c in COORDINATES)
    maps = (s.rotation.T @ point_rows(vehicle, six, body, s.position)[: len(AXES)] for s in sensors)
    rows = np.vstack([np.where(s.measured[: len(AXES), None], m, 0.0) for s, m in zip(sensors, maps)])
    free = np.array([c in vehicle.bodies[body].coordinates for c in COORDINATES])
    check = GyroCheck(sensors, [names.index(g) for g in gyros], rows, free)
    if not check.possible:
        return None
    run = corrected_run(run, {s.name: s.correction for s in sensors})
    samples = np.hstack([run.data[n][:, : len(AXES)] for n in names])
    rates = np.stack([run.data[g][:, len(AXES) :] @ vehicle.sensors[g].rotation.T for g in gyros], axis=1)
    there = np.stack([run.valid[n] for n in names], axis=1)
    length = max(round(_BLOCK_S * run.rate_hz), 1)
    for first in range(0, run.samples, length):
        part = slice(first, first + length)
        check.observe(samples[part], rates[part], there[part], 1.0 / run.rate_hz)
    return {gyros[g]: words for g, words in check.found.items()}


def _by_model(plant: Plant, gyros: Sequence[str], run: UniformRun, settings: Settings) -> dict[str, str]:
    """Return the gyros whose rates have another unit, sign or axis than those the vehicle file predicts."""
    data = RunData(plant, measurement(plant, run), settings)
    model = ModelRun(data, ModelState(*file_parameters(plant)))
    out: dict[str, str] = {}
    for gyro in gyros:
        rows = [i for i, s in enumerate(plant.outputs) if s.kind == "rate" and s.sensor == gyro]
        measured, predicted = (
            data.grid.signal(data.inside(x[:, rows]) * data.grid.band_weight[:, None])
            for x in (data.output_spectrum, model.ideal_spectrum)
        )
        noise = np.array([plant.outputs[i].noise_std for i in rows])
        turns = np.flatnonzero(np.std(predicted, axis=0) > _TURNING * noise)
        if turns.size:
            moments = predicted[:, turns].T @ predicted[:, turns]
            gains = np.diag((measured.T @ predicted[:, turns] @ np.linalg.inv(moments))[turns])
            if np.any((gains < _FACTORS[0]) | (gains > _FACTORS[1])):
                axes = np.array([plant.outputs[rows[t]].component - len(AXES) for t in turns])
                out[gyro] = wrong_rates(gains, axes)
    return out


def unused_rates(plant: Plant, columns: Mapping[str, int]) -> tuple[str, ...]:
    """Return words on gyros that have no place in the model: on bases, and on bodies that do not turn.

    Parameters
    ----------
    columns
        Sensor -> number of columns that the run has.
    """
    used = {s.sensor for s in plant.outputs if s.kind == "rate"}
    imus = [s for s in plant.sensors if plant.vehicle.sensors[s].kind == "imu"]
    rated = [s for s in imus if columns[s] == len(CHANNELS) and s not in used]
    inputs = {s.sensor for s in plant.inputs}
    bases, others = ([s for s in rated if (s in inputs) is at_base] for at_base in (True, False))
    out = []
    if bases:
        out.append(f"the angular rates of {', '.join(bases)} are not used: base motion comes from accelerations alone")
    if others:
        out.append(f"the angular rates of {', '.join(others)} are not used: their body does not turn in the model")
    return tuple(out)
