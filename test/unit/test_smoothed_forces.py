# Copyright 2026 ride_estimation contributors
"""Smoothed forces of finished runs against the truth of the worlds, and where the online estimate stands."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import START_NS, believed_vehicle, recording
from worlds.cab import drive, measure, random_sensors, random_vehicle, simulate
from worlds.roads import Road, base_motion

from ride_estimation.api.replaying import all_warnings
from ride_estimation.estimation import offline
from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.model.run_forces import RunForces
from ride_estimation.estimation.model.run_readings import without_readings
from ride_estimation.estimation.model.smoothed_forces import Anomalies, SmoothedForces, _faded, smoothed_forces
from ride_estimation.estimation.model.smoother import SmoothedSegment
from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.output import left_out_of
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

RATE = 100.0


@functools.cache
def drawn(seed: int = 41, duration: float = 12.0, kind: str = "air"):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, kind)
    run = drive(cab, Road.random(rng), duration, seed, step=1e-3)
    data = measure(run, random_sensors(cab, rng), RATE, seed, noise_share=0.01, anti_alias=0.0)
    return data, believed_vehicle(data, seed=seed), recording(data)


def test_a_model_counts_where_it_explains_what_the_online_estimate_suspects() -> None:
    anomalies = Anomalies(np.array([False, True, False]), np.array([False, False, True]))
    assert anomalies.ordinary(RunForces()).tolist() == [[True, False, False], [True, True, False]]
    assert anomalies.ordinary(RunForces(findings=("a law is not linear",)))[0].tolist() == [True, False, False]
    assert anomalies.ordinary(RunForces(faults=("a.gain.x",)))[0].tolist() == [True, True, False]
    assert anomalies.ordinary(RunForces(load="a load")).tolist() == [[True, False, True], [True, True, True]]


def test_forces_of_the_model_fade_out_before_and_in_after_what_it_does_not_describe() -> None:
    ordinary = np.ones(400, dtype=bool)
    ordinary[200] = False
    share = _faded(ordinary, np.arange(400, dtype=np.int64) * 10_000_000)
    assert share[200] == 0.0 and share[140] == share[260] == pytest.approx(1.0)
    assert np.abs(np.diff(share)).max() < 0.05 and np.allclose(share[201:260], share[141:200][::-1])


@functools.cache
def shared_run() -> OfflineRun:
    _, vehicle, record = drawn()
    return run_offline(record, Pipeline(vehicle))


def error(run: OfflineRun, data, force: np.ndarray, since: float = 2.0) -> np.ndarray:
    """Return the NRMSE of forces per mount and axis."""
    row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
    good = (row >= since * RATE) & (row < len(data.time))
    true = data.truth["mount_force"][row[good]]
    return np.sqrt(np.mean((force[good] - true) ** 2, axis=0)) / true.std(axis=0)


def test_smoothed_forces_are_nearer_to_the_truth_and_no_surer_than_they_are() -> None:
    data, _, _ = drawn()
    run = shared_run()
    assert isinstance(run.smoothed, SmoothedForces)
    live, later = (error(run, data, force) for force in (run.signals["mount_force"], run.force))
    # most of this run is before the online estimator knows the mounts
    assert np.median(later[:, :2]) < 0.6 * np.median(live[:, :2])
    assert np.median(later[:, 2]) < 0.6 * np.median(live[:, 2])
    row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
    good = (row >= 0) & (row < len(data.time))
    inside = np.abs(run.force[good] - data.truth["mount_force"][row[good]]) <= 2.0 * run.force_std[good]
    assert np.mean(inside) > 0.9
    assert np.mean(run.force_std[:, :, :2]) < np.mean(run.signals["mount_force_std"][:, :, :2])


def test_the_online_estimate_and_its_digest_stay_what_they_are() -> None:
    _, vehicle, record = drawn()
    bare = run_offline(record, Pipeline(vehicle), smoothing=False)
    assert bare.digest == shared_run().digest
    for name, values in bare.signals.items():
        assert np.array_equal(values, shared_run().signals[name]), name
    assert isinstance(bare.smoothed, str)
    assert bare.force is bare.signals["mount_force"]
    assert "not smoothed" in bare.forces_in_words()


def test_a_load_of_which_only_the_cg_is_seen_widens_smoothed_forces_and_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    _, vehicle, record = drawn()
    runs = []
    load = RunForces(refused="not wanted", load="the CG is elsewhere", load_share=0.2)
    for model in (RunForces(refused="not wanted"), load):
        monkeypatch.setattr(offline, "run_forces", lambda *_, found=model: found)
        runs.append(run_offline(record, Pipeline(vehicle)))
    without, loaded = runs
    np.testing.assert_allclose(loaded.force_std, np.hypot(without.force_std, 0.2 * np.abs(without.force)))
    assert ["the CG is elsewhere" in all_warnings(record, vehicle, {}, run) for run in runs] == [False, True]


def test_axes_with_a_transducer_keep_what_it_measures() -> None:
    data, vehicle, record = drawn()
    mount = vehicle.mounts["front_left"]
    sensor = Sensor(
        "travel", "displacement", "/travel", mount.base, mount="front_left", axis="z", position=mount.position, noise_std=2e-5
    )
    rng = np.random.default_rng(3)
    stamps = START_NS + np.round(data.time * 1e9).astype(np.int64)
    travel = data.truth["deflection"][:, 0, 2] + 2e-5 * rng.standard_normal(len(stamps))
    channel = Channel("travel", stamps, travel[:, None], stamps + 2_000_000)
    told = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "travel": sensor})
    run = run_offline(Recording("travel", {**record.channels, "travel": channel}), Pipeline(told))
    assert isinstance(run.smoothed, SmoothedForces)
    row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
    good = (row >= 2.0 * RATE) & (row < len(stamps))
    # mount axes against cab axes: a rotation of 0.02 rad of 10 mm at most
    assert np.std(run.deflection[good, 0, 2] - data.truth["deflection"][row[good], 0, 2]) < 1e-4


def without_base_sensor(record: Recording, vehicle: Vehicle, first_s: float, last_s: float) -> Recording:
    """Return a recording in which a sensor of the base is silent for a time."""
    name = next(s.name for s in geometry_of(vehicle).base_sensors if s is not None)
    channel = record.channels[name]
    kept = (channel.stamp_ns - START_NS < 1e9 * first_s) | (channel.stamp_ns - START_NS > 1e9 * last_s)
    return Recording("silent", {**record.channels, name: channel.picked(kept)})


def test_the_model_goes_on_through_a_gap_of_a_base_sensor() -> None:
    data, vehicle, record = drawn()
    run = run_offline(without_base_sensor(record, vehicle, 5.1, 5.4), Pipeline(vehicle))
    assert isinstance(run.smoothed, SmoothedForces) and run.smoothed.share > 0.9
    assert np.isfinite(run.force).all() and np.isfinite(run.force_std).all() and (run.force_std > 0.0).all()
    time = (run.stamp_ns - START_NS) * 1e-9
    beside = (time > 5.0) & (time < 5.4)
    # it is less certain there than with the sensor, and no narrower than the error
    assert np.mean(run.force_std[beside]) > 1.1 * np.mean(shared_run().force_std[beside[: len(shared_run().stamp_ns)]])
    error = run.force[beside] - data.truth["mount_force"][np.round(time[beside] * RATE).astype(int)]
    assert np.mean(np.abs(error) <= 2.0 * run.force_std[beside]) > 0.9


def test_a_base_sensor_lost_while_driving_is_a_reading_less() -> None:
    """How far the base deforms beyond what the other sensors show is told by the part with all of them."""
    data, vehicle, record = drawn(41, 24.0)
    run = run_offline(without_base_sensor(record, vehicle, 12.0, 99.0), Pipeline(vehicle))
    assert isinstance(run.smoothed, SmoothedForces) and run.smoothed.share > 0.9
    live, later = (error(run, data, force, 13.0) for force in (run.signals["mount_force"], run.force))
    assert np.median(later[:, :2]) < 0.6 * np.median(live[:, :2])
    assert np.median(later[:, 2]) < np.median(live[:, 2])
    row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
    good = (row >= 13 * RATE) & (row < len(data.time))
    wrong, std = run.force[good] - data.truth["mount_force"][row[good]], run.force_std[good]
    assert np.mean(np.abs(wrong) <= 2.0 * std) > 0.9
    assert 0.7 < np.median(np.sqrt(np.mean(std**2, axis=0) / np.mean(wrong**2, axis=0))[:, :2]) < 2.5


@pytest.mark.parametrize("place", ["base", pytest.param("body", marks=pytest.mark.slow)])
def test_the_model_goes_on_without_a_sensor_that_goes_wrong(place: str) -> None:
    """What tests of the sensors found while the run was estimated the model does not find by itself."""
    data, vehicle, record = drawn(41, 24.0)
    geometry = geometry_of(vehicle)
    name = next(s.name for s in (geometry.base_sensors if place == "base" else geometry.body_sensors) if s is not None)
    channel = record.channels[name]
    values = np.where(channel.stamp_ns[:, None] - START_NS > 12_000_000_000, 1.6, 1.0) * channel.values
    wrong = Recording("wrong", {**record.channels, name: dataclasses.replace(channel, values=values)})
    run = run_offline(wrong, Pipeline(vehicle))
    assert isinstance(run.smoothed, SmoothedForces) and run.smoothed.share > 0.9
    later = error(run, data, run.force, 2.0)
    assert np.median(later[:, :2]) < 0.1 and np.median(later[:, 2]) < 0.05
    row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
    good = (row >= 2 * RATE) & (row < len(data.time))
    error_ = run.force[good] - data.truth["mount_force"][row[good]]
    assert np.mean(np.abs(error_) <= 2.0 * run.force_std[good]) > 0.9


def test_laws_that_are_not_known_live_beside_a_sensor_that_is_left_out_say_nothing_of_the_model(monkeypatch) -> None:
    """A base sensor that errs has the live estimate forget its laws; live forces were up to nine times the true ones."""
    run = shared_run()
    asked = []

    def fade_in(self: RunForces, *arguments) -> float:
        asked.append(arguments[-1])
        return 1.0

    monkeypatch.setattr(RunForces, "fade_in", fade_in)
    unknown = dataclasses.replace(run.parameters[1], name="front_left.z.stiffness", status=Status.STARTING)
    anomalies = Anomalies(*np.zeros((2, len(run.stamp_ns)), dtype=bool))
    for bridged, axes in ((False, 2), (True, 3)):
        model = RunForces(((0, SmoothedSegment(*np.zeros((3, 2, 4, 3)), 1.0, bridged)),), 0.01)
        found = smoothed_forces({**run.signals, "stamp_ns": run.stamp_ns}, anomalies, model, [unknown], {})
        assert isinstance(found, SmoothedForces) and asked[-1] == axes and bool(found.not_modelled) is not bridged


def test_times_in_which_a_sensor_was_not_used_are_joined() -> None:
    @dataclasses.dataclass
    class Block:
        stamp_ns: np.ndarray
        left_out: tuple[str, ...]

    names: tuple[tuple[str, ...], ...] = ((), ("a",), ("a", "b"), ("b",), (), ("a",))
    blocks = [Block(100 * n + np.arange(10), left_out) for n, left_out in enumerate(names)]
    assert left_out_of(blocks) == {"a": [(100, 209), (500, 509)], "b": [(200, 309)]}  # type: ignore[arg-type]


def test_readings_are_taken_out_with_what_surrounds_them() -> None:
    _, _, record = drawn()
    name = next(iter(record.channels))
    times = {name: [(START_NS + 5_000_000_000, START_NS + 6_000_000_000)]}
    count = len(record.channels[name].stamp_ns)
    whole = dataclasses.replace(record.channels[name], order=np.arange(count), variance=np.ones((count, 3)))
    rest = without_readings(dataclasses.replace(record, channels={**record.channels, name: whole}), times).channels[name]
    seconds = (rest.stamp_ns - START_NS) * 1e-9
    assert rest.order is not None and rest.variance is not None
    assert len(rest.stamp_ns) == len(rest.values) == len(rest.arrival_ns) == len(rest.order) == len(rest.variance) < count
    assert not np.any((seconds > 3.0) & (seconds < 8.0)) and seconds.min() < 0.1 and seconds.max() > 11.0


def test_a_break_in_time_makes_two_segments() -> None:
    _, vehicle, record = drawn()
    late = {}
    for name, c in record.channels.items():
        jump = np.where(c.stamp_ns - START_NS > 5_000_000_000, 60_000_000_000, 0)
        late[name] = Channel(name, c.stamp_ns + jump, c.values, c.arrival_ns + jump)
    run = run_offline(Recording("break", late), Pipeline(vehicle))
    assert isinstance(run.smoothed, SmoothedForces)
    assert run.smoothed.share > 0.5
    assert np.isfinite(run.force).all() and np.isfinite(run.force_std).all()
    whole = shared_run()
    first = (run.stamp_ns - START_NS) * 1e-9 < 3.0
    count = int(first.sum())
    scale = whole.force[:count].std(axis=0)
    assert np.all(np.std(run.force[:count] - whole.force[:count], axis=0) < 0.35 * scale)


def test_layouts_without_base_sensors_and_short_runs_say_why_there_is_no_smoothing() -> None:
    _, vehicle, record = drawn()
    bases = {s.name for s in geometry_of(vehicle).base_sensors if s is not None}
    bare = dataclasses.replace(vehicle, sensors={n: s for n, s in vehicle.sensors.items() if n not in bases})
    run = run_offline(record, Pipeline(bare))
    assert "without a triaxial accelerometer on their base" in run.forces_in_words()
    assert run.force is run.signals["mount_force"]
    brief = {}
    for name, c in record.channels.items():
        kept = c.stamp_ns - START_NS < 6_000_000_000
        brief[name] = Channel(name, c.stamp_ns[kept], c.values[kept], c.arrival_ns[kept])
    assert "less than 10 s" in run_offline(Recording("brief", brief), Pipeline(vehicle)).forces_in_words()


@pytest.mark.slow
def test_horizontal_forces_and_intervals_over_worlds() -> None:
    """Eight worlds: the median error of horizontal forces is that of the table of targets, and 2-sigma intervals hold."""
    found, live, inside = [], [], []
    for seed in range(3640, 3648):
        data, vehicle, record = drawn(seed, 15.0, "air" if seed % 2 == 0 else "rubber")
        run = run_offline(record, Pipeline(vehicle))
        found.append(error(run, data, run.force, 8.0))
        live.append(error(run, data, run.signals["mount_force"], 8.0))
        row = np.round((run.stamp_ns - START_NS) * 1e-9 * RATE).astype(int)
        good = (row >= 8.0 * RATE) & (row < len(data.time))
        error_ = run.force[good] - data.truth["mount_force"][row[good]]
        inside.append(np.mean(np.abs(error_) <= 2.0 * run.force_std[good], axis=0))
        drawn.cache_clear()
    assert np.median(np.array(found)[:, :, :2]) < 0.08
    assert np.median(np.array(found)[:, :, :2]) < 0.65 * np.median(np.array(live)[:, :, :2])
    assert np.mean(inside) > 0.92


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "modelled", "bound"), [(3649, True, 0.05), (3650, True, 0.05), (3648, False, 0.08)])
def test_a_mount_that_softens_in_the_middle_is_followed(seed: int, modelled: bool, bound: float) -> None:
    """By a force beside its law, or live where the model does not find it and leaves too much."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    drift = np.zeros((4, 3, 4))
    drift[:, :, 1:3] = [15.0, 16.0]
    drift[0, 2, 0] = -0.2
    changed = dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, drift=drift))
    run = simulate(changed, base_motion(Road.random(rng), cab.mounts, 35.0, 5e-4, seed))
    data = measure(run, sensors, RATE, seed, noise_share=0.01, anti_alias=0.0)
    found = run_offline(recording(data), Pipeline(believed_vehicle(data, seed=seed)))
    assert ("linear law at front_left z" in found.forces_in_words()) == modelled
    assert ("not smoothed: the model does not explain" in found.forces_in_words()) != modelled
    time = (found.stamp_ns - START_NS) * 1e-9
    row = np.clip(np.round(time * RATE).astype(int), 0, len(data.time) - 1)
    for part in ((time > 3.0) & (time < 14.0), (time > 22.0) & (time < 34.0)):
        true = data.truth["mount_force"][row[part]][:, 0, 2]
        wrong = found.force[part][:, 0, 2] - true
        # a stiffness that is 20 % off would leave 20 % of the force of this mount
        assert np.std(wrong) < bound * np.std(true)
