# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation identify``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.identification.bench.choices import EXTRACTIONS, JOUNCE_MODELS, MODELS, NORMS

HELP = "identify a force element (stiffness, damping, friction) from bench records of displacement and force"
EXAMPLES = """\
  ride-estimation identify sine_1hz.csv sine_5hz.csv --validate random.csv --out out/bushing
  ride-estimation identify run.mat --displacement x --displacement-unit mm --force F --force-unit kN --rate 1000 --out out/mount
  ride-estimation identify stop.csv --model jounce_bumper --out out/stop

Records have columns of time, displacement and force with the unit in the name (time_s, displacement_mm, force_kn).
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("records", nargs="+", type=Path, metavar="RECORD", help="csv, npz, mat file or bag")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder for identification.json, element.yaml, report.html"
    )
    parser.add_argument("--validate", nargs="+", type=Path, default=[], metavar="RECORD", help="records that are not fitted")
    names = ", ".join((*MODELS, *JOUNCE_MODELS))
    parser.add_argument("--model", default="auto", help=f"auto (choose on held-out data) or one of: {names}")
    parser.add_argument(
        "--method", choices=("time", "frequency"), default="time", help="fit force samples, or K and W of harmonic tests"
    )
    parser.add_argument(
        "--norm", choices=NORMS, default=NORMS[0], help="misfit of --method frequency; printed: document 003 eq. (24) as printed"
    )
    parser.add_argument(
        "--extraction", choices=EXTRACTIONS, default=EXTRACTIONS[0], help="how K and W are taken from harmonic tests"
    )
    parser.add_argument(
        "--local-models", type=int, metavar="M", help="local models of a network (default: chosen on records left out in turn)"
    )
    parser.add_argument(
        "--static", nargs="+", type=Path, default=[], metavar="RECORD",
        help="slow records for the static curve of a network that is trained on the other records only",
    )  # fmt: skip
    parser.add_argument(
        "--oscillator", default="", metavar="INPUT,OUTPUT", help="columns of an excitation and a response: is the spring linear"
    )
    parser.add_argument(
        "--fit-range",
        nargs=2,
        type=float,
        metavar=("FROM", "TO"),
        help="seconds of the record that --oscillator fits (default: the first 70 %%); the rest is held out",
    )
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
    group.add_argument(
        "--zero", choices=("auto", "mean", "start", "none"), default="auto", help="which displacement counts as zero"
    )
    group.add_argument(
        "--sign", choices=("tension", "opposed"), default="tension", help="opposed: force has the opposite sign of displacement"
    )
    group.add_argument("--mount", default="", help="mount of a bag (joint <mount>_<axis>)")
    group.add_argument("--axis", default="", choices=("", "x", "y", "z"), help="axis of a bag")
    group.add_argument("--accept-stiffness", action="store_true", help="accept a stiffness outside the plausible range")
