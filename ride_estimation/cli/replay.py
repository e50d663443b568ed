# Copyright 2026 ride_estimation contributors
"""``ride-estimation replay``: a recorded run through the code that runs live, with results and report."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ride_estimation.api.runs import read_run, require_layout
from ride_estimation.assessment.durability import DEFAULT_SLOPE, checked_slope
from ride_estimation.cli.parts import part_of_options
from ride_estimation.cli.progress import Progress
from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.compile_ahead import compile_ahead
from ride_estimation.io.result_files import read_diagnosis
from ride_estimation.io.results import output_folder
from ride_estimation.io.settings_file import load_settings
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.vehicle import Vehicle

#: usual share of the time by stage
_STAGES = {"reading": 0.02, "estimating": 0.58, "smoothing": 0.05, "report": 0.35}


@dataclasses.dataclass(frozen=True)
class ReplayJob:
    """Everything a replay needs beside the recording; one object serves many runs.

    Attributes
    ----------
    vehicle, settings
        What is known, how to estimate.
    salvage
        Use what is readable of a damaged file.
    slope
        Of the damage line.
    daily_exposure_s
        For A(8) and VDV [s].
    formats
        Of the report: html, pdf, png.
    smoothing
        Whether forces are made again with the whole run known.
    part
        Begin and end of what is used of the run: seconds since its first stamp or markers, None for the whole.
    channels
        Channel map of a measurement file.
    events
        Table of markers.
    mcap
        Whether ``run.mcap`` is written.
    """

    vehicle: Vehicle
    settings: PipelineSettings
    salvage: bool = False
    slope: float = DEFAULT_SLOPE
    daily_exposure_s: float = 8.0 * 3600.0
    formats: tuple[str, ...] = ("html",)
    smoothing: bool = True
    part: tuple[float | str | None, float | str | None] = (None, None)
    channels: str = ""
    events: str = ""
    mcap: bool = False

    @classmethod
    def of(cls, options: argparse.Namespace, formats: Sequence[str]) -> ReplayJob:
        """Return the job of a command line.

        Raises
        ------
        ConfigurationError
            Mistakes in the vehicle file, the settings or the numbers given.
        """
        vehicle = without_sensors(load_vehicle(options.vehicle), options.without)
        settings = load_settings(options.settings) if options.settings else PipelineSettings()
        if options.rate is not None:
            settings = dataclasses.replace(settings, rate_hz=options.rate)
        if not 0.0 < options.daily_hours <= 24.0:
            raise ConfigurationError(f"--daily-hours {options.daily_hours:g}; allowed: more than 0, at most 24")
        chosen = tuple(f for f in dict.fromkeys(formats) if f != "none")
        slope = DEFAULT_SLOPE if options.slope is None else checked_slope(options.slope)
        return cls(
            vehicle, settings, options.salvage, slope, 3600.0 * options.daily_hours, chosen,
            not options.no_smoothing, part_of_options(options), options.channels, options.events, getattr(options, "mcap", False),
        )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Replay one run."""
    if "none" in options.format and len(options.format) > 1:
        raise ConfigurationError(f"--format {' '.join(options.format)}: none stands alone")
    job = ReplayJob.of(options, ("none",) if options.no_report else options.format)
    diagnosis = read_diagnosis(options.diagnosis) if options.diagnosis else None
    require_layout(job.vehicle)
    folder = output_folder(options.out)
    with Progress("replay", shares=_STAGES) as progress:
        _, text, written = replay_run(options.recording, job, folder, diagnosis, progress.advance, progress.begin)
    print(text)
    print(f"written to {folder}: {', '.join(written)}")
    return 0


def replay_run(
    path: str | Path,
    job: ReplayJob,
    folder: Path,
    diagnosis: Mapping[str, Any] | None = None,
    advance: Callable[[int, int], None] = lambda done, total: None,
    begin: Callable[[str], None] = lambda stage: None,
) -> tuple[dict[str, Any], str, list[str]]:
    """Replay a recording and write the results.

    Parameters
    ----------
    path
        Recording.
    job
        What to do with it.
    folder
        Existing folder for the results.
    diagnosis
        Content of a ``diagnosis.json``.
    advance
        Called with samples done since the last call and samples in all.
    begin
        Called with the name of every stage as it begins.

    Returns
    -------
    tuple
        Content of ``result.json``, the summary in words, names of the files written.
    """
    begin("reading")
    run = read_run(
        path, job.vehicle, start_s=job.part[0], end_s=job.part[1], salvage=job.salvage, channels=job.channels, events=job.events
    )
    # importing and compiling take time: whoever named a wrong file need not wait for them
    from ride_estimation.api.replaying import replay

    compile_ahead(begin)
    found = replay(
        run, settings=job.settings, slope=job.slope, daily_exposure_s=job.daily_exposure_s, smoothing=job.smoothing,
        advance=advance, begin=begin,
    )  # fmt: skip
    begin("report" if job.formats else "writing results")
    written = found.save(folder, job.formats, diagnosis, job.mcap)
    return found.document, found.summary(), written


def without_sensors(vehicle: Vehicle, names: Sequence[str]) -> Vehicle:
    """Return the vehicle without some of its sensors.

    Raises
    ------
    ConfigurationError
        A name that is no sensor of the vehicle.
    """
    unknown = [name for name in names if name not in vehicle.sensors]
    if unknown:
        known = ", ".join(vehicle.sensors)
        raise ConfigurationError([f"--without {name}: no such sensor; there are {known}" for name in unknown])
    return dataclasses.replace(vehicle, sensors={k: v for k, v in vehicle.sensors.items() if k not in names})
