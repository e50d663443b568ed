# Copyright 2026 ride_estimation contributors
"""Procedures on recorded runs: damping against frequency, operating range, road class, force of an element step by step."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.stability import STABILITY_BOUNDS, largest_explicit_step, require_explicit_step
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.excitation import jounce_programme, road_analysis
from ride_estimation.identification import nonparametric_damping
from ride_estimation.io.atomic import replacing
from ride_estimation.io.document import read_yaml
from ride_estimation.io.results import output_folder
from ride_estimation.io.tables import Table, read_table
from ride_estimation.io.vehicle_mechanics import read_element, read_seen
from ride_estimation.simulation.co_simulation import ElementStepper
from ride_estimation.vehicles.data_range import BEYOND, seen_in, seen_in_contact

#: frequencies of the damping that are printed; all go into --out
_PRINTED = 12


def uniform_rate(table: Table, column: str = "time", unit: str = "s") -> float:
    """Return the samples per second (or metre) of a table whose column rises in even steps.

    Raises
    ------
    InputDataError
        Steps that do not rise or differ by more than 10 %.
    """
    t = table.column(column, unit)
    if t.size < 3 or (t[1:] <= t[:-1]).any():
        raise InputDataError(f"{table.path}: {column} must rise from row to row")
    step = float(t[-1] - t[0]) / (t.size - 1)
    if (abs(t[1:] - t[:-1] - step) > 0.1 * step).any():
        raise InputDataError(f"{table.path}: {column} steps vary by more than 10 %; resample the record")
    return 1.0 / step


def write_columns(path: Path, header: Sequence[str], *columns: np.ndarray[Any, Any]) -> None:
    """Write columns as CSV with units in the header."""
    output_folder(path.parent)
    with replacing(path) as place, place.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))


def _damping(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    body, base = (table.column(name, "m/s^2") for name in (options.body, options.base))
    if not (options.mass_kg > 0.0 and options.stiffness_n_per_m > 0.0):
        given = f"--mass-kg {options.mass_kg:g}, --stiffness-n-per-m {options.stiffness_n_per_m:g}"
        raise InputDataError(f"{given}; allowed: above 0")
    found = nonparametric_damping.measured_damping(
        body, base, uniform_rate(table), options.block, options.mass_kg, options.stiffness_n_per_m
    )
    first, last = options.range_hz
    inside = (found.frequency_hz >= first) & (found.frequency_hz <= last)
    if inside.sum() < 3:
        raise InputDataError(
            f"--range-hz {first:g} {last:g} holds {inside.sum()} coherent lines; they run from {found.frequency_hz[0]:.3g} to "
            f"{found.frequency_hz[-1]:.3g} Hz (a longer --block has more lines)"
        )
    print(f"damping C(j omega) = (-m A - k D) / V, resolution {found.resolution_hz:.3g} Hz, {inside.sum()} coherent lines")
    print(f"{'Hz':>8}{'taken up N s/m':>18}{'std':>10}{'in phase N s/m':>18}")
    for i in np.flatnonzero(inside)[:: max(1, int(inside.sum()) // _PRINTED)]:
        print(
            f"{found.frequency_hz[i]:>8.3f}{found.damping[i].real:>18.4g}{found.std[i]:>10.2g}{found.damping[i].imag:>18.4g}"
        )
    _band_fit(options, found, inside)
    if options.out is not None:
        header = ["frequency_hz", "damping_n_s_per_m", "in_phase_n_s_per_m", "std_n_s_per_m"]
        write_columns(options.out, header, found.frequency_hz, found.damping.real, found.damping.imag, found.std)


def _band_fit(options: argparse.Namespace, found: nonparametric_damping.MeasuredDamping, inside: Any) -> None:
    omega = 2.0 * np.pi * found.frequency_hz[inside]
    level = max(float(np.median(found.damping[inside].real)), 1e-3 * options.mass_kg)
    start = nonparametric_damping.BandDamping(options.stiffness_n_per_m, level, level, float(np.sqrt(omega[0] * omega[-1])), 0.7)
    weight = 1.0 / np.maximum(found.transmissibility_std[inside], 1e-6)
    fit = nonparametric_damping.fit_band_damping(omega, options.mass_kg, found.transmissibility[inside], weight, start)
    units = ("N/m", "N s/m", "N s/m", "rad/s", "1")
    for (name, value), std, unit in zip(dataclasses.asdict(fit.band).items(), fit.std, units, strict=True):
        told = "" if std < 0.5 * value else "  not identifiable from this run"
        print(f"  {name:<12}{value:>12.5g} +- {std:<10.2g}{unit}{told}")
    if not fit.filter_identifiable:
        k, c = fit.plain
        print(f"a spring of {k:.5g} N/m and a damper of {c:.4g} N s/m explain as much: the filter is not identifiable")
    print(f"chi-square a degree {fit.chi_square:.3g}" + (": the band law is not all of it" if fit.chi_square > 2.0 else ""))


def _travel(path: Path) -> tuple[Any, Any]:
    table = read_table(path)
    travel = table.column("travel", "m")
    return travel, np.gradient(travel) * uniform_rate(table)


def _operating_range(options: argparse.Namespace) -> None:
    margin = jounce_programme.MARGIN if options.margin is None else options.margin
    if not margin >= 0.0:
        raise InputDataError(f"--margin {margin:g}: allowed: 0 or more")
    parts = [_travel(path) for path in options.files]
    travel, rate = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    hull = jounce_programme.operating_hull(travel, rate, margin)
    farthest, (slowest, fastest) = float(hull.vertices[:, 0].max()), (float(f(hull.vertices[:, 1])) for f in (np.min, np.max))
    print(
        f"in contact {100 * np.mean(travel >= 0.0):.3g} % of the time; travel to {1e3 * travel.max():.4g} mm, with the margin "
        f"{1e3 * farthest:.4g} mm; speed {slowest:.3g} to {fastest:.3g} m/s; {len(hull.vertices)} corners"
    )
    if options.programme:
        runs = [_travel(path) for path in options.programme]
        driven, speeds = (np.concatenate([run[i] for run in runs]) for i in (0, 1))
        covered = jounce_programme.operating_hull(driven, speeds, 0.0)
        loaded = travel >= 0.0
        share = float(np.mean(covered.contains(travel[loaded], rate[loaded])))
        rest = "" if share > 0.999 else "; the rest is unseen"
        print(f"the programme covers {100 * share:.4g} % of the loaded samples{rest}")
    if options.out is not None:
        write_columns(options.out, ["travel_m", "speed_m_per_s"], hull.vertices[:, 0], hull.vertices[:, 1])


def _road(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    if options.speed_m_per_s is None:
        spacing = 1.0 / uniform_rate(table, "distance", "m")
    elif options.speed_m_per_s > 0.0:
        spacing = options.speed_m_per_s / uniform_rate(table)
    else:
        raise InputDataError(f"--speed-m-per-s {options.speed_m_per_s:g}: allowed: above 0")
    height = table.column(options.column, "m")
    fit = road_analysis.fit_road(height, spacing)
    print(
        f"ISO 8608 class {fit.iso_class}: Gd(n0) {1e6 * fit.roughness:.4g}e-6 m^3, waviness {fit.waviness:.3g}, "
        f"{height.size * spacing:.0f} m"
    )
    along = road_analysis.road_spectrogram(height, spacing)
    longest = along.band(0.0, 0.1)
    place = float(along.distance[int(np.argmax(longest))])
    wave = 1.0 / float(along.wavenumber[1:][np.argmax(along.density[1:, int(np.argmax(longest))])])
    size = 1e3 * float(np.sqrt(longest.max()))
    print(f"long waves stand at {place:.0f} m: {wave:.3g} m long, {size:.3g} mm rms above 10 m length")
    for frequency in options.frequency_hz:
        speed = road_analysis.speed_of_excitation(wave, frequency)
        print(f"they excite {frequency:g} Hz at {speed:.3g} m/s ({3.6 * speed:.3g} km/h)")


def _force(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    deflection = table.column("displacement", "m")
    problems: list[str] = []
    mapping = read_yaml(options.element)
    element = read_element(mapping, "element", problems, {})
    known = read_seen(mapping, "element", problems)
    if element is None or problems:
        raise ConfigurationError(problems, where=str(options.element))
    stepper = ElementStepper(element, 1.0 / rate)
    speed = np.gradient(deflection) * rate
    force = np.array([stepper.step(float(x), float(v)) for x, v in zip(deflection, speed, strict=True)])
    write_columns(options.out, ["time_s", "force_n"], table.column("time", "s"), force)
    print(f"{element.KIND} stepped at {rate:g} Hz: force {force.min():.5g} to {force.max():.5g} N, {np.std(force):.4g} N rms")
    if known is None:
        here = None
    elif _has_contact(element, known.deflection):
        here = seen_in_contact(deflection, force != 0.0, 1.0 / rate)
    else:
        here = seen_in(deflection, 1.0 / rate)
    if known is not None and here is not None and here.deflection > BEYOND * known.deflection:
        print(
            f"warning: the record goes {1e3 * here.deflection:.3g} mm far, the data the element was identified from "
            f"{1e3 * known.deflection:.3g} mm: force beyond that is extrapolated (is extension positive?)"
        )
    _explicit_steps(element, float(np.abs(speed).max()), options.explicit_step_s)
    if "force" in table.columns:
        measured = table.column("force", "N")
        error = measured - force - float(np.mean(measured - force))
        print(f"measured force of the file: NRMSE {100 * float(np.std(error) / max(np.std(measured), 1e-300)):.3g} %")


def _has_contact(element: ForceElement, deflection: float) -> bool:
    """Return whether an element at rest pushes on one side only, as a bumper does."""
    pushes = [ElementStepper(element, 1.0).step(side * deflection, 0.0) != 0.0 for side in (-1.0, 1.0)]
    return pushes[0] != pushes[1]


def _explicit_steps(element: ForceElement, peak_speed: float, step_s: float | None) -> None:
    """Print below which step an explicit solver integrates the memory of the element on this record; refuse a given one."""
    longest = {method: largest_explicit_step(element, peak_speed, method) for method in STABILITY_BOUNDS}
    if math.isinf(longest["euler"]):
        print("explicit solvers: no memory with a rate, any step is stable")
        return
    listed = ", ".join(f"{method} below {1e3 * step:.3g} ms" for method, step in longest.items())
    print(f"explicit solvers at {peak_speed:.3g} m/s: {listed}; the exact step used here has no bound")
    if step_s is not None:
        require_explicit_step(element, step_s, peak_speed)


RUN_PROCEDURES = {"damping": _damping, "operating-range": _operating_range, "road": _road, "force": _force}
