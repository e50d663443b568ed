# Copyright 2026 ride_estimation contributors
"""The estimator node in process: lifecycle, outputs, services, parameters, saved state. Lockstep, no sleeping."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import AccelWithCovarianceStamped, InertiaStamped, WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import qos
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.nodes.estimator_parameters import TABLE
from ride_estimation.nodes.inputs import MESSAGE_CLASSES
from ros.conftest import Ros
from ros.drive import IMU, accel_stamped, drive, imu, vector3_stamped

MOUNTS = ("front_left", "front_right", "rear_left", "rear_right")


def estimator(ros: Ros, **parameters: object) -> EstimatorNode:
    """Add an estimator node with some parameters."""
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = EstimatorNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False)
    ros.add(node)
    return node


def state_of(node: EstimatorNode) -> str:
    return str(node._state_machine.current_state[1])


class Listener(Node):
    """Keeps every message of some topics."""

    def __init__(self, ros: Ros, topics: dict[str, type]) -> None:
        super().__init__("listener", context=ros.context, use_global_arguments=False)
        self.got: dict[str, list] = {name: [] for name in topics}
        for name, kind in topics.items():
            self.create_subscription(kind, name, self.got[name].append, qos.output(2000))
        ros.add(self)


def feed(node: EstimatorNode, seconds: float) -> int:
    """Drive the handlers of the node; return the number of ticks."""
    assert node.session is not None
    blocks = [b for m in drive(node.session.vehicle, seconds) for b in node.receive(m.topic, m.type_name, m.payload)]
    return sum(len(b.stamp_ns) for b in blocks)


def statuses(message: DiagnosticArray) -> dict[str, DiagnosticStatus]:
    """Return the statuses by what they are about, without the name of the node."""
    return {status.name.partition(": ")[2]: status for status in message.status}


# ---- lifecycle ----


def test_starts_by_itself(ros: Ros) -> None:
    assert state_of(estimator(ros)) == "active"


def test_without_autostart_a_manager_is_in_charge(ros: Ros) -> None:
    node = estimator(ros, autostart=False)
    assert state_of(node) == "unconfigured"
    expected = {
        Transition.TRANSITION_CONFIGURE: "inactive",
        Transition.TRANSITION_ACTIVATE: "active",
        Transition.TRANSITION_DEACTIVATE: "inactive",
        Transition.TRANSITION_CLEANUP: "unconfigured",
    }
    for transition, state in expected.items():
        request = ChangeState.Request(transition=Transition(id=transition))
        assert ros.call("/ride/estimator/change_state", ChangeState, request).success
        assert ros.call("/ride/estimator/get_state", GetState).current_state.label == state


def test_cleaned_up_node_configures_again(ros_single: Ros) -> None:
    node = estimator(ros_single)
    feed(node, 0.5)
    node.trigger_deactivate()
    node.trigger_cleanup()
    assert node.session is None
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    assert feed(node, 0.5) > 0


def test_deactivated_node_keeps_what_it_learned(ros: Ros) -> None:
    node = estimator(ros)
    session = node.session
    node.trigger_deactivate()
    node.trigger_activate()
    assert node.session is session


@pytest.mark.parametrize("content", ["name: [", "schema: ride_estimation/vehicle/1\nname: x\n"])
def test_mistake_in_the_vehicle_file_is_a_diagnostic_and_no_crash(ros_single: Ros, tmp_path: Path, content: str) -> None:
    vehicle = tmp_path / "broken.yaml"
    vehicle.write_text(content, encoding="utf-8")
    listener = Listener(ros_single, {"/diagnostics": DiagnosticArray})
    node = estimator(ros_single, vehicle=str(vehicle))
    assert state_of(node) == "unconfigured"
    ros_single.until(lambda: node.count_subscribers("/diagnostics") > 0)
    node.watch()
    ros_single.until(lambda: bool(listener.got["/diagnostics"]))
    status = statuses(listener.got["/diagnostics"][-1])["estimator node"]
    assert status.level == DiagnosticStatus.ERROR
    assert "broken.yaml" in status.message


def test_mistake_can_be_corrected_without_a_restart(ros_single: Ros, tmp_path: Path) -> None:
    vehicle = tmp_path / "cab.yaml"
    vehicle.write_text("name: [", encoding="utf-8")
    node = estimator(ros_single, vehicle=str(vehicle))
    source = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
    vehicle.write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS


# ---- outputs ----


def test_every_topic_of_the_interface_speaks(ros: Ros) -> None:
    names: dict[str, type] = {
        "/ride/estimator/cg_accel": AccelWithCovarianceStamped,
        "/ride/estimator/cg_imu": Imu,
        "/ride/estimator/inertial_load": WrenchStamped,
        "/ride/estimator/mounts/states": JointState,
        "/ride/estimator/mounts/stddev": JointState,
        "/ride/estimator/inertia": InertiaStamped,
        "/ride/estimator/parameters": DiagnosticArray,
        "/diagnostics": DiagnosticArray,
    } | {f"/ride/estimator/mounts/{mount}/force": WrenchStamped for mount in MOUNTS}
    listener = Listener(ros, names)
    node = estimator(ros, output_depth=2000)
    ros.until(lambda: all(node.count_subscribers(name) for name in names))
    ticks = feed(node, 1.5)
    per_tick = [got for name, got in listener.got.items() if "mounts" in name or "cg_" in name or "load" in name]
    ros.until(lambda: all(listener.got.values()) and all(len(got) == ticks for got in per_tick))
    joints = [f"{mount}_{axis}" for mount in MOUNTS for axis in "xyz"]
    state = listener.got["/ride/estimator/mounts/states"][-1]
    stddev = listener.got["/ride/estimator/mounts/stddev"][-1]
    assert list(state.name) == list(stddev.name) == joints
    assert min(stddev.effort) > 0.0
    forces = np.array([listener.got[f"/ride/estimator/mounts/{mount}/force"][-1].wrench.force.z for mount in MOUNTS])
    assert np.array_equal(forces, np.array(state.effort).reshape(4, 3)[:, 2]), "both force topics carry the same numbers"
    assert listener.got["/ride/estimator/mounts/front_left/force"][0].header.frame_id == "mount_front_left"
    assert listener.got["/ride/estimator/cg_accel"][0].header.frame_id == "cab_cg"
    spread = listener.got["/ride/estimator/cg_imu"][-1].angular_velocity_covariance
    assert min(spread[0], spread[4], spread[8]) > 0.0, "the cab has no gyro: its rates are derived and far from exact"
    assert {s.hardware_id for s in listener.got["/ride/estimator/parameters"][0].status} == {"cab"}


def test_static_weight_is_carried_upwards_by_the_mounts(ros_single: Ros) -> None:
    listener = Listener(ros_single, {"/ride/estimator/mounts/states": JointState})
    node = estimator(ros_single, output_depth=2000)
    ros_single.until(lambda: node.count_subscribers("/ride/estimator/mounts/states") > 0)
    ticks = feed(node, 3.0)
    messages = listener.got["/ride/estimator/mounts/states"]
    ros_single.until(lambda: len(messages) == ticks)
    carried = np.array([np.array(m.effort).reshape(4, 3)[:, 2].sum() for m in messages])
    # cab of 1200 kg, whole periods of the 1.3 Hz heave of 0.8 m/s^2 leave the weight of 11768 N; 5 % for the ends of the run
    assert carried.mean() == pytest.approx(1200 * 9.80665, rel=0.05)


def test_stamps_are_data_time_and_rise(ros_single: Ros) -> None:
    listener = Listener(ros_single, {"/ride/estimator/cg_accel": AccelWithCovarianceStamped})
    node = estimator(ros_single, output_depth=2000)
    ros_single.until(lambda: node.count_subscribers("/ride/estimator/cg_accel") > 0)
    ticks = feed(node, 1.0)
    got = listener.got["/ride/estimator/cg_accel"]
    ros_single.until(lambda: len(got) == ticks)
    stamps = np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in got])
    assert np.all(np.diff(stamps) == 10_000_000)


def test_publish_every_thins_out_the_messages_only(ros_single: Ros) -> None:
    listener = Listener(ros_single, {"/ride/estimator/cg_accel": AccelWithCovarianceStamped})
    node = estimator(ros_single, publish_every=5, output_depth=2000)
    ros_single.until(lambda: node.count_subscribers("/ride/estimator/cg_accel") > 0)
    ticks = feed(node, 2.0)
    got = listener.got["/ride/estimator/cg_accel"]
    ros_single.until(lambda: len(got) == (ticks + 4) // 5)
    assert ticks > 150


def test_parameters_and_diagnostics_come_once_per_second_of_data(ros_single: Ros) -> None:
    names: dict[str, type] = {"/ride/estimator/parameters": DiagnosticArray}
    listener = Listener(ros_single, names)
    node = estimator(ros_single)
    ros_single.until(lambda: node.count_subscribers("/ride/estimator/parameters") > 0)
    feed(node, 4.7)
    got = listener.got["/ride/estimator/parameters"]
    ros_single.until(lambda: len(got) == 5)
    stamps = np.array([m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in got])
    assert np.diff(stamps) == pytest.approx(1.0, abs=0.05)  # s, one block of ticks


# ---- inputs over the wire ----


def test_messages_over_the_wire_reach_the_estimator(ros: Ros) -> None:
    node = estimator(ros)
    assert node.session is not None
    talker = ros.add(Node("talker", context=ros.context, use_global_arguments=False))
    publishers = {name: talker.create_publisher(Imu, name, qos.output(100)) for name in node.session.topics}
    ros.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    states = node.session.states
    for n, message in enumerate(drive(node.session.vehicle, 0.6)):
        publishers[message.topic].publish(message.payload)
        ros.until(lambda n=n: sum(s.received for s in states.values()) == n + 1)
    assert node.session.pipeline.health().ticks > 0


ACCEL, VECTOR = "geometry_msgs/msg/AccelStamped", "geometry_msgs/msg/Vector3Stamped"
VICTIM = "/cab/front_left/accel"
SAMPLE = (10**18, np.array([0.1, 0.2, 9.8]))


class Driver:
    """A sensor driver that publishes one type of message on one topic; a participant of its own, as a process would be."""

    def __init__(self, ros: Ros, type_name: str) -> None:
        self.ros, self.type_name = ros, type_name
        self.node = ros.participant("driver")
        self.publisher = self.node.create_publisher(MESSAGE_CLASSES[type_name], VICTIM, qos.output(100))

    def seen_by(self, node: EstimatorNode) -> None:
        """Wait until the node knows the type, and let it look."""
        self.ros.until(lambda: self.type_name in {p.topic_type for p in node.get_publishers_info_by_topic(VICTIM)})
        node.watch()

    def publish_to(self, node: EstimatorNode) -> None:
        """Publish one sample and wait until it was received."""
        state = node.session.states[VICTIM]
        before = state.received
        self.ros.until(lambda: self.publisher.get_subscription_count() > 0)
        make = {IMU: imu, ACCEL: accel_stamped, VECTOR: vector3_stamped}[self.type_name]
        self.publisher.publish(make(*SAMPLE))
        self.ros.until(lambda: state.received == before + 1)
        assert state.type_name == self.type_name
        assert not state.rejected

    def leave(self, node: EstimatorNode) -> None:
        """End, and wait until the node knows."""
        self.node.destroy_node()
        self.ros.until(lambda: not node.get_publishers_info_by_topic(VICTIM))


@pytest.fixture
def no_garbage_collection() -> Iterator[None]:
    """Nothing is destroyed because it was collected."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_garbage_collection")
