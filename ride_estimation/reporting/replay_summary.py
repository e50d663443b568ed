# Copyright 2026 ride_estimation contributors
"""The first screen of a replay report: the result in one sentence, loads, comfort, modes, and what is not known."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ride_estimation.assessment.durability import Damage
from ride_estimation.assessment.run_assessment import MountDamage, RunAssessment
from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.reporting.damage_plots import worst
from ride_estimation.reporting.numbers import interval, plain, with_half
from ride_estimation.reporting.page import Digits, Page
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.identified import with_identified
from ride_estimation.vehicles.modes import NEUTRAL_HZ, Mode, linearise, modes
from ride_estimation.vehicles.vehicle import Vehicle

#: half width of a 95 % interval in standard deviations
HALF_95 = 1.96
_STATUS = {
    "not_identifiable": "cannot be identified from this run", "suspect": "doubtful", "invalid": "invalid",
    "estimating": "still converging", "starting": "not started",
}  # fmt: skip
_MOST_MODES = 8


def summary(
    page: Page, vehicle: Vehicle, run: OfflineRun, result: Mapping[str, Any], assessment: RunAssessment
) -> None:
    """Add the first screen.

    Parameters
    ----------
    page
        The report.
    vehicle, run, result, assessment
        What was known, what was found, ``result.json``, damage and comfort.
    """
    page.verdict(verdict(run, result, assessment))
    loads = _loads(run, assessment)
    if loads:
        page.beside({"Most damaging force of each mount": (
            ("mount", "axis", "static [kN]", "peak [kN]", "rms [kN]", "equivalent amplitude [kN]", "damage [% of all]"), loads
        )})  # fmt: skip
    parts: dict[str, tuple[Sequence[str], list[list[object]]]] = {}
    found = found_modes(vehicle, run.best_parameters)
    if found:
        parts["Modes with the identified parameters"] = (("mode", "frequency [Hz]", "damping ratio [%]"), [
            [m.label, Digits(with_half(m.frequency_hz, m.frequency_half)),
             Digits(with_half(100.0 * m.damping_ratio, 100.0 * m.damping_half))]
            for m in found[:_MOST_MODES]
        ])  # fmt: skip
    if assessment.exposures:
        parts["Ride comfort"] = (("place", "a_w,z [m/s²]", "A(8) [m/s²]", "VDV day [m/s¹·⁷⁵]"), [
            [e.location, *(Digits(plain(v, 3)) for v in (e.axes[2].weighted_rms, e.a8, e.dose))] for e in assessment.exposures
        ])  # fmt: skip
    page.beside(parts)
    page.beside({"What is not known": (("what", "why"), list(not_known(run)) or [["nothing is open", ""]])})
    page.text(
        "± and intervals are 95 %. Peak: largest force, static share included; rms: about the mean. Equivalent amplitude: a 1 Hz "
        "sine with the same damage in the same time. Intervals of modes take the parameters as independent."
    )


def verdict(run: OfflineRun, result: Mapping[str, Any], assessment: RunAssessment) -> str:
    """Return the result of a replay in one sentence."""
    words = []
    found = worst(assessment.damages)
    known_loads = [d for d in found.values() if d.estimated.known]
    if known_loads:
        leading = max(known_loads, key=lambda d: d.estimated.value)
        words.append(
            f"the most damaging load is that of {leading.mount} {leading.axis}: peak {_peak(run, leading)} kN, equivalent "
            f"amplitude {_equivalent(leading.estimated)} kN"
        )
    elif found:
        words.append("no attachment force is known well enough to state its damage")
    stiff = [p for p in run.best_parameters if p.name.endswith(".z.stiffness") and p.value > 0.0]
    sure = [p for p in stiff if p.status.value == "valid"]
    if stiff:
        known = f"within {plain(100.0 * HALF_95 * max(p.std / p.value for p in sure), 2)} %" if sure else ""
        words.append(f"vertical stiffness of {len(sure)} of {len(stiff)} mounts is known {known}".rstrip())
    if assessment.exposures:
        most = max(assessment.exposures, key=lambda e: e.a8)
        words.append(f"A(8) is {plain(most.a8, 3)} m/s² ({most.location})")
    count = len(result["warnings"])
    words.append(f"{100.0 * run.valid.mean():.3g} % of {run.time_s[-1]:.3g} s is usable")
    words.append(f"{count} warning{'s' * (count != 1)}" if count else "no warnings")
    text = "; ".join(words)
    return f"{text[0].upper()}{text[1:]}."


def _peak(run: OfflineRun, damage: MountDamage) -> str:
    place = run.mount_names.index(damage.mount), AXES.index(damage.axis)
    force, std = run.force[run.valid, place[0], place[1]], run.force_std[run.valid, place[0], place[1]]
    most = int(np.argmax(np.abs(force)))
    return with_half(1e-3 * float(force[most]), 1e-3 * HALF_95 * float(std[most]))


def _equivalent(damage: Damage) -> str:
    low, high = 1e-3 * damage.equivalent_lower, 1e-3 * damage.equivalent_upper
    return f"{plain(1e-3 * damage.equivalent_amplitude, 3)} ({interval(low, high, 3)})"


def _loads(run: OfflineRun, assessment: RunAssessment) -> list[list[object]]:
    """Return one row per mount; the error of the force counts as one factor on its dynamic part, as in its damage."""
    found = worst(assessment.damages)
    total = sum(d.estimated.value for d in found.values())
    rows: list[list[object]] = []
    for mount in run.mount_names:
        if mount not in found:
            continue
        damage = found[mount]
        e = damage.estimated
        force = run.force[run.valid, run.mount_names.index(mount), AXES.index(damage.axis)]
        rms = float(np.std(force))
        rows.append([
            mount, damage.axis, Digits(plain(1e-3 * float(np.mean(force)), 3)), Digits(_peak(run, damage)),
            Digits(with_half(1e-3 * rms, 1e-3 * HALF_95 * rms * e.relative_std)), Digits(_equivalent(e)),
            Digits(plain(100.0 * e.value / total, 2)) if total > 0.0 else "-",
        ])  # fmt: skip
    return rows


@dataclasses.dataclass(frozen=True)
class FoundMode:
    """A mode of the vehicle with the parameters of a run, with half widths of the 95 % intervals."""

    label: str
    frequency_hz: float
    frequency_half: float
    damping_ratio: float
    damping_half: float


def found_modes(vehicle: Vehicle, parameters: Sequence[Estimate]) -> list[FoundMode]:
    """Return the oscillating modes with identified parameters; empty where the vehicle cannot be linearised.

    ``half^2 = sum_i (1.96 (f(p + s_i e_i) - f(p)))^2``: every parameter is moved by its standard deviation, one at a time.

    Parameters
    ----------
    vehicle
        The vehicle file.
    parameters
        Of the run.
    """
    values = {p.name: (p.value, p.std) for p in parameters if p.value > 0.0 and math.isfinite(p.std)}
    try:
        found = _modes(vehicle, values)
        moved = [_modes(vehicle, {**values, n: (value + std, std)}) for n, (value, std) in values.items() if std > 0.0]
    except ConfigurationError:
        return []
    rows = []
    for mode in found:
        if not 0.0 <= mode.damping_ratio < 1.0 or mode.frequency_hz < NEUTRAL_HZ:
            continue
        square = np.zeros(2)
        for others in moved:
            # modes may change places: the one with the most similar shape is the same
            same = max(others, key=lambda other: _likeness(mode, other))
            square += (same.frequency_hz - mode.frequency_hz) ** 2, (same.damping_ratio - mode.damping_ratio) ** 2
        half = HALF_95 * np.sqrt(square)
        rows.append(FoundMode(mode.words, mode.frequency_hz, float(half[0]), mode.damping_ratio, float(half[1])))
    return rows


def _modes(vehicle: Vehicle, values: Mapping[str, tuple[float, float]]) -> tuple[Mode, ...]:
    return modes(linearise(assemble(with_identified(vehicle, values, "this run"))))


def _likeness(one: Mode, other: Mode) -> float:
    """Return the modal assurance criterion of two shapes."""
    cross = abs(np.vdot(one.shape, other.shape)) ** 2
    return float(cross / (np.vdot(one.shape, one.shape).real * np.vdot(other.shape, other.shape).real))


def not_known(run: OfflineRun) -> Iterator[list[object]]:
    """Yield what the run left open, with the reason: parameters by status, sensors that were left out."""
    groups: dict[tuple[str, str], list[str]] = {}
    for p in run.parameters:
        if p.status.value != "valid":
            groups.setdefault((p.status.value, p.reason.partition("; ")[0]), []).append(p.name)
    for (status, reason), names in sorted(groups.items(), key=lambda item: -len(item[1])):
        yield [f"{grouped(names, run.mount_names)}: {_STATUS[status]}", reason]
    left_out = [name for name, health in run.health.sensors.items() if health.refused]
    if left_out:
        yield [f"sensors left out for a part of the run: {', '.join(left_out)}", "see Data quality"]
    if not run.valid.all():
        yield [f"{plain(100.0 * (1.0 - float(run.valid.mean())), 2)} % of the run", "not usable: gaps, settling or faults"]


def grouped(names: Iterable[str], mounts: Sequence[str]) -> str:
    """Return names of parameters in few words: what holds at every mount is named once.

    Examples
    --------
    >>> grouped(["a.x.damping", "b.x.damping", "a.y.damping", "cab.mass"], ("a", "b"))
    'x damping of all mounts, y damping of a, cab.mass'
    """
    kinds: dict[str, list[str]] = {}
    for name in names:
        mount, _, kind = name.partition(".")
        if mount in mounts and kind:
            kinds.setdefault(kind.replace(".", " "), []).append(mount)
        else:
            kinds.setdefault(name, [])
    where: dict[str, list[str]] = {}
    for kind, of in kinds.items():
        words = "" if not of else " of all mounts" if len(of) == len(mounts) else f" of {', '.join(of)}"
        where.setdefault(words, []).append(kind)
    return ", ".join(f"{', '.join(kind)}{words}" for words, kind in where.items())
