# Copyright 2026 ride_estimation contributors
"""``ride-estimation design-test``: drive files of the bench tests that tell a force element as well as wanted."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import InputDataError
from ride_estimation.excitation.jounce_programme import jounce_programme, reference_travel
from ride_estimation.excitation.programmes import validation_signals
from ride_estimation.identification.bench.design import (
    Design,
    DriveSignal,
    candidate_signals,
    design_tests,
)
from ride_estimation.identification.bench.models import BenchModel, model_by_name
from ride_estimation.io.bounded import read_text
from ride_estimation.io.files.channels import UNKNOWN_START_NS, FileChannel
from ride_estimation.io.files.formats import write_measurement_file
from ride_estimation.io.results import output_folder, require_folder
from ride_estimation.io.tables import read_table

_JOUNCE = "jounce_bumper"


def run(options: argparse.Namespace) -> int:
    """Choose the tests, write them, say what they will tell and what not."""
    require_finite(options)
    require_folder(options.out)
    if options.model == _JOUNCE:
        signals = _jounce(options)
    else:
        model, values = _expected(options)
        wanted = _wanted(options, model) * np.abs(values)
        every = candidate_signals(1e-3 * options.stroke_mm, options.highest_hz, options.rate_hz)
        candidates = [every[0], *(signal for signal in every[1:] if signal.name in options.tests)]
        design = design_tests(
            model, values, wanted, candidates, force_noise=options.force_noise_n, peak_speed=options.speed_m_per_s,
            longest_s=options.longest_s,
        )  # fmt: skip
        _print(options, model, values, design)
        signals = [*design.signals, *_validation(options)]
    output_folder(options.out)
    for number, signal in enumerate(signals):
        path = options.out / f"{number}_{signal.name}.{options.format}"
        channel = FileChannel("displacement", "mm", signal.time_s, 1e3 * signal.displacement)
        write_measurement_file(path, [[channel]], UNKNOWN_START_NS)
        largest = 1e3 * float(np.abs(signal.displacement).max())
        print(f"{path}: {signal.duration_s:.0f} s, to {largest:.3g} mm, {signal.peak_speed:.3g} m/s")
    print(f"{sum(s.duration_s for s in signals) / 60.0:.1f} minutes in all; displacement is positive in extension")
    return 0


def _expected(options: argparse.Namespace) -> tuple[BenchModel, NDArray[np.float64]]:
    """Return the model and what its parameters are expected to be."""
    given = _pairs("--expect", options.expect)
    name = options.model
    if options.like is not None:
        name, found = _identified(options.like, name)
        given = {**found, **given}
    if not name:
        raise InputDataError("--model is needed, or --like with the identification.json of a similar element")
    model = model_by_name(name)
    names = [q.name for q in model.quantities]
    missing = [n for n in names if not given.get(n)]
    unknown = [n for n in given if n not in names]
    if missing or unknown:
        raise InputDataError(
            f"--expect: {name} needs {', '.join(f'{q.name} [{q.unit}]' for q in model.quantities)}, none of them zero; "
            f"missing: {', '.join(missing) or 'none'}; unknown: {', '.join(unknown) or 'none'}"
        )
    values = np.array([given[n] for n in names])
    if np.any(values[model.physical_positive] <= 0.0):
        raise InputDataError(f"--expect: every parameter of {name} but a cubic rate must be positive")
    return model, values


def _identified(path: Path, name: str | None) -> tuple[str, dict[str, float]]:
    try:
        document = json.loads(read_text(path))
        found = {str(p["name"]): float(p["value"]) for p in document["parameters"]}
        model = str(document["model"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputDataError(f"{path}: is not an identification.json of identify ({type(error).__name__}: {error})") from error
    if name and name != model:
        raise InputDataError(f"--model {name}: {path} is of {model}")
    return model, found


def _pairs(option: str, given: list[str]) -> dict[str, float]:
    found = {}
    for item in given:
        name, _, value = item.partition("=")
        try:
            found[name] = float(value)
        except ValueError as error:
            raise InputDataError(f"{option} {item!r}: give NAME=NUMBER, for example stiffness=2e5") from error
        if not np.isfinite(found[name]):
            raise InputDataError(f"{option} {item!r}: the number must be finite")
    return found


def _wanted(options: argparse.Namespace, model: BenchModel) -> NDArray[np.float64]:
    own = _pairs("--wanted", options.wanted)
    names = [q.name for q in model.quantities]
    unknown = [n for n in own if n not in names]
    if unknown:
        raise InputDataError(f"--wanted: {', '.join(unknown)}: no parameter of {model.name}; allowed: {', '.join(names)}")
    percent = np.array([own.get(n, options.percent) for n in names])
    if np.any(percent <= 0.0):
        raise InputDataError("--percent and --wanted: allowed: above 0 %")
    return percent / 100.0


def _print(options: argparse.Namespace, model: BenchModel, values: NDArray[np.float64], design: Design) -> None:
    print(f"{model.name}, load cell noise {options.force_noise_n:g} N: standard deviations to be expected")
    for quantity, value, std, wanted in zip(model.quantities, values, design.std, design.wanted, strict=True):
        percent = 100.0 * std / abs(value)
        stated = f"{percent:8.2g} %" if np.isfinite(percent) else "  -"
        short = "" if std <= 1.001 * wanted else "  not as well as wanted"
        print(
            f"  {quantity.name:<18}{value:>12.5g} {quantity.unit:<7}{stated} (wanted {100.0 * wanted / abs(value):.2g} %){short}"
        )
    for said in design.left_out:
        print(f"left out {said}")
    if design.not_identifiable:
        limits = f"{options.longest_s:g} s, {options.stroke_mm:g} mm and {options.speed_m_per_s:g} m/s"
        print(f"cannot be identified to the wanted accuracy within {limits}: {', '.join(design.not_identifiable)}")
    print(
        f"not covered by any such test: forces beyond {options.stroke_mm:g} mm and {options.highest_hz:g} Hz, another preload or "
        "temperature, ageing, and a force law the model does not have (the validation records V1 to V3 show that)"
    )


def _validation(options: argparse.Namespace) -> list[DriveSignal]:
    """Return the three validation signals, within stroke and speed of the machine."""
    found = []
    for name, (time_s, x) in validation_signals(1, max(options.rate_hz, 100.0)).items():
        signal = DriveSignal(name, time_s, x * min(1.0, 1e-3 * options.stroke_mm / float(np.max(np.abs(x)))))
        slower = min(1.0, options.speed_m_per_s / signal.peak_speed)
        found.append(DriveSignal(name, time_s, signal.displacement * slower))
    return found


def _jounce(options: argparse.Namespace) -> list[DriveSignal]:
    """Return the programme of a jounce bumper, scaled to its reference travel; travel into the bumper is negative."""
    if (options.reference_mm is None) == (options.static_curve is None):
        raise InputDataError("a jounce bumper needs either --reference-mm or --static-curve")
    if options.reference_mm is not None:
        reference = 1e-3 * options.reference_mm
    else:
        table = read_table(options.static_curve)
        reference = reference_travel(table.column("travel", "m"), table.column("force", "N"))
    parts = jounce_programme(reference, peak_speed=options.speed_m_per_s, rate_hz=options.rate_hz)
    print(
        f"jounce bumper, reference travel {1e3 * reference:.4g} mm: static ramps for curve and hysteresis, dynamic ramps and "
        "sweep for the cells; add recorded roads to them. Its law is found by the tests, so no accuracy can be promised"
    )
    beyond = f"travel beyond {1e3 * reference:.4g} mm"
    print(f"not identifiable: {beyond}, the hysteresis height near it, relaxation slower than the rests")
    return [DriveSignal(part.name, part.time_s, -part.travel) for part in parts]