def test_destroyed_node_is_gone_for_others_at_once(ros_single: Ros) -> None:
    other = ros_single.participant("other")
    node = EstimatorNode(context=ros_single.context, use_global_arguments=False)
    ros_single.until(lambda: "estimator" in other.get_node_names())
    node.destroy_node()
    ros_single.until(lambda: "estimator" not in other.get_node_names())


@pytest.mark.parametrize("first", ["driver", "estimator"])
@pytest.mark.parametrize("type_name", [ACCEL, VECTOR])
def test_type_of_the_publisher_decides_how_an_accelerometer_is_read(
    ros_single: Ros, type_name: str, first: str
) -> None:
    driver = Driver(ros_single, type_name) if first == "driver" else None
    node = estimator(ros_single)
    node.watch()
    driver = driver or Driver(ros_single, type_name)
    driver.seen_by(node)
    driver.publish_to(node)
    node.watch()
    driver.publish_to(node)


def test_driver_that_comes_back_with_another_type_is_followed(ros: Ros) -> None:
    node = estimator(ros)
    for type_name in (IMU, ACCEL):
        driver = Driver(ros, type_name)
        driver.seen_by(node)
        driver.publish_to(node)
        driver.leave(node)
        node.watch()


def test_second_publisher_of_another_type_is_said_and_changes_nothing(ros_single: Ros) -> None:
    node = estimator(ros_single)
    driver = Driver(ros_single, VECTOR)
    driver.seen_by(node)
    driver.publish_to(node)
    Driver(ros_single, IMU).seen_by(node)
    driver.publish_to(node)
    node.look()  # a participant that is announced late was waited for in silence
    level, message = node.session.states[VICTIM].verdict()
    assert level == DiagnosticStatus.WARN
    assert f"a publisher of {IMU} is not read" in message


