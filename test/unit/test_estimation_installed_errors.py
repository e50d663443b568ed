# Copyright 2026 ride_estimation contributors
"""Errors of installed sensors: their columns, how far gravity shows a lean, and what deformation the sensors make up."""

from __future__ import annotations

import dataclasses
import pathlib
import types

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.free_parameters import find_free_parameters
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.parameters.balance_kernel import high_pass_block, integrate_block
from ride_estimation.estimation.parameters.force_balance import BalanceInput, ForceBalance
from ride_estimation.estimation.sensor_errors.installed_errors import InstalledErrors
from ride_estimation.estimation.sensor_errors.lean import LeanOfBases
from ride_estimation.estimation.sensor_errors.spurious_deformation import SpuriousDeformation
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.installation import USUAL

VEHICLE = load_vehicle(pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml")
GEOMETRY = geometry_of(VEHICLE)
CORNER, DT, TICKS = 2.0 * np.pi * 0.4, 0.005, 4000
PRIOR = np.full((2, 4, 3), 0.3)
#: horizontal axes of the base sensors
JUDGED = tuple(3 * i + a for i in range(4) for a in (0, 1))
SMALL = 1e-4


def shaken(seed: int, channels: int) -> np.ndarray:
    """Accelerations of 1 to 6 Hz and their derivative, shape (2, TICKS, channels)."""
    rng = np.random.default_rng(seed)
    omega, phase = 2.0 * np.pi * rng.uniform(1.0, 6.0, (8, channels)), rng.uniform(0.0, 6.0, (8, channels))
    angle = omega * (np.arange(TICKS) * DT)[:, None, None] + phase
    return np.stack([np.sin(angle).sum(axis=1), (omega * np.cos(angle)).sum(axis=1)])


def at(motion: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Accelerations (K, S, 3) at arms (S, 3) of a rigid body."""
    return motion[:, None, :3] + np.cross(motion[:, None, 3:], arms)


def balance(body: np.ndarray, base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Modelled less measured acceleration (K, 6) for readings of body (K, 6) and bases (K, 4, 3), and columns of the errors."""
    free = find_free_parameters(GEOMETRY, PipelineSettings())
    errors, no_tilt = InstalledErrors(GEOMETRY, JUDGED), types.SimpleNamespace(maps=np.zeros((4, 3, 12)))
    own = ForceBalance(GEOMETRY, no_tilt, free, MountLaw(GEOMETRY), CORNER / (2.0 * np.pi), errors)
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = GEOMETRY.body.mass.value * np.eye(3), GEOMETRY.body.inertia
    nothing = np.zeros((TICKS, 4, 3))
    relative = at(body, GEOMETRY.arms) - base
    data = BalanceInput(body @ mass, relative, *[nothing] * 5, np.zeros((TICKS, 3)), base)
    chunk = own.observe(data, np.zeros((4, 3)), 1.0, DT)
    return chunk.modelled - chunk.measured, chunk.columns[:, :, len(free) + 1 + own.turned_count :]


def read_wrongly(kind: str, axis: int, accel: np.ndarray, jerk: np.ndarray, turning: np.ndarray) -> np.ndarray:
    """Acceleration (K, 3) that a sensor with a small error reads."""
    unit = np.eye(3)[axis]
    wrong = {
        "turned": np.cross(unit, accel), "gain": unit * accel, "place": np.cross(turning, unit), "late": -jerk,
    }[kind]  # fmt: skip
    return accel + SMALL * wrong


BODY, JERK = shaken(1, 6)
GROUND, GROUND_JERK = shaken(2, 6)


@pytest.mark.parametrize(
    ("kind", "axis", "place"),
    [
        *(("turned", 0, 0), ("turned", 1, 1), ("turned", 2, 2), ("gain", 2, 3), ("place", 0, 4), ("place", 1, 5)),
        *(("place", 2, 6), ("late", 0, 7), ("gain", 0, 32), ("gain", 1, 33)),
    ],
)
@pytest.mark.parametrize("mount", [0, 3])
def test_a_column_is_what_an_error_of_a_base_sensor_hides(kind: str, axis: int, place: int, mount: int):
    base, jerk = at(GROUND, GEOMETRY.arms), at(GROUND_JERK, GEOMETRY.arms)
    read = base.copy()
    read[:, mount] = read_wrongly(kind, axis, base[:, mount], jerk[:, mount], GROUND[:, 3:])
    true, wrong = balance(BODY, base)[0], balance(BODY, read)
    column = wrong[1][:, :, 10 + (place + 2 * mount if place >= 32 else place + 8 * mount)]
    left = wrong[0] + SMALL * column - true
    # the first second the filters settle
    assert np.linalg.norm(left[200:]) < 0.02 * np.linalg.norm((wrong[0] - true)[200:])


@pytest.mark.parametrize(("kind", "first"), [("turned", 0), ("gain", 3), ("place", 6), ("late", 9)])
@pytest.mark.parametrize("axis", range(3))
def test_a_column_is_what_an_error_that_all_sensors_of_the_body_have_moves(kind: str, first: int, axis: int):
    arms = np.array([s.position - GEOMETRY.body.cg for s in GEOMETRY.body_sensors])
    right, jerk, base = at(BODY, arms), at(JERK, arms), at(GROUND, GEOMETRY.arms)
    read = np.stack([read_wrongly(kind, axis, right[:, j], jerk[:, j], BODY[:, 3:]) for j in range(len(arms))], axis=1)
    rows = np.vstack([np.hstack([np.eye(3), np.cross(np.eye(3), r).T]) for r in arms])
    seen = np.linalg.lstsq(rows, read.reshape(TICKS, -1).T, rcond=None)[0].T
    assert np.allclose(at(seen, arms), read, atol=1e-2) and not np.allclose(seen, BODY, atol=1e-9)
    true, wrong = balance(BODY, base)[0], balance(seen, base)
    left = wrong[0] + SMALL * wrong[1][:, :, first + (0 if kind == "late" else axis)] - true
    if kind == "late":
        # all bases early, and all a little later
        left += SMALL * np.gradient(true, 2.0 * DT, axis=0)
    assert np.linalg.norm(left[200:]) < 0.02 * np.linalg.norm((wrong[0] - true)[200:])


def test_columns_of_the_second_order_are_what_it_makes_of_the_forces():
    """Bodies that turn about z against the bases: what follows with the whole rotation and not with none."""
    free, none = find_free_parameters(GEOMETRY, PipelineSettings()), np.zeros((TICKS, 4, 3))
    moved, turn = 1e-3 * shaken(8, 12)[0].reshape(-1, 4, 3), none.copy()
    turn[:, :, 2] = 1e-2 * shaken(9, 4)[0]
    found = []
    for follow in (0.0, 1.0):
        tilt = types.SimpleNamespace(maps=np.zeros((4, 3, 12)))
        own = ForceBalance(GEOMETRY, tilt, free, MountLaw(GEOMETRY), 0.4, InstalledErrors(GEOMETRY, ()))
        data = BalanceInput(np.zeros((TICKS, 6)), none, moved, none, turn, none, none, np.zeros((TICKS, 3)), none)
        found.append(own.observe(data, np.zeros((4, 3)), follow, DT))
    columns = found[1].columns[:, :, len(free) + 1 :][:, :, : own.turned_count]
    assert own.turned_count == 8 and np.all(np.std(columns[:, 0, 0::2], axis=0) > 0.0)
    assert np.allclose(found[1].modelled - found[0].modelled, columns.sum(axis=2))


def test_standard_deviations_are_those_of_the_installation_and_of_many_sensors():
    errors = InstalledErrors(GEOMETRY, JUDGED)
    body = 0.5 * np.array([USUAL.misalignment] * 3 + [USUAL.gain] * 3 + [USUAL.position] * 3 + [USUAL.delay])
    base = [USUAL.misalignment] * 3 + [USUAL.gain] + [USUAL.position] * 3 + [USUAL.delay]
    assert errors.count == 10 + 4 * 8 + 8
    assert np.allclose(errors.std, np.concatenate([body, base * 4, [USUAL.gain] * 8]))
    # a body that all bases say leans by half a degree about x
    errors.constant = np.tile([0.0, np.radians(0.5) * 9.80665], (4, 1)), np.zeros((4, 2))
    assert np.isclose(errors.std[0], np.radians(0.5)) and np.allclose(errors.std[1:10], body[1:])


def test_an_axis_that_is_not_estimated_hides_nothing():
    sensors = {n: s for n, s in VEHICLE.sensors.items() if n != "chassis_front_left"}
    three = geometry_of(dataclasses.replace(VEHICLE, sensors=sensors))
    errors = InstalledErrors(three, ())
    base = tuple(shaken(seed, 12)[0] for seed in (3, 4, 5))
    hidden = errors.hidden(base, 0)
    assert errors.count == 10 + 3 * 8 and not np.any(hidden[:, :2]) and np.any(hidden[:, 2])


def test_gravity_shows_the_lean_of_a_base_as_far_as_its_bias_leaves_it():
    bases, none = LeanOfBases(GEOMETRY), np.zeros((4, 2))
    one = none.copy()
    # one of four leans by half a degree along y
    one[0, 1] = np.radians(0.5) * 9.80665
    lean = bases.of(one, none)
    # by hand: a bias of 0.02 m/s^2 and an angle of 0.004 rad leave 0.7936 of it to the angle, known to 0.1041 degrees
    assert np.allclose(np.degrees(lean.std[:, 1]), np.hypot(0.7936 * np.array([0.5, 0.0, 0.0, 0.0]), 0.1041), rtol=1e-3)
    assert np.allclose(np.degrees(lean.std[:, 0]), 0.1041, rtol=1e-3)
    # one is not all
    assert not lean.common.any() and np.allclose(np.degrees(bases.of(none + one[0], none).common), [0.0, 0.5])
    # what four sensors at the bases and four of the body leave
    assert np.allclose(lean.common_std, np.sqrt(0.5) * np.hypot(0.004, 0.02 / 9.80665))
    # a constant reading that is not known yet shows nothing
    unknown = bases.of(one, none + 1.0)
    assert np.allclose(unknown.std, USUAL.misalignment, rtol=1e-3) and np.all(unknown.common_std > 0.05)


def test_a_drawn_lean_is_as_large_as_stated():
    rng = np.random.default_rng(8)
    bases = LeanOfBases(GEOMETRY)
    angle = USUAL.misalignment * rng.standard_normal((4000, 4, 2))
    reading = 9.80665 * angle + USUAL.bias * rng.standard_normal(angle.shape)
    found = [bases.of(own, np.zeros((4, 2))) for own in reading]
    # what all have in common is not of a base alone
    ratio = np.mean((angle - np.median(angle, axis=1, keepdims=True)) ** 2) / np.mean([lean.std**2 for lean in found])
    assert 0.85 < ratio < 1.05
    # the body of this test does not lean: half of the variance is that of its own sensors
    assert np.isclose(np.std([lean.common for lean in found]), np.sqrt(0.5) * found[0].common_std[0], rtol=0.15)


def spurious(moved: np.ndarray, base: np.ndarray, geometry=GEOMETRY) -> SpuriousDeformation:
    """Deflections alike their rates, and motion of the bases, shape (K, 3 M) each."""
    found = SpuriousDeformation(geometry, InstalledErrors(geometry, ()), CORNER)
    found.observe((moved, moved), (base, base, base), DT)
    return found


def test_a_split_that_only_noise_shows_is_as_uncertain_as_the_vehicle_file():
    # relative acceleration that is nothing but noise of the base sensors, through the filters of the force balance
    rng = np.random.default_rng(4)
    noise = np.array([s.noise_std for s in GEOMETRY.base_sensors])
    relative = np.repeat(noise, 3) * rng.standard_normal((40000, 12))
    passed, x, v = (np.empty_like(relative) for _ in range(3))
    high_pass_block(relative, CORNER, DT, np.zeros((3, 12)), passed)
    integrate_block(passed, CORNER, DT, np.zeros((9, 12)), x, v)
    found = SpuriousDeformation(GEOMETRY, InstalledErrors(GEOMETRY, ()), CORNER)
    found.observe((x, v), (0.0 * x,) * 3, DT)
    # 200 s at 0.4 Hz and above hold about a hundred independent values of every mount
    assert np.all(found.std(PRIOR)[:, :, :2] > 0.8 * 0.3)


def test_a_split_that_only_turned_sensors_show_is_as_uncertain_as_the_vehicle_file():
    """What turned sensors make of vertical motion shows no deformation; ten times as much does."""
    rng = np.random.default_rng(5)
    up, wrong = np.zeros((20000, 4, 3)), np.zeros((20000, 4, 3))
    up[:, :, 2] = 5e-3 * rng.standard_normal((20000, 4))
    wrong[:, :, 1] = up[:, :, 2] * USUAL.misalignment * np.array([1.0, -1.0, 1.0, -1.0])
    left = [spurious(more * wrong.reshape(-1, 12), up.reshape(-1, 12)).std(PRIOR)[0, :, 1] for more in (1.0, 10.0)]
    # positions and rotations about z, as large, make as much of it as the leans
    assert np.all(left[0] == 0.3) and np.all(left[1] < 0.1 * 0.3) and np.all(left[1] > 0.01 * 0.3)


def test_before_any_motion_the_split_is_as_uncertain_as_in_the_file():
    found = SpuriousDeformation(GEOMETRY, InstalledErrors(GEOMETRY, ()), CORNER).std(PRIOR)
    assert np.all(found[:, :, :2] == PRIOR[:, :, :2]) and np.all(found[:, :, 2] == 0.0)


def test_a_saved_state_continues_alike():
    first = spurious(1e-3 * shaken(6, 12)[0], 1e-3 * shaken(7, 12)[0])
    other = SpuriousDeformation(GEOMETRY, InstalledErrors(GEOMETRY, ()), CORNER)
    other.load(first.save())
    assert np.array_equal(other.std(PRIOR), first.std(PRIOR)) and not np.array_equal(first.std(PRIOR), PRIOR)


def test_six_mounts_leave_a_vertical_split_that_only_the_deformation_tells():
    first = next(iter(VEHICLE.mounts.values()))
    place = [(x, y) for x in (1.0, 0.0, -1.0) for y in (0.6, -0.6)]
    mounts = {
        f"m{n}": dataclasses.replace(first, name=f"m{n}", position=np.array([x, y, -0.4])) for n, (x, y) in enumerate(place)
    }
    sensors = {n: s for n, s in VEHICLE.sensors.items() if s.body == "cab"}
    six = geometry_of(dataclasses.replace(VEHICLE, mounts=mounts, sensors=sensors))
    found = SpuriousDeformation(six, InstalledErrors(six, ()), CORNER).std(np.full((2, 6, 3), 0.3))[0, :, 2]
    # by hand: y (1, -2, 1) is orthogonal to 1, x, y, x^2, x y (y^2 is constant); its shares are 1 / sqrt(12) and 2 / sqrt(12)
    assert np.allclose(found / found[0], [1.0, 1.0, 2.0, 2.0, 1.0, 1.0]) and found[0] > 0.0
