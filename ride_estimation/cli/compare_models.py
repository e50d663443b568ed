# Copyright 2026 ride_estimation contributors
"""``ride-estimation compare-models``: Voigt, damping filter, Maxwell and friction on the same data, scored on unseen runs."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation import metrics
from ride_estimation.api.runs import read_run
from ride_estimation.assessment.durability import damage_ratio
from ride_estimation.cli.parts import read_part
from ride_estimation.cli.progress import Progress
from ride_estimation.errors import InputDataError
from ride_estimation.identification.model_comparison import (
    CANDIDATES,
    LITERATURE,
    FittedModel,
    MeasuredRun,
    fit_candidates,
    predict,
)
from ride_estimation.io.json_file import write_json
from ride_estimation.io.results import output_folder, require_folder
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.reporting.numbers import plain
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import run_title
from ride_estimation.signals.spectra import spectrum_correlation
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_SPECTRUM_BLOCK_S = 5.0
_UNNAMED_S = 0.5  # sensors do not begin and end at the same instant


def run(options: argparse.Namespace) -> int:
    """Fit every model to the run, score all of them on all runs, print the table."""
    from ride_estimation.reporting.model_spectra import write_model_spectra

    vehicle = load_vehicle(options.vehicle)
    if any(path.exists() and options.run.exists() and path.samefile(options.run) for path in options.validate):
        raise InputDataError(f"--validate {options.run}: is the run that is fitted; only another one is unseen")
    if options.out is not None:
        require_folder(options.out)
    recordings = [read_part(options.run, vehicle, options)]
    recordings += [read_run(path, vehicle, channels=options.channels).recording for path in options.validate]
    runs = [MeasuredRun(vehicle, align(recording)) for recording in recordings]
    for path, run_ in zip((options.run, *options.validate), runs):
        if run_.left_out_s > _UNNAMED_S:
            begin, end = run_.used_s
            print(f"{path}: {begin:.1f} to {end:.1f} s are used, the longest stretch without gaps")
    candidates = (*CANDIDATES, *LITERATURE) if options.literature else CANDIDATES
    with Progress("fitting mount models") as progress:
        fitted = fit_candidates(vehicle, runs[0], candidates, progress.update)
    document = compare(vehicle, runs, fitted)
    if options.out is not None:
        output_folder(options.out)
        write_json(options.out / "comparison.json", document)
        last = runs[-1]
        block = min(round(_SPECTRUM_BLOCK_S * last.rate_hz), len(last.measured))
        simulated = {model.name: predict(vehicle, last, model) for model in fitted}
        write_model_spectra(options.out, last.name, last.sensors, last.measured, simulated, last.rate_hz, block)
    print_table(document)
    return 0


def compare(vehicle: Vehicle, runs: list[MeasuredRun], fitted: tuple[FittedModel, ...]) -> dict[str, Any]:
    """Return scores of every model on every run; the first run is the one that was fitted."""
    models = []
    for model in fitted:
        entry: dict[str, Any] = {
            "name": model.name,
            "stiffness_n_per_m": model.stiffness,
            "damping_n_s_per_m": model.damping,
            "shape": model.shape,
            "on_bounds": model.on_bounds,
            "scores": [dataclasses.asdict(score(run, predict(vehicle, run, model))) for run in runs],
        }
        models.append(entry)
    names = [r.name for r in runs]
    return {"schema": "ride_estimation/comparison/1", "runs": names, "fitted_run": names[0], "models": models}


@dataclasses.dataclass(frozen=True)
class Score:
    """Scores of one model on one run, all vertical channels; spectrum_r and r are blind to gain and are shown to say so."""

    rmse_percent: float
    rmse_m_per_s2: float
    r_squared: float
    vaf: float
    r: float
    spectrum_r: float
    damage_ratio: float | None


def score(run: MeasuredRun, modelled: Array) -> Score:
    """Score a prediction in the time domain, with the scores of document 000 beside."""
    block = min(round(_SPECTRUM_BLOCK_S * run.rate_hz), len(modelled))
    first, model = run.measured[:, 0], modelled[:, 0]
    try:
        damage: float | None = damage_ratio(first, model)
    except InputDataError:
        damage = None  # a constant measurement does no damage
    return Score(
        rmse_percent=100.0 * metrics.nrmse(run.measured, modelled),
        rmse_m_per_s2=metrics.rmse(run.measured, modelled),
        r_squared=metrics.r_squared(run.measured, modelled),
        vaf=metrics.variance_accounted_for(run.measured, modelled),
        r=metrics.pearson_r(run.measured, modelled),
        spectrum_r=spectrum_correlation(first, model, run.rate_hz, block),
        damage_ratio=damage,
    )


def print_table(document: dict[str, Any]) -> None:
    """Print one line per model: error on every run, then the other scores on the last run."""
    names = document["runs"]
    last = "fitted run" if len(names) == 1 else names[-1]
    print(f"error of the vertical body accelerations in % of their standard deviation; other scores on {run_title(last)}")
    head = "".join(f"{run_title(name)[-14:]:>16}" for name in names)
    print(f"{'model':<30}{head}{'R2':>9}{'r':>9}{'spectrum-r':>12}{'damage':>9}")
    for model in document["models"]:
        scores = model["scores"]
        errors = "".join(f"{s['rmse_percent']:>16.2f}" for s in scores)
        s = scores[-1]
        damage = "-" if s["damage_ratio"] is None else f"{s['damage_ratio']:.2f}"
        note = f"  on bound: {', '.join(model['on_bounds'])}" if model["on_bounds"] else ""
        print(f"{model['name']:<30}{errors}{s['r_squared']:>9.4f}{s['r']:>9.4f}{s['spectrum_r']:>12.4f}{damage:>9}{note}")
    best = min(document["models"], key=lambda m: m["scores"][-1]["rmse_percent"])
    voigt = document["models"][0]["scores"][-1]["rmse_percent"]
    for model in dict.fromkeys((document["models"][0]["name"], best["name"])):
        print(_parameters(next(m for m in document["models"] if m["name"] == model)))
    print(
        f"best on {run_title(last)}: {best['name']} with {best['scores'][-1]['rmse_percent']:.2f} %, Voigt {voigt:.2f} %; r and "
        "spectrum-r are blind to gain and offset and cannot rank models"
    )


def _parameters(model: dict[str, Any]) -> str:
    """Return what was fitted for a model, vertical mounts."""
    mounts = "; ".join(
        f"{mount} {plain(k)} N/m, {plain(model['damping_n_s_per_m'][mount])} N s/m"
        for mount, k in model["stiffness_n_per_m"].items()
    )
    shape = "".join(f"; {name} {plain(value)}" for name, value in model["shape"].items())
    return f"{model['name']}, along z: {mounts}{shape}"
