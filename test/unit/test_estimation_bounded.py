# Copyright 2026 ride_estimation contributors
"""Nothing unbounded comes out: samples beyond any sensor, filters in any pattern of loss, poisoned states, planar bodies."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest
from replay.loss_run import Chain, Course, course, undisturbed_rows
from worlds.adapters import plane_inputs
from worlds.plane_scenario import machine_case

from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import LARGEST_TRAVEL, DeflectionEstimator, Equilibrium
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.signals.recording import Channel, Recording

NAME = "air, 4 + 4 accelerometers, 100 Hz"
VICTIM = "cab_front_right"


@pytest.fixture(scope="module")
def drive() -> Course:
    return course(NAME, 3, 60.0)


@pytest.fixture(scope="module")
def begun(drive: Course) -> Chain:
    chain = Chain(drive)
    chain.feed(undisturbed_rows(len(drive.samples), 1000))
    return chain


@pytest.fixture
def chain(begun: Chain) -> Chain:
    """Return an estimator that has seen ten seconds of the drive."""
    return copy.deepcopy(begun)


@pytest.fixture(scope="module")
def clean_error(drive: Course) -> float:
    """Return the error over fifteen seconds of the drive as it is."""
    return error(Chain(drive), 1500)


def error(chain: Chain, rows: int) -> float:
    found = chain.feed(undisturbed_rows(len(chain.course.samples), rows))
    assert np.isfinite(found.force).all() and np.isfinite(found.std).all()
    good = (found.rows >= 0) & found.valid
    good[: len(good) // 2] = False
    return float(np.sqrt(np.mean((found.force[good] - chain.course.force[found.rows[good]]) ** 2)))


@pytest.mark.parametrize("value", [*(pytest.param(v, marks=pytest.mark.slow) for v in (1e300, 1e12)), -1e30, 1.7e308])
def test_one_sample_beyond_any_sensor_is_rejected_and_counted_and_changes_nothing(
    drive: Course, clean_error: float, value: float
):
    spoiled = {name: values.copy() for name, values in drive.samples.items()}
    spoiled[VICTIM][700, 2] = value
    hit = Chain(Course(drive.vehicle, spoiled, drive.force, drive.rate_hz))
    assert error(hit, 1500) < 1.02 * clean_error
    health = hit.pipeline.health()
    assert health.sensors[VICTIM].rejected == {"beyond_any_sensor": 1}
    assert health.messages == (f"{VICTIM}: samples rejected: 1 beyond_any_sensor",)


def test_data_quality_leaves_such_samples_out_of_its_means(drive: Course):
    channels = {}
    for name, values in drive.samples.items():
        own = values[:1000].copy()
        if name == VICTIM:
            own[300], own[600] = 1.7e308, -1.7e308
        stamps = 10**18 + np.arange(1000) * 10**7
        channels[name] = Channel(name, stamps, own, stamps)
    quality = judge_sensors(Recording("run", channels), drive.vehicle.sensors, 9.80665)[VICTIM]
    assert quality.beyond == 2
    assert np.isfinite(quality.mean).all() and np.isfinite(quality.std).all()
    assert any("2 samples are larger than any sensor of this kind can give" in text for text in quality.findings)


@pytest.mark.parametrize("poison", [np.nan, np.inf, 1e200])
def test_a_poisoned_deflection_ends_in_a_restart_with_what_was_learned(chain: Chain, poison: float):
    before = np.array([e.value for e in chain.pipeline.parameters()])
    chain.pipeline._deflection._state[0, 0, 2] = poison
    assert error(chain, 1000) < 100.0
    after = np.array([e.value for e in chain.pipeline.parameters()])
    np.testing.assert_allclose(after, before, rtol=0.2)
    health = chain.pipeline.health()
    if not np.isfinite(poison):
        assert sum(health.faults.values()) == 1
        assert health.messages[0].startswith("numerical fault (1 times)")


def test_poisoned_parameters_go_back_to_the_last_checkpoint_and_never_into_a_saved_state(chain: Chain):
    before = np.array([e.value for e in chain.pipeline.parameters()])
    chain.pipeline._parameters.theta[:] = np.nan
    state = chain.pipeline.save_state()
    json.dumps(state, allow_nan=False)
    np.testing.assert_allclose([e.value for e in chain.pipeline.parameters()], before, rtol=0.2)
    fresh = Pipeline(chain.course.vehicle)
    fresh.load_state(state)
    assert chain.pipeline.health().faults == {"the state is not finite": 1}


def test_a_load_that_the_vehicle_cannot_carry_is_not_valid(chain: Chain):
    chain.pipeline._law._rates[0] *= 1e6
    found = chain.feed(undisturbed_rows(len(chain.course.samples), 200))
    limit = chain.pipeline._guard.largest
    assert np.abs(found.force[found.valid]).max(initial=0.0) <= limit
    assert any("cannot carry" in text for text in chain.pipeline.health().messages)


def test_travel_beyond_what_the_laws_of_the_file_allow_is_not_valid(drive: Course):
    """A stop ends the travel, and no load goes further than into the stop."""
    stop = BumpStop(compression_gap=0.02, extension_gap=0.03, stiffness=5e7)
    spring = drive.vehicle.mounts["front_left"].elements["z"]
    vehicle = drive.vehicle.replace_elements({("front_left", "z"): SumOfElements(elements=(spring, stop))})
    chain = Chain(Course(vehicle, drive.samples, drive.force, drive.rate_hz))
    guard = chain.pipeline._guard
    np.testing.assert_allclose(guard.travel[0, 2], [-0.02 - guard.largest / 5e7, 0.03 + guard.largest / 5e7], atol=1e-3)
    assert (guard.travel[1:, 2] == [-1.0, 1.0]).all()
    chain.feed(undisturbed_rows(len(drive.samples), 500))
    chain.pipeline._deflection._state[0, 0, 2] = 0.06
    found = chain.feed(undisturbed_rows(len(drive.samples), 200))
    assert any("beyond the travel" in text for text in chain.pipeline.health().messages)
    assert not found.valid.all()


def test_deflections_stay_within_the_travel_whatever_the_sensors_say(drive: Course):
    rng = np.random.default_rng(8)
    wild = {name: 1e5 * rng.standard_normal(values.shape) for name, values in drive.samples.items()}
    chain = Chain(Course(drive.vehicle, wild, drive.force, drive.rate_hz))
    found = chain.feed(undisturbed_rows(len(wild), 2000))
    assert np.isfinite(found.force).all() and np.isfinite(found.std).all()
    assert np.abs(chain.pipeline._deflection._state[0]).max() <= LARGEST_TRAVEL
    json.dumps(chain.pipeline.save_state(), allow_nan=False)


def test_a_planar_body_keeps_its_attitude_and_its_forces():
    case = machine_case(None, 1, duration=25.0)
    vehicle, run, _ = plane_inputs(case)
    stamps = run.start_ns + np.round(np.arange(len(run.data["cab_front"])) * 1e9 / case.rate_hz).astype(np.int64)
    recording = Recording("plane", {name: Channel(name, stamps, values, stamps) for name, values in run.data.items()})
    found = run_offline(recording, Pipeline(vehicle))
    cab = np.mean([values for name, values in run.data.items() if name.startswith("cab")], axis=0)
    row = np.round((found.stamp_ns - run.start_ns) * 1e-9 * case.rate_hz).astype(int)
    late = found.time_s > 5.0
    pitch = -cab[row, 0] / 9.80665
    assert np.ptp(pitch[late]) > 0.01
    np.testing.assert_allclose(found.signals["tilt"][late, 1], pitch[late], atol=0.01)
    assert not any("disagree" in text for text in found.health.messages)
    assert found.valid[late].all()
    # what the mounts together carry is the mass times the specific force
    carried = vehicle.bodies["cab"].mass.value * found.signals["cg_specific_force"][late, 2]
    assert np.std(found.force[late, :, 2].sum(axis=1) - carried) < 0.02 * np.std(carried)


@pytest.mark.parametrize("silent", ["bases", "body inconsistent"])
def test_equilibrium_a_block_late_never_drives_the_deflections_apart(silent: str):
    a = geometry_of(load_vehicle("truck_cab"))
    count, ticks, dt = len(a.mounts), 10, 0.002
    estimator = DeflectionEstimator(a, BracketTilt(a))
    still = np.tile([0.0, 0.0, 9.80665, 0.0, 0.0, 0.0], (ticks, 1))
    variance = 1e-4 if silent == "bases" else 1e6
    motion = MotionBlock(
        still, variance * np.eye(6), np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0, np.zeros((ticks, 0)),
        np.ones(ticks, dtype=bool),
    )  # fmt: skip
    base, none = np.tile([0.0, 0.0, 9.80665], (ticks, count, 1)), np.zeros((ticks, count, 3))
    spoke = np.full((ticks, count), silent != "bases")
    lag, sizes = np.full((count, 3), 0.06), []
    missing = np.tile([0.0, 0.0, 1e-3], (count, 1))
    for _ in range(500):
        rest = Equilibrium(none, lag, missing)
        told = spoke.all(axis=1)
        found = estimator.observe(motion, base, spoke, told, none, none > 0.0, np.full((count, 3), 1e-6), dt, rest)
        # spring and damper at rest: what equilibrium misses is what the estimate has
        missing = -np.mean(found.deflection + lag[None] * found.rate, axis=0)
        sizes.append(float(np.abs(found.deflection).max()))
    assert max(sizes) < 0.01
    assert max(sizes[-50:]) < 1e-4


def test_a_rotation_that_feeds_itself_begins_anew_where_equilibrium_contradicts_it():
    """A body at rest, taken to have rolled by a quarter of a radian and to be sure of it."""
    a = geometry_of(load_vehicle("truck_cab"))
    count, ticks, dt = len(a.mounts), 10, 0.002
    estimator = DeflectionEstimator(a, BracketTilt(a))
    still = np.tile([0.0, 0.0, 9.80665, 0.0, 0.0, 0.0], (ticks, 1))
    motion = MotionBlock(
        still, 1e-4 * np.eye(6), np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0, np.zeros((ticks, 0)), np.ones(ticks, dtype=bool)
    )
    base, none = np.tile([0.0, 0.0, 9.80665], (ticks, count, 1)), np.zeros((ticks, count, 3))
    spoke = np.ones((ticks, count), dtype=bool)
    square, lag, missing, sizes, anew = np.full((count, 3), 0.005**2), np.full((count, 3), 0.06), np.zeros((count, 3)), [], []
    for block in range(1000):
        if block == 500:
            estimator._state[0, :, 2] = 0.25 * a.arms[:, 1]
            missing = -estimator._state[0]
        rest = Equilibrium(none, lag, missing)
        found = estimator.observe(motion, base, spoke, spoke.all(axis=1), none, none > 0.0, square, dt, rest)
        missing = -np.mean(found.deflection + lag[None] * found.rate, axis=0)
        sizes.append(float(np.abs(found.deflection).max()))
        anew.append(estimator.began_anew)
    assert np.flatnonzero(anew).tolist() == [500]
    assert max(sizes) < 1e-3


@pytest.mark.parametrize("missing", ["body", "base"])
def test_an_unobservable_mount_comes_to_rest_with_a_wide_standard_deviation(missing: str):
    a = geometry_of(load_vehicle("truck_cab"))
    count, ticks, dt = len(a.mounts), 10, 0.002
    estimator = DeflectionEstimator(a, BracketTilt(a))
    still = np.tile([0.0, 0.0, 9.80665, 0.0, 0.0, 0.0], (ticks, 1))
    base, none = np.tile([0.0, 0.0, 9.80665], (ticks, count, 1)), np.zeros((ticks, count, 3))
    expected, size = np.full((count, 3), 0.02**2), []
    for block in range(150):
        told = block < 50
        motion = MotionBlock(
            still, 1e-4 * np.eye(6), np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0, np.zeros((ticks, 0)),
            np.full(ticks, told or missing == "base"),
        )  # fmt: skip
        spoke = np.full((ticks, count), told or missing == "body")
        if block == 50:
            estimator._state[1, :, 2] = 1.3
        found = estimator.observe(motion, base, spoke, spoke.all(axis=1), none, none > 0.0, expected, dt)
        size.append(np.abs(found.deflection).max())
    assert max(size[50:]) < 0.28
    if missing == "body":
        assert size[-1] < 1e-3
        np.testing.assert_allclose(found.std, 0.02, rtol=0.05)
        np.testing.assert_allclose(found.rate_std, 0.2, rtol=0.05)
