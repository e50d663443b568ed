# Copyright 2026 ride_estimation contributors
"""Serialized messages as the live node receives them, damaged: decoded and observed by one estimator that goes on and on."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fuzz.recordings import START
from fuzz.targets import Target
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path

#: inputs after which the estimator begins anew
_FRESH = 2000


def imu_payload(stamp_ns: int, acceleration: np.ndarray) -> bytes:
    """Return a ``sensor_msgs/msg/Imu`` as little-endian CDR (XCDR1: doubles aligned to 8 behind the encapsulation)."""
    head = struct.pack("<iII", stamp_ns // 10**9, stamp_ns % 10**9, 4) + b"cab\0"
    numbers = [0.0, 0.0, 0.0, 1.0, -1.0, *[0.0] * 8, *[0.0] * 3, *[0.0] * 9, *acceleration, *[0.0] * 9]
    return b"\x00\x01\x00\x00" + head + struct.pack("<37d", *numbers)


def _seeds(folder: Path) -> list[bytes]:
    from ride_estimation.estimation.common.settings import PipelineSettings
    from ride_estimation.estimation.warm_up import warm_up

    # to compile takes longer than an answer may
    warm_up(load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml")), PipelineSettings())
    rng = np.random.default_rng(0)
    return [imu_payload(START + k * 2_000_000, np.array([0.0, 0.0, 9.81]) + rng.normal(size=3)) for k in range(8)]


def _consumer() -> Callable[[Path, Path], None]:
    from ride_estimation.estimation.common.settings import PipelineSettings
    from ride_estimation.nodes.session import Session

    kept: list[Session] = []
    count = [0]

    def consume(file: Path, folder: Path) -> None:
        if not kept or count[0] % _FRESH == 0:
            kept[:] = [Session(load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml")), PipelineSettings())]
        session = kept[0]
        topics = list(session.topics)
        bad = topics[count[0] % len(topics)]
        count[0] += 1
        # stamps go on while the damaged message comes in between good ones
        stamp = START + count[0] * 10_000_000
        rng = np.random.default_rng(count[0])
        for topic in topics:
            payload = file.read_bytes() if topic == bad else imu_payload(stamp, np.array([0.0, 0.0, 9.81]) + rng.normal(size=3))
            for block in session.receive(topic, "sensor_msgs/msg/Imu", payload):
                usable = block.publishable()
                assert np.isfinite(block.mount_force[usable]).all()
        if count[0] % 200 == 0:
            for _ in session.statuses():
                pass
            assert all(np.isfinite(p.value) and np.isfinite(p.std) for p in session.pipeline.parameters())

    return consume


def live_targets() -> dict[str, Target]:
    """Return the target of the live messages, none where ROS is not installed."""
    if importlib.util.find_spec("rclpy") is None:
        return {}
    words = (
        struct.pack("<d", float("nan")),
        struct.pack("<d", 1e308),
        struct.pack("<d", -1e200),
        struct.pack("<d", 1e18),
        b"\x00\x00\x00\x00",
    )
    return {"live": Target(".cdr", _seeds, _consumer(), words)}
