# Copyright 2026 ride_estimation contributors
"""``ride-estimation import-file``: a measurement file of another program to a bag that every other command takes."""

from __future__ import annotations

import argparse

from ride_estimation.api.runs import part_between
from ride_estimation.cli.parts import part_of_options
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.recorded_run import read_mapped
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.quality import judge_sensors


def run(options: argparse.Namespace) -> int:
    """Read, map, write."""
    vehicle = load_vehicle(options.vehicle)
    whole = read_mapped(options.file, vehicle, options.channels)
    recording = part_between(whole, options.file, *part_of_options(options), options.events)
    write_bag(options.out, recording, vehicle.sensors)
    for reason, count in recording.ignored.items():
        print(f"not used: {reason} ({count} samples)")
    for name, quality in judge_sensors(recording, vehicle.sensors, vehicle.gravity, weight=vehicle.weight).items():
        for finding in quality.findings:
            print(f"{name}: {finding}")
    without = [name for name in vehicle.sensors if name not in recording.channels]
    if without:
        print(f"sensors of the vehicle file without data: {', '.join(without)} (replay --without ...)")
    samples = sum(len(c.stamp_ns) for c in recording.channels.values())
    print(f"{options.out}: {samples} samples of {len(recording.channels)} sensors")
    return 0
