# Copyright 2026 ride_estimation contributors
"""``ride-estimation quarter-car``: the six models of document 002 on a recorded table, with everything it left out."""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import numpy as np

from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import InputDataError
from ride_estimation.identification.quarter_car.checks import check_road, line_test, pitch_evidence
from ride_estimation.identification.quarter_car.fit import QuarterCarFit, fit_models
from ride_estimation.identification.quarter_car.half_car import HalfCarFit, HalfCarMasses, fit_half_car
from ride_estimation.identification.quarter_car.models import PARAMETERS, QuarterCarSimulation
from ride_estimation.io.json_file import write_json
from ride_estimation.io.results import output_folder, require_folder
from ride_estimation.io.tables import Table, read_table


def run(options: argparse.Namespace) -> int:
    """Fit, print the table of models and what is doubtful about each."""
    require_finite(options)
    if options.starts < 0 or options.speed_m_per_s < 0.0:
        given = f"--starts {options.starts}, --speed-m-per-s {options.speed_m_per_s:g}"
        raise InputDataError(f"{given}; allowed: 0 or more")
    if options.roll_envelope and options.speed_m_per_s == 0.0:
        raise InputDataError("--roll-envelope needs --speed-m-per-s: how far the wheel rolls between two samples")
    extra = (options.wheelbase_m, options.rear_sprung_mass_kg, options.rear_unsprung_mass_kg)
    if any(v is not None for v in extra) and (any(v is None for v in extra) or options.speed_m_per_s == 0.0):
        raise InputDataError(
            "a half car needs --wheelbase-m, --rear-sprung-mass-kg, --rear-unsprung-mass-kg and --speed-m-per-s together"
        )
    if options.out is not None:
        require_folder(options.out)
    table = read_table(options.table)
    time, road = table.column("time", "s"), table.column("road", "m")
    body, axle = (table.column(f"{place}_acceleration", "m/s^2") for place in ("body", "axle"))
    rate = (time.size - 1) / float(time[-1] - time[0]) if time[-1] > time[0] else 0.0
    if rate <= 0.0 or np.any(np.abs(np.diff(time) * rate - 1.0) > 0.1):
        raise InputDataError(f"{options.table}: time must rise in equal steps")
    if options.speed_m_per_s > 0.0:
        check = check_road(road, rate, options.speed_m_per_s, options.wheel_radius_m)
        if options.roll_envelope:
            road = check.envelope
            print("road replaced by the envelope of the rolling wheel")
        elif check.objection:
            print(f"warning: {check.objection} (--roll-envelope)")
    fixed = {} if options.spring_rate_n_per_m is None else {"spring_rate": options.spring_rate_n_per_m}
    masses = (options.sprung_mass_kg, options.unsprung_mass_kg)
    noise = (options.noise_m_per_s2, options.noise_m_per_s2)
    results = fit_models(
        road, np.column_stack([body, axle]), rate, sprung_mass=masses[0], unsprung_mass=masses[1], noise_std=noise,
        fixed=fixed, models=tuple(options.models), starts=options.starts,
    )
    for result in results:
        _print(result)
    best = min(results, key=lambda r: r.sum_of_squares)
    plain = min((r for r in results if not r.model.sine), key=lambda r: r.sum_of_squares, default=best)
    residual = body - QuarterCarSimulation(*masses, road, rate).run(plain.values, "")[:, 0]
    print(f"best fit: model {best.model.number}, {best.model.title}")
    samples = 2 * time.size
    # Schwarz 1978, Ann. Statist. 6: a model with more parameters always fits at least as well
    price = [samples * np.log(r.sum_of_squares) + len(r.std) * np.log(samples) for r in results]
    enough = results[int(np.argmin(price))]
    if enough is not best:
        print(f"the simplest that explains as much: model {enough.model.number}, {enough.model.title}")
    if best.sinusoid is not None:
        searched = (PARAMETERS["sine_frequency"].lower, PARAMETERS["sine_frequency"].upper)
        print(line_test(residual, rate, best.sinusoid.frequency_hz, searched).statement)
    if options.speed_m_per_s > 0.0:
        offer = pitch_evidence(residual, axle, rate, options.speed_m_per_s).offer
        if offer:
            print(offer)
    document: dict[str, Any] = {"models": [dataclasses.asdict(r) for r in results]}
    if extra[0] is not None:
        rear = [table.column(name, "m/s^2") for name in _rear_columns(table)]
        half = fit_half_car(
            road, np.column_stack([body, axle, *rear]), rate, HalfCarMasses(*masses, extra[1], extra[2], extra[0]),
            options.speed_m_per_s, options.noise_m_per_s2, starts=options.starts,
        )  # fmt: skip
        _print_half(half)
        if not rear:
            share = half.sum_of_squares / best.sum_of_squares
            print(f"the half car leaves {100.0 * share:.3g} % of the squared error of model {best.model.number}")
        document["half_car"] = dataclasses.asdict(half)
    if options.out is not None:
        output_folder(options.out)
        write_json(options.out / "quarter_car.json", document)
    return 0


def _rear_columns(table: Table) -> list[str]:
    """Return the rear channels a table holds: above the axle, or above and on it."""
    found = [name for name in ("rear_body_acceleration", "rear_axle_acceleration") if name in table.columns]
    if found == ["rear_axle_acceleration"]:
        raise InputDataError("rear_axle_acceleration without rear_body_acceleration: a half car takes the body, or both")
    return found


def _print_half(fit: HalfCarFit) -> None:
    errors = ", ".join(f"{name.replace('_', ' ')} {100.0 * value:.1f} %" for name, value in fit.nrmse.items())
    print(f"\nhalf car, linear: weighted sum of squares {fit.sum_of_squares:.5g}, error {errors}")
    for name, value in fit.values.items():
        flag = " ON BOUND" if name in fit.on_bounds else " not identified" if name in fit.not_identified else ""
        unit = "kg m^2" if name == "pitch_inertia" else "N/m" if name.endswith("rate") else "N s/m"
        print(f"  {name:<18}{value:>12.5g} +- {fit.std[name]:<9.2g} {unit}{flag}")


def _print(result: QuarterCarFit) -> None:
    body, axle = (100.0 * v for v in result.nrmse)
    print(
        f"\nmodel {result.model.number}, {result.model.title}: weighted sum of squares {result.sum_of_squares:.5g}, error body "
        f"{body:.1f} %, axle {axle:.1f} %"
    )
    for name in result.std:
        if not name.startswith("sine"):
            flag = " ON BOUND" if name in result.on_bounds else " not identified" if name in result.not_identified else ""
            print(f"  {name:<18}{result.values[name]:>12.5g} +- {result.std[name]:<9.2g} {PARAMETERS[name].unit}{flag}")
    if result.sinusoid is not None:
        s = result.sinusoid
        print(f"  sinusoid          {s.amplitude:>12.4g} {s.unit} at {s.frequency_hz:.3f} Hz, phase {s.phase_rad:+.2f} rad")
    for objection in result.plausible.objections:
        print(f"  implausible: {objection}")
