# Copyright 2026 ride_estimation contributors
"""``ride-estimation replay``: a recorded run through the code that runs live, with results and report."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ride_estimation.assessment.durability import DEFAULT_SLOPE, checked_slope
from ride_estimation.assessment.run_assessment import EIGHT_HOURS_S, assess_run
from ride_estimation.cli.progress import Stages
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.compile_ahead import compile_ahead
from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.frames import AXES
from ride_estimation.io.bags import read_recording
from ride_estimation.io.json_file import written_last
from ride_estimation.io.result_files import read_diagnosis
from ride_estimation.io.results import output_folder, result_document, write_signals
from ride_estimation.io.settings_file import load_settings
from ride_estimation.io.vehicle_file import body_layout, load_vehicle
from ride_estimation.reporting.formats import clear_pages, write_page
from ride_estimation.reporting.numbers import plain, with_std
from ride_estimation.reporting.replay_report import replay_page
from ride_estimation.reporting.replay_spectra import tick_rate
from ride_estimation.reporting.side_signals import side_signals
from ride_estimation.sensors.consistency import consistency_findings
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.signals.quality import ChannelQuality
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

HELP = "estimate motion, loads, mount parameters and attachment forces from a recorded run"
EXAMPLES = """\
  ride-estimation replay bags/nominal/bag --vehicle truck_cab --out out/nominal
  ride-estimation replay run.mcap --vehicle my_truck.yaml --out out/run --slope 4 --daily-hours 6 --format html pdf
  ride-estimation replay run.mcap --vehicle my_truck.yaml --out out/run --without cab_rear_left   (a broken sensor)