@pytest.mark.parametrize("first", ["driver", "estimator"])
def test_topic_with_a_foreign_type_is_named(ros_single: Ros, first: str) -> None:
    foreign = "sensor_msgs/msg/JointState"
    driver = Driver(ros_single, foreign) if first == "driver" else None
    node = estimator(ros_single)
    node.watch()
    driver = driver or Driver(ros_single, foreign)
    driver.seen_by(node)
    level, message = node.session.states[VICTIM].verdict()
    assert level == DiagnosticStatus.ERROR
    assert f"carries {foreign}, which is not accepted" in message
    driver.leave(node)
    good = Driver(ros_single, IMU)
    good.seen_by(node)
    good.publish_to(node)


def test_publisher_that_cannot_match_is_named(ros: Ros) -> None:
    override = {"qos_overrides./cab/front_left/accel.subscription.reliability": "reliable"}
    node = estimator(ros, **override)
    talker = ros.add(Node("talker", context=ros.context, use_global_arguments=False))
    talker.create_publisher(Imu, "/cab/front_left/accel", QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
    assert node.session is not None
    state = node.session.states["/cab/front_left/accel"]
    ros.until(lambda: bool(state.incompatible_qos))
    level, message = state.verdict()
    assert level == DiagnosticStatus.ERROR
    assert "RELIABILITY" in message


def test_best_effort_and_reliable_publishers_both_match(ros_single: Ros) -> None:
    node = estimator(ros_single)
    assert node.session is not None
    talker = ros_single.add(Node("talker", context=ros_single.context, use_global_arguments=False))
    publishers = []
    for topic, reliability in zip(node.session.topics, [ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE]):
        publishers.append(talker.create_publisher(Imu, topic, QoSProfile(depth=5, reliability=reliability)))
    ros_single.until(lambda: all(p.get_subscription_count() == 1 for p in publishers))
    assert not any(s.incompatible_qos for s in node.session.states.values())


# ---- services and saved state ----


def test_reset_starts_again(ros: Ros) -> None:
    node = estimator(ros)
    feed(node, 1.0)
    answer = ros.call("/ride/estimator/reset", Trigger)
    assert answer.success
    assert node.session is not None
    assert sum(node.session.pipeline.health().restarts.values()) == 1
    assert feed(node, 0.5) > 0


def test_services_of_an_unconfigured_node_say_so(ros_single: Ros) -> None:
    estimator(ros_single, autostart=False)
    for name in ("reset", "save_parameters"):
        answer = ros_single.call(f"/ride/estimator/{name}", Trigger)
        assert not answer.success
        assert "not configured" in answer.message


def test_saved_vehicle_file_loads_again_and_saved_state_continues(ros_single: Ros, tmp_path: Path) -> None:
    first = estimator(ros_single, save_directory=str(tmp_path / "saved"))
    feed(first, 4.0)
    answer = ros_single.call("/ride/estimator/save_parameters", Trigger)
    assert answer.success, answer.message
    vehicle_file, state_file = (next((tmp_path / "saved").glob(f"*{end}")) for end in ("_identified.yaml", "_state.json"))
    assert str(vehicle_file) in answer.message
    assert set(load_vehicle(vehicle_file).mounts) == set(MOUNTS)
    assert first.session is not None
    learned = {e.name: (e.value, e.std) for e in first.session.pipeline.parameters()}
    first.trigger_deactivate()
    overrides = [Parameter("state_file", value=str(state_file))]
    second = EstimatorNode(context=ros_single.context, use_global_arguments=False, parameter_overrides=overrides)
    ros_single.add(second)
    assert second.session is not None
    assert {e.name: (e.value, e.std) for e in second.session.pipeline.parameters()} == learned


def test_state_that_does_not_exist_yet_is_no_error(ros_single: Ros, tmp_path: Path) -> None:
    assert state_of(estimator(ros_single, state_file=str(tmp_path / "later.json"))) == "active"


@pytest.mark.parametrize("content", ["{", "[]", '{"schema": "something/else"}'])
def test_state_that_is_none_is_refused_by_name(ros_single: Ros, tmp_path: Path, content: str) -> None:
    state_file = tmp_path / "state.json"
    state_file.write_text(content, encoding="utf-8")
    node = estimator(ros_single, state_file=str(state_file))
    assert state_of(node) == "unconfigured"
    assert "saved state" in node.fault


def test_folder_that_cannot_be_written_is_answered_and_no_crash(ros_single: Ros, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    estimator(ros_single, save_directory=str(blocked / "below"))
    answer = ros_single.call("/ride/estimator/save_parameters", Trigger)
    assert not answer.success
    assert "not saved" in answer.message


# ---- parameters ----


def set_parameter(ros: Ros, name: str, value: object) -> object:
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return ros.call("/ride/estimator/set_parameters", SetParameters, request).results[0]


def test_every_parameter_is_described_with_its_unit(ros_single: Ros) -> None:
    estimator(ros_single)
    request = DescribeParameters.Request(names=[p.name for p in TABLE])
    answer = ros_single.call("/ride/estimator/describe_parameters", DescribeParameters, request)
    for parameter, descriptor in zip(TABLE, answer.descriptors, strict=True):
        assert descriptor.description == parameter.description
        assert descriptor.read_only == parameter.read_only
        ranged = bool(descriptor.floating_point_range or descriptor.integer_range)
        assert ranged == (parameter.lower is not None and not parameter.or_zero)
        if parameter.or_zero:
            assert descriptor.additional_constraints == parameter.range_text


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("excitation_accel", 1e9, ""),
        ("save_directory", 5, ""),
        ("block_ticks", 8, "read-only"),
        ("executor", "single", "read-only"),
    ],
)
def test_change_that_is_not_allowed_is_rejected(ros_single: Ros, name: str, value: object, reason: str) -> None:
    node = estimator(ros_single)
    before = node.get_parameter(name).value
    result = set_parameter(ros_single, name, value)
    assert not result.successful
    assert result.reason
    assert reason in result.reason
    assert node.get_parameter(name).value == before


