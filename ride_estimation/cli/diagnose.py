# Copyright 2026 ride_estimation contributors
"""``ride-estimation diagnose``: what the simulation of a run gets wrong, by which cause, and what the extension gains."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ride_estimation.api.runs import read_run
from ride_estimation.cli.parts import part_of_options
from ride_estimation.cli.progress import Progress
from ride_estimation.cli.reading import reading_options
from ride_estimation.diagnosis.common.parallel import allocate_from_one_heap
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.identification.bench.record import BenchRecord
from ride_estimation.io.bench_records import ReadOptions, read_bench_record, read_oscillator_record
from ride_estimation.io.results import output_folder
from ride_estimation.io.vehicle_file import load_vehicle

# the diagnosis is imported after the records are read: it takes a second, which whoever named a wrong file need not wait
if TYPE_CHECKING:
    from ride_estimation.api.diagnosing import DiagnosedRun
    from ride_estimation.diagnosis.answer.result import Diagnosis

#: usual share of the time by stage
STAGES = {"reading": 0.03, "searching for causes": 0.92, "report": 0.05}


def run(options: argparse.Namespace) -> int:
    """Diagnose one run."""
    settings = Settings(stability=not options.quick, plan_next=options.next_run)
    if options.band is not None:
        low, high = options.band
        if not 0.0 < low < high:
            raise ConfigurationError(f"--band {low:g} {high:g}: two frequencies with 0 < LOW < HIGH are needed [Hz]")
        settings = dataclasses.replace(settings, band_hz=(low, high))
    bench = (Path(options.recording).suffix.lower() in _BENCH_SUFFIXES and not options.channels) or options.vehicle is None
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
    allocate_from_one_heap()  # before the first thread has a heap of its own
    with Progress("diagnose", shares=STAGES) as progress:
        progress.begin("reading")
        run = read_run(
            options.recording, vehicle, start_s=begin, end_s=end, channels=options.channels, events=options.events
        )
        others = [read_run(path, vehicle, channels=options.channels) for path in options.validate]
        for path, other in zip(options.validate, others):
            if other.recording.checksum == run.recording.checksum:
                raise ConfigurationError(f"--validate {path}: is the run that is fitted; only another one can judge the gain")
        from ride_estimation.api.diagnosing import diagnose

        progress.begin("searching for causes")
        found = diagnose(run, others, settings=settings, rate_hz=rate, report=progress.reach)
        _save(found, folder, options, progress)
    return _say(found.answer, folder, options)


_BENCH_SUFFIXES = (".csv", ".txt", ".tsv", ".npz", ".mat")


def _run_bench(options: argparse.Namespace, settings: Settings) -> int:
    """Diagnose one bench record."""
    reading = reading_options(options)
    records: list[BenchRecord] = []
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
        records.append(record)
    from ride_estimation.api.diagnosing import DiagnosedRun
    from ride_estimation.diagnosis.adapters.bench import BenchSample, diagnose_bench

    samples = [BenchSample(record.name, 1.0 / record.step_s, record.displacement, record.force) for record in records]
    warnings = [words for record in records for words in record.warnings]
    if options.vehicle is not None:
        warnings.append(f"--vehicle {options.vehicle} is not used: the record is one mount on a bench")
    folder = output_folder(options.out)
    band = options.band is not None
    with Progress("diagnose", shares=STAGES) as progress:
        progress.begin("searching for causes")
        answer = diagnose_bench(samples[0], tuple(samples[1:]), settings, band, progress.reach)
        answer = dataclasses.replace(answer, warnings=(*answer.warnings, *warnings))
        facts = {"path": str(options.recording), "checksum": "", "duration_s": len(samples[0].force) / samples[0].rate_hz}
        found = DiagnosedRun(answer, samples[0].name, facts, {"name": answer.extended.name, "checksum": ""})
        _save(found, folder, options, progress)
    return _say(answer, folder, options)


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
    from ride_estimation.api.diagnosing import DiagnosedRun
    from ride_estimation.diagnosis.adapters.oscillator import default_fit, diagnose_oscillator

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
    with Progress("diagnose", shares=STAGES) as progress:
        progress.begin("searching for causes")
        answer = diagnose_oscillator(record, fit, others)
        facts = {"path": str(options.recording), "checksum": "", "duration_s": duration}
        found = DiagnosedRun(answer, record.name, facts, {"name": answer.extended.name, "checksum": ""})
        _save(found, folder, options, progress)
    return _say(answer, folder, options)


_MOST_FITTED = 0.8  # share of an oscillator record


def _save(found: DiagnosedRun, folder: Path, options: argparse.Namespace, progress: Progress) -> None:
    """Write the files of an answer."""
    progress.begin("writing results" if options.no_report else "report")
    found.save(folder, report=not options.no_report)


def _say(answer: Diagnosis, folder: Path, options: argparse.Namespace) -> int:
    """Print an answer and where its files are."""
    from ride_estimation.diagnosis.answer.result import INSUFFICIENT

    print(answer.sentence)
    if answer.next_run is not None:
        print(answer.next_run.sentence)
    for line in (*answer.remarks, *answer.warnings):
        print(f"  {line}")
    # an answer that says nothing about the vehicle writes it as it came: nothing was extended
    unchanged = " (as given, nothing was found out about it)" if answer.verdict == INSUFFICIENT else ""
    print(f"written to {folder}: diagnosis.json, vehicle_extended.yaml{unchanged}{'' if options.no_report else ', report.html'}")
    return 0
