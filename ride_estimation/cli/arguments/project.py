# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation project``."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ride_estimation.cli.arguments.replay import add_estimation_arguments

HELP = "many recordings of one test campaign: a folder with vehicle, channel map and table of runs; one report over all"
EXAMPLES = """\
  ride-estimation project init campaign recordings/*.mf4 --vehicle my_truck.yaml --channels logger.yaml
  ride-estimation project add campaign recordings/loaded_*.mf4 --payload-kg 250 --tags loaded
  ride-estimation project run campaign                            (again: only what is new, changed or failed)
  ride-estimation project report campaign                         (the page anew, from the runs that are finished)

campaign/runs.csv has a line per run (file, vehicle, channels, payload_kg, payload_position_m, tags, from, to) to be edited in any
spreadsheet; an empty cell means what campaign/project.yaml says. Results: campaign/out/report.html, campaign/out/project.csv,
campaign/out/runs/NAME.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add one sub-command per step."""
    steps = parser.add_subparsers(dest="step", required=True, metavar="STEP", help="one of")
    init = steps.add_parser("init", help="make a project folder")
    _add_folder(init)
    _add_runs(init, vehicle_required=True)
    add = steps.add_parser("add", help="add recordings to the table of runs")
    _add_folder(add)
    _add_runs(add, vehicle_required=False)
    run = steps.add_parser("run", help="replay every run that is not finished, write the report")
    _add_folder(run)
    cores = os.cpu_count() or 1
    run.add_argument("--workers", type=int, default=cores, metavar="N", help="processes (default: one per core)")
    run.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="Dask scheduler to use instead (extra 'fleet')")
    run.add_argument("--no-run-reports", action="store_true", help="no report.html for every run (less time and disk)")
    add_estimation_arguments(run)
    report = steps.add_parser("report", help="write the report from the runs that are finished")
    _add_folder(report)


def _add_folder(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="PROJECT", help="folder of the project")


def _add_runs(parser: argparse.ArgumentParser, vehicle_required: bool) -> None:
    parser.add_argument(
        "files", nargs="*" if vehicle_required else "+", type=Path, metavar="RUN",
        help="bag, measurement file, or a folder that is searched for them",
    )  # fmt: skip
    whose = "of the project" if vehicle_required else "of these runs, where it is not that of the project"
    parser.add_argument("--vehicle", required=vehicle_required, default="", metavar="V.yaml", help=f"vehicle file {whose}")
    parser.add_argument("--channels", default="", metavar="MAP.yaml", help=f"channel map of measurement files {whose}")
    parser.add_argument("--payload-kg", type=float, default=0.0, metavar="M", help="payload that is not in the vehicle file")
    parser.add_argument("--payload-position-m", type=float, nargs=3, metavar=("X", "Y", "Z"), help="its place (default: the CG)")
    parser.add_argument("--tags", nargs="+", default=[], metavar="WORD", help="words to group these runs by")
    parser.add_argument("--from", dest="from_s", default="", metavar="S|MARKER", help="use the runs from here on")
    parser.add_argument("--to", dest="to_s", default="", metavar="S|MARKER", help="use the runs up to here")
