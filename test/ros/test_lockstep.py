# Copyright 2026 ride_estimation contributors
"""Offline replay and the real node in lockstep give the same bytes, on a clean run and on one full of faults."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import Imu, JointState

from ride_estimation.estimation.offline import EstimateDigest, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bags import read_recording
from ride_estimation.io.playback import playable_topics, recorded_messages
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.nodes import qos
from ride_estimation.nodes.conversions import header
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.nodes.inputs import MESSAGE_CLASSES
from ride_estimation.nodes.lockstep import run_in_lockstep
from ride_estimation.resources import shared_path
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle
from ros.conftest import Ros
from ros.drive import drive, imu, wire

TRUCK = shared_path("config", "vehicles", "truck_cab.yaml")
Wire = tuple[str, str, int, bytes]


def node_for(ros: Ros, vehicle: Path) -> EstimatorNode:
    overrides = [Parameter("vehicle", value=str(vehicle))]
    node = EstimatorNode(context=ros.context, use_global_arguments=False, parameter_overrides=overrides)
    ros.add(node)
    return node


def offline_digest(run: Path, vehicle: Path) -> str:
    loaded = load_vehicle(vehicle)
    return run_offline(read_recording(run, loaded), Pipeline(loaded)).digest


def write_bag(folder: Path, messages: list[Wire]) -> Path:
    """Write serialized messages as they are: (topic, type, arrival, bytes)."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        types = {topic: kind for topic, kind, _, _ in messages}
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in types.items()}
        for topic, _, arrival, payload in messages:
            writer.write(connections[topic], arrival, payload)
    return folder


def faulty_drive(vehicle: Vehicle, seconds: float) -> Iterator[Wire]:
    """Yield a drive with NaN, doubled, late, cut and missing messages, changing covariances, transducers in between."""
    rng = np.random.default_rng(5)
    held: list[Wire] = []
    for n, m in enumerate(drive(vehicle, seconds)):
        arrival = m.stamp_ns + int(rng.integers(0, 2_000_000))
        item = (m.topic, m.type_name, arrival, m.payload)
        fate = rng.random()
        if fate < 0.01:
            continue
        if fate < 0.02:
            item = (*item[:3], wire(imu(m.stamp_ns, np.array([np.nan, 0.0, 9.8]))))
        elif fate < 0.03:
            item = (*item[:3], wire(imu(m.stamp_ns, np.array([0.0, 0.0, 9.8]), covariance0=-1.0)))
        elif fate < 0.04:
            item = (*item[:3], m.payload[:50])
        elif fate < 0.05:
            held.append(item)
            continue
        elif fate < 0.1:
            item = (*item[:3], wire(imu(m.stamp_ns, np.array([0.1, 0.0, 9.7]), covariance0=float(rng.uniform(1e-4, 1e-3)))))
        yield item
        if fate > 0.99:
            yield item
        if n % 50 == 0:
            yield from held
            held.clear()
        if n % 8 == 0:
            joints = JointState(header=header(m.stamp_ns, ""), name=["a", "b"], position=[0.001 * np.sin(n), 0.002])
            yield ("/mounts/displacement", "sensor_msgs/msg/JointState", arrival, wire(joints))


