# Copyright 2026 ride_estimation contributors
"""What turned base sensors leave uncertain: as large as the error they make in a least-squares split, nothing for z."""

from __future__ import annotations

import pathlib

import numpy as np

from ride_estimation.estimation.arrangement import arrange
from ride_estimation.estimation.mounting_doubt import MountingDoubt
from ride_estimation.io.vehicle_file import load_vehicle

ARRANGEMENT = arrange(load_vehicle(pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml"))


def motion(rng: np.random.Generator, deformation: float, vertical: float = 5e-3, rigid: float = 3e-4) -> np.ndarray:
    """Deflections (K, 4, 3): lateral rigid motion and deformation, vertical motion of every bracket on its own."""
    x = np.zeros((20000, 4, 3))
    x[:, :, 2] = vertical * rng.standard_normal((20000, 4))
    x[:, :, 1] = rigid * rng.standard_normal((20000, 1)) + deformation * rng.standard_normal((20000, 4))
    return x


def test_std_covers_the_split_that_turned_sensors_make_wrong():
    rng = np.random.default_rng(1)
    x = motion(rng, 5e-5)
    doubt = MountingDoubt(ARRANGEMENT)
    doubt.observe(x, 30.0 * x)
    stated = doubt.std()[0, :, 1]
    # every mount its own force, all seen through their sum and their first moment: what turned sensors do to the fit
    k = np.array([3e5, 3e5, 2.8e5, 2.8e5])
    errors = []
    for _ in range(200):
        turned = x.copy()
        turned[:, :, 1] += np.radians(0.1) * rng.standard_normal(4) * x[:, :, 2]
        arm = ARRANGEMENT.arms[:, 0]
        force = np.concatenate([x[:, :, 1] @ k, (x[:, :, 1] * arm) @ k])
        found = np.linalg.lstsq(np.concatenate([turned[:, :, 1], turned[:, :, 1] * arm]), force, rcond=None)[0]
        errors.append(found / k - 1.0)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # independent vertical motion of the mounts is the kindest case: the stated value is a bound and of the same order
    assert np.all(rms < 2.0 * stated) and np.all(stated < 20.0 * rms)


def test_less_deformation_leaves_more_doubt_and_vertical_parameters_have_none():
    stated = []
    for deformation in (2e-4, 2e-5):
        doubt = MountingDoubt(ARRANGEMENT)
        x = motion(np.random.default_rng(2), deformation)
        doubt.observe(x, x)
        stated.append(doubt.std())
    assert np.all(stated[1][:, :, 1] > 3.0 * stated[0][:, :, 1])
    assert np.all(stated[0][:, :, 2] == 0.0) and np.all(np.isfinite(stated))


def test_nothing_observed_is_no_doubt_and_a_saved_state_continues_alike():
    doubt = MountingDoubt(ARRANGEMENT)
    assert np.all(doubt.std() == 0.0)
    x = motion(np.random.default_rng(3), 1e-4)
    doubt.observe(x, x)
    other = MountingDoubt(ARRANGEMENT)
    other.load(doubt.save())
    assert np.array_equal(other.std(), doubt.std())
