# Copyright 2026 ride_estimation contributors
"""A bench record of one mount as a run: the same chain that tests a vehicle tests a force element.

A record of displacement and force is the same as a mount between a base that moves by minus the displacement and a body too
heavy to move: the body's acceleration times its mass is the force.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.spectra import make_grid
from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import InputDataError
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]

_MASS = 1.0e9  # kg, moves by less than 1e-9 of the stroke for any mount

MOUNT, FORCE, MOTION = "mount", "force", "motion"


def bench_vehicle(
    element: ForceElement, rate_hz: float, force_noise: float, displacement_noise: float, band_hz: tuple[float, float]
) -> Vehicle:
    """Return the bench as a vehicle: one body, one mount along z, a force and a motion channel.

    Parameters
    ----------
    element
        What is believed of the mount.
    rate_hz
        Sample rate of the records [Hz].
    force_noise, displacement_noise
        Standard deviation of one sample [N], [m].
    band_hz
        Band of the test [Hz]; the acceleration noise of the motion channel is stated at its geometric middle.
    """
    middle = 2.0 * np.pi * float(np.sqrt(band_hz[0] * min(band_hz[1], 0.42 * rate_hz)))
    body = Body("head", Prior(_MASS), np.zeros(3), _MASS * np.eye(3), coordinates=("z",))
    sensors = {
        FORCE: Sensor(FORCE, "accelerometer", "", "head", noise_std=max(force_noise, 1e-9) / _MASS, coupling="ac"),
        MOTION: Sensor(
            MOTION, "accelerometer", "", "piston", mount=MOUNT, coupling="ac",
            noise_std=max(displacement_noise, 1e-12) * middle**2,
        ),
    }
    mount = Mount(MOUNT, np.zeros(3), "head", "piston", {"z": element})
    return Vehicle("bench", {"head": body}, {MOUNT: mount}, sensors)


def bench_run(name: str, rate_hz: float, displacement: Array, force: Array, band_hz: tuple[float, float]) -> UniformRun:
    """Return a record as a run of the bench.

    Parameters
    ----------
    displacement
        Extension of the mount [m], shape (N,).
    force
        Tension [N], shape (N,).
    band_hz
        Band of the test [Hz]: derivatives are taken within it.

    Raises
    ------
    InputDataError
        Lengths differ, or values that are not finite.
    """
    x, f = np.asarray(displacement, dtype=float), np.asarray(force, dtype=float)
    if x.shape != f.shape or x.ndim != 1 or x.size < 8:
        raise InputDataError(
            f"record {name}: displacement and force need one length of at least 8; given {x.shape} and {f.shape}"
        )
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(f))):
        raise InputDataError(f"record {name}: values that are not finite")
    grid = make_grid(len(x), rate_hz, band_hz)
    acceleration = grid.signal(grid.omega**2 * grid.spectrum(x - np.mean(x)))
    zero = np.zeros_like(x)
    # the base moves by -x: deflection (body minus base) is x; the tension pulls the body down: a = -F / m
    data = {MOTION: np.stack([zero, zero, acceleration], axis=1), FORCE: np.stack([zero, zero, -f / _MASS], axis=1)}
    valid = {key: np.ones(len(x), dtype=bool) for key in data}
    return UniformRun(name, rate_hz, 0, data, valid)