def with_transducers(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with two displacement transducers on one JointState."""
    extra = {
        name: Sensor(name, "displacement", "/mounts/displacement", "cab", mount=mount, axis="z", element=element, noise_std=1e-4)
        for name, mount, element in (("d_left", "front_left", "a"), ("d_right", "front_right", "b"))
    }
    return dataclasses.replace(vehicle, sensors={**vehicle.sensors, **extra})


@pytest.mark.parametrize("seconds", [5.0, pytest.param(30.0, marks=pytest.mark.slow)])
def test_bundled_run_gives_the_same_bytes_offline_and_through_the_node(
    ros_single: Ros, tmp_path: Path, seconds: float
) -> None:
    bundled = shared_path("bags", "nominal", "bag")
    messages = list(recorded_messages(bundled, playable_topics(bundled)))
    limit = messages[0].arrival_ns + round(seconds * 1e9)
    run = write_bag(tmp_path / "run", [(m.topic, m.type_name, m.arrival_ns, m.payload) for m in messages if m.arrival_ns < limit])
    live = run_in_lockstep(node_for(ros_single, TRUCK), run)
    print(f"digest {live}")
    assert live == offline_digest(run, TRUCK)


def test_faulty_run_gives_the_same_bytes_offline_and_through_the_node(ros_single: Ros, tmp_path: Path) -> None:
    vehicle = with_transducers(load_vehicle(TRUCK))
    save_vehicle(vehicle, tmp_path / "cab.yaml")
    run = write_bag(tmp_path / "run", list(faulty_drive(vehicle, 4.0)))
    node = node_for(ros_single, tmp_path / "cab.yaml")
    live = run_in_lockstep(node, run)
    print(f"digest {live}")
    assert live == offline_digest(run, tmp_path / "cab.yaml")
    assert node.session is not None
    rejected = [reason for state in node.session.states.values() for reason in state.rejected]
    assert {"message_not_decodable", "covariance_says_not_provided"} <= set(rejected), "the run was as bad as it should be"


def test_the_digest_sees_a_change_far_below_the_noise(tmp_path: Path) -> None:
    vehicle = load_vehicle(TRUCK)
    messages = [(m.topic, m.type_name, m.stamp_ns, m.payload) for m in drive(vehicle, 1.0)]
    changed = list(messages)
    topic, kind, arrival, payload = changed[400]
    at = len(payload) - 12 * 8 + 3  # x of the linear acceleration, changed by about 1e-10 m/s^2
    changed[400] = (topic, kind, arrival, payload[:at] + bytes([payload[at] ^ 1]) + payload[at + 1 :])
    first, second = write_bag(tmp_path / "a", messages), write_bag(tmp_path / "b", changed)
    assert offline_digest(first, TRUCK) == offline_digest(first, TRUCK)
    assert offline_digest(first, TRUCK) != offline_digest(second, TRUCK)


def test_run_over_the_wire_in_lockstep_gives_the_same_bytes(ros: Ros, tmp_path: Path) -> None:
    vehicle = load_vehicle(TRUCK)
    run = write_bag(tmp_path / "run", [(m.topic, m.type_name, m.stamp_ns, m.payload) for m in drive(vehicle, 1.5)])
    digest = EstimateDigest()

    class Recording(EstimatorNode):
        def receive(self, topic: str, type_name: str, payload: bytes) -> tuple:
            blocks = super().receive(topic, type_name, payload)
            for block in blocks:
                digest.update(block)
            return blocks

    node = Recording(context=ros.context, use_global_arguments=False)
    ros.add(node)
    assert node.session is not None
    states = node.session.states
    talker = ros.add(Node("talker", context=ros.context, use_global_arguments=False))
    publishers = {name: talker.create_publisher(Imu, name, qos.output(100)) for name in states}
    ros.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for n, m in enumerate(drive(vehicle, 1.5)):
        publishers[m.topic].publish(m.payload)
        ros.until(lambda n=n: sum(s.received for s in states.values()) == n + 1)
    for block in node.finish():
        digest.update(block)
    digest.parameters(node.session.pipeline.parameters())
    assert digest.hexdigest() == offline_digest(run, TRUCK)


@pytest.mark.parametrize("type_name", sorted(MESSAGE_CLASSES))
def test_cheap_reader_agrees_with_rclpy(type_name: str) -> None:
    from rclpy.serialization import deserialize_message

    from ride_estimation.io.messages import accepted_types, make_converter
    from ride_estimation.nodes.cdr import make_reader

    rng = np.random.default_rng(3)
    kind = next(k for k in ("imu", "accelerometer", "displacement", "speed", "force") if type_name in accepted_types(k))
    convert = make_converter(type_name, [Sensor("s", kind, "/s", "cab", element="j0")])
    assert convert is not None
    read = make_reader(type_name)
    for frame in ("", "a", "abcdefg", "abcdefgh", "x" * 40):
        payload = wire(_filled(MESSAGE_CLASSES[type_name], frame, rng))
        assert convert(read(payload)) == convert(deserialize_message(payload, MESSAGE_CLASSES[type_name]))


def _filled(message_class: type, frame: str, rng: np.random.Generator) -> object:
    """Return a message with random numbers everywhere."""
    message = message_class(header=header(int(rng.integers(0, 2**60)), frame))

    def fill(part: object) -> None:
        for name, kind in part.get_fields_and_field_types().items():
            if name == "header":
                continue
            if kind == "string":
                setattr(part, name, frame)
            elif kind == "double":
                setattr(part, name, float(rng.normal()))
            elif kind in ("double[9]", "double[36]"):
                setattr(part, name, rng.uniform(0.1, 1.0, int(kind[7:-1])))
            elif kind == "sequence<double>":
                setattr(part, name, rng.normal(size=3).tolist())
            elif kind == "sequence<string>":
                setattr(part, name, ["j0", "j1", "j2"])
            else:
                fill(getattr(part, name))

    fill(message)
    return message
