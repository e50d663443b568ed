# Copyright 2026 ride_estimation contributors
"""``ride-estimation plan``: what a sensor set will be able to tell, before the truck is instrumented."""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Collection
from typing import TYPE_CHECKING

from ride_estimation.api.planning import Plan, plan
from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.progress import Progress
from ride_estimation.vehicles.modes import NEUTRAL_HZ

if TYPE_CHECKING:
    from ride_estimation.api.predicted import Addition, PredictedReplay
    from ride_estimation.identification.fisher import Identifiability
    from ride_estimation.identification.sensor_plan import Option, SensorPlan

_SHOWN = 6  # null directions that are printed one by one


def run(options: argparse.Namespace) -> int:
    """Print what is identifiable, what is not and why, and the ranked additions."""
    require_finite(options)
    with Progress("plan, simulated drives") as progress:
        found = plan(
            options.vehicle, road=options.road, speed=options.speed, duration=options.duration, rate=options.rate,
            rigid_frame=options.rigid_frame, unknown_mass=options.unknown_mass, drives=not options.bounds_only,
            report=progress.reach,
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
    _print_bounds(result, found.replay)
    _print_options(result, {a.name for a in found.helpful})
    if found.replay is not None:
        _print_prediction(found, found.replay)
    return 0


def _print_bounds(result: SensorPlan, replay: PredictedReplay | None) -> None:
    present = result.present
    print(f"rank {present.rank} of {len(present.names)} parameters")
    if result.ratio_to:
        print(
            f"the absolute scale is not observable: {result.ratio_to} and everything proportional to it may be off by a factor; "
            f"ratios to {result.ratio_to} have the standard deviation in the second column"
        )
    if present.rank or result.ratio_to:
        stated = {p.name: p for p in replay.parameters} if replay is not None else {}
        head = f"{'bound':>18}" + (f"{'of the ratio':>18}" if result.ratio_to else "")
        head += f"{'replay std':>14}  status" if stated else ""
        print(f"\n{'parameter':<40}{head}")
        for name, std in zip(present.names, present.relative_std):
            ratio = _percent(result.ratios.get(name, math.inf)) if result.ratio_to and name != result.ratio_to else ""
            cells = f"{_percent(float(std)):>18}" + (f"{ratio:>18}" if result.ratio_to else "")
            if name in stated:
                cells += f"{_percent(stated[name].relative_std):>14}  {stated[name].words}"
            print(f"{name:<40}{cells}".rstrip())
        print("(bound: Cramer-Rao bound for white noise, a perfect model and a frame that deforms by a tenth of its motion;")
        print(" replay std: what the estimator states after simulated drives with the installation errors of good sensors)")
    for words in present.null_directions[:_SHOWN]:
        print(f"not identifiable: {words}")
    if len(present.null_directions) > _SHOWN:
        print(f"not identifiable: {len(present.null_directions) - _SHOWN} more combinations like these")


def _print_options(result: SensorPlan, driven: Collection[str]) -> None:
    """Print what additions do to the bound; those that simulated drives judge are left to these."""
    worth = {option.name: _worth(option, result.present) for option in result.options if option.name not in driven}
    if not worth:
        return
    print("\nforce references and their effect on the bound, best first:" if driven else "\nadditions by the bound, best first:")
    for name, words in worth.items():
        if words:
            print(f"  {name}: {words}")
    useless = [name for name, words in worth.items() if not words]
    if useless:
        print(f"  no lower bound by itself: {'; '.join(useless)}")


def _print_prediction(found: Plan, replay: PredictedReplay) -> None:
    """Print what replay will estimate, what replay and diagnose will refuse, and the sensor that helps most."""
    if replay.refusal:
        print(f"\nreplay will refuse: {replay.refusal}")
    else:
        valid = replay.of_status("valid")
        print(
            f"\nreplay will identify {len(valid)} of {len(replay.parameters)} parameters within {replay.duration_s:g} s"
            + (f": {', '.join(valid)}" if valid else "")
        )
    print(f"diagnose will refuse: {replay.diagnosis}" if replay.diagnosis else "diagnose will accept this layout")
    for a in found.helps[:3]:
        print(f"  with {a.name}: {_brings(a)}")
    if found.single is not None:
        print(f"the one sensor that helps most: {found.single.name}: {_brings(found.single)}")
    elif found.helps:
        print(f"what helps most: {found.helps[0].name}")
    elif found.helpful:
        print("no further motion sensor improves this noticeably")


def _brings(addition: Addition) -> str:
    return f"{addition.valid} parameters valid, standard deviations {addition.improvement:.2g} times smaller"


def _percent(std: float) -> str:
    return f"{100 * std:.2g} %" if math.isfinite(std) else "not identifiable"


def _worth(option: Option, present: Identifiability) -> str:
    """Return what an addition brings: parameters or ratios gained, else the change of the median bound, else nothing."""
    finite = [float(s) for s in present.relative_std if math.isfinite(s)]
    median, total = _percent(option.median_relative_std), len(present.names)
    if option.gained:
        return f"{option.identifiable} of {total} known or identifiable instead of {len(finite)}, median bound {median}"
    if option.rank > present.rank and option.identifiable < total and option.rank > option.identifiable:
        return f"identifies ratios and combinations only, rank {option.rank} of {total} instead of {present.rank}"
    if finite and option.median_relative_std < 0.95 * statistics.median(finite):
        return f"median bound {median} instead of {_percent(statistics.median(finite))}"
    return ""
