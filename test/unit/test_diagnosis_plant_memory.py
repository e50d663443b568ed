# Copyright 2026 ride_estimation contributors
"""How long a body keeps the start of a run, and what is left out of it for that."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.elements.kelvin_voigt import KelvinVoigt


def damped(damping: float):
    """Return the quarter car with another damping, N s/m."""
    vehicle = quarter_car()
    mount = vehicle.mounts["strut"]
    spring = KelvinVoigt(stiffness=mount.elements["z"].stiffness, damping=damping)
    return dataclasses.replace(vehicle, mounts={"strut": dataclasses.replace(mount, elements={"z": spring})})


@pytest.mark.parametrize("damping", [100.0, 800.0])
def test_the_memory_of_a_body_on_one_mount_is_twice_its_mass_over_the_damping(damping: float):
    vehicle = damped(damping)
    plant = build_plant(vehicle, dict.fromkeys(vehicle.sensors, 1))
    mass = float(plant.mass[0, 0])
    laws = np.array([plant.ports[0].stiffness]), np.array([plant.ports[0].damping])
    assert plant.memory_s(*laws, (0.4, 40.0)) == pytest.approx(2.0 * mass / damping, rel=1e-6)
    frequency = np.sqrt(plant.ports[0].stiffness / mass) / (2.0 * np.pi)
    assert plant.memory_s(*laws, (1.1 * frequency, 40.0)) == 0.0  # what does not move in the band is not judged there


def test_a_body_that_decays_slowly_has_more_of_both_ends_left_out():
    run = quarter_car_run(11)
    seconds = run.samples / run.rate_hz
    light, heavy = (diagnose(damped(damping), run).evidence for damping in (20.0, 2000.0))
    assert light is not None and heavy is not None
    assert heavy.block_time_s[0] < 5.0
    assert 0.15 * seconds < light.block_time_s[0] < 0.15 * seconds + 2.0
