# Copyright 2026 ride_estimation contributors
"""Recorded runs: bags to :class:`~ride_estimation.signals.recording.Recording`, and message by message.

``read_recording(path, vehicle)`` decodes whole topics at once (:mod:`ride_estimation.io.bags_bulk`);
``iterate_messages(path, topics)`` gives message objects in order of arrival, for a replay in lockstep with a node. Both follow
:mod:`ride_estimation.io.messages`.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.io.bag_source import READER_ERRORS, BagSource, checksum_of, open_bag
from ride_estimation.io.bags_bulk import Layout, TopicMessages
from ride_estimation.io.cdr import DecodedTopic, has_fixed_layout
from ride_estimation.io.messages import (
    GYRO_NOT_PROVIDED,
    INVALID_COVARIANCE,
    LARGEST_VARIANCE,
    NOT_PROVIDED,
    SMALLEST_VARIANCE,
    accepted_types,
    make_converter,
    sensors_by_topic,
)
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_IMU = "sensor_msgs/msg/Imu"
#: first of the doubles of an Imu that belongs to its angular velocity and to its linear acceleration
_ANGULAR, _LINEAR = 13, 25


def read_recording(path: str | Path, vehicle: Vehicle, *, salvage: bool = False) -> Recording:
    """Read the sensors of a vehicle from a recorded run.

    Parameters
    ----------
    path
        rosbag2 folder, ``.mcap``, ``.db3`` or ROS 1 ``.bag``.
    vehicle
        Says which topics belong to which sensor.
    salvage
        Use what is readable of a broken file.

    Raises
    ------
    InputDataError
        Unreadable or empty run, a run without duration, or a configured sensor that contributed nothing (the message says
        which topics there are).
    """
    path = Path(path)
    source = open_bag(path, salvage=salvage)
    if not any(source.counts.values()):
        raise InputDataError(f"{path}: the recording contains no messages")
    by_topic = sensors_by_topic(vehicle.sensors.values())
    collected, damage = source.read({t: _layout(source, t, sensors) for t, sensors in by_topic.items() if t in source.types})
    ignored: Counter[str] = Counter()
    for topic, count in sorted(source.counts.items()):
        if topic not in by_topic and count:
            ignored[f"topic {topic} ({source.types[topic]}) belongs to no sensor of the vehicle file"] = count
    if not by_topic:
        topics = ", ".join(f"{t} ({n} messages)" for t, n in sorted(source.counts.items()) if n)
        raise InputDataError(f"{path}: the vehicle file has no sensors, so nothing can be read; topics: {topics}")
    channels: dict[str, Channel] = {}
    for topic, sensors in by_topic.items():
        if topic in collected:
            channels.update(_channels(source, topic, sensors, collected[topic], ignored))
    missing = [s for s in vehicle.sensors.values() if s.name not in channels or not len(channels[s.name].stamp_ns)]
    if missing:
        raise InputDataError(_missing_text(path, source, missing, ignored))
    recording = Recording(
        name=str(path),
        channels={name: dataclasses.replace(channels[name], correction=s.correction) for name, s in vehicle.sensors.items()},
        checksum=checksum_of(path),
        ignored=dict(ignored),
        warnings=(*source.warnings, *damage),
    )
    if all(np.ptp(c.stamp_ns) == 0 for c in recording.channels.values()):
        zero = all(np.all(c.stamp_ns == 0) for c in recording.channels.values())
        why = "every header stamp is zero: the drivers set none" if zero else "every sensor has one stamp only"
        raise InputDataError(f"{path}: the recording lasts 0 s ({why})")
    return recording


def iterate_messages(
    path: str | Path, topics: Collection[str] = (), *, salvage: bool = False
) -> Iterator[tuple[str, str, int, Any]]:
    """Yield (topic, message type, receive time [ns], message object) in order of arrival.

    Parameters
    ----------
    path
        A run as in :func:`read_recording`.
    topics
        Topics wanted; all topics of readable type where empty.
    salvage
        Use what is readable of a broken file.
    """
    source = open_bag(Path(path), salvage=salvage)
    known = {topic: kind for topic, kind in source.types.items() if accepted(kind)}
    wanted = [topic for topic in (topics or known) if topic in known and (topics or topic not in source.unreadable)]
    try:
        for topic, arrival, raw in source.messages(wanted):
            yield topic, known[topic], arrival, source.deserialize(raw, known[topic])
    except RideEstimationError:
        raise
    except READER_ERRORS as error:
        raise InputDataError(f"{path}: damaged: {error or type(error).__name__}") from error


def accepted(message_type: str) -> bool:
    """Return whether a message type can feed any kind of sensor."""
    return any(message_type in accepted_types(kind) for kind in ("accelerometer", "imu", "displacement", "speed", "force"))


def _layout(source: BagSource, topic: str, sensors: Sequence[Sensor]) -> Layout | None:
    """Return how the messages of a topic are decoded in bulk, None where they are not."""
    kind = source.types[topic]
    if not (source.little_endian_cdr and len(sensors) == 1 and has_fixed_layout(kind)):
        return None
    if kind != _IMU:
        return Layout(kind, 0)
    return Layout(kind, _ANGULAR if sensors[0].kind == "imu" else _LINEAR)


def _channels(
    source: BagSource, topic: str, sensors: Sequence[Sensor], entry: TopicMessages, ignored: Counter[str]
) -> dict[str, Channel]:
    """Return the channels of one topic; refused samples are counted in ``ignored``."""
    message_type = source.types[topic]
    if make_converter(message_type, sensors) is None:
        kinds = accepted_types(sensors[0].kind)
        what = f"topic {topic}: type {message_type} cannot feed a sensor of kind {sensors[0].kind} (allowed: {', '.join(kinds)})"
        ignored[what] += len(entry.order)
        return {}
    if entry.decoded is None:
        return _channels_one_by_one(source, message_type, sensors, entry, ignored)
    channel = _bulk_channel(message_type, sensors[0], entry, entry.decoded, ignored)
    if not len(entry.raw):
        return {sensors[0].name: channel}
    extra = _channels_one_by_one(source, message_type, sensors, entry, ignored)
    return {sensors[0].name: _merged(channel, extra[sensors[0].name])}


def _bulk_channel(
    message_type: str, sensor: Sensor, entry: TopicMessages, decoded: DecodedTopic, ignored: Counter[str]
) -> Channel:
    """Return the channel of the messages decoded in bulk."""
    fields = decoded.fields
    variance: Array | None = None
    keep = np.ones(len(fields), dtype=np.bool_)
    if message_type == _IMU:
        linear = fields[:, -12:]
        values = linear[:, :3]
        variance, reasons = _judge_covariances(linear[:, 3:], sensor.trust_despite_minus_one, sensor.noise_std**2)
        refused = {NOT_PROVIDED: reasons == 1, INVALID_COVARIANCE: reasons == 2}
        if sensor.kind == "imu":
            values = np.hstack([values, fields[:, :3]])
            spread, why = _judge_covariances(fields[:, 3:12], sensor.trust_despite_minus_one, sensor.gyro_noise_std**2)
            variance = _joined_variance(variance, spread, sensor)
            refused[GYRO_NOT_PROVIDED] = (why == 1) & (reasons == 0)
            refused[INVALID_COVARIANCE] = refused[INVALID_COVARIANCE] | ((why == 2) & (reasons == 0))
        for reason, mask in refused.items():
            count = int(np.sum(mask))
            if count:
                ignored[f"{sensor.name}: {reason}"] += count
            keep &= ~mask
    else:
        values = fields[:, : sensor.channels]
    values = sensor.only_measured(values)
    return Channel(
        name=sensor.name,
        stamp_ns=decoded.stamp_ns[keep],
        values=np.ascontiguousarray(values[keep]),
        arrival_ns=entry.arrival[decoded.decoded][keep],
        variance=None if variance is None else np.ascontiguousarray(variance[keep]),
        frame_id=decoded.frame_id,
        order=entry.order[decoded.decoded][keep],
    )


def _judge_covariances(covariance: Array, trusted: bool, noise: float) -> tuple[Array | None, NDArray[np.int64]]:
    """Return (variance per axis (N, 3) or None, reason per message: 0 fine, 1 not provided, 2 invalid); NaN rows: not stated."""
    diagonal = covariance[:, [0, 4, 8]]
    unknown = np.all(diagonal == 0.0, axis=1)
    absent = ~unknown & ((diagonal[:, 0] == -1.0) | np.isnan(diagonal[:, 0]))
    possible = (diagonal == 0.0) | ((diagonal >= SMALLEST_VARIANCE) & (diagonal <= LARGEST_VARIANCE))
    invalid = ~unknown & ~absent & ~np.all(possible, axis=1)
    reasons = np.where(absent, 1, np.where(invalid, 2, 0)) * (0 if trusted else 1)
    stated = ~(unknown | absent | invalid)
    if not np.any(stated):
        return None, reasons
    variance = np.where(diagonal == 0.0, noise, diagonal)
    variance[~stated] = np.nan
    return variance, reasons


def _joined_variance(variance: Array | None, spread: Array | None, sensor: Sensor) -> Array | None:
    if variance is None and spread is None:
        return None
    known = variance if variance is not None else spread
    rows = len(known) if known is not None else 0
    first = np.full((rows, 3), np.nan) if variance is None else variance
    second = np.full((rows, 3), np.nan) if spread is None else spread
    neither = np.isnan(first[:, 0]) & np.isnan(second[:, 0])
    both = np.hstack([
        np.where(np.isnan(first), sensor.noise_std**2, first), np.where(np.isnan(second), sensor.gyro_noise_std**2, second)
    ])
    both[neither] = np.nan
    return both


def _channels_one_by_one(
    source: BagSource, message_type: str, sensors: Sequence[Sensor], entry: TopicMessages, ignored: Counter[str]
) -> dict[str, Channel]:
    """Return the channels of the messages of a topic that were not decoded in bulk, through message objects."""
    convert = make_converter(message_type, sensors)
    rows: dict[str, list[tuple[int, int, int, tuple[float, ...], tuple[float, ...] | None]]] = {s.name: [] for s in sensors}
    frame = ""
    for number, raw in entry.raw:
        order, arrival = int(entry.order[number]), int(entry.arrival[number])
        try:
            message = source.deserialize(raw, message_type)
            samples = convert(message) if convert is not None else ()
        except READER_ERRORS:
            ignored[f"{sensors[0].name}: message_not_decodable"] += 1
            continue
        frame = frame or str(message.header.frame_id)
        for sample in samples:
            if sample.rejection:
                ignored[f"{sample.sensor}: {sample.rejection}"] += 1
            else:
                rows[sample.sensor].append((order, arrival, sample.stamp_ns, sample.values, sample.variance))
    return {s.name: _channel_from_rows(s, rows[s.name], frame) for s in sensors}


def _channel_from_rows(
    sensor: Sensor, rows: Sequence[tuple[int, int, int, tuple[float, ...], tuple[float, ...] | None]], frame: str
) -> Channel:
    variance: Array | None = None
    if any(row[4] is not None for row in rows):
        unknown = (np.nan,) * sensor.channels
        variance = np.array([row[4] or unknown for row in rows], dtype=float)
    return Channel(
        name=sensor.name,
        stamp_ns=np.array([row[2] for row in rows], dtype=np.int64),
        values=np.array([row[3] for row in rows], dtype=float).reshape(len(rows), sensor.channels),
        arrival_ns=np.array([row[1] for row in rows], dtype=np.int64),
        variance=variance,
        frame_id=frame,
        order=np.array([row[0] for row in rows], dtype=np.int64),
    )


def _merged(first: Channel, second: Channel) -> Channel:
    """Return two parts of one channel in order of arrival."""
    places = [c.order if c.order is not None else c.arrival_ns for c in (first, second)]
    by_arrival = np.argsort(np.concatenate(places), kind="stable")
    variance: Array | None = None
    if first.variance is not None or second.variance is not None:
        parts = [np.full(c.values.shape, np.nan) if c.variance is None else c.variance for c in (first, second)]
        variance = np.vstack(parts)[by_arrival]
    return Channel(
        name=first.name,
        stamp_ns=np.concatenate([first.stamp_ns, second.stamp_ns])[by_arrival],
        values=np.vstack([first.values, second.values])[by_arrival],
        arrival_ns=np.concatenate([first.arrival_ns, second.arrival_ns])[by_arrival],
        variance=variance,
        frame_id=first.frame_id or second.frame_id,
        order=np.concatenate(places)[by_arrival],
    )


def _missing_text(path: Path, source: BagSource, missing: Sequence[Sensor], ignored: Counter[str]) -> str:
    lines = []
    for sensor in missing:
        if sensor.topic not in source.types:
            why = f"the run has no topic {sensor.topic}"
        else:
            own = (f"{sensor.name}:", f"topic {sensor.topic}:")
            reasons = [f"{reason} ({n})" for reason, n in ignored.items() if reason.startswith(own)]
            empty = f"topic {sensor.topic} has no messages"
            if sensor.element and source.counts[sensor.topic]:
                empty = f"no message of {sensor.topic} names {sensor.element!r}"
            why = "; ".join(reasons) or empty
        lines.append(f"  - {sensor.name}: {why}")
    there = [f"{topic} ({source.types[topic]}, {count} messages)" for topic, count in sorted(source.counts.items())]
    sensors = "1 sensor" if len(missing) == 1 else f"{len(missing)} sensors"
    return (
        f"{path}: {sensors} of the vehicle file contributed nothing\n" + "\n".join(lines)
        + f"\n  topics in the run: {', '.join(there)}"
    )
