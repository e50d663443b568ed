# Copyright 2026 ride_estimation contributors
"""``ride-estimation compare``: several runs side by side."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from ride_estimation.cli.replay import ReplayJob, replay_run
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.result_files import FinishedReplay, read_diagnosis, read_replay
from ride_estimation.io.results import output_folder


def run(options: argparse.Namespace) -> int:
    """Replay what is not replayed yet, write the page and print which runs are outliers."""
    folder = output_folder(options.out)
    finished = [Path(given) for given in options.runs]
    missing = [str(path) for path in finished if not path.exists()]
    if missing:
        raise InputDataError(f"{', '.join(missing)}: does not exist")
    diagnoses = [path for path in finished if (path / "diagnosis.json").is_file() and not (path / "result.json").is_file()]
    if diagnoses:
        return _compare_diagnoses(finished, diagnoses, folder, options)
    recordings = [path for path in finished if not (path / "result.json").is_file()]
    if recordings:
        finished = replayed(finished, recordings, folder, options)
    elif options.vehicle or options.settings or options.without or options.rate is not None:
        raise ConfigurationError("--vehicle, --rate, --settings and --without are for recordings; all runs are replayed already")
    runs = named_apart([read_replay(path) for path in finished])
    from ride_estimation.reporting.formats import write_page  # draws; whoever named a wrong folder need not wait for it
    from ride_estimation.reporting.outliers import LEAST_RUNS
    from ride_estimation.reporting.runs_report import runs_page

    page, findings = runs_page(runs)
    written = write_page(page, folder, options.format)
    few = f"outlier detection needs at least {LEAST_RUNS} runs"
    print("\n".join(findings) or (f"no outlier among {len(runs)} runs" if len(runs) >= LEAST_RUNS else few))
    print(f"written to {folder}: {', '.join(written)}")
    return 0


def _compare_diagnoses(given: list[Path], diagnoses: list[Path], folder: Path, options: argparse.Namespace) -> int:
    """Write the page that compares two diagnoses and print what changed."""
    if len(given) != 2 or len(diagnoses) != 2:
        raise ConfigurationError(f"{diagnoses[0]}: is a diagnosis; compare takes two diagnoses, or replays only")
    documents = [read_diagnosis(path) for path in given]
    from ride_estimation.reporting.differences import diagnoses_page
    from ride_estimation.reporting.formats import write_page

    try:
        page, said = diagnoses_page((given[0].name, given[1].name), *documents)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputDataError(f"{', '.join(map(str, given))}: a diagnosis.json does not have the form of one ({error})") from error
    written = write_page(page, folder, options.format)
    print("\n".join(said))
    print(f"written to {folder}: {', '.join(written)}")
    return 0


def replayed(given: list[Path], recordings: list[Path], folder: Path, options: argparse.Namespace) -> list[Path]:
    """Replay recordings below the folder; return all runs as folders of finished replays.

    Raises
    ------
    ConfigurationError
        No vehicle file, so that a folder without results cannot be replayed.
    """
    if options.vehicle is None:
        raise ConfigurationError(f"{recordings[0]}: no result.json; a recording needs --vehicle V.yaml")
    job = ReplayJob.of(options, ())
    places = []
    for number, path in enumerate(given, start=1):
        if path not in recordings:
            places.append(path)
            continue
        place = output_folder(folder / "runs" / f"{number:03d}_{path.stem}")
        print(f"replay of {path}", flush=True)
        replay_run(path, job, place)
        places.append(place)
    return places


def named_apart(runs: list[FinishedReplay]) -> list[FinishedReplay]:
    """Return the runs with names that differ."""
    names = [run.name for run in runs]
    return [
        run if names.count(run.name) == 1 else dataclasses.replace(run, name=f"{run.name} ({number})")
        for number, run in enumerate(runs, start=1)
    ]
