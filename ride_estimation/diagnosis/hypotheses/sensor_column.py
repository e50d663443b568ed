# Copyright 2026 ride_estimation contributors
"""Columns of sensor errors: what one unit of a gain, rotation, shift or delay does to readings, inputs and mean readings."""

from __future__ import annotations

import math

import numpy as np

from ride_estimation.diagnosis.calibration.baseline import mean_table, sensor_error_means, sensor_error_spectra, turned_reading
from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.model.plant import CHANNELS
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import rotation_matrices

_NO_ANGLE = 1e-6  # reference that stands for the derivative at no rotation [rad]


def sensor_axes(view: RunView, sensor: str) -> tuple[int, ...]:
    """Return the measured components of a sensor, those of its angular rates from three on."""
    signals = (*view.plant.outputs, *view.plant.inputs)
    return tuple(s.component for s in signals if s.sensor == sensor)


def is_accelerometer(view: RunView, sensor: str) -> bool:
    """Return whether a sensor measures acceleration."""
    return view.plant.vehicle.sensors[sensor].kind != "displacement"


def is_input(view: RunView, sensor: str) -> bool:
    """Return whether a sensor measures base motion, the input of the model."""
    return any(s.sensor == sensor for s in view.plant.inputs)


def sensor_column(view: RunView, sensor: str, kind: str, component: int) -> Column:
    """Return the column of one unit of a sensor error; empty where the error has no effect.

    Parameters
    ----------
    kind
        As in :func:`baseline.sensor_error_spectra`.
    component
        Axis of the error.
    """
    errors, from_input = sensor_error_spectra(view, sensor, kind, component)
    where, sign = (Where.INPUT, -1.0) if from_input else (Where.OUTPUT, 1.0)
    effects = [Effect(where, i, sign * view.grid.signal(spectrum)) for i, spectrum in errors.items()]
    if is_accelerometer(view, sensor) and effects:
        table = mean_table(view)
        means = sensor_error_means(table, sensor, kind, component)
        if from_input and kind == "gain":  # the share of a base reading that is too much: of the mean reading, not of gravity
            means = {row: value + float(table.residual[row] * table.std[row]) for row, value in means.items()}
        effects += [Effect(Where.MEAN, row, np.array([value])) for row, value in means.items()]
    return tuple(effects)


def turned_column(view: RunView, sensor: str, component: int, angle: float) -> Column:
    """Return the column of a sensor turned about one of its axes, per radian and exact at an angle; empty without effect.

    A sensor turned by R reads ``R^T`` times what one that is not turned reads, accelerations and angular rates alike; what a
    base sensor should have read is R times its reading.

    Parameters
    ----------
    component
        Axis of the rotation.
    angle
        Where the column is exact [rad].
    """
    angle = angle if abs(angle) > _NO_ANGLE else _NO_ANGLE
    plant, from_input = view.plant, is_input(view, sensor)
    turn = rotation_matrices(angle * np.eye(3)[component][None])[0]
    change = ((turn if from_input else turn.T) - np.eye(3)) / angle
    signals, spectrum = (plant.inputs, view.data.input_spectrum) if from_input else (plant.outputs, view.model.ideal_spectrum)
    rows = {s.component: i for i, s in enumerate(signals) if s.sensor == sensor}
    where = Where.INPUT if from_input else Where.OUTPUT
    effects = [Effect(where, i, view.grid.signal(s)) for i, s in turned_reading(spectrum, rows, change).items()]
    if effects:
        table = mean_table(view)
        shift = (turn.T - np.eye(3)) @ table.gravity[sensor] / angle
        means = {table.row(sensor, c): float(shift[c]) for c in range(3)}
        effects += [Effect(Where.MEAN, row, np.array([v])) for row, v in means.items() if row is not None and v != 0.0]
    return tuple(effects)


def fault_std(view: RunView, sensor: str, kind: str, std: float) -> float:
    """Return the standard deviation of a fault that is stated as all of the error of a sensor, known to ``std``.

    A part of that error is what a sensor in good order has, too: ``hypot(std, tolerance)``.

    Parameters
    ----------
    kind
        Of :class:`~ride_estimation.sensors.installation.Installation`, or ``gyro_gain``.
    """
    tolerances = view.settings.tolerances
    installed = tolerances.of(view.plant.vehicle.sensors[sensor])
    return math.hypot(std, tolerances.gyro_gain if kind == "gyro_gain" else getattr(installed, kind))


def axis_name(component: int, rotation: bool = False) -> str:
    """Return x y z and rate_x rate_y rate_z of angular rates, or roll pitch yaw."""
    return ("roll", "pitch", "yaw")[component] if rotation else CHANNELS[component]
