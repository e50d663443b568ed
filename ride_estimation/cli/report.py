# Copyright 2026 ride_estimation contributors
"""``ride-estimation report``: finished replays side by side."""

from __future__ import annotations

import argparse

from ride_estimation.io.result_files import read_replay
from ride_estimation.io.results import output_folder
from ride_estimation.reporting.runs_report import write_runs_report

HELP = "compare finished replays: parameters, loads and spectra of several runs on one page"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("results", nargs="+", metavar="DIR", help="output folder of a replay")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for report.html")


def run(options: argparse.Namespace) -> int:
    """Write the page and print which runs stand out."""
    runs = [read_replay(folder) for folder in options.results]
    folder = output_folder(options.out)
    findings = write_runs_report(folder / "report.html", runs)
    print("\n".join(findings) or f"no run stands out among {len(runs)}")
    print(f"written to {folder}: report.html")
    return 0