def test_estimator_setting_changes_while_running_and_keeps_what_was_learned(ros_single: Ros) -> None:
    node = estimator(ros_single)
    feed(node, 2.0)
    assert node.session is not None
    learned = [(e.name, e.value, e.std) for e in node.session.pipeline.parameters()]
    assert set_parameter(ros_single, "excitation_accel", 0.2).successful
    assert node.session.pipeline.settings.excitation_accel == 0.2
    assert [(e.name, e.value, e.std) for e in node.session.pipeline.parameters()] == learned
    assert feed(node, 0.5) > 0


def test_interval_of_reports_changes_while_running(ros_single: Ros) -> None:
    node = estimator(ros_single)
    assert set_parameter(ros_single, "diagnostics_period", 0.5).successful
    assert node.get_parameter("diagnostics_period").value == 0.5


def test_value_outside_its_range_at_the_start_is_named(ros_single: Ros) -> None:
    with pytest.raises(Exception, match="input_depth"):
        estimator(ros_single, input_depth=1)


def test_imu_with_fields_checked_is_what_the_node_reads() -> None:
    message = imu(5, np.array([1.0, 2.0, 3.0]))
    with pytest.raises(AssertionError):
        message.linear_acceleration.x = 1
    assert IMU == "sensor_msgs/msg/Imu"


