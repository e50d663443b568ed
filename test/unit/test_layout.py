# Copyright 2026 ride_estimation contributors
"""Rank and condition of sensor layouts against hand-derived cases."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.frames import COORDINATES, rotation_from_rpy
from ride_estimation.sensors.layout import check_layout, motion_rows
from ride_estimation.sensors.sensor import Sensor


def accelerometer(
    position: tuple[float, float, float], kind: str = "accelerometer", rotation: np.ndarray | None = None
) -> Sensor:
    turned = np.eye(3) if rotation is None else rotation
    return Sensor("s", kind, "/s", "cab", position=np.array(position), rotation=turned)


def test_rows_give_what_rigid_body_kinematics_gives() -> None:
    rng = np.random.default_rng(0)
    rotation = rotation_from_rpy(0.3, -0.2, 1.1)
    position, cg = rng.normal(size=3), rng.normal(size=3)
    accel, alpha = rng.normal(size=3), rng.normal(size=3)
    rows = motion_rows([accelerometer(tuple(position), rotation=rotation)], cg)
    point = accel + np.cross(alpha, position - cg)
    assert rows @ np.concatenate([accel, alpha]) == pytest.approx(rotation.T @ point, abs=1e-14)


@pytest.mark.parametrize(
    ("positions", "rank"),
    [
        ([(0.0, 0.0, 0.0)], 3),
        ([(1.0, 0.5, 0.2)], 3),
        ([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)], 5),  # the turn about the line through both is invisible
        ([(1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)], 5),  # three on one line
        ([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)], 6),
        ([(1.0, 1.0, 0.5)] * 4, 3),  # four at one place
    ],
)
def test_rank_of_known_layouts(positions: list[tuple[float, float, float]], rank: int) -> None:
    check = check_layout([accelerometer(p) for p in positions], np.zeros(3))
    assert check.rank == rank
    assert check.accelerometers_suffice == (rank == 6)
    assert np.isfinite(check.condition) == (rank == 6)


def test_the_invisible_turn_is_named() -> None:
    check = check_layout([accelerometer((1.0, 0.0, 0.0)), accelerometer((-1.0, 0.0, 0.0))], np.zeros(3))
    assert check.undetermined == ("roll acceleration",)
    assert "roll acceleration" in check.sentence("cab") and "determine 5 of 6" in check.sentence("cab")


def test_a_turn_about_a_line_off_the_cg_is_named_as_a_combination() -> None:
    # both sensors 1 m above the CG: turning about their line also moves the CG sideways
    check = check_layout([accelerometer((1.0, 0.0, 1.0)), accelerometer((-1.0, 0.0, 1.0))], np.zeros(3))
    assert len(check.undetermined) == 1
    assert "lateral" in check.undetermined[0] and "roll" in check.undetermined[0]


def test_gyro_completes_a_single_sensor() -> None:
    check = check_layout([accelerometer((0.3, 0.1, 0.2), "imu")], np.zeros(3))
    assert (check.rank, check.rank_with_gyro, check.complete) == (3, 6, True)


def test_fewer_coordinates_need_fewer_sensors() -> None:
    two = [accelerometer((1.0, 0.0, 0.0)), accelerometer((-1.0, 0.0, 0.0))]
    assert check_layout(two, np.zeros(3), ("z", "pitch")).accelerometers_suffice
    assert not check_layout(two, np.zeros(3), ("z", "roll")).complete


def test_condition_grows_as_three_sensors_approach_a_line() -> None:
    conditions = [
        check_layout([accelerometer(p) for p in ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, off, 0.0))], np.zeros(3)).condition
        for off in (1.0, 0.1, 0.001)
    ]
    assert conditions[0] < conditions[1] < conditions[2]
    assert conditions[0] < 5.0 and conditions[2] > 100.0


def test_condition_does_not_depend_on_the_unit_of_length() -> None:
    places = ((1.0, 0.2, 0.0), (-1.0, 0.5, 0.3), (0.0, -0.8, 0.1))
    small = check_layout([accelerometer(p) for p in places], np.zeros(3)).condition
    large = check_layout([accelerometer(tuple(10.0 * v for v in p)) for p in places], np.zeros(3)).condition  # type: ignore[arg-type]
    assert large == pytest.approx(small, rel=1e-9)


def test_no_accelerometer_is_said() -> None:
    check = check_layout([Sensor("d", "displacement", "/d", "cab")], np.zeros(3))
    assert check.channels == 0 and not check.complete and check.undetermined
    assert "no accelerometer" in check.sentence("cab")
    assert check.coordinates == COORDINATES
