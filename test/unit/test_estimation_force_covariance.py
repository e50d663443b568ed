# Copyright 2026 ride_estimation contributors
"""Every part of the stated uncertainty of the attachment forces is the scatter that drawn errors of its source make."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.forces.mount_forces import ForceBlock, MountForceEstimator
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock
from ride_estimation.frames import AXES
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Prior, Vehicle

TICKS = 400
#: stated sizes: deflection [m], rate [m/s], logarithm of a parameter, mass, static load [N]
DEFLECTION, RATE, PARAMETER, MASS, STATIC = 4e-4, 8e-3, 0.1, 0.05, 60.0
#: force that a misread base is worth [N]
FORCE = 300.0
#: covariance of the wrench [N, N m]
LOAD = np.diag(np.array([200.0, 150.0, 400.0, 120.0, 180.0, 90.0]) ** 2)
#: ticks so short that nothing is slow, and so long that everything is [s]
FAST, SLOW = 1e-7, 1e3
#: a std that is nothing beside the others
TINY = 1e-3


def vehicle(bases: bool, static_std: float) -> Vehicle:
    """A cab whose static loads were weighed, with sensors at its bases or else transducers along every axis."""
    cab = load_vehicle("truck_cab")
    loads = dict(zip(cab.mounts, estimator(cab).static_force[:, 2].tolist()))
    mounts = {n: dataclasses.replace(m, static_load=Prior(loads[n], std=static_std)) for n, m in cab.mounts.items()}
    sensors = dict(cab.sensors)
    if not bases:
        sensors = {n: s for n, s in sensors.items() if not s.mount}
        for m in mounts:
            for a in AXES:
                sensors[f"{m}_{a}"] = Sensor(f"{m}_{a}", "displacement", f"/{m}/{a}", "cab", mount=m, axis=a, noise_std=1e-5)
    return dataclasses.replace(cab, mounts=mounts, sensors=sensors, force_references=())


def estimator(own: Vehicle) -> MountForceEstimator:
    geometry = geometry_of(own)
    return MountForceEstimator(geometry, MountLaw(geometry), np.ones((4, 3), dtype=bool), BracketTilt(geometry))


class Drive:
    """A cab on linear mounts that moves so little that nothing turns; what its forces are said to be for wrong readings."""

    def __init__(self, seed: int, bases: bool = True, dt: float = FAST, static_std: float = TINY) -> None:
        self.rng, self.dt = np.random.default_rng(seed), dt
        self.forces = estimator(vehicle(bases, static_std))
        assert (self.forces._frame is not None) is bases
        value, rate = (s * self.rng.standard_normal((TICKS, 12)) for s in (2e-3, 4e-2))
        if self.forces._frame is not None:  # a frame that does not deform, as is known
            rigid = np.eye(12) - self.forces._frame.projector
            value, rate = value @ rigid.T, rate @ rigid.T
            self.forces._frame.variance[:], self.forces._frame.rate_variance[:] = 0.0, 0.0
        self.value, self.rate = value.reshape(TICKS, 4, 3), rate.reshape(TICKS, 4, 3)
        law = self.forces.law
        moving = (-law.stiffness * self.value - law.damping * self.rate).reshape(TICKS, 12)
        self.support = (self.forces.static_force.ravel() + moving) @ self.forces.geometry.wrench.T

    def stated(self, stated: float = TINY, load: np.ndarray = TINY * LOAD) -> ForceBlock:
        """Forces from readings without errors; deflections are stated to be off by a share of their usual error."""
        for _ in range(12):  # until their size is known
            self.forces._until = 0.0
            block = self.observe(0.0, 0.0, 0.0, stated, load)
        self.forces._until = np.inf
        return block

    def observe(
        self, value: np.ndarray | float, rate: np.ndarray | float, support: np.ndarray | float, stated: float = TINY,
        load: np.ndarray = TINY * LOAD,
    ) -> ForceBlock:  # fmt: skip
        """Forces from readings with errors."""
        none, shape = np.zeros((TICKS, 4, 3)), (4, 3)
        block = DeflectionBlock(
            self.value + value, self.rate + rate, none, none, none[:, 0], none[:, 0], np.full(shape, stated * DEFLECTION),
            np.full(shape, stated * RATE), none,
        )  # fmt: skip
        return self.forces.observe(block, self.support + support, np.ones(TICKS, dtype=bool), load, none, self.dt)

    def normal(self, *shape: int) -> np.ndarray:
        return self.rng.standard_normal(shape)


def agrees(errors: list[np.ndarray], std: np.ndarray, band: float) -> None:
    """The mean squares of errors (K, 4, 3) are the stated variances (4, 3), neither more nor less."""
    ratio = np.mean([np.mean(e**2, axis=0) for e in errors], axis=0) / std**2
    assert ratio.min() > 1.0 - band, ratio
    assert ratio.max() < 1.0 + band, ratio


@pytest.mark.parametrize("bases", [True, False], ids=["bases", "transducers"])
def test_uncertain_deflections(bases: bool):
    drive = Drive(1, bases)
    exact = drive.stated(1.0, LOAD)
    wrong = [drive.observe(DEFLECTION * drive.normal(TICKS, 4, 3), RATE * drive.normal(TICKS, 4, 3), 0.0) for _ in range(10)]
    agrees([w.force - exact.force for w in wrong], exact.std_model[0], 0.15)


@pytest.mark.parametrize("bases", [True, False], ids=["bases", "transducers"])
def test_uncertain_stiffness_and_damping(bases: bool):
    drive = Drive(2, bases)
    drive.forces.parameter_std[:] = PARAMETER
    exact, errors = drive.stated(), []
    for _ in range(200):
        drive.forces.law.scale(1.0 + PARAMETER * drive.normal(2, 4, 3))
        errors.append(drive.observe(0.0, 0.0, 0.0).force - exact.force)
    agrees(errors, exact.std_model[0], 0.3)


def test_slow_forces_that_are_shared_by_an_uncertain_stiffness():
    drive = Drive(7, bases=False, dt=SLOW)
    drive.value[:], drive.rate[:] = 0.0, 0.0
    drive.support[:] = drive.forces.static_force.ravel() @ drive.forces.geometry.wrench.T + 3.0 * np.sqrt(np.diag(LOAD))
    drive.forces.parameter_std[0] = PARAMETER
    exact, errors = drive.stated(), []
    for _ in range(300):
        drive.forces.law.scale(1.0 + PARAMETER * drive.normal(2, 4, 3))
        drive.forces._update_static()
        errors.append(drive.observe(0.0, 0.0, 0.0).force - exact.force)
    agrees(errors, exact.std_model[0], 0.35)


def test_a_base_sensor_that_reads_too_much_along_one_axis():
    drive = Drive(8, bases=False)
    drive.forces.misread_variance[1, 1] = FORCE**2
    exact, size = drive.stated(1.0, LOAD), np.full((4, 3), DEFLECTION)
    size[1, 1] = np.hypot(DEFLECTION, FORCE / drive.forces.law.stiffness[1, 1])
    wrong = [drive.observe(size * drive.normal(TICKS, 4, 3), RATE * drive.normal(TICKS, 4, 3), 0.0) for _ in range(10)]
    agrees([w.force - exact.force for w in wrong], exact.std_model[0], 0.15)


def test_uncertain_motion_of_the_body():
    drive = Drive(3)
    exact = drive.stated(1.0, LOAD)
    wrong = [drive.observe(0.0, 0.0, drive.normal(TICKS, 6) * np.sqrt(np.diag(LOAD))) for _ in range(10)]
    agrees([w.force - exact.force for w in wrong], exact.std_equilibrium[0], 0.15)


def test_biases_of_the_sensors_of_the_body():
    drive = Drive(4, bases=False, dt=SLOW)
    drive.forces.constant_load = LOAD
    exact = drive.stated(1.0)
    errors = [drive.observe(0.0, 0.0, drive.normal(6) * np.sqrt(np.diag(LOAD))).force - exact.force for _ in range(200)]
    agrees(errors, exact.std_equilibrium[0], 0.3)


def test_uncertain_mass():
    drive = Drive(5)
    drive.forces.mass_relative_std = MASS
    exact = drive.stated()
    # stiffness, damping and loads are known for the mass of the file: all forces are off by the same share
    agrees([MASS * n * exact.force for n in drive.normal(200)], exact.std_equilibrium[0], 0.3)


def test_static_loads_as_they_were_weighed():
    drive = Drive(6, static_std=STATIC)
    exact, g = drive.stated(), drive.forces.geometry.wrench
    covariance = np.diag(np.tile([0.0, 0.0, STATIC**2], 4))
    gain = covariance @ g.T @ np.linalg.pinv(g @ covariance @ g.T)
    drawn = np.sqrt(np.diag(covariance)) * drive.normal(2000, 12)
    # equilibrium puts right what it can
    errors = (drawn - drawn @ g.T @ gain.T).reshape(2000, 1, 4, 3)
    agrees(list(errors[..., 2:]), exact.std_model[0][:, 2:], 0.15)
