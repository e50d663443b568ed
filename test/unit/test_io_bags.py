# Copyright 2026 ride_estimation contributors
"""Bags: what is written is read, in bulk and message by message; covariance semantics; every kind of bad bag."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import iterate_messages, read_recording
from ride_estimation.io.messages import make_converter, sensors_by_topic
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

START = 1_700_000_000_123_456_789
SENSORS = {
    s.name: s
    for s in (
        Sensor("accel", "accelerometer", "/accel", "cab", noise_std=0.02),
        Sensor("imu", "imu", "/imu", "cab", noise_std=0.03, gyro_noise_std=0.001),
        Sensor("fl_z", "displacement", "/mounts/displacement", "cab", mount="fl", axis="z", element="fl_z"),
        Sensor("fr_z", "displacement", "/mounts/displacement", "cab", mount="fr", axis="z", element="fr_z"),
        Sensor("speed", "speed", "/vehicle/speed", "chassis"),
        Sensor("cell", "force", "/mounts/fl/force_measured", "cab", mount="fl"),
    )
}
VEHICLE = Vehicle("v", {}, {}, SENSORS)


def recording(seed: int = 0, count: int = 200) -> Recording:
    rng = np.random.default_rng(seed)
    channels = {}
    for i, sensor in enumerate(SENSORS.values()):
        stamps = START + np.arange(count) * 2_000_000 + (0 if sensor.kind == "displacement" else 1000 * i)
        arrival = stamps + 300_000 + rng.integers(0, 100_000, count)
        if sensor.kind == "displacement":
            arrival = stamps + 300_000
        variance = np.full((count, sensor.channels), 4e-4) if sensor.kind == "imu" else None
        channels[sensor.name] = Channel(sensor.name, stamps, rng.normal(size=(count, sensor.channels)), arrival, variance)
    return Recording("r", channels)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "run"
    write_bag(path, recording(), SENSORS)
    return path


def same(first: Recording, second: Recording) -> None:
    assert list(first.channels) == list(second.channels)
    for name, channel in first.channels.items():
        other = second.channels[name]
        assert np.array_equal(channel.stamp_ns, other.stamp_ns), name
        assert np.array_equal(channel.values, other.values), name
        assert np.array_equal(channel.arrival_ns, other.arrival_ns), name
        assert (channel.variance is None) == (other.variance is None), name


def test_what_is_written_is_read_from_every_container(bag: Path, tmp_path: Path) -> None:
    given = recording()
    same(read_recording(bag, VEHICLE), given)
    same(read_recording(bag / "run.mcap", VEHICLE), given)
    write_bag(tmp_path / "sql", given, SENSORS, storage="sqlite3")
    same(read_recording(tmp_path / "sql", VEHICLE), given)
    same(read_recording(tmp_path / "sql" / "sql.db3", VEHICLE), given)


def test_a_folder_without_metadata_is_read_with_a_warning(bag: Path, tmp_path: Path) -> None:
    shutil.copytree(bag, tmp_path / "run")
    (tmp_path / "run" / "metadata.yaml").unlink()
    read = read_recording(tmp_path / "run", VEHICLE)
    same(read, recording())
    assert any("metadata.yaml is missing" in w for w in read.warnings)


def test_order_of_arrival_over_all_sensors_is_kept(bag: Path) -> None:
    read = read_recording(bag, VEHICLE)
    names = list(read.channels)
    from_bulk = [(names[i], stamp, tuple(values)) for i, stamp, values, _ in read.in_order()]
    converters = {t: make_converter("", ()) for t in ()}
    one_by_one = []
    groups = sensors_by_topic(SENSORS.values())
    for topic, kind, _, message in iterate_messages(bag):
        converters.setdefault(topic, make_converter(kind, groups[topic]))
        convert = converters[topic]
        assert convert is not None
        one_by_one += [(s.sensor, s.stamp_ns, s.values) for s in convert(message)]
    assert from_bulk == one_by_one
    assert len(from_bulk) == 200 * len(SENSORS)


@pytest.mark.parametrize("kind", ["geometry_msgs/msg/AccelStamped", "geometry_msgs/msg/Vector3Stamped"])
def test_other_types_of_accelerometer_messages(kind: str, tmp_path: Path) -> None:
    one = {"accel": SENSORS["accel"]}
    given = Recording("r", {"accel": recording().channels["accel"]})
    write_bag(tmp_path / "b", given, one, message_types={"accel": kind})
    same(read_recording(tmp_path / "b", Vehicle("v", {}, {}, one)), given)


STORE = get_typestore(Stores.ROS2_JAZZY)


def imu(stamp: int, accel_covariance: list[float], gyro_covariance: list[float], frame: str = "f", store: Any = STORE) -> Any:
    t = store.types
    extra = {"seq": 0} if store is not STORE else {}
    return t["sensor_msgs/msg/Imu"](
        header=t["std_msgs/msg/Header"](
            stamp=t["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=frame, **extra
        ),
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0] + [0.0] * 8),
        angular_velocity=t["geometry_msgs/msg/Vector3"](x=0.1, y=0.2, z=0.3),
        angular_velocity_covariance=np.array(gyro_covariance),
        linear_acceleration=t["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=3.0),
        linear_acceleration_covariance=np.array(accel_covariance),
    )


def write_messages(path: Path, messages: list[Any], topic: str = "/accel") -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(topic, messages[0].__msgtype__, typestore=STORE)
        for i, message in enumerate(messages):
            writer.write(connection, START + i * 1_000_000, STORE.serialize_cdr(message, connection.msgtype))
    return path


ZERO = [0.0] * 9
GIVEN = [0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.03]
ABSENT = [-1.0] + [0.0] * 8
NAN = [float("nan")] * 9
PARTLY = [0.01, 0, 0, 0, 0.0, 0, 0, 0, 0.03]
NEGATIVE = [0.01, 0, 0, 0, -4.0, 0, 0, 0, 0.03]
COVARIANCES = [
    # covariance, trusted, used, variance, reason
    (ZERO, False, True, None, ""),
    (GIVEN, False, True, [0.01, 0.02, 0.03], ""),
    (ABSENT, False, False, None, "covariance_says_not_provided"),
    (ABSENT, True, True, None, ""),
    (NAN, False, False, None, "covariance_says_not_provided"),
    (NAN, True, True, None, ""),
    (PARTLY, False, True, [0.01, 0.0004, 0.03], ""),  # the noise of the vehicle file where one axis is zero
    (NEGATIVE, False, False, None, "covariance_invalid"),
    (NEGATIVE, True, True, None, ""),
]


@pytest.mark.parametrize(("covariance", "trusted", "used", "variance", "reason"), COVARIANCES)
def test_covariance_semantics_in_bulk_and_one_by_one(
    covariance: list[float], trusted: bool, used: bool, variance: list[float] | None, reason: str, tmp_path: Path
) -> None:
    sensor = dataclasses.replace(SENSORS["accel"], trust_despite_minus_one=trusted)
    vehicle = Vehicle("v", {}, {}, {"accel": sensor})
    # the good messages are twice as many, so that the recording is not empty
    messages = [imu(START + k * 2_000_000, covariance if k % 3 == 0 else GIVEN, ABSENT) for k in range(30)]
    path = write_messages(tmp_path / "b", messages)
    read = read_recording(path, vehicle)
    channel = read.channels["accel"]
    assert len(channel.stamp_ns) == (30 if used else 20)
    assert dict(read.ignored) == ({f"accel: {reason}": 10} if reason else {})
    stated = [v for _, _, _, v in read.in_order()]
    convert = make_converter("sensor_msgs/msg/Imu", (sensor,))
    assert convert is not None
    samples = [convert(m)[0] for m in messages]
    assert [s.rejection for s in samples[:3]] == [reason, "", ""]
    alone = [s.variance for s in samples if not s.rejection]
    assert [None if v is None else tuple(v) for v in stated] == alone
    if used:
        assert alone[0] == (None if variance is None else pytest.approx(variance))


def test_gyro_that_is_not_provided_is_named(tmp_path: Path) -> None:
    path = write_messages(tmp_path / "b", [imu(START + k * 2_000_000, ZERO, ABSENT) for k in range(5)], "/imu")
    with pytest.raises(InputDataError, match=r"angular_velocity_says_not_provided \(5\)"):
        read_recording(path, Vehicle("v", {}, {}, {"imu": SENSORS["imu"]}))
    trusted = dataclasses.replace(SENSORS["imu"], trust_despite_minus_one=True)
    read = read_recording(path, Vehicle("v", {}, {}, {"imu": trusted}))
    assert read.channels["imu"].values[0].tolist() == [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]


def test_changing_frame_names_and_big_endian_messages_are_decoded(tmp_path: Path) -> None:
    messages = [imu(START + k * 2_000_000, GIVEN, ABSENT, frame="f" * (k % 7)) for k in range(20)]
    path = tmp_path / "b"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=STORE)
        for i, message in enumerate(messages):
            raw = STORE.serialize_cdr(message, connection.msgtype, little_endian=i % 2 == 0)
            writer.write(connection, START + i * 1_000_000, raw)
    channel = read_recording(path, Vehicle("v", {}, {}, {"accel": SENSORS["accel"]})).channels["accel"]
    assert channel.stamp_ns.tolist() == [START + k * 2_000_000 for k in range(20)]
    assert np.array_equal(channel.values, np.tile([1.0, 2.0, 3.0], (20, 1)))
    assert channel.order is not None and channel.order.tolist() == list(range(20))


def test_ros1_bag(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(tmp_path / "one.bag") as writer:
        connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=store)
        for k in range(10):
            message = imu(START + k * 2_000_000, GIVEN, ABSENT, store=store)
            writer.write(connection, START + k * 2_000_000, store.serialize_ros1(message, connection.msgtype))
    channel = read_recording(tmp_path / "one.bag", Vehicle("v", {}, {}, {"accel": SENSORS["accel"]})).channels["accel"]
    assert channel.stamp_ns.tolist() == [START + k * 2_000_000 for k in range(10)]
    assert channel.variance is not None and channel.variance[0].tolist() == pytest.approx([0.01, 0.02, 0.03])


def test_topics_without_sensor_are_counted_and_a_sensor_without_topic_is_an_error(bag: Path) -> None:
    few = Vehicle("v", {}, {}, {"accel": SENSORS["accel"]})
    ignored = read_recording(bag, few).ignored
    assert ignored["topic /imu (sensor_msgs/msg/Imu) belongs to no sensor of the vehicle file"] == 200
    assert sum(ignored.values()) == 200 * 4
    extra = dataclasses.replace(SENSORS["accel"], name="rear", topic="/rear/accel")
    with pytest.raises(InputDataError) as caught:
        read_recording(bag, Vehicle("v", {}, {}, {**SENSORS, "rear": extra}))
    text = str(caught.value)
    assert "rear: the run has no topic /rear/accel" in text and "/imu (sensor_msgs/msg/Imu, 200 messages)" in text


def test_a_type_that_cannot_feed_the_sensor_is_named(bag: Path) -> None:
    wrong = dataclasses.replace(SENSORS["accel"], topic="/vehicle/speed")
    with pytest.raises(InputDataError, match=r"geometry_msgs/msg/TwistStamped cannot feed a sensor of kind accelerometer"):
        read_recording(bag, Vehicle("v", {}, {}, {"accel": wrong}))


def test_an_element_missing_from_joint_states_is_named(bag: Path) -> None:
    other = dataclasses.replace(SENSORS["fl_z"], name="rl_z", element="rl_z")
    with pytest.raises(InputDataError, match=r"rl_z: no message of /mounts/displacement names 'rl_z'"):
        read_recording(bag, Vehicle("v", {}, {}, {"fl_z": SENSORS["fl_z"], "rl_z": other}))
    with pytest.raises(InputDataError, match=r"rl_z: element_not_in_message \(200\)"):
        read_recording(bag, Vehicle("v", {}, {}, {"rl_z": other}))


def test_unknown_message_types_in_the_bag_do_not_disturb(tmp_path: Path) -> None:
    path = tmp_path / "b"
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register({"odd_msgs/msg/Odd": ([], [("value", (1, ("float64", 0)))])})
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        known = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=STORE)
        odd = writer.add_connection("/odd", "odd_msgs/msg/Odd", typestore=store)
        for k in range(10):
            writer.write(known, START + k, STORE.serialize_cdr(imu(START + k * 2_000_000, ZERO, ABSENT), known.msgtype))
            writer.write(odd, START + k, b"\x00\x01\x00\x00" + b"\x00" * 8)
    read = read_recording(path, Vehicle("v", {}, {}, {"accel": SENSORS["accel"]}))
    assert len(read.channels["accel"].stamp_ns) == 10
    assert read.ignored == {"topic /odd (odd_msgs/msg/Odd) belongs to no sensor of the vehicle file": 10}


def test_truncated_mcap_is_refused_and_can_be_salvaged(tmp_path: Path) -> None:
    given = recording(count=3000)
    write_bag(tmp_path / "run", given, SENSORS)
    data = (tmp_path / "run" / "run.mcap").read_bytes()
    for share, least in ((0.999, 2900), (0.5, 900)):
        cut = tmp_path / f"cut{share}.mcap"
        cut.write_bytes(data[: int(share * len(data))])
        with pytest.raises(InputDataError, match=r"truncated or corrupt .* can be recovered with --salvage"):
            read_recording(cut, VEHICLE)
        read = read_recording(cut, VEHICLE, salvage=True)
        assert any("truncated" in w for w in read.warnings)
        channel = read.channels["accel"]
        assert len(channel.stamp_ns) >= least
        assert np.array_equal(channel.values, given.channels["accel"].values[: len(channel.values)])


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("seed", range(3))
def test_corrupt_files_are_refused_or_read_but_never_crash(storage: str, seed: int, tmp_path: Path) -> None:
    write_bag(tmp_path / "run", recording(), SENSORS, storage=storage)
    file = next(p for p in (tmp_path / "run").iterdir() if p.suffix in (".mcap", ".db3"))
    data = bytearray(file.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(10, len(data), 200):
        data[place] ^= int(rng.integers(1, 256))
    file.write_bytes(bytes(data))
    for salvage in (False, True):
        try:
            read = read_recording(file, VEHICLE, salvage=salvage)
        except InputDataError as error:
            assert str(file) in str(error)
        else:
            assert sum(len(c.stamp_ns) for c in read.channels.values()) > 0


def test_empty_and_wrong_paths(tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.mcap").write_text("no recording at all")
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    (tmp_path / "folder").mkdir()
    with Writer(tmp_path / "nothing", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=STORE)
    for name, words in (
        ("none", "does not exist"), ("empty.mcap", "is empty"), ("text.mcap", "recording"), ("table.csv", "not a bag"),
        ("folder", "contains no"), ("nothing", "contains no messages"),
    ):  # fmt: skip
        with pytest.raises(InputDataError, match=words) as caught:
            read_recording(tmp_path / name, VEHICLE)
        assert name in str(caught.value)


def test_a_folder_of_recordings_is_no_recording(tmp_path: Path) -> None:
    """Not the first of them either, which would be an answer about a run nobody asked for."""
    write_bag(tmp_path / "day" / "run1", recording(), SENSORS)
    assert read_recording(tmp_path / "day", VEHICLE).checksum == read_recording(tmp_path / "day" / "run1", VEHICLE).checksum
    write_bag(tmp_path / "day" / "run2", recording(), SENSORS)
    for folder, names in ((tmp_path / "day", "run1, run2"), (tmp_path, "day/run1, day/run2")):
        with pytest.raises(InputDataError, match=f"a folder of recordings .{names}.: name one"):
            read_recording(folder, VEHICLE)


def test_a_run_without_duration_is_refused(tmp_path: Path) -> None:
    path = write_messages(tmp_path / "b", [imu(START, ZERO, ABSENT)] * 3)
    with pytest.raises(InputDataError, match=r"lasts 0 s .*one stamp only"):
        read_recording(path, Vehicle("v", {}, {}, {"accel": SENSORS["accel"]}))
    unset = write_messages(tmp_path / "unset", [imu(0, ZERO, ABSENT)] * 3)
    with pytest.raises(InputDataError, match="every header stamp is zero"):
        read_recording(unset, Vehicle("v", {}, {}, {"accel": SENSORS["accel"]}))


def test_writing_refuses_to_overwrite_and_to_guess(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(InputDataError, match="never overwritten"):
        write_bag(bag, recording(), SENSORS)
    with pytest.raises(InputDataError, match="without a sensor"):
        write_bag(tmp_path / "x", recording(), {})
    with pytest.raises(InputDataError, match="cannot carry"):
        write_bag(tmp_path / "y", recording(), SENSORS, message_types={"accel": "geometry_msgs/msg/TwistStamped"})


def test_checksum_is_that_of_the_content(bag: Path, tmp_path: Path) -> None:
    first = read_recording(bag, VEHICLE).checksum
    shutil.copytree(bag, tmp_path / "elsewhere")
    assert read_recording(tmp_path / "elsewhere", VEHICLE).checksum == first
    write_bag(tmp_path / "other", recording(seed=1), SENSORS)
    assert read_recording(tmp_path / "other", VEHICLE).checksum != first
