# Copyright 2026 ride_estimation contributors
"""``ride-estimation identify``: one force element from bench records of displacement and force."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

import ride_estimation
from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.progress import Progress
from ride_estimation.cli.reading import reading_options
from ride_estimation.elements.registry import SEEN
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.analysis import BenchIdentification, identify_records
from ride_estimation.identification.bench.choices import JOUNCE_MODELS, MODELS
from ride_estimation.identification.bench.element_mapping import build_element
from ride_estimation.identification.bench.frequency_analysis import identify_operating_points
from ride_estimation.identification.bench.jounce_analysis import identify_jounce
from ride_estimation.identification.bench.models import ladder_for
from ride_estimation.identification.bench.oscillator import identify_oscillator
from ride_estimation.identification.bench.record import BenchRecord
from ride_estimation.identification.bench.steady_cycles import OperatingPoints, find_operating_points
from ride_estimation.identification.bench.time_domain import prepare
from ride_estimation.io.bench_records import read_bench_record, read_operating_points, read_oscillator_record
from ride_estimation.io.identification_files import write_identification
from ride_estimation.io.results import require_folder
from ride_estimation.io.vehicle_mechanics import seen_to_mapping
from ride_estimation.vehicles.data_range import DataRange, seen_in, seen_in_contact, union


def run(options: argparse.Namespace) -> int:
    """Identify and write the results."""
    require_finite(options)
    require_folder(options.out)
    if options.model not in ("auto", *MODELS, *JOUNCE_MODELS):
        allowed = ", ".join(("auto", *MODELS, *JOUNCE_MODELS))
        raise InputDataError(f"--model: model {options.model!r} is unknown; allowed: {allowed}")
    if options.local_models is not None and options.local_models < 1:
        raise InputDataError(f"--local-models {options.local_models}: allowed: 1 or more")
    if options.static and options.model not in JOUNCE_MODELS[1:]:
        raise InputDataError(f"--static gives the static curve of a network; allowed with --model {', '.join(JOUNCE_MODELS[1:])}")
    if options.oscillator:
        return _run_oscillator(options)
    if options.model in JOUNCE_MODELS:
        return _run_jounce(options)
    if options.method == "frequency":
        return _run_frequency(options)
    return _run_time(options)


def _software() -> str:
    return f"ride_estimation {ride_estimation.__version__}"


def _write(
    options: argparse.Namespace, document: dict[str, Any], mapping: dict[str, Any] | None, seen: DataRange | None = None
) -> None:
    """Write the result files; say where an element is outside the bounds of its kind instead of writing one."""
    element, problem = (None, "") if mapping is None else build_element(mapping)
    if problem:
        document["warnings"].append(f"no element.yaml: {problem}")
    known = {} if seen is None else {SEEN: seen_to_mapping(seen)}
    document |= known
    write_identification(options.out, document, None if element is None else element.to_mapping() | known)
    for warning in document["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    print(f"written to {options.out}")


def _seen(records: Sequence[BenchRecord]) -> DataRange | None:
    """Return what records to fit show of the element."""
    return union(seen_in(r.displacement, r.step_s, float(np.mean(r.force))) for r in records)


def _seen_in_contact(records: Sequence[BenchRecord]) -> DataRange | None:
    """Return what records show of a bumper: its travel, which force and displacement count in the same direction."""
    loads = [float(np.mean(r.force)) for r in records]
    return union(
        seen_in_contact(r.displacement, np.sign(load) * r.displacement > 0.0, r.step_s, load)
        for r, load in zip(records, loads, strict=True)
    )


def _seen_points(points: OperatingPoints) -> DataRange:
    """Return what a table of operating points shows of the element."""
    frequency = points.omega / (2.0 * np.pi)
    return DataRange(float(np.max(points.amplitude)), (float(np.min(frequency)), float(np.max(frequency))))


def _run_time(options: argparse.Namespace) -> int:
    reading = reading_options(options)
    records = [read_bench_record(p, reading) for p in options.records]
    validation = [read_bench_record(p, reading) for p in options.validate]
    # the report draws; whoever named a wrong file need not wait for it
    from ride_estimation.reporting.identification_report import identification_document, write_identification_report

    with Progress("identify", len(ladder_for(options.model))) as progress:
        found = identify_records(records, validation, model=options.model, progress=progress.update)
    print_summary(found)
    _write(options, identification_document(found, _software()), found.element, _seen(records))
    write_identification_report(found, options.out / "report.html")
    return 0


def _run_frequency(options: argparse.Namespace) -> int:
    reading = reading_options(options)
    table = read_operating_points(options.records[0]) if len(options.records) == 1 else None
    if table is None:
        table = find_operating_points([prepare(read_bench_record(p, reading)) for p in options.records], options.extraction)
    validation = [prepare(read_bench_record(p, reading)) for p in options.validate]
    from ride_estimation.reporting.identification_special_reports import frequency_document, write_frequency_report

    with Progress("identify", len(ladder_for(options.model))) as progress:
        found = identify_operating_points(table, validation, model=options.model, norm=options.norm, progress=progress.update)
    print(
        f"{'model':<18}{'parameters':>11}{'fitted %':>10}{'left out %':>12}{'criterion':>12}"
        f"   ({table.omega.size} operating points)"
    )
    for i, rung in enumerate(found.rungs):
        mark = " <" if i == found.chosen else ""
        print(
            f"{rung.fit.model.name:<18}{rung.fit.model.parameter_count:>11}{100 * rung.fitted:>10.3g}"
            f"{100 * rung.left_out:>12.3g}{rung.criterion:>12.1f}{mark}"
        )
    for quantity, value, std in zip(found.best.fit.model.quantities, found.best.fit.values, found.best.fit.std, strict=True):
        print(f"  {quantity.name:<18}{value:>13.5g} +- {std:<10.2g}{quantity.unit}")
    for held in found.best.held_out:
        print(f"  {held.name}: NRMSE {100 * held.scores()['std']:.3g} %")
    _write(options, frequency_document(found, _software()), found.element, _seen_points(found.points))
    write_frequency_report(found, options.out / "report.html")
    return 0


def _run_jounce(options: argparse.Namespace) -> int:
    reading = reading_options(options)
    if reading.zero == "auto":
        # travel counts from contact: a record that never leaves contact must keep its zero
        reading = dataclasses.replace(reading, zero="none")
    records = [read_bench_record(p, reading) for p in options.records]
    validation = [read_bench_record(p, reading) for p in options.validate]
    static = [read_bench_record(p, reading) for p in options.static]
    from ride_estimation.reporting.identification_special_reports import jounce_document, jounce_status, write_jounce_report

    with Progress("identify", 4 if options.model == JOUNCE_MODELS[0] else len(records) + bool(validation)) as progress:
        found = identify_jounce(
            records, validation, options.model, static=static, models=options.local_models, progress=progress.update
        )
    for name in dict.fromkeys([*found.fitted, *found.held_out]):
        fitted = f"{100 * found.fitted[name]:.3g} %" if name in found.fitted else "-"
        held = f"{100 * found.held_out[name]:.3g} %" if name in found.held_out else "-"
        print(f"  {name:<28} fitted {fitted:>8}  held out {held:>8}")
    if found.choice is not None:
        sizes = ", ".join(f"{n}: {100 * score:.3g} %" for n, score in found.choice.sizes.items())
        print(f"  error on records left out by number of local models: {sizes}; chosen {found.choice.models}")
    for name, value, unit, std in found.quantities:
        print(f"  {name:<32}{value:>12.5g} {'' if std is None else f'+- {std:<10.2g}'}{unit:<7}{jounce_status(name, value, std)}")
    usable = found.choice is None or not found.choice.refusal
    _write(options, jounce_document(found, _software()), found.element if usable else None, _seen_in_contact([*records, *static]))
    write_jounce_report(found, options.out / "report.html")
    return 0


def _run_oscillator(options: argparse.Namespace) -> int:
    if len(options.records) != 1:
        raise InputDataError(f"--oscillator fits one record; {len(options.records)} were given (more go to --validate)")
    record = read_oscillator_record(options.records[0], options.oscillator, options.rate, options.time)
    validation = [read_oscillator_record(p, options.oscillator, options.rate, options.time) for p in options.validate]
    time = np.arange(record.u.size) * record.step_s
    first, last = options.fit_range or ((0.0, np.inf) if validation else (0.0, 0.7 * float(time[-1])))
    fit = (time >= first) & (time < last)
    if fit.sum() < 1000:
        raise InputDataError(
            f"--fit-range {first:g} {last:g} holds {fit.sum()} samples of 0 to {time[-1]:g} s; at least 1000 are needed"
        )
    from ride_estimation.reporting.identification_special_reports import (
        oscillator_document,
        unexplained_oscillator,
        write_oscillator_report,
    )

    rungs, chosen = identify_oscillator(record, fit, validation)
    for i, rung in enumerate(rungs):
        held = ", ".join(f"{n} {e[0]:.4g} rms ({100 * e[1]:.3g} %)" for n, e in rung.held_out.items())
        print(f"{rung.name:<26} fitted {rung.fitted_rms:.4g} rms; {held}{' <' if i == chosen else ''}")
    print(unexplained_oscillator(rungs, chosen))
    _write(options, oscillator_document(rungs, chosen, _software()), None)
    write_oscillator_report(rungs, chosen, options.out / "report.html")
    return 0


def print_summary(found: BenchIdentification) -> None:
    """Print the ladder, the parameters and what stays unexplained."""
    print(f"{'model':<18}{'parameters':>11}{'fitted %':>10}{'held out %':>12} {'gain %':>9}{'criterion':>12}")
    for i, rung in enumerate(found.rungs):
        mark = " <" if i == found.chosen else ""
        gain = f"{max(100 * rung.gain, -999.0):>9.1f}" if rung.gain_over else f"{'':>9}"
        print(
            f"{rung.fit.model.name:<18}{rung.fit.model.parameter_count:>11}{100 * rung.fitted['std']:>10.3g}"
            f"{100 * rung.mse**0.5:>12.3g} {gain}{rung.criterion:>12.0f}{mark}"
        )
    if found.validation:
        print_validation(found)
    for p in found.uncertainty.parameters:
        print(f"  {p.name:<18}{p.value:>13.5g} +- {p.std:<10.2g}{p.unit:<8}{p.status}{'  ' + p.reason if p.reason else ''}")
    print(found.uncertainty.null_direction)
    print(found.unexplained)


def print_validation(found: BenchIdentification) -> None:
    """Print the parameters of every model and its NRMSE on every record that was not fitted (document 003 Table 3, Figure 19)."""
    records = [held.name for held in found.best.held_out]
    print("NRMSE [%] on " + ", ".join(records) + "; parameters in SI")
    for rung in found.rungs:
        scores = "".join(f"{100 * held.scores()['std']:>9.3g}" for held in rung.held_out)
        names = (quantity.name for quantity in rung.fit.model.quantities)
        values = ", ".join(f"{name} {value:.4g}" for name, value in zip(names, rung.fit.values, strict=True))
        print(f"{rung.fit.model.name:<18}{scores}   {values}")
