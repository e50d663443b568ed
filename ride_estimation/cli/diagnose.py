# Copyright 2026 ride_estimation contributors
"""``ride-estimation diagnose``: what the simulation of a run gets wrong, by which cause, and what the extension gains."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from ride_estimation.api.diagnosing import DiagnosedRun, diagnose
from ride_estimation.api.runs import read_run
from ride_estimation.cli.identify import add_reading_arguments, reading_options
from ride_estimation.cli.parts import add_part_arguments, part_of_options
from ride_estimation.cli.progress import Progress
from ride_estimation.diagnosis.bench import BenchSample, diagnose_bench
from ride_estimation.diagnosis.oscillator import default_fit, diagnose_oscillator
from ride_estimation.diagnosis.result import INSUFFICIENT, Diagnosis
from ride_estimation.diagnosis.settings import Settings
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.bench_records import ReadOptions, read_bench_record, read_oscillator_record
from ride_estimation.io.results import output_folder
from ride_estimation.io.vehicle_file import load_vehicle

Answer = TypeVar("Answer", Diagnosis, DiagnosedRun)

HELP = "find what the simulation of a recorded run gets wrong, name the cause, extend the model, measure the gain"
EXAMPLES = """\
  ride-estimation diagnose bags/hidden_friction/bag --vehicle truck_cab \\
      --validate bags/hidden_friction_validation/bag --out out/diagnosis
  ride-estimation diagnose bench.csv --out out/mount             (columns time_s, displacement_mm, force_kn of one mount)
  ride-estimation diagnose record.csv --oscillator V1,V2 --rate 610 --out out/oscillator
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "recording", metavar="RUN",
        help="rosbag2 folder, .mcap, .db3 or ROS 1 .bag file; or a bench record (.csv, .txt, .tsv, .npz, .mat, or a bag without "
        "--vehicle) of the displacement and force of one mount, or with --oscillator of the excitation and response of one mass",
    )
    parser.add_argument(
        "--vehicle", metavar="V.yaml", help="vehicle file, or the name of a bundled one; not used for a bench record"
    )
    parser.add_argument(
        "--validate", nargs="+", action="extend", default=[], metavar="RUN2",
        help="further runs that neither fit nor select: the gain is measured on them",
    )
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder for diagnosis.json, vehicle_extended.yaml, report.html"
    )
    parser.add_argument("--band", nargs=2, type=float, metavar=("LOW", "HIGH"), help="analysis band [Hz] (default: 0.4 40)")
    parser.add_argument(
        "--oscillator", default="", metavar="INPUT,OUTPUT",
        help="RUN is a record of a driven oscillator: columns of excitation and response (any units)",
    )
    parser.add_argument(
        "--fit-range", nargs=2, type=float, metavar=("FROM", "TO"),
        help="seconds of an --oscillator record that are fitted (default: the first half); the rest chooses and judges",
    )
    add_part_arguments(parser)
    parser.add_argument("--no-report", action="store_true", help="write no report.html")
    # --rate of this group is also the rate of the common time base of a vehicle run (default: the fastest sensor, 400 at most)
    add_reading_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Diagnose one run; see :data:`HELP`."""
    settings = Settings()
    if options.band is not None:
        low, high = options.band
        if not 0.0 < low < high:
            raise ConfigurationError(f"--band {low:g} {high:g}: two frequencies with 0 < LOW < HIGH are needed [Hz]")
        settings = dataclasses.replace(settings, band_hz=(low, high))
    bench = Path(options.recording).suffix.lower() in _BENCH_SUFFIXES or options.vehicle is None
    if (options.oscillator or bench) and part_of_options(options) != (None, None):
        raise ConfigurationError("--from, --to: only for a run of a vehicle")
    if options.oscillator:
        return _run_oscillator(options)
    if options.fit_range is not None:
        raise ConfigurationError("--fit-range: only with --oscillator INPUT,OUTPUT")
    if bench:
        return _run_bench(options, settings)
    if dataclasses.replace(reading_options(options), rate_hz=0.0) != ReadOptions():
        raise ConfigurationError(
            f"{options.recording}: is a run of a vehicle; columns, units, --zero, --sign, --mount, --axis are for bench records"
        )
    vehicle = load_vehicle(options.vehicle)
    folder = output_folder(options.out)
    rate = options.rate if options.rate > 0.0 else None
    begin, end = part_of_options(options)
    run = read_run(options.recording, vehicle, start_s=begin, end_s=end)
    others = [read_run(path, vehicle) for path in options.validate]
    for path, other in zip(options.validate, others):
        if other.recording.checksum == run.recording.checksum:
            raise ConfigurationError(f"--validate {path}: is the run that is fitted; only another one can judge the gain")
    return _write(_shown(lambda report: diagnose(run, others, settings=settings, rate_hz=rate, report=report)), folder, options)


def _shown(work: Callable[[Callable[[float], None]], Answer]) -> Answer:
    """Return the answer of some work that tells the share it has done, shown on a terminal."""
    progress = Progress(1.0, "diagnose")
    shown = 0.0

    def report(share: float) -> None:
        nonlocal shown
        progress.update(share - shown)
        shown = share

    answer = work(report)
    progress.close()
    return answer


_BENCH_SUFFIXES = (".csv", ".txt", ".tsv", ".npz", ".mat")


def _run_bench(options: argparse.Namespace, settings: Settings) -> int:
    """Diagnose one bench record."""
    reading = reading_options(options)
    samples: list[BenchSample] = []
    warnings: list[str] = []
    for path in (options.recording, *options.validate):
        try:
            record = read_bench_record(Path(path), reading)
        except InputDataError as error:
            words = ""
            if "looks like it" in str(error):
                words = "; excitation and response of a driven oscillator are read with --oscillator INPUT,OUTPUT"
            elif Path(path).suffix.lower() not in _BENCH_SUFFIXES:
                words = "; without --vehicle V.yaml, which a run of a vehicle needs, a bag is read as a bench record of one mount"
            raise InputDataError(f"{error}{words}") from error
        samples.append(BenchSample(record.name, 1.0 / record.step_s, record.displacement, record.force))
        warnings += record.warnings
    if options.vehicle is not None:
        warnings.append(f"--vehicle {options.vehicle} is not used: the record is one mount on a bench")
    folder = output_folder(options.out)
    band = options.band is not None
    answer = _shown(lambda report: diagnose_bench(samples[0], tuple(samples[1:]), settings, band, report))
    answer = dataclasses.replace(answer, warnings=(*answer.warnings, *warnings))
    facts = {"path": str(options.recording), "checksum": "", "duration_s": len(samples[0].force) / samples[0].rate_hz}
    found = DiagnosedRun(answer, samples[0].name, facts, {"name": answer.extended.name, "checksum": ""})
    return _write(found, folder, options)


def _run_oscillator(options: argparse.Namespace) -> int:
    """Diagnose one record of a driven oscillator."""
    for path in (options.recording, *options.validate):
        if Path(path).suffix.lower() not in _BENCH_SUFFIXES:
            raise ConfigurationError(f"{path}: --oscillator reads records ({', '.join(_BENCH_SUFFIXES)})")
    record, *others = [
        read_oscillator_record(Path(path), options.oscillator, options.rate, options.time)
        for path in (options.recording, *options.validate)
    ]
    duration = record.u.size * record.step_s
    fit = default_fit(record.u.size)
    if options.fit_range is not None:
        begin, end = options.fit_range
        if not 0.0 <= begin < end <= duration:
            raise ConfigurationError(f"--fit-range {begin:g} {end:g}: allowed are times with 0 <= FROM < TO <= {duration:.6g} s")
        time = np.arange(record.u.size) * record.step_s
        fit = (time >= begin) & (time < end)
        if np.mean(fit) > _MOST_FITTED:
            raise ConfigurationError(
                f"--fit-range {begin:g} {end:g}: {100 * np.mean(fit):.0f} % of the record; at most {100 * _MOST_FITTED:.0f} %, "
                "the rest chooses the model and judges it"
            )
    folder = output_folder(options.out)
    answer = diagnose_oscillator(record, fit, others)
    facts = {"path": str(options.recording), "checksum": "", "duration_s": duration}
    found = DiagnosedRun(answer, record.name, facts, {"name": answer.extended.name, "checksum": ""})
    return _write(found, folder, options)


_MOST_FITTED = 0.8  # share of an oscillator record


def _write(found: DiagnosedRun, folder: Path, options: argparse.Namespace) -> int:
    """Write the files of an answer and say it."""
    answer = found.answer
    found.save(folder, report=not options.no_report)
    print(answer.sentence)
    for line in (*answer.remarks, *answer.warnings):
        print(f"  {line}")
    # an answer that says nothing about the vehicle writes it as it came: nothing was extended
    unchanged = " (as given, nothing was found out about it)" if answer.verdict == INSUFFICIENT else ""
    print(f"written to {folder}: diagnosis.json, vehicle_extended.yaml{unchanged}{'' if options.no_report else ', report.html'}")
    return 0
