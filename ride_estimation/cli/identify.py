# Copyright 2026 ride_estimation contributors
"""``ride-estimation identify``: one force element from bench records of displacement and force."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import ride_estimation
from ride_estimation.cli.progress import Progress
from ride_estimation.identification.bench.analysis import BenchIdentification, identify_records, ladder_for
from ride_estimation.identification.bench.element_mapping import build_element
from ride_estimation.identification.bench.models import LADDER
from ride_estimation.io.bench_records import ReadOptions, read_bench_record
from ride_estimation.io.identification_files import write_identification

HELP = "identify a force element (stiffness, damping, friction) from bench records of displacement and force"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("records", nargs="+", type=Path, metavar="RECORD", help="csv, npz, mat file or bag")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for identification.json, element.yaml, report.html")
    parser.add_argument("--validate", nargs="+", type=Path, default=[], metavar="RECORD", help="records that are not fitted")
    names = ", ".join(m.name for m in LADDER)
    parser.add_argument("--model", default="auto", help=f"auto (choose on held-out data) or one of: {names}")
    add_reading_arguments(parser)


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how columns and units are found."""
    group = parser.add_argument_group("columns and units (default: from names such as displacement_mm, force_kn)")
    group.add_argument("--time", default="", help="column of time")
    group.add_argument("--displacement", default="", help="column of displacement (extension positive)")
    group.add_argument("--force", default="", help="column of force (tension positive)")
    group.add_argument("--time-unit", default="", help="s, ms, us, ns")
    group.add_argument("--displacement-unit", default="", help="m, mm, um, cm, in")
    group.add_argument("--force-unit", default="", help="N, kN, daN, kgf, lbf")
    group.add_argument("--rate", type=float, default=0.0, metavar="HZ", help="sample rate of a record without time column")
    group.add_argument("--zero", choices=("auto", "mean", "start", "none"), default="auto", help="which displacement counts as zero")
    group.add_argument("--sign", choices=("tension", "opposed"), default="tension", help="opposed: force has the opposite sign of displacement")
    group.add_argument("--mount", default="", help="mount of a bag (joint <mount>_<axis>)")
    group.add_argument("--axis", default="", choices=("", "x", "y", "z"), help="axis of a bag")
    group.add_argument("--accept-stiffness", action="store_true", help="accept a stiffness outside the plausible range")


def reading_options(options: argparse.Namespace) -> ReadOptions:
    """Return the reading options of the command line."""
    return ReadOptions(
        time=options.time, displacement=options.displacement, force=options.force, time_unit=options.time_unit,
        displacement_unit=options.displacement_unit, force_unit=options.force_unit, rate_hz=options.rate,
        zero=options.zero, sign=options.sign, mount=options.mount, axis=options.axis,
        accept_stiffness=options.accept_stiffness,
    )


def run(options: argparse.Namespace) -> int:
    """Identify and write the results."""
    from ride_estimation.reporting.identification_report import identification_document, write_identification_report

    reading = reading_options(options)
    models = ladder_for(options.model)
    records = [read_bench_record(p, reading) for p in options.records]
    validation = [read_bench_record(p, reading) for p in options.validate]
    progress = Progress(len(models), "identify")
    found = identify_records(records, validation, model=options.model, progress=progress.update)
    progress.close()
    document = identification_document(found, f"ride_estimation {ride_estimation.__version__}")
    element, problem = build_element(found.element)
    if element is None:
        document["warnings"].append(f"no element.yaml: {problem}")
    write_identification(options.out, document, None if element is None else element.to_mapping())
    write_identification_report(found, options.out / "report.html")
    print_summary(found, options.out)
    if element is None:
        print(f"warning: no element.yaml: {problem}", file=sys.stderr)
    return 0


def print_summary(found: BenchIdentification, out: Path) -> None:
    """Print the ladder, the parameters and the warnings."""
    print(f"{'model':<18}{'parameters':>11}{'fitted %':>10}{'held out %':>12}{'gain %':>9}{'criterion':>12}")
    for i, rung in enumerate(found.rungs):
        mark = " <" if i == found.chosen else ""
        print(
            f"{rung.fit.model.name:<18}{rung.fit.model.parameter_count:>11}{100 * rung.fitted['std']:>10.3g}"
            f"{100 * rung.mse**0.5:>12.3g}{100 * rung.gain:>9.1f}{rung.criterion:>12.0f}{mark}"
        )
    for p in found.uncertainty.parameters:
        print(f"  {p.name:<18}{p.value:>13.5g} +- {p.std:<10.2g}{p.unit:<8}{p.status}{'  ' + p.reason if p.reason else ''}")
    print(found.uncertainty.null_direction)
    print(found.unexplained)
    for warning in found.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(f"written to {out}")
