# Copyright 2026 ride_estimation contributors
"""``ride-estimation import-file``: a measurement file of another program to a bag that every other command takes."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.files.channel_map import default_map, load_channel_map
from ride_estimation.io.files.conversion import recording_from_file
from ride_estimation.io.files.formats import READ_SUFFIXES, read_measurement_file
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.quality import judge_sensors

HELP = "make a bag of an MDF4, TDMS, RPC III, LabVIEW (.lvm), CSV or Parquet file"
EXAMPLES = """\
  ride-estimation import-file run.mf4 --vehicle my_truck.yaml --channels channels.yaml --out run_bag
  ride-estimation import-file run.csv --vehicle my_truck.yaml --out run_bag     (columns named cab_front_left.x [m/s^2], ...)

CSV: comma, semicolon or tab; decimal comma beside the latter two; "name [unit]" or a second line of units; lines above the
header and columns of text are passed over. Time: a column called time, t, timestamp, ... with its unit in the heading or the
name (Time_ms), seconds where that says nothing.

a channel map says which channel is which component of which sensor:
  schema: ride_estimation/channels/1
  channels:
    cab_front_left.x: AccFL_X                                      unit as the file states it
    cab_front_left.y: {channel: AccFL_Y, unit: g, factor: -1.0}    unit and sign said here
  time: {channel: Time_1, unit: ms}        only where the file does not say it; or {rate_hz: 500}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("file", type=Path, metavar="FILE", help=f"measurement file: {', '.join(READ_SUFFIXES)}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file with the sensors")
    parser.add_argument("--channels", type=Path, metavar="MAP.yaml", help="channel map (default: names as an export writes them)")
    parser.add_argument("--out", required=True, type=Path, metavar="BAG", help="folder of the bag; never overwritten")


def run(options: argparse.Namespace) -> int:
    """Read, map, write."""
    vehicle = load_vehicle(options.vehicle)
    channels = default_map(vehicle.sensors) if options.channels is None else load_channel_map(options.channels, vehicle.sensors)
    file = read_measurement_file(options.file, channels.time)
    if options.channels is None:
        # a file that was exported with fewer sensors is complete in itself
        there = {channel.name for channel in file.channels} | set(file.unreadable)
        channels = type(channels)({name: source for name, source in channels.sources.items() if name in there})
    recording = recording_from_file(file, vehicle.sensors, channels)
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
