# Copyright 2026 ride_estimation contributors
"""``run.mcap``: the inputs of a replay beside what the node would have published live, and the bounds, for any MCAP viewer.

Topics of the node are bit by bit those of a live run (:mod:`ride_estimation.io.estimate_messages` makes both). Beside them stand
the ends of the 95 % intervals as series of their own, because no common viewer draws a band, and the smoothed forces.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores

from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.io.atomic import replacing
from ride_estimation.io.bag_source import type_store
from ride_estimation.io.bag_writer import by_arrival, serialized_inputs
from ride_estimation.io.estimate_messages import INERTIA_TOPIC, PARAMETERS_TOPIC, EstimateMessages, Frames, acceleration, wrench
from ride_estimation.io.force_arrows import ARROWS_TOPIC, ForceArrows, static_transforms
from ride_estimation.io.message_form import MessageForm
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Body, Vehicle

Array = NDArray[np.float64]
#: topic, message type, times [ns], messages
Series = tuple[str, str, Sequence[int], Iterator[bytes]]

#: name of the node as it starts by itself, and of the series that only a recording has
NODE, BOUNDS, SMOOTHED = "/ride/estimator", "/ride/bounds", "/ride/smoothed"
#: half width of a 95 % interval in standard deviations
_HALF_95 = 1.96


def write_run_mcap(path: Path, recording: Recording, vehicle: Vehicle, body: Body, run: OfflineRun) -> None:
    """Write the file.

    Parameters
    ----------
    path
        File to write.
    recording, vehicle
        What was replayed with what.
    body
        Whose loads were estimated.
    run
        What was found.

    Raises
    ------
    OSError
        The disk is full, no permission...
    """
    frames = Frames()
    known = Recording(recording.name, {name: c for name, c in recording.channels.items() if name in vehicle.sensors})
    series = [
        *serialized_inputs(known, vehicle.sensors, {}), *_published(run, vehicle, body, frames), *_bounds(run, frames),
    ]  # fmt: skip
    with replacing(path) as new, tempfile.TemporaryDirectory(dir=new.parent) as place:
        writer = Writer(Path(place) / "bag", version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            store = type_store(Stores.ROS2_JAZZY)
            jobs = [(writer.add_connection(topic, kind, typestore=store), times, found) for topic, kind, times, found in series]
            for connection, time_ns, message in by_arrival(jobs):
                writer.write(connection, time_ns, message)
        shutil.move(Path(place) / "bag" / "bag.mcap", new)


def _published(run: OfflineRun, vehicle: Vehicle, body: Body, frames: Frames) -> Iterator[Series]:
    """Yield what the node would have published, each message at the time of its stamp."""
    messages, arrows = EstimateMessages(run.mount_names, frames), ForceArrows(vehicle, body.name, run.mount_names, frames)
    times: list[int] = []
    of_topics: list[list[bytes]] = [[] for _ in messages.topics]
    drawn: list[tuple[int, bytes]] = []
    for block in run.blocks:
        ticks = np.flatnonzero(block.publishable()).tolist()
        times += block.stamp_ns[ticks].tolist()
        for found, more in zip(of_topics, messages.ticks(block, ticks)):
            found.extend(more)
        arrow = arrows.message(block, ticks)
        if arrow is not None:
            drawn.append((int(block.stamp_ns[ticks[-1]]), arrow))
    for (name, kind), found in zip(messages.topics.items(), of_topics):
        yield f"{NODE}/{name}", kind, times, iter(found)
    stamps = [report.stamp_ns for report in run.reports]
    yield f"{NODE}/{PARAMETERS_TOPIC}", "diagnostic_msgs/msg/DiagnosticArray", stamps, iter(
        [messages.parameters(r.stamp_ns, body, r.parameters) for r in run.reports]
    )
    yield f"{NODE}/{INERTIA_TOPIC}", "geometry_msgs/msg/InertiaStamped", stamps, iter(
        [messages.inertia(r.stamp_ns, body, r.inertia, r.parameters) for r in run.reports]
    )
    yield f"{NODE}/{ARROWS_TOPIC}", "visualization_msgs/msg/MarkerArray", [t for t, _ in drawn], (m for _, m in drawn)
    first = int(run.stamp_ns[0])
    yield "/tf_static", "tf2_msgs/msg/TFMessage", [first], iter([static_transforms(vehicle, body.name, frames, first)])


def _bounds(run: OfflineRun, frames: Frames) -> Iterator[Series]:
    """Yield lower and upper ends of the 95 % intervals, and the smoothed forces with theirs."""
    good = np.flatnonzero(run.valid)
    stamps = run.stamp_ns[good]
    times = stamps.tolist()
    form = MessageForm(lambda stamp, n: acceleration(stamp, frames.cg, n), 6)
    values, half = run.signals["cg_accel"][good], _HALF_95 * run.signals["cg_accel_std"][good]
    for word, sign in (("lower", -1.0), ("upper", 1.0)):
        yield f"{BOUNDS}/cg_accel_{word}", form.type_name, times, iter(form.fill(stamps, values + sign * half))
    later = None if isinstance(run.smoothed, str) else run.smoothed
    for number, mount in enumerate(run.mount_names):
        form = _force_form(f"{frames.mount_prefix}{mount}")
        live = (BOUNDS, run.signals["mount_force"], run.signals["mount_force_std"], (-1.0, 1.0))
        for place, force, std, signs in (live, *([(SMOOTHED, later.force, later.std, (0.0, -1.0, 1.0))] if later else [])):
            for sign in signs:
                word = {0.0: "force", -1.0: "force_lower", 1.0: "force_upper"}[sign]
                shown = force[good, number] + sign * _HALF_95 * std[good, number]
                yield f"{place}/mounts/{mount}/{word}", form.type_name, times, iter(form.fill(stamps, shown))


def _force_form(frame_id: str) -> MessageForm:
    return MessageForm(lambda stamp, n: wrench(stamp, frame_id, n), 3)
