# Copyright 2026 ride_estimation contributors
"""A base sensor that goes and comes back never steps the mean of its mount: offsets are no motion."""

from __future__ import annotations

import numpy as np

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.forces.base_fill import BaseFill
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock
from ride_estimation.io.vehicle_file import load_vehicle

BLOCK, DT = 10, 0.01
OFFSETS = np.array([[0.3, -0.2, 0.4], [0.0, 0.1, -0.1], [-0.2, 0.0, 0.2], [0.1, 0.3, -0.3]])
#: offset of the first sensor after its absence
OTHER = np.array([-0.3, 0.4, 1.2])


def used(away: tuple[float, float], end: float) -> tuple[np.ndarray, np.ndarray, list[tuple[float, int]]]:
    """Return block means of what is used at the first mount and of its true motion, and when which sensor was used again."""
    rng, fill = np.random.default_rng(4), BaseFill(geometry_of(load_vehicle("truck_cab")))
    found, truth, returned = [], [], []
    for k in range(round(end / DT / BLOCK)):
        time = k * BLOCK * DT
        own = rng.standard_normal((BLOCK, 1, 3)) + [0.0, 0.0, 9.81] + 0.05 * rng.standard_normal((BLOCK, 4, 3))
        offset = OFFSETS.copy()
        offset[0] = OFFSETS[0] if time < away[1] else OTHER
        ok = np.ones((BLOCK, 4), dtype=bool)
        ok[:, 0] = not away[0] <= time < away[1]
        base, base_ok = fill.fill(np.where(ok[..., None], own + offset, 0.0), ok, BLOCK * DT)
        assert base_ok.all()
        found.append(base[:, 0].mean(axis=0))
        truth.append(own[:, 0].mean(axis=0))
        returned += [(time, m) for m in fill.returned]
    return np.array(found), np.array(truth), returned


def test_what_is_made_up_for_a_sensor_has_its_mean_and_so_has_the_sensor_when_it_is_back_with_another_offset() -> None:
    found, truth, returned = used((30.0, 70.0), 90.0)
    error = (found - truth - OFFSETS[0]).reshape(-1, 50, 3).mean(axis=1)
    assert np.abs(error).max() < 0.05
    assert [(round(time), m) for time, m in returned] == [(73, 0)]


def test_after_a_short_absence_a_sensor_is_used_as_it_reads_at_once() -> None:
    found, truth, returned = used((30.0, 33.0), 40.0)
    np.testing.assert_allclose((found - truth)[340:].mean(axis=0), OTHER, atol=0.03)
    assert not returned


def test_a_fault_that_is_found_within_ten_seconds_is_not_in_the_mean() -> None:
    """The first sensor reads 5 m/s^2 too much for eight seconds before it is left out."""
    fill = BaseFill(geometry_of(load_vehicle("truck_cab")))
    for k in range(500):
        time = k * BLOCK * DT
        base = np.broadcast_to([0.0, 0.0, 9.81], (BLOCK, 4, 3)) + OFFSETS
        base[:, 0] += 5.0 * (time >= 30.0)
        ok = np.ones((BLOCK, 4), dtype=bool)
        ok[:, 0] = time < 38.0
        base, _ = fill.fill(base, ok, BLOCK * DT)
    np.testing.assert_allclose(base[:, 0], np.array([0.0, 0.0, 9.81]) + np.broadcast_to(OFFSETS[0], (BLOCK, 3)), atol=1e-9)


def test_offsets_of_sensors_outlast_a_new_time_base() -> None:
    """All clocks jump and a sensor is gone with them: made up without its offset it would step where it comes back."""
    fill = BaseFill(geometry_of(load_vehicle("truck_cab")))
    base, ok = np.broadcast_to([0.0, 0.0, 9.81], (BLOCK, 4, 3)) + OFFSETS, np.ones((BLOCK, 4), dtype=bool)
    for _ in range(300):
        fill.fill(base, ok, BLOCK * DT)
    fill.restart()
    ok[:, 0] = False
    found, _ = fill.fill(base, ok, BLOCK * DT)
    np.testing.assert_allclose(found[:, 0], base[:, 0], atol=1e-9)


def test_a_sensor_that_is_lost_in_the_first_seconds_is_made_up_with_its_offset_too() -> None:
    found, truth, _ = used((5.0, 9.0), 9.0)
    np.testing.assert_allclose((found - truth)[52:].mean(axis=0), OFFSETS[0], atol=0.05)


def test_what_is_made_up_errs_by_what_its_bracket_and_those_that_stand_for_it_move_on_their_own() -> None:
    """The blend of three noisy brackets minus the noise of the fourth, in units of the variance of one."""
    fill, rng = BaseFill(geometry_of(load_vehicle("truck_cab"))), np.random.default_rng(6)
    own, ok = rng.standard_normal((20_000, 4, 3)), np.ones((20_000, 4), dtype=bool)
    ok[:, 0] = False
    base, _ = fill.fill(own, ok, 1e-3)
    still = DeflectionBlock(*(np.zeros((1, 4, 3)) for _ in range(6)), np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((1, 4, 3)))
    fill.widen(still, 1e-3)
    np.testing.assert_allclose(fill.made_up[0], np.var(base[:, 0] - own[:, 0], axis=0), rtol=0.05)
    assert not fill.made_up[1:].any()
