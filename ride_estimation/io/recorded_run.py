# Copyright 2026 ride_estimation contributors
"""A recorded run of any kind: a bag, or a measurement file of another program whose channels a map assigns to sensors."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.bag_source import checksum_of
from ride_estimation.io.bags import read_recording
from ride_estimation.io.files.channel_map import ChannelMap, default_map, load_channel_map
from ride_estimation.io.files.conversion import recording_from_file
from ride_estimation.io.files.formats import read_measurement_file
from ride_estimation.io.files.suffixes import READ_SUFFIXES
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle


def is_measurement_file(path: Path) -> bool:
    """Return whether a path is a file of a logger by its ending, not a bag."""
    return path.suffix.lower() in READ_SUFFIXES and not path.is_dir()


def read_recorded_run(path: str | Path, vehicle: Vehicle, *, channels: str | Path = "", salvage: bool = False) -> Recording:
    """Read the sensors of a vehicle from a bag or a measurement file.

    Parameters
    ----------
    path
        rosbag2 folder, ``.mcap``, ``.db3``, ROS 1 ``.bag``, or a measurement file (MDF4, TDMS, RPC III, LabVIEW, CSV, Parquet).
    vehicle
        Says which sensors there are.
    channels
        Channel map of a measurement file; without it its channels must have the names an export writes.
    salvage
        Use what is readable of a broken bag.

    Raises
    ------
    InputDataError
        Unreadable file, or a sensor of the vehicle without data.
    ConfigurationError
        Mistakes in the channel map, or one for a bag.
    """
    path = Path(path)
    if not is_measurement_file(path):
        if channels:
            raise ConfigurationError(f"--channels {channels}: {path} is a bag; its topics are in the vehicle file")
        return read_recording(path, vehicle, salvage=salvage)
    if not path.exists():
        raise InputDataError(f"{path}: does not exist")
    recording = read_mapped(path, vehicle, channels)
    missing = [name for name in vehicle.sensors if name not in recording.channels]
    if missing:
        why = f"no channel for {', '.join(missing)}"
        raise InputDataError(f"{path}: {why}; map them (--channels), or leave the sensors out (replay --without)")
    return recording


def read_mapped(path: Path, vehicle: Vehicle, channels: str | Path = "") -> Recording:
    """Return the sensors that a measurement file has channels for.

    Parameters
    ----------
    path
        Measurement file.
    vehicle
        Says which sensors there are.
    channels
        Channel map; without it channels must have the names an export writes, and a file of fewer sensors is complete in itself.

    Raises
    ------
    RideEstimationError
        As in :func:`read_recorded_run`.
    """
    chosen = load_channel_map(Path(channels), vehicle.sensors) if channels else default_map(vehicle.sensors)
    file = read_measurement_file(path, chosen.time)
    if not channels:
        there = {channel.name for channel in file.channels} | set(file.unreadable)
        chosen = ChannelMap({name: source for name, source in chosen.sources.items() if name in there})
    recording = recording_from_file(file, vehicle.sensors, chosen)
    known = vehicle.sensors
    corrected = {name: dataclasses.replace(c, correction=known[name].correction) for name, c in recording.channels.items()}
    return dataclasses.replace(recording, checksum=checksum_of_run(path), channels=corrected)


def checksum_of_run(path: Path) -> str:
    """Return the SHA-256 of the files of a run."""
    if not is_measurement_file(path):
        return checksum_of(path)
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputDataError(f"{path}: cannot be read: {error.strerror or error}") from error