@pytest.mark.parametrize(("name", "value"), [("noise_scale", 3.0), ("parameter_memory", 60.0), ("prior_stiffness_std", 0.5)])
def test_noise_and_forgetting_can_be_tuned_while_running(ros_single: Ros, name: str, value: float) -> None:
    node = estimator(ros_single)
    feed(node, 1.0)
    assert set_parameter(ros_single, name, value).successful
    assert getattr(node.session.pipeline.settings, name) == value
    assert feed(node, 0.5) > 0


def test_noise_scaled_live_reaches_the_estimate_and_not_the_vehicle(ros_single: Ros) -> None:
    node = estimator(ros_single)
    before = {s.name: s.noise_std for s in node.session.pipeline.geometry.body_sensors}
    feed(node, 1.0)
    variance = np.array(node.session.pipeline.save_state()["motion"]["variance"])
    assert set_parameter(ros_single, "noise_scale", 3.0).successful
    pipeline = node.session.pipeline
    # what was learned is kept, the noise that it was learned with is not
    assert np.array(pipeline.save_state()["motion"]["variance"]) == pytest.approx(9.0 * variance)
    assert {s.name: s.noise_std / 3.0 for s in pipeline.geometry.body_sensors} == pytest.approx(before)
    assert {name: pipeline.vehicle.sensors[name].noise_std for name in before} == before


@pytest.mark.parametrize("name", ["vehicle", "rate_hz", "block_ticks", "cg_frame"])
def test_geometry_and_time_base_are_locked(ros_single: Ros, name: str) -> None:
    node = estimator(ros_single)
    value = node.get_parameter(name).value
    other = f"{value}x" if isinstance(value, str) else value + type(value)(100)
    assert "read-only" in set_parameter(ros_single, name, other).reason