"""
#: fewer say nothing about any signal
LEAST_TICKS = 8
FORMATS = ("html", "pdf", "png", "none")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help="rosbag2 folder, .mcap, .db3 or ROS 1 .bag file")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for result.json, signals.npz, report.html")
    add_replay_arguments(parser)
    parser.add_argument("--diagnosis", metavar="DIR", help="folder of a diagnosis of this run, to report its ladder of models")
    parser.add_argument(
        "--format", nargs="+", choices=FORMATS, default=["html"], metavar="F",
        help=f"of the report: {', '.join(FORMATS)} (default html; png writes one file per picture)",
    )  # fmt: skip
    parser.add_argument("--no-report", action="store_true", help="write no report, as --format none")


def add_replay_arguments(parser: argparse.ArgumentParser, vehicle_required: bool = True) -> None:
    """Add the options that every command has that replays."""
    parser.add_argument(
        "--vehicle", required=vehicle_required, metavar="V.yaml", help="vehicle file, or the name of a bundled one"
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="rate of the time base [Hz] (default: the fastest sensor)")
    parser.add_argument("--settings", metavar="P.yaml", help="parameter file of the node, to replay with what ran live")
    parser.add_argument("--no-hindsight", action="store_true", help="leave out the second pass over the forces of a finished run")
    parser.add_argument("--without", action="append", default=[], metavar="SENSOR", help="leave a sensor of the vehicle file out")
    parser.add_argument("--salvage", action="store_true", help="use what is readable of a truncated or damaged file")
    parser.add_argument("--slope", type=float, default=DEFAULT_SLOPE, metavar="K", help="of the damage line [-] (default 5)")
    parser.add_argument(
        "--daily-hours", type=float, default=8.0, metavar="H", help="hours a day of this vibration, for A(8) and VDV (default 8)"
    )


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
        Of the report, of :data:`FORMATS`.
    hindsight
        Whether forces are made again with the whole run known.
    """

    vehicle: Vehicle
    settings: PipelineSettings
    salvage: bool = False
    slope: float = DEFAULT_SLOPE
    daily_exposure_s: float = EIGHT_HOURS_S
    formats: tuple[str, ...] = ("html",)
    hindsight: bool = True

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
        return cls(
            vehicle, settings, options.salvage, checked_slope(options.slope), 3600.0 * options.daily_hours, chosen,
            not options.no_hindsight,
        )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Replay one run; see :data:`HELP`."""
    if "none" in options.format and len(options.format) > 1:
        raise ConfigurationError(f"--format {' '.join(options.format)}: none stands alone")
    job = ReplayJob.of(options, ("none",) if options.no_report else options.format)
    diagnosis = read_diagnosis(options.diagnosis) if options.diagnosis else None
    require_layout(job.vehicle, Pipeline(job.vehicle, job.settings))
    stages = Stages()
    compile_ahead(stages.begin)
    folder = output_folder(options.out)
    _, text, written = replay_run(options.recording, job, folder, diagnosis, stages.advance, stages.begin)
    stages.close()
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
    vehicle = job.vehicle
    pipeline = Pipeline(vehicle, job.settings)
    require_layout(vehicle, pipeline)
    begin("reading")
    recording = read_recording(path, vehicle, salvage=job.salvage)
    samples = sum(len(c.stamp_ns) for c in recording.channels.values())
    begin("estimating")
    result = run_offline(recording, pipeline, lambda done: advance(done, samples), job.hindsight, begin)
    if len(result.stamp_ns) < LEAST_TICKS:
        raise InputDataError(f"{path}: the run holds {len(result.stamp_ns)} ticks of the time base; {LEAST_TICKS} are needed")
    left_out = {name: s.refused for name, s in result.health.sensors.items()}
    quality = judge_sensors(recording, vehicle.sensors, vehicle.gravity, weight=vehicle.weight, left_out=left_out)
    warnings = all_warnings(recording, vehicle, quality, result)
    layout = body_layout(vehicle, pipeline.arrangement.body.name).sentence(pipeline.arrangement.body.name)
    side = side_signals(recording, vehicle, result)
    assessment = assess_run(
        result.mount_names, result.force, result.force_std, result.valid, tick_rate(result),
        side.accelerations, side.cells, job.slope, job.daily_exposure_s,
        mass_relative_std(result, pipeline.arrangement.body.name),
    )  # fmt: skip
    document = result_document(recording, vehicle, result, quality, warnings, (layout,), assessment, job.settings)
    document["inertia_kg_m2"] = pipeline.loads.moments(pipeline.arrangement.body)
    clear_pages(folder)
    begin("writing results and report" if job.formats else "writing results")
    written = ["result.json", "signals.npz"]
    with written_last(folder / "result.json", document):
        document["signals_sha256"] = write_signals(folder / "signals.npz", result)
        if job.formats:
            page = replay_page(recording, vehicle, result, quality, document, side, assessment, diagnosis)
            written += write_page(page, folder, job.formats)
    text = f"{summary(recording, result, (*warnings,), layout)}\n{inertia_words(document['inertia_kg_m2'])}"
    return document, text, written


def inertia_words(inertia: Mapping[str, Mapping[str, float]]) -> str:
    """Return the moments of inertia the loads were computed with, beside those of the vehicle file."""
    listed = ", ".join(f"{n} {v['value']:.4g} +- {v['std']:.2g} (file {v['file']:.4g})" for n, v in inertia.items())
    return f"inertia in use [kg m^2]: {listed}"


def mass_relative_std(result: OfflineRun, body: str) -> float:
    """Return the relative standard deviation of the mass of the body, 0 where it is not among the parameters."""
    for estimate in result.parameters:
        if estimate.name == f"{body}.mass" and estimate.value > 0.0 and math.isfinite(estimate.std):
            return estimate.std / estimate.value
    return 0.0


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


def require_layout(vehicle: Vehicle, pipeline: Pipeline) -> None:
    """Refuse a layout that cannot tell the motion of the body.

    Raises
    ------
    ConfigurationError
        Names what is not determined.
    """
    body = pipeline.arrangement.body.name
    check = body_layout(vehicle, body)
    if not check.complete:
        raise ConfigurationError(check.sentence(body), where=f"sensor layout of {vehicle.name}")


def all_warnings(
    recording: Recording, vehicle: Vehicle, quality: dict[str, ChannelQuality], result: OfflineRun
) -> tuple[str, ...]:
    """Return every warning of a replay, data quality first."""
    found = list(recording.warnings)
    found += [f"{name}: {finding}" for name, q in quality.items() for finding in q.findings]
    found += exchange_findings(recording, vehicle)
    found += [f"ignored: {reason}: {count}" for reason, count in recording.ignored.items()]
    # the gaps of a sensor are in the findings of its data already, with what was done about them
    told = tuple(f"{name}: {words}" for name, q in quality.items() for words in (f"{q.gaps} gaps", f"{q.gaps} gap,") if q.gaps)
    found += [m for m in result.health.messages if m not in found and not m.startswith(told)]
    return tuple(found)


def exchange_findings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Return what exchanged topics or axes would explain, over all bodies with accelerometers."""
    motion = [s for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu")]
    found = []
    for body in vehicle.bodies.values():
        own = [s for s in motion if s.body == body.name]
        found += consistency_findings(recording, own, [s for s in motion if s.body != body.name], body.cg)
    return found


def summary(recording: Recording, result: OfflineRun, warnings: Sequence[str], layout: str) -> str:
    """Return the short text the command prints."""
    time = result.time_s
    lines = [
        f"{recording.name}: {time[-1]:.1f} s, {len(time)} ticks, {100.0 * result.valid.mean():.1f} % valid",
        layout,
        f"{'parameter':<34}{'value':>12}{'std':>10}{'prior':>12}  unit    status",
    ]
    for p in result.parameters:
        reason = f" ({p.reason})" if p.reason else ""
        value, std = with_std(p.value, p.std)
        lines.append(f"{p.name:<34}{value:>12}{std:>10}{plain(p.prior):>12}  {p.unit:<7} {p.status.value}{reason}")
    if result.mount_names:
        heads = (_three_words(f"mean {axis}" for axis in AXES), _three_words(f"swing {axis}" for axis in AXES))
        lines.append(f"{'force on the body by mount [N]':<34}{heads[0]:>32}{heads[1]:>32}  (largest deviation from the mean)")
        force = result.force[result.valid]
        for i, name in enumerate(result.mount_names if len(force) else ()):
            mean = force[:, i].mean(axis=0)
            swing = abs(force[:, i] - mean).max(axis=0)
            lines.append(f"{name:<34}{_three(mean):>32}{_three(swing):>32}")
        lines.append(result.forces_in_words())
    lines += [f"warning: {text}" for text in warnings[:12]]
    if len(warnings) > 12:
        lines.append(f"... {len(warnings) - 12} more warnings in result.json")
    lines.append(f"digest {result.digest}")
    return "\n".join(lines)


def _three(values: Sequence[float]) -> str:
    return _three_words(f"{v:.0f}" for v in values)


def _three_words(words: Iterable[str]) -> str:
    return "  ".join(f"{word:>8}" for word in words)
