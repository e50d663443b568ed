# Copyright 2026 ride_estimation contributors
"""Sections of the replay report beside motion and parameters: spectra, mounts, durability, comfort, ladder of models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ride_estimation.assessment.durability import EQUIVALENT_RATE_HZ
from ride_estimation.assessment.ride_comfort import ACTION_VALUE_A8, ACTION_VALUE_VDV, LIMIT_VALUE_A8, LIMIT_VALUE_VDV
from ride_estimation.assessment.run_assessment import RunAssessment
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.reporting import damage_plots, replay_mounts, replay_plots, replay_spectra
from ride_estimation.reporting.numbers import interval, plain
from ride_estimation.reporting.page import Digits, Page
from ride_estimation.reporting.replay_mounts import LawStiffness, StiffnessClass
from ride_estimation.reporting.side_signals import SideSignals


def spectra(page: Page, run: OfflineRun, side: SideSignals) -> None:
    """Add power spectra, spectrogram and transmissibility."""
    page.heading("Spectra and transmissibility")
    if not replay_spectra.block_of(run):
        page.text("The run is too short for a spectrum.")
        return
    page.text(f"Spectra: {replay_spectra.spectrum_words(run)}.")
    page.figure(replay_spectra.power_spectra(run), "Power spectral density of the CG acceleration", tight=False)
    page.figure(replay_spectra.spectrogram(run), "Spectrogram of the vertical CG acceleration", tight=False)
    functions = replay_spectra.transmissibilities(run, side.offsets, side.base)
    if not functions:
        page.text(
            "No transmissibility: it needs accelerometers at the mount bases (sensors with mount: in the vehicle file) and a run "
            f"of at least {0.5 * (replay_spectra.LEAST_AVERAGES + 1) * replay_spectra.BLOCK_S:g} s."
        )
        return
    averages = next(iter(functions.values())).averages
    page.figure(
        replay_spectra.transmissibility_plot(functions),
        f"Frequency response from base to body, vertical, at each mount (H1, {averages} averages); heave is mean base to CG",
        tight=False,
    )
    page.text(
        "Every curve takes one base as the only input. Where other mounts move the body too the coherence falls below one, and "
        "that curve means little there (phase is drawn from a coherence of 0.5 on); heave is the least disturbed by that."
    )


def mounts(page: Page, run: OfflineRun, side: SideSignals) -> None:
    """Add hysteresis loops and dynamic stiffness by amplitude."""
    if not run.mount_names:
        return
    page.heading("Mounts: hysteresis and dynamic stiffness")
    cells = "Grey is a load cell. " if side.cells else "Without a load cell the estimate rests on equilibrium and the law. "
    page.text(
        f"Tension over deflection, about the mean, busiest seconds of each mount. {cells}"
        "The law is that of the vehicle file with the stiffness and damping found in this run."
    )
    curves = {
        (m, a): replay_mounts.mount_curves(run, m, a, side.elements.get((m, a)), _cell(side, name, a))
        for m, name in enumerate(run.mount_names) for a in range(3) if (m, a) in side.elements
    }  # fmt: skip
    vertical = {m: curve for (m, a), curve in curves.items() if a == 2}
    if not vertical:
        return
    most = max(vertical, key=lambda m: float(np.std(run.force[run.valid, m, 2])))
    page.figure(
        replay_mounts.large_loop(run, f"{run.mount_names[most]} z, the largest load", vertical[most]),
        "Hysteresis loop of the mount with the largest load, and what the law leaves of its force over the rate", tight=False,
    )  # fmt: skip
    page.figure(
        replay_mounts.loops(run, run.mount_names, curves), "Hysteresis loops of every mount, one scale of force", tight=False
    )
    rate = replay_spectra.tick_rate(run)
    found: dict[str, tuple[list[StiffnessClass], LawStiffness]] = {}
    for m, curve in vertical.items():
        force = curve.estimated if curve.measured is None else curve.measured
        classes = replay_mounts.stiffness_by_amplitude(curve.deflection, force, run.valid, rate)
        if any(len(one.frequency_hz) for one in classes):
            amplitude = np.sqrt(2.0) * float(np.median([one.amplitude for one in classes]))
            law = replay_mounts.law_stiffness(side.elements[m, 2], _relative_stds(run, m), amplitude)
            found[f"{run.mount_names[m]} z"] = (classes, law)
    if found:
        of = "measured" if all(curve.measured is not None for curve in vertical.values()) else "estimated"
        page.figure(
            replay_mounts.stiffness_plot(found),
            f"Dynamic stiffness and loss angle by frequency and amplitude from the {of} force, with ± 2 std (coherence of at "
            "least 0.8), and the law with the values found",
            tight=False,
        )  # fmt: skip


def _relative_stds(run: OfflineRun, mount: int) -> dict[str, float]:
    """Return the relative standard deviations of vertical stiffness and damping of a mount by role."""
    names = {f"{run.mount_names[mount]}.z.{role}": role for role in ("stiffness", "damping")}
    own = (p for p in run.best_parameters if p.name in names)
    return {names[p.name]: p.std / p.value for p in own if p.value > 0.0 and math.isfinite(p.std)}


def _cell(side: SideSignals, mount: str, axis: int) -> Any:
    cell = side.cells.get(mount)
    return None if cell is None else cell[:, axis]


def durability(page: Page, run: OfflineRun, assessment: RunAssessment) -> None:
    """Add damage per mount and axis, rainflow matrices, range pairs and damage over time."""
    if not run.mount_names:
        return
    page.heading("Durability of the attachment forces")
    for note in assessment.notes:
        page.text(f"{note[0].upper()}{note[1:]}.")
    if not assessment.damages:
        return
    page.text(
        f"Rainflow counting after ASTM E1049, pseudo-damage = sum of range^{assessment.slope:g}; only its ratios mean "
        "anything, so it is stated relative to the worst force (absolute values: result.json). "
        f"The equivalent amplitude is that of a sine of {EQUIVALENT_RATE_HZ:g} Hz that does the same damage in the same time. "
        "The interval (95 %) takes the stated uncertainty of the force as one unknown factor, the kind of error that changes "
        "damage most, and every cycle with the uncertainty of its time; where the lower end is zero the damage is not known."
    )
    measured = any(d.measured is not None for d in assessment.damages)
    largest = max(d.estimated.value for d in assessment.damages)
    rows = []
    for d in assessment.damages:
        e = d.estimated
        row: list[object] = [
            d.mount, d.axis, Digits(plain(1e-3 * e.equivalent_amplitude, 3)),
            interval(1e-3 * e.equivalent_lower, 1e-3 * e.equivalent_upper, 3), Digits(plain(1e-3 * e.largest_range, 3)),
            Digits(plain(100.0 * e.value / largest, 3)) if largest > 0.0 else "-",
            interval(100.0 * e.lower / largest, 100.0 * e.upper / largest, 2) if largest > 0.0 else "-",
        ]  # fmt: skip
        rows.append([*row, "" if d.ratio is None else float(d.ratio)] if measured else row)
    heads = [
        "mount", "axis", "equivalent amplitude [kN]", "95 % [kN]", "largest range [kN]", "damage [% of the worst]", "95 % [%]",
    ]  # fmt: skip
    page.table([*heads, "estimated / measured"] if measured else heads, rows)
    worst = damage_plots.worst(assessment.damages)
    leading = max(worst.values(), key=lambda d: d.estimated.value)
    force = run.force[run.valid, run.mount_names.index(leading.mount), AXES.index(leading.axis)]
    page.figure(
        damage_plots.matrix_plot(leading, force), f"Most damaged force, {leading.mount} {leading.axis}: rainflow and crossings",
        tight=False,
    )  # fmt: skip
    page.figure(damage_plots.range_pair_plot(list(worst.values())), "Range pairs, most damaged axis of each mount", tight=False)
    page.figure(
        damage_plots.damage_time_plot(list(worst.values()), run.time_s[run.valid], replay_spectra.tick_rate(run)),
        "Damage per second, share of the total", tight=False,
    )  # fmt: skip


def comfort(page: Page, assessment: RunAssessment) -> None:
    """Add the exposure to whole-body vibration at every accelerometer of the body."""
    page.heading("Ride comfort (ISO 2631-1, Directive 2002/44/EC)")
    if not assessment.exposures:
        page.text("; ".join(assessment.notes) or "No accelerometer on the body could be assessed.")
        return
    hours = assessment.daily_exposure_s / 3600.0
    page.text(
        f"Wd on x and y, Wk on z. A(8) and VDV are for {hours:g} h a day of this vibration, dominant axis of 1.4 x, 1.4 y, z. "
        f"Action value A(8) {ACTION_VALUE_A8} m/s² or VDV {ACTION_VALUE_VDV} m/s¹·⁷⁵, limit {LIMIT_VALUE_A8} m/s² or "
        f"{LIMIT_VALUE_VDV:g} m/s¹·⁷⁵."
    )
    page.table(
        [
            "place", "A(8) [m/s²]", "A(8) to action [min]", "A(8) to limit [min]", "VDV day [m/s¹·⁷⁵]", "VDV to action [min]",
            "VDV to limit [min]", "a_v [m/s²]",
        ],
        [
            [
                e.location, Digits(plain(e.a8, 3)), _minutes(e.minutes_to_action), _minutes(e.minutes_to_limit),
                Digits(plain(e.dose, 3)), _minutes(e.dose_minutes_to_action), _minutes(e.dose_minutes_to_limit),
                Digits(plain(e.vector_sum, 3)),
            ]
            for e in assessment.exposures
        ],
    )  # fmt: skip
    page.table(
        ["place", "axis", "a_w [m/s²]", "VDV of the run [m/s¹·⁷⁵]", "MTVV [m/s²]", "crest factor [-]"],
        [
            [
                e.location, name,
                *(Digits(plain(v, 3)) for v in (a.weighted_rms, a.vibration_dose, a.maximum_transient, a.crest_factor)),
            ]
            for e in assessment.exposures for name, a in zip(AXES, e.axes)
        ],
    )  # fmt: skip
    places: dict[str, list[str]] = {}
    for exposure in assessment.exposures:
        for note in exposure.notes():
            places.setdefault(note, []).append(exposure.location)
    for note, where in places.items():
        head = "" if len(where) == len(assessment.exposures) else f"{', '.join(where)}: "
        text = f"{head}{note}."
        page.text(f"{text[0].upper()}{text[1:]}")


def carried(page: Page, run: OfflineRun, side: SideSignals) -> None:
    """Add how carried bodies moved: simulated from the motion below them, against their own sensors."""
    if not side.carried:
        return
    page.heading("Carried bodies: measured against simulated")
    page.text(
        "A seat or any other body on the estimated one: its motion follows from the estimated motion of what carries it with "
        "mass, stiffness and damping of the vehicle file. About the means; std is what the vehicle file and the noise of the "
        "sensor leave open, and 95 % of the errors should lie within two of it."
    )
    rows = [
        [
            point.body, point.sensor, axis,
            *(Digits(plain(found[key], 3)) for key in ("measured_rms_m_per_s2", "simulated_rms_m_per_s2")),
            Digits(plain(100.0 * found["nrmse"], 2)), Digits(plain(found["correlation"], 3)),
            Digits(plain(found["std_m_per_s2"], 2)), Digits(plain(100.0 * found["within_two_std"], 3)),
        ]
        for point in side.carried for axis, found in point.scores(run.valid).items()
    ]  # fmt: skip
    if rows:
        page.table([
            "body", "sensor", "axis", "measured rms [m/s²]", "simulated rms [m/s²]", "error [% of measured]", "correlation [-]",
            "std [m/s²]", "within two std [%]",
        ], rows)  # fmt: skip
    for point in side.carried:
        if point.measured is None:
            page.text(f"{point.body}: no accelerometer on it; the exposure above is that of its centre of gravity as simulated.")
        else:
            figure = replay_plots.measured_and_model(run, point.measured, point.simulated, "simulated")
            page.figure(figure, f"{point.body} at {point.sensor}, body axes: busiest 5 s; spectra of the whole run", tight=False)


def _minutes(value: float) -> object:
    if not math.isfinite(value) or value > 1440.0:
        return "more than 24 h"
    return Digits(plain(value, 2))


def ladder(page: Page, diagnosis: Mapping[str, Any] | None, checksum: str) -> None:
    """Add the ladder of models of a diagnosis of the same run, where there is one."""
    if diagnosis is None:
        return
    page.heading("Ladder of models")
    if diagnosis.get("run", {}).get("checksum") != checksum:
        page.warning("The diagnosis is of another recording than this replay.")
    page.verdict(str(diagnosis.get("sentence", "")))
    page.table(
        ["model", "NRMSE [%]", "misfit (1 = noise)", "gain over the model before [nat]"],
        [
            [str(step.get("model", "")), *(_number(step.get(key), factor) for key, factor in (
                ("nrmse", 100.0), ("misfit_per_degree", 1.0), ("log_likelihood", 1.0)
            ))]
            for step in diagnosis.get("ladder", [])
        ],
    )  # fmt: skip
    for cause in diagnosis.get("causes", []):
        values = ", ".join(
            f"{p.get('name')} {_number(p.get('value'), 1.0)} ± {_number(p.get('std'), 1.0)} {p.get('unit')}"
            for p in cause.get("parameters", [])
        )
        place = " ".join(str(cause.get(key) or "") for key in ("location", "axis")).strip()
        page.text(f"Named cause: {str(cause.get('id', '')).replace('_', ' ')} at {place}: {values}.")


def _number(value: object, factor: float) -> object:
    return Digits(plain(factor * value, 3)) if isinstance(value, (int, float)) and np.isfinite(value) else "-"
