# Copyright 2026 ride_estimation contributors
"""Bad input through the real node: it goes on, publishes no NaN, and every message that was not used is counted."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter

from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.nodes import qos
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.resources import shared_path
from ros.conftest import Ros
from ros.drive import IMU, START_NS, Message, drive, imu, wire

TRUCK = shared_path("config", "vehicles", "truck_cab.yaml")
VICTIM = "/cab/front_left/accel"
SENSOR = "cab_front_left"
GOOD = np.array([0.0, 0.0, 9.81])
Spoil = Callable[[int, Message], list[Message]]


def with_payload(message: Message, payload: bytes) -> Message:
    return Message(message.topic, message.type_name, payload, message.stamp_ns)


def value(bad: float) -> Spoil:
    return lambda n, m: [with_payload(m, wire(imu(m.stamp_ns, np.array([bad, 0.0, 9.8]))))] if n % 10 == 5 else [m]


def stamp(change: Callable[[int], int], every: int = 10) -> Spoil:
    return lambda n, m: [with_payload(m, wire(imu(change(m.stamp_ns), GOOD)))] if n % every == 5 else [m]


def covariance(first: float) -> Spoil:
    return lambda n, m: [with_payload(m, wire(imu(m.stamp_ns, GOOD, covariance0=first)))]


class Watched:
    """A node with everything it publishes and every block it computed."""

    def __init__(self, ros: Ros, **parameters: object) -> None:
        overrides = [Parameter(name, value=v) for name, v in parameters.items()]
        self.node = EstimatorNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False)
        ros.add(self.node)
        assert self.node.session is not None
        self.session = self.node.session
        self.blocks: list = []

    def feed(self, messages: list[Message]) -> None:
        for m in messages:
            self.blocks += self.node.receive(m.topic, m.type_name, m.payload)

    def drive(self, spoil: Spoil, seconds: float = 3.0) -> None:
        count = 0
        for message in drive(self.session.vehicle, seconds):
            if message.topic == VICTIM:
                self.feed(spoil(count, message))
                count += 1
            else:
                self.feed([message])

    @property
    def ticks(self) -> int:
        return sum(len(b.stamp_ns) for b in self.blocks)

    def rejected(self) -> dict[str, int]:
        """Return the rejected samples of the victim by reason, decoder and time base together."""
        found = dict(self.session.states[VICTIM].rejected)
        for reason, count in self.session.pipeline.health().sensors[SENSOR].rejected.items():
            found[reason] = found.get(reason, 0) + count
        return found

    def statuses(self) -> dict[str, DiagnosticStatus]:
        return {s.name: s for s in self.session.statuses()}


@pytest.fixture
def watched(ros_single: Ros) -> Watched:
    return Watched(ros_single)


@pytest.mark.parametrize(
    "spoil",
    [
        pytest.param(value(math.nan), id="nan"),
        pytest.param(value(math.inf), id="inf"),
        pytest.param(value(-math.inf), id="minus_inf"),
        pytest.param(stamp(lambda t: 0), id="stamp_zero"),
        pytest.param(stamp(lambda t: t - 10_000_000_000), id="one_message_ten_seconds_old"),
        pytest.param(stamp(lambda t: t + 3_600_000_000_000), id="one_message_from_the_future"),
        pytest.param(lambda n, m: [m, m] if n % 10 == 5 else [m], id="duplicated"),
        pytest.param(lambda n, m: [with_payload(m, m.payload[:60])] if n % 10 == 5 else [m], id="cut_short"),
        pytest.param(lambda n, m: [with_payload(m, b"")] if n % 10 == 5 else [m], id="empty"),
    ],
)
def test_single_bad_messages_are_counted_and_cost_little(watched: Watched, spoil: Spoil) -> None:
    watched.drive(spoil)
    assert sum(watched.rejected().values()) == 30  # every tenth of 300
    assert watched.ticks > 250, "the time base goes on"
    assert all(np.isfinite(b.mount_force).all() and np.isfinite(b.cg_accel).all() for b in watched.blocks)
    statuses = watched.statuses()
    flagged = {statuses[f"topic {VICTIM}"].level, statuses[f"sensor {SENSOR}"].level}
    assert DiagnosticStatus.WARN in flagged


def test_time_running_backwards_starts_again_and_goes_on(watched: Watched) -> None:
    messages = list(drive(watched.session.vehicle, 2.0))
    watched.feed(messages)
    first = watched.ticks
    watched.feed(list(drive(watched.session.vehicle, 2.0, start_ns=START_NS - 60_000_000_000)))
    assert sum(watched.session.pipeline.health().restarts.values()) >= 1
    assert watched.ticks > first + 150
    assert watched.blocks[-1].stamp_ns[-1] < START_NS


def test_sensor_that_never_speaks_is_an_error_and_the_others_go_on(watched: Watched) -> None:
    watched.drive(lambda n, m: [], seconds=4.0)
    statuses = watched.statuses()
    assert statuses[f"sensor {SENSOR}"].level == DiagnosticStatus.ERROR
    assert statuses[f"topic {VICTIM}"].level == DiagnosticStatus.ERROR
    assert statuses["estimates"].level == DiagnosticStatus.ERROR
    assert SENSOR in statuses["estimates"].message
    assert watched.ticks > 200


def test_sensor_that_stops_is_named_and_the_others_go_on(watched: Watched) -> None:
    watched.drive(lambda n, m: [m] if n < 150 else [], seconds=4.0)
    status = watched.statuses()[f"sensor {SENSOR}"]
    assert (status.level, status.message) == (DiagnosticStatus.ERROR, "has stopped")
    assert watched.ticks > 300


def test_swapped_topics_are_noticed(watched: Watched) -> None:
    # the accelerometer at the front left of the cab and the one below it on the chassis, which shakes differently
    other = "/chassis/front_left/accel"
    swap = {VICTIM: other, other: VICTIM}
    for m in drive(watched.session.vehicle, 8.0):  # residuals count once the angular rate has settled, after about 5 s
        watched.feed([Message(swap.get(m.topic, m.topic), m.type_name, m.payload, m.stamp_ns)])
    status = watched.statuses()["estimates"]
    assert status.level != DiagnosticStatus.OK
    assert SENSOR in status.message


@pytest.mark.parametrize("first", [-1.0, math.nan])
def test_data_marked_as_not_provided_are_ignored_and_it_is_said(watched: Watched, first: float) -> None:
    watched.drive(covariance(first))
    assert watched.rejected() == {"covariance_says_not_provided": 300}
    assert watched.statuses()[f"topic {VICTIM}"].level == DiagnosticStatus.WARN
    assert watched.session.pipeline.health().sensors[SENSOR].accepted == 0


def test_data_marked_as_not_provided_can_be_trusted(ros_single: Ros, tmp_path: Path) -> None:
    vehicle = load_vehicle(TRUCK)
    sensors = {**vehicle.sensors, SENSOR: dataclasses.replace(vehicle.sensors[SENSOR], trust_despite_minus_one=True)}
    save_vehicle(dataclasses.replace(vehicle, sensors=sensors), tmp_path / "cab.yaml")
    watched = Watched(ros_single, vehicle=str(tmp_path / "cab.yaml"))
    watched.drive(covariance(-1.0))
    assert watched.rejected() == {}
    assert watched.session.pipeline.health().sensors[SENSOR].accepted == 300


def test_zero_covariance_means_unknown_and_the_data_count(watched: Watched) -> None:
    watched.drive(covariance(0.0))
    assert watched.rejected() == {}
    assert watched.session.pipeline.health().sensors[SENSOR].accepted == 300


def test_layout_with_too_few_sensors_is_refused_in_words(ros_single: Ros, tmp_path: Path) -> None:
    vehicle = load_vehicle(TRUCK)
    kept = {n: s for n, s in vehicle.sensors.items() if s.body != "cab" or n in ("cab_front_left", "cab_front_right")}
    save_vehicle(dataclasses.replace(vehicle, sensors=kept), tmp_path / "cab.yaml")
    overrides = [Parameter("vehicle", value=str(tmp_path / "cab.yaml"))]
    node = EstimatorNode(context=ros_single.context, parameter_overrides=overrides, use_global_arguments=False)
    ros_single.add(node)
    assert node.session is None
    assert "determine 5 of 6 motion components" in node.fault


def test_one_imu_on_one_mount_is_enough_for_its_motion(ros_single: Ros) -> None:
    overrides = [Parameter("vehicle", value="single_imu")]
    node = EstimatorNode(context=ros_single.context, parameter_overrides=overrides, use_global_arguments=False)
    ros_single.add(node)
    blocks = []
    for k in range(300):
        message = imu(START_NS + k * 10_000_000, GOOD)
        message.angular_velocity_covariance[0] = 0.0
        blocks += node.receive("/imu/data", IMU, wire(message))
    assert sum(len(b.stamp_ns) for b in blocks) > 250
    assert np.isfinite(blocks[-1].cg_accel).all()


def test_message_of_another_type_is_counted(watched: Watched) -> None:
    watched.feed([Message(VICTIM, "sensor_msgs/msg/JointState", b"\x00\x01\x00\x00", 0)])
    assert watched.rejected() == {"message_type_not_accepted": 1}


def test_arithmetic_that_fails_is_an_error_until_it_is_over(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    original = watched.session.pipeline.observe
    calls = iter(range(10**9))

    def fail_once(*arguments: object) -> object:
        if next(calls) == 400:
            raise np.linalg.LinAlgError("Singular matrix")
        return original(*arguments)

    monkeypatch.setattr(watched.session.pipeline, "observe", fail_once)
    watched.drive(lambda n, m: [m])
    status = watched.statuses()["estimates"]
    said = "numerical fault (1 times): LinAlgError: Singular matrix; motion and forces began anew"
    assert (status.level, status.message) == (DiagnosticStatus.ERROR, said)
    assert watched.blocks[-1].stamp_ns[-1] > START_NS + 2_500_000_000, "estimates go on"
    watched.drive(lambda n, m: [m], seconds=11.0)
    status = watched.statuses()["estimates"]
    assert (status.level, status.message) == (DiagnosticStatus.WARN, said)


def test_random_bytes_never_stop_the_node(watched: Watched) -> None:
    rng = np.random.default_rng(7)
    for length in rng.integers(0, 400, size=300):
        watched.feed([Message(VICTIM, IMU, rng.integers(0, 256, size=int(length), dtype=np.uint8).tobytes(), 0)])
    state = watched.session.states[VICTIM]
    assert state.received == 300
    assert sum(state.rejected.values()) > 200
    watched.drive(lambda n, m: [m])
    assert watched.ticks > 250
    assert all(np.isfinite(b.mount_force).all() for b in watched.blocks)


def test_nothing_at_all_is_an_error_on_diagnostics(ros: Ros) -> None:
    listener = ros.add(Node("listener", context=ros.context, use_global_arguments=False))
    got: list[DiagnosticArray] = []
    listener.create_subscription(DiagnosticArray, "/diagnostics", got.append, qos.output())
    node = Watched(ros).node
    ros.until(lambda: node.count_subscribers("/diagnostics") > 0)
    node.watch()
    ros.until(lambda: bool(got))
    statuses = {s.name.removeprefix("/ride/estimator: "): s for s in got[-1].status}
    assert statuses[f"topic {VICTIM}"].message == "configured, but nothing has been received (no publisher)"
    assert {s.level for name, s in statuses.items() if name.startswith(("topic", "sensor"))} == {DiagnosticStatus.ERROR}
