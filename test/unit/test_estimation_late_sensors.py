# Copyright 2026 ride_estimation contributors
"""Sensors whose readings are late: found, put back in time, and learning goes on."""

from __future__ import annotations

import dataclasses
import functools
import json

import numpy as np
import pytest
from worlds.adapters import believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.drawn import drawn_belief
from worlds.installation import installed
from worlds.roads import Road
from worlds.vehicle_text import Belief

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.faults.late_sensors import LateSensors
from ride_estimation.estimation.offline import EstimateDigest
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.estimation.sensor_errors.sensor_faults import Fault
from ride_estimation.sensors.installation import USUAL
from ride_estimation.signals.recording import Channel, Recording

START_NS = 1_700_000_000_000_000_000


# -- which delays are taken ------------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Told:
    """What a fault test says."""

    fault: Fault | None
    delay: tuple[float, float, bool] | None
    taken: float = 0.0

    def judge(self) -> Fault | None:
        return self.fault

    def delay_of(self, _name: str) -> tuple[float, float, bool] | None:
        return self.delay

    def put_back(self, _name: str, delay: float) -> None:
        self.taken += delay


LATE = Fault("cab_front_left", "delay", "", 0.9, (), -50.0)


@functools.cache
def any_vehicle():
    rng = np.random.default_rng(5)
    cab = random_vehicle(rng, "air")
    data = measure(drive(cab, Road.random(rng), 0.5, 5), random_sensors(cab, rng), 100.0, 5)
    return believed_vehicle(data, Belief(), 5)


@pytest.mark.parametrize(
    ("fault", "delay"),
    [
        (None, (0.008, 0.0002, True)),
        (dataclasses.replace(LATE, kind="position"), (0.008, 0.0002, True)),
        (dataclasses.replace(LATE, rivals=("cab_front_right",)), (0.008, 0.0002, True)),
        (dataclasses.replace(LATE, explained=0.7), (0.008, 0.0002, True)),
        (LATE, None),
        (LATE, (0.008, 0.0002, False)),
        (LATE, (0.3, 0.0002, True)),
    ],
    ids=["none", "another kind", "another sensor", "little explained", "too early", "mostly noise", "beyond any"],
)
def test_what_is_no_delay_of_one_sensor_for_certain_is_not_taken(fault, delay) -> None:
    late = LateSensors(any_vehicle())
    assert not late.find([Told(fault, delay)]) and not late.delays() and not late.messages()


def test_a_delay_is_taken_with_what_is_not_known_of_it_and_refined_once_that_is_less() -> None:
    late = LateSensors(any_vehicle())
    assert late.find([Told(None, None), Told(LATE, (0.008, 0.0003, True))])
    assert late.delays() == {"cab_front_left": 0.008}
    open_share = late.vehicle().sensors["cab_front_left"].stated_installation.delay
    assert open_share == pytest.approx(np.hypot(0.0003, 0.05 * 0.008))
    assert late.vehicle().sensors["cab_front_right"].stated_installation == USUAL
    again = Told(None, (-0.0004, 0.9 * open_share, True))
    assert not late.refine([again]) and again.taken == 0.0
    better = Told(None, (-0.0004, 0.0001, True))
    assert late.refine([better]) and better.taken == -0.0004
    assert late.delays()["cab_front_left"] == pytest.approx(0.0076)
    assert late.vehicle().sensors["cab_front_left"].stated_installation.delay < USUAL.delay
    assert late.messages() == [
        "cab_front_left is 7.6 +- 0.1 ms late: its readings are put back by that delay; state delay_ms: 7.6 in the vehicle file"
    ]
    loaded = LateSensors(any_vehicle())
    loaded.load(json.loads(json.dumps(late.save())))
    assert loaded.delays() == late.delays() and loaded.messages() == late.messages()


