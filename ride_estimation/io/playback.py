# Copyright 2026 ride_estimation contributors
"""Recorded messages as ROS 2 bytes in order of arrival, whatever the container, to feed a node or a topic."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_typestore

from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.io.bag_source import READER_ERRORS, BagSource, open_bag
from ride_estimation.io.bags import accepted


class RecordedMessage(NamedTuple):
    """One message.

    Attributes
    ----------
    topic, type_name
        Where it was recorded and what it is, as in ``sensor_msgs/msg/Imu``.
    arrival_ns
        When the recorder received it [ns].
    payload
        CDR bytes of ROS 2.
    """

    topic: str
    type_name: str
    arrival_ns: int
    payload: bytes


def playable_topics(path: str | Path) -> dict[str, str]:
    """Return the topics of a run whose messages can feed a sensor, with their types.

    Raises
    ------
    InputDataError
        The run cannot be read.
    """
    source = open_bag(Path(path))
    return {topic: kind for topic, kind in source.types.items() if accepted(kind) and topic not in source.unreadable}


def recorded_messages(path: str | Path, topics: Collection[str]) -> Iterator[RecordedMessage]:
    """Yield the messages of some topics in order of arrival.

    Parameters
    ----------
    path
        rosbag2 folder, ``.mcap``, ``.db3`` or ROS 1 ``.bag``; ROS 1 messages are written anew as ROS 2 bytes.
    topics
        Topics wanted; those the run does not have are passed over.

    Raises
    ------
    InputDataError
        The run cannot be read, or not to its end.
    """
    source = open_bag(Path(path))
    wanted = [topic for topic in topics if topic in source.types]
    try:
        for topic, arrival, raw in source.messages(wanted):
            kind = source.types[topic]
            yield RecordedMessage(topic, kind, arrival, raw if source.little_endian_cdr else _as_ros2(source, raw, kind))
    except RideEstimationError:
        raise
    except READER_ERRORS as error:
        raise InputDataError(f"{path}: damaged: {error or type(error).__name__}") from error


def _as_ros2(source: BagSource, raw: bytes, kind: str) -> bytes:
    store = get_typestore(Stores.ROS2_JAZZY)
    return bytes(store.serialize_cdr(_copied(source.deserialize(raw, kind), store.types), kind))


def _copied(message: Any, types: Any) -> Any:
    """Return a message of the ROS 2 class of the same name, field by field (ROS 1 headers have one more)."""
    target = types[message.__msgtype__]
    fields = {name for name in target.__dataclass_fields__ if name != "__msgtype__"}
    values = {name: getattr(message, name) for name in fields}
    return target(**{name: _copied(v, types) if hasattr(v, "__msgtype__") else v for name, v in values.items()})
