# Copyright 2026 ride_estimation contributors
"""Time and size of the report of a one-minute run with eight accelerometers and four mounts (target: 5 s, 4 MB).

``python benchmarks/report_speed.py [SECONDS]`` prints replay, report as HTML and as PDF; processor time, and wall time beside.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.api.replaying import replay
from ride_estimation.api.runs import read_run
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.reporting.formats import write_page
from ride_estimation.resources import shared_path
from ride_estimation.signals.recording import Channel, Recording


def longer(recording: Recording, seconds: float) -> Recording:
    """Return the recording repeated until it lasts as long as asked."""
    first = min(int(c.stamp_ns.min()) for c in recording.channels.values())
    last = max(int(c.stamp_ns.max()) for c in recording.channels.values())
    period = last - first + 5_000_000
    count = max(round(seconds * 1e9 / period), 1)
    channels = {}
    for name, c in recording.channels.items():
        stamps = np.concatenate([c.stamp_ns + k * period for k in range(count)])
        channels[name] = Channel(name, stamps, np.tile(c.values, (count, 1)), stamps)
    return Recording(recording.name, channels)


def timed(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return result, processor time and wall time of a call."""
    wall, own = time.perf_counter(), time.process_time()
    found = call()
    return found, time.process_time() - own, time.perf_counter() - wall


def main() -> None:
    """Measure."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    vehicle = load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml"))
    source = read_recording(shared_path("bags", "rough_with_bumps", "bag"), vehicle)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_bag(folder / "bag", longer(source, seconds), vehicle.sensors)
        replay(read_run(folder / "bag", vehicle, end_s=5.0))  # compiles the kernels
        found, own, wall = timed(lambda: replay(read_run(folder / "bag", vehicle)))
        lasts = found.document["run"]["duration_s"]
        print(f"run of {lasts:.0f} s, {len(vehicle.sensors)} sensors, load {os.getloadavg()[0]:.1f}")
        print(f"replay  {own:6.2f} s processor, {wall:6.2f} s wall (reading, estimating, smoothing, damage and comfort)")
        page, composing, wall = timed(found.page)
        print(f"page    {composing:6.2f} s processor, {wall:6.2f} s wall (spectra, loops and figures, not yet drawn)")
        for kind in ("html", "pdf"):
            _, own, wall = timed(lambda one=kind: write_page(page, folder, (one,)))
            size = (folder / f"report.{kind}").stat().st_size / 1e6
            print(f"{kind:<8}{own:6.2f} s processor, {wall:6.2f} s wall, {size:.2f} MB")


if __name__ == "__main__":
    main()
