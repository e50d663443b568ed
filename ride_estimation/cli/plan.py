# Copyright 2026 ride_estimation contributors
"""``ride-estimation plan``: what a sensor set will be able to tell, before the truck is instrumented."""

from __future__ import annotations

import argparse
import math
import statistics

from ride_estimation.api.planning import plan
from ride_estimation.cli.finite import require_finite
from ride_estimation.identification.fisher import Identifiability
from ride_estimation.identification.sensor_plan import Option, SensorPlan
from ride_estimation.vehicles.modes import NEUTRAL_HZ

_SHOWN = 6  # null directions that are printed one by one


def run(options: argparse.Namespace) -> int:
    """Print what is identifiable, what is not and why, and the ranked additions."""
    require_finite(options)
    found = plan(
        options.vehicle, road=options.road, speed=options.speed, duration=options.duration, rate=options.rate,
        rigid_frame=options.rigid_frame, unknown_mass=options.unknown_mass,
    )  # fmt: skip
    vehicle, result = found.vehicle, found.result
    print(
        f"{vehicle.name}: class {options.road} road, {options.speed:g} m/s, {options.duration:g} s at {options.rate:g} Hz, "
        f"{'rigid' if options.rigid_frame else 'twisting'} frame"
    )
    for words in result.warnings:
        print(f"warning: {words}")
    modes = [f"{label} {f'{hz:.3g} Hz' if hz > NEUTRAL_HZ else 'not held'}" for label, hz in result.modes_hz]
    print(f"undamped modes: {', '.join(modes)}")
    for words in result.layouts:
        print(words)
    known = ", ".join(f"{n} ({100 * std:.2g} %)" if std else n for n, std in result.known.items())
    print(f"known beforehand: {known or 'nothing (forces are then ratios only)'}")
    _print_bounds(result)
    _print_options(result)
    return 0


def _print_bounds(result: SensorPlan) -> None:
    present = result.present
    print(f"rank {present.rank} of {len(present.names)} parameters")
    if result.ratio_to:
        print(
            f"the scale is not told: {result.ratio_to} and everything that goes with it may be off by one common factor; "
            f"ratios to {result.ratio_to} are told as well as the second column says"
        )
    if present.rank or result.ratio_to:
        head = f"{'smallest std':>18}" + (f"{'of the ratio':>18}" if result.ratio_to else "")
        print(f"\n{'parameter':<40}{head}")
        for name, std in zip(present.names, present.relative_std):
            ratio = _percent(result.ratios.get(name, math.inf)) if result.ratio_to and name != result.ratio_to else ""
            print(f"{name:<40}{_percent(float(std)):>18}{ratio:>18}".rstrip())
        print(
            "(Cramer-Rao: white noise and a perfect model; errors of gain, place and alignment of the sensors come on top:\n"
            "little along z, several times these bounds along x and y where the mounts are stiff)"
        )
    for words in present.null_directions[:_SHOWN]:
        print(f"not identifiable: {words}")
    if len(present.null_directions) > _SHOWN:
        print(f"not identifiable: {len(present.null_directions) - _SHOWN} more combinations like these")


def _print_options(result: SensorPlan) -> None:
    worth = {option.name: _worth(option, result.present) for option in result.options}
    print("\nadditions, best first:")
    for name, words in worth.items():
        if words:
            print(f"  {name}: {words}")
    useless = [name for name, words in worth.items() if not words]
    if useless:
        print(f"  no difference by itself: {'; '.join(useless)}")


def _percent(std: float) -> str:
    return f"{100 * std:.2g} %" if math.isfinite(std) else "not identifiable"


def _worth(option: Option, present: Identifiability) -> str:
    """Return what an addition brings: parameters or ratios gained, else the change of the median bound, else nothing."""
    finite = [float(s) for s in present.relative_std if math.isfinite(s)]
    median, total = _percent(option.median_relative_std), len(present.names)
    if option.gained:
        return f"{option.identifiable} of {total} known or identifiable instead of {len(finite)}, median bound {median}"
    if option.rank > present.rank and option.identifiable < total and option.rank > option.identifiable:
        return f"tells ratios and combinations only, rank {option.rank} of {total} instead of {present.rank}"
    if finite and option.median_relative_std < 0.95 * statistics.median(finite):
        return f"median bound {median} instead of {_percent(statistics.median(finite))}"
    return ""