def test_what_is_found_again_and_again_is_no_constant_delay() -> None:
    late = LateSensors(any_vehicle())
    for found in (0.008, 0.005, -0.001):
        assert late.find([Told(LATE, (found, 0.0003, True))])
    assert not late.find([Told(LATE, (0.005, 0.0003, True))])
    assert late.delays()["cab_front_left"] == pytest.approx(0.012)


# -- on a drive ------------------------------------------------------------------------------------------------------------

BELIEF = Belief(stiffness_std=0.1, damping_std=0.125, mass_std=0.005, cg_std=0.0075, inertia_std=0.04)


@functools.cache
def driven(seed: int, name: str, late: float):
    """Return vehicle and recording of a drive with drawn errors of file and sensors, one of them late."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    stds = {kind: getattr(USUAL, kind) for kind in ("bias", "gain", "misalignment", "position", "delay")}
    sensors = installed(random_sensors(cab, rng), seed, **stds)
    sensors = tuple(dataclasses.replace(s, delay_s=late if s.name == name else s.delay_s) for s in sensors)
    data = measure(drive(cab, Road.random(rng), 25.0, seed, step=1e-3), sensors, 100.0, seed, noise_share=0.01)
    vehicle = believed_vehicle(data, drawn_belief(BELIEF, seed), seed)
    stamps = {n: START_NS + np.round(data.stamps[n] * 1e9).astype(np.int64) for n in vehicle.sensors}
    return vehicle, Recording("drive", {n: Channel(n, s, np.asarray(data.data[n]), s) for n, s in stamps.items()})


def replayed(pipeline: Pipeline, recording: Recording) -> str:
    digest = EstimateDigest()
    for blocks, _ in pipeline.replay(recording):
        for block in blocks:
            digest.update(block)
    return digest.hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "late"), [("cab_rear_left", 0.003), ("cab_rear_left", 0.008), ("chassis_front_left", 0.008)])
def test_a_late_sensor_is_put_back_and_parameters_are_learned_as_without(name: str, late: float) -> None:
    valid = {}
    for delay in (0.0, late):
        vehicle, recording = driven(8, name, delay)
        pipeline = Pipeline(vehicle)
        replayed(pipeline, recording)
        valid[delay] = {p.name for p in pipeline.parameters() if p.status is Status.VALID}
        said = [m for m in pipeline.health().messages if "late" in m]
        assert bool(said) is (delay > 0.0), said
    (found,) = pipeline._late._found.values()
    assert abs(found.seconds - late) < 3.0 * found.std < 0.003
    assert said[0].startswith(f"{name} is ") and "delay_ms" in said[0]
    assert pipeline.health().sensors[name].residual_ratio < 2.0
    # learning began anew when the delay was found: vertical ones are known again
    assert {n for n in valid[0.0] if ".z." in n} <= valid[late] and valid[late]


@pytest.mark.slow
def test_a_delay_is_found_alike_live_and_kept_by_a_restart() -> None:
    vehicle, recording = driven(8, "cab_rear_left", 0.008)
    bulk, live, digest = Pipeline(vehicle), Pipeline(vehicle), EstimateDigest()
    whole = replayed(bulk, recording)
    order = sorted((t, n, i) for n, c in recording.channels.items() for i, t in enumerate(c.stamp_ns.tolist()))
    names = list(recording.channels)
    for stamp, name, i in sorted(order, key=lambda o: (o[0], names.index(o[1]))):
        for block in live.observe(name, stamp, tuple(recording.channels[name].values[i].tolist())):
            digest.update(block)
    assert bulk.health().restarts == live.health().restarts == {"a delay was found": 1}
    assert digest.hexdigest() == whole
    again = Pipeline(vehicle)
    again.load_state(json.loads(json.dumps(bulk.save_state())))
    replayed(again, recording)
    assert not again.health().restarts
    assert again.health().messages[0] == bulk.health().messages[0]
    assert again.health().sensors["cab_rear_left"].residual_ratio < 2.0
    for stiffness in (p for p in again.parameters() if p.name.endswith("z.stiffness")):
        assert stiffness.status is Status.VALID
