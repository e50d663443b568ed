# Copyright 2026 ride_estimation contributors
"""Mount forces as arrows and the frames of a vehicle file as fixed transforms, for 3D viewers; serialized, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.output import Ticks
from ride_estimation.io.estimate_messages import Frames, header, new, vector
from ride_estimation.io.message_form import MessageForm, serialized
from ride_estimation.vehicles.published_frames import published_frames
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

ARROWS_TOPIC = "mounts/arrows"
#: an eye follows ten arrows a second; each is wiped when the next ones do not come [s]
PERIOD_S, LIFETIME_S = 0.1, 0.5
#: length of an arrow that carries an equal share of the weight [m]
SHARE_LENGTH_M = 0.5
_ARROW = 0
_SHAFT_M, _HEAD_M, _HEAD_LENGTH_M = 0.03, 0.06, 0.08


class ForceArrows:
    """Arrows from the mounts along the force on the body, in the frame of the vehicle file.

    Parameters
    ----------
    vehicle, body, mount_names
        Of the forces, in the order of the (.., M, 3) arrays.
    frames
        Frame names.
    """

    def __init__(self, vehicle: Vehicle, body: str, mount_names: Sequence[str], frames: Frames) -> None:
        self._at = np.array([vehicle.mounts[name].position for name in mount_names]).reshape(-1, 3)
        weight = vehicle.bodies[body].mass.value * vehicle.gravity
        self._scale = SHARE_LENGTH_M * max(len(mount_names), 1) / weight  # [m/N]
        self._shown_ns: int | None = None
        numbers = 6 * len(mount_names)
        self._form = MessageForm(lambda stamp, n: _arrows(stamp, frames.vehicle, mount_names, n), numbers) if numbers else None

    def message(self, block: Ticks, ticks: Sequence[int]) -> bytes | None:
        """Return the arrows of the last of some ticks of a block; None while the last ones are younger than the period."""
        if not len(ticks) or self._form is None:
            return None
        now = int(block.stamp_ns[ticks[-1]])
        if self._shown_ns is not None and 0 <= now - self._shown_ns < round(PERIOD_S * 1e9):
            return None
        self._shown_ns = now
        tips = self._at + self._scale * block.mount_force[ticks[-1]]
        return self._form.fill(np.array([now]), np.hstack([self._at, tips]).reshape(1, -1))[0]


def _arrows(stamp_ns: int, frame_id: str, mount_names: Sequence[str], numbers: Array) -> Any:
    """Return the markers of a stamp; six numbers each: begin and tip [m]."""
    ends = np.asarray(numbers).reshape(len(mount_names), 2, 3)
    arrows = [_arrow(stamp_ns, frame_id, number, name, ends[number]) for number, name in enumerate(mount_names)]
    return new("visualization_msgs/msg/MarkerArray", markers=arrows)


def _arrow(stamp_ns: int, frame_id: str, number: int, name: str, ends: Array) -> Any:
    upright = new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    nothing = np.zeros(0, dtype=np.uint8)
    return new(
        "visualization_msgs/msg/Marker", header=header(stamp_ns, frame_id), ns="mount_force", id=number, type=_ARROW, action=0,
        pose=new("geometry_msgs/msg/Pose", position=_point((0.0, 0.0, 0.0)), orientation=upright),
        scale=vector((_SHAFT_M, _HEAD_M, _HEAD_LENGTH_M)), color=new("std_msgs/msg/ColorRGBA", r=0.04, g=0.41, b=0.85, a=1.0),
        lifetime=new("builtin_interfaces/msg/Duration", sec=0, nanosec=round(LIFETIME_S * 1e9)), frame_locked=False,
        points=[_point(end) for end in ends], colors=[], texture_resource="",
        texture=new("sensor_msgs/msg/CompressedImage", header=header(0, ""), format="", data=nothing), uv_coordinates=[],
        text=name, mesh_resource="", mesh_file=new("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )  # fmt: skip


def _point(values: Any) -> Any:
    return new("geometry_msgs/msg/Point", x=float(values[0]), y=float(values[1]), z=float(values[2]))


def static_transforms(vehicle: Vehicle, body: str, frames: Frames, stamp_ns: int = 0) -> bytes:
    """Return the frames of outputs and sensors below the vehicle frame as a ``tf2_msgs/msg/TFMessage``."""
    found = []
    for frame in published_frames(vehicle, body, frames.cg, frames.mount_prefix):
        x, y, z, w = (float(v) for v in frame.quaternion)
        turned = new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        moved = new("geometry_msgs/msg/Transform", translation=vector(frame.position), rotation=turned)
        above = header(stamp_ns, frames.vehicle)
        found.append(new("geometry_msgs/msg/TransformStamped", header=above, child_frame_id=frame.name, transform=moved))
    return serialized(new("tf2_msgs/msg/TFMessage", transforms=found))
