# Copyright 2026 ride_estimation contributors
"""One axis that repeats exactly is stuck where the sensors beside it move; resolution, standstill and isolation are no faults."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.faults.gate_kernel import Scan, scan_block
from ride_estimation.estimation.faults.stuck_sensors import DEAD, FLAT_AXES, SATURATED, StuckSensors

DT = 0.01
#: three sensors on the body and three at the bases, one of each turned by 90 degrees about z
TURNED = (1, 4)


def watch(values: np.ndarray, noise: float = 0.02) -> dict[int, set[str]]:
    """Return why sensors were found stuck in readings (K, 6, 3) of body axes, which the sensors take in their own axes."""
    rotation = np.tile(np.eye(3), (6, 1, 1))
    rotation[list(TURNED)] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    stuck = StuckSensors(rotation, np.full(6, noise), np.ones(6, dtype=bool), 3, 9.81)
    last, square, found = np.zeros((6, 3)), np.zeros(6), {}
    for k in range(0, len(values), 10):
        block = np.ascontiguousarray(values[k : k + 10])
        runs, sizes = np.empty((10, 6), dtype=np.int64), np.empty((10, 6))
        figures, mean = np.empty((4, 6)), np.empty((6, 3))
        longest, longest_axis, full = scan_block(
            block, np.ones((10, 6), dtype=bool), last, k > 0, values.mean(axis=0), np.full(6, 1e3), stuck.run, stuck.axis_run,
            stuck.held, runs, sizes, figures, mean,
        )  # fmt: skip
        scan = Scan(runs, sizes, figures, mean, longest, longest_axis, full)
        for a, reason in stuck.judge(block, scan, square, (), k == 0, DT).items():
            found.setdefault(a, set()).add(reason)
        square, last = figures[1], block[-1]
    return found


def ride(seconds: float = 6.0, size: float = 0.5, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / DT)) * DT
    phase = rng.uniform(0.0, 6.0, (1, 6, 3))
    values = size * np.sin(2.0 * np.pi * 1.5 * time[:, None, None] + 0.3 * phase) + 0.02 * rng.normal(size=(len(time), 6, 3))
    values[:, :, 2] += 9.81
    return values


@pytest.mark.parametrize("sensor", range(6))
@pytest.mark.parametrize("axis", range(3))
def test_one_axis_that_holds_its_value_is_stuck_on_body_and_base_alike(sensor: int, axis: int) -> None:
    values = ride()
    values[300:, sensor, axis] = values[300, sensor, axis]
    assert watch(values) == {sensor: {FLAT_AXES[axis]}}


def test_an_axis_that_never_said_anything_is_stuck_too() -> None:
    values = ride()
    values[:, 3, 0] = 0.0
    assert watch(values) == {3: {FLAT_AXES[0]}}


@pytest.mark.parametrize("resolution", [0.02, 0.05, 0.1])
def test_resolution_makes_no_axis_stuck(resolution: float) -> None:
    quiet = ride(size=0.6, seed=1)
    quiet[:, 2, 1] = 0.2 * (quiet[:, 2, 1])
    reasons = set().union(*watch(np.round(quiet / resolution) * resolution).values())
    assert not reasons & {*FLAT_AXES, *SATURATED}


def test_a_body_that_stays_still_on_bases_that_move_is_isolated_and_not_stuck() -> None:
    values = ride()
    values[:, :3] = np.array([0.0, 0.0, 9.81])
    assert not set().union(*watch(values).values()) & set(FLAT_AXES)


def test_all_sensors_that_read_zero_are_dead_and_a_vehicle_at_rest_is_not() -> None:
    assert watch(np.zeros((300, 6, 3))) == {a: {DEAD} for a in range(6)}
    assert watch(np.tile([0.0, 0.0, 9.81], (300, 6, 1))) == {}


@pytest.mark.parametrize("ends", [(-0.3, 0.3), (-9.0, 0.2)])
def test_an_axis_that_rests_at_its_largest_values_is_saturated(ends: tuple[float, float]) -> None:
    values = ride(seed=2)
    values[:, 5, 0] = np.clip(values[:, 5, 0], *ends)
    assert SATURATED[0] in watch(values)[5] and set(watch(values)) == {5}
