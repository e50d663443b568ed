# Copyright 2026 ride_estimation contributors
"""The report of a replay: the result first, then forces, mounts, damage, comfort, parameters; data quality and sources last.

Sections beside those of the estimates: :mod:`ride_estimation.reporting.replay_sections`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.assessment.run_assessment import RunAssessment
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.reporting import replay_plots as plots
from ride_estimation.reporting import replay_sections as sections
from ride_estimation.reporting.numbers import alike, plain, reading_unit, with_std
from ride_estimation.reporting.page import Digits, Page
from ride_estimation.reporting.replay_summary import summary
from ride_estimation.reporting.side_signals import SideSignals
from ride_estimation.sensors.sensor import SENSOR_KINDS
from ride_estimation.signals.quality import ChannelQuality
from ride_estimation.signals.recording import Recording, run_title
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_STATUS_WORDS = {
    "starting": "has not begun", "estimating": "is converging", "valid": "converged", "suspect": "is doubtful",
    "not_identifiable": "not identifiable from these data", "invalid": "is invalid",
}


def replay_page(
    recording: Recording,
    vehicle: Vehicle,
    run: OfflineRun,
    quality: Mapping[str, ChannelQuality],
    result: Mapping[str, Any],
    side: SideSignals,
    assessment: RunAssessment,
    diagnosis: Mapping[str, Any] | None = None,
) -> Page:
    """Return the report of a replay.

    Parameters
    ----------
    recording, vehicle, run, quality
        What was read, what was known, what was found, how good the data are.
    result
        Content of ``result.json``.
    side, assessment
        Signals beside the estimates; durability and comfort.
    diagnosis
        Content of ``diagnosis.json`` of the same run, for the ladder of models.
    """
    page = Page(f"Replay of {run_title(recording.name)} with {vehicle.name}")
    summary(page, vehicle, run, result, assessment)
    if result["warnings"]:
        page.heading("Warnings")
    for text in result["warnings"]:
        page.warning(text)
    _forces(page, run, side)
    sections.mounts(page, run, side)
    sections.durability(page, run, assessment)
    sections.comfort(page, assessment)
    sections.carried(page, run, side)
    _parameters(page, run, result)
    _motion(page, run)
    sections.spectra(page, run, side)
    _fit(page, run, result)
    _quality(page, vehicle, run, quality)
    sections.ladder(page, diagnosis, recording.checksum)
    _sources(page, recording, vehicle, run, result)
    return page


def _sources(page: Page, recording: Recording, vehicle: Vehicle, run: OfflineRun, result: Mapping[str, Any]) -> None:
    page.heading("Sources and checksums")
    for text in result["layout"]:
        page.text(text)
    software = ", ".join(f"{name} {version}" for name, version in result["software"].items())
    page.table(["", ""], [
        ["recording", f"{recording.name} (SHA-256 {recording.checksum[:16]})"],
        ["vehicle file", f"{vehicle.name} (SHA-256 {vehicle.checksum[:16]})"],
        ["software", software],
        ["digest of the estimates", run.digest],
    ])  # fmt: skip


def _motion(page: Page, run: OfflineRun) -> None:
    page.heading("Motion and inertial load of the body")
    page.text("At the centre of gravity, gravity removed; the load is m a and I alpha + omega x I omega.")
    _signal_table(page, run)
    page.figure(plots.motion_and_load(run), "Acceleration of the CG and inertial load over the run with ± 2 std", tight=False)


def _quality(page: Page, vehicle: Vehicle, run: OfflineRun, quality: Mapping[str, ChannelQuality]) -> None:
    page.heading("Data quality")
    rows = []
    units = {name: SENSOR_KINDS[vehicle.sensors[name].kind][1].partition(",")[0].replace("^2", "²") for name in quality}
    shared = next(iter(units.values())) if len(set(units.values())) == 1 else ""
    for name, q in quality.items():
        health = run.health.sensors.get(name)
        own = "" if shared else f" {units[name]}"
        rows.append([
            name, q.samples, health.accepted if health else 0, sum(health.rejected.values()) if health else 0,
            q.backwards, q.rate_hz, Digits(plain(1e3 * q.jitter_s, 2)), q.gaps, Digits(plain(1e3 * q.longest_gap_s, 3)),
            q.clipped, q.spikes, f"{alike(q.mean[:3])}{own}", f"{alike(q.std[:3])}{own}", "; ".join(q.findings) or "fine",
        ])  # fmt: skip
    page.table([
        "sensor", "samples", "used", "rejected", "out of order", "rate [Hz]", "jitter [ms]", "gaps", "longest [ms]", "clipped",
        "spikes", f"mean [{shared}]" if shared else "mean", f"std [{shared}]" if shared else "std", "findings",
    ], rows)  # fmt: skip
    page.text("Mean of an accelerometer in sensor axes; a specific force of +9.81 m/s² points up at rest.")


def _fit(page: Page, run: OfflineRun, result: Mapping[str, Any]) -> None:
    page.heading("Measured against model, channel by channel")
    page.text(
        "The model is one rigid body that moves so that all accelerometers agree best. NRMSE is the error in percent of the "
        "standard deviation of the measurement. An outlier indicates a sensor whose position or orientation differs from the "
        "vehicle file, or the body is not rigid there."
    )
    rows = []
    for sensor in run.measured:
        values = [result["fit"].get(f"{sensor}.{axis}") for axis in AXES]
        rows.append([sensor, *("constant" if v is None else Digits(plain(100.0 * float(v), 2)) for v in values)])
    page.table(["sensor", *(f"NRMSE {axis} [%]" for axis in AXES)], rows)
    test = run.health.residual
    page.text(
        f"Normalised squared residual (chi-square per degree of freedom): {plain(test.ratio, 3)}; noise alone gives 1, "
        f"and more than {plain(test.limit, 3)} once in a thousand runs."
    )
    for sensor in run.measured:
        caption = f"{sensor}, sensor axes: busiest 5 s; spectra of the whole run"
        page.figure(plots.measured_against_model(run, sensor), caption, tight=False)


def _signal_table(page: Page, run: OfflineRun) -> None:
    rows = []
    for name, unit in (("cg_accel", ("m/s²", "rad/s²")), ("inertial_load", ("N", "N m"))):
        values, std = run.signals[name][run.valid], run.signals[f"{name}_std"][run.valid]
        for i, axis in enumerate((*AXES, "roll", "pitch", "yaw")):
            column = values[:, i]
            if len(column):
                rms = float(np.sqrt(np.mean(column**2)))
                rows.append([
                    f"{name} {axis} [{unit[i // 3]}]", float(column.mean()), rms, float(column.min()), float(column.max()),
                    float(np.abs(column).max() / rms) if rms > 0.0 else 0.0, _kurtosis(column),
                    Digits(plain(float(np.median(std[:, i])), 2)),
                ])  # fmt: skip
    page.table(["signal", "mean", "rms", "min", "max", "crest factor [-]", "kurtosis [-]", "std of the estimate"], rows)
    page.text("Crest factor: largest value over rms. Kurtosis: 3 for a Gaussian signal, more with isolated events.")


def _kurtosis(values: Array) -> object:
    about = values - values.mean()
    variance = float(np.mean(about**2))
    return Digits(plain(float(np.mean(about**4)) / variance**2, 3)) if variance > 0.0 else "constant"


def _forces(page: Page, run: OfflineRun, side: SideSignals) -> None:
    if not run.mount_names:
        return
    page.heading("Attachment forces")
    page.text(
        "Force on the body by each mount, body axes, static share included (rms: about the mean). The standard deviation has a "
        "part that rigid-body equilibrium determines and a part that rests on the mount model (how the forces are split among "
        "the mounts). "
        f"The table and the curves show {run.forces_in_words()}."
    )
    later = not isinstance(run.smoothed, str)
    if later:
        page.text(
            "Dashed beside them: the load cell where there is one, else the estimate as the node publishes it live "
            "(mount_force in signals.npz)."
        )
    s = run.signals
    rows = []
    for m, mount in enumerate(run.mount_names):
        for i, axis in enumerate(AXES):
            force = run.force[run.valid, m, i]
            if len(force):
                stds = [run.force_std, *(s[f"mount_force_std{part}"] for part in ("", "_equilibrium", "_model"))]
                parts = [Digits(plain(1e-3 * float(np.median(std[run.valid, m, i])), 2)) for std in (stds if later else stds[1:])]
                numbers = alike([1e-3 * float(v) for v in (force.mean(), force.std(), force.min(), force.max())], 4).split()
                rows.append([mount, axis, *map(Digits, numbers), *parts])
    page.table([
        "mount", "axis", "mean [kN]", "rms [kN]", "min [kN]", "max [kN]", *(["std [kN]"] if later else []),
        f"{'live ' if later else ''}std [kN]", "live: equilibrium [kN]", "live: mount model [kN]",
    ], rows)  # fmt: skip
    for m, mount in enumerate(run.mount_names):
        page.figure(plots.mount_forces(run, m, side.cells.get(mount)), f"Force on the body by mount {mount}", tight=False)


def _parameters(page: Page, run: OfflineRun, result: Mapping[str, Any]) -> None:
    page.heading("Parameters")
    rows = []
    whole = {p.name: p for p in run.smoothed_parameters}
    for p in run.parameters:
        unit, factor = reading_unit(p.unit)
        words = f"{p.status.value}: {_STATUS_WORDS[p.status.value]}"
        own = _of_whole_run(whole.get(p.name), factor) if whole else []
        rows.append([p.name, *_digits(p, factor), *own, unit.replace(" ", "\u00a0"), factor * p.prior, words, p.reason])
    heads = ["live", "± 95 %", "whole run", "± 95 %", "whole run: status"] if whole else ["value", "± 95 %"]
    page.table(["parameter", *heads, "unit", "prior", "live: status" if whole else "status", "reason"], rows)
    if whole:
        page.text(
            "Whole run: stiffness and damping estimated from all readings at once, together with the errors of the sensors; the "
            "others are those the node publishes at the end of the run."
        )
    _mass_properties(page, run)
    if run.health.innovation_ratio > 0.0:
        page.text(
            f"Normalised innovation squared (NIS), last intervals: "
            f"{plain(run.health.innovation_ratio, 3)}; 1 where mounts and uncertainty are as stated, less where the "
            "uncertainty is cautious, more where the mounts do not follow their law."
        )
    for kind in dict.fromkeys(p.name.rsplit(".", 1)[-1] for p in run.parameters):
        names = [p.name for p in run.parameters if p.name.rsplit(".", 1)[-1] == kind]
        if any(p.status.value != "valid" or p.value != p.prior for p in run.parameters if p.name in names):
            page.figure(plots.parameter_convergence(run, names, kind), f"{kind}: value over prior with ± 2 std", tight=False)
    page.heading("What these data can and cannot identify")
    page.table(["", "what", "why"], list(_told(run, result["identifiability"])))


def _mass_properties(page: Page, run: OfflineRun) -> None:
    rows = []
    for p in run.mass_properties:
        unit, factor = ("mm", 1e3) if p.unit == "m" else reading_unit(p.unit)
        off = Digits(with_std(factor * (p.value - p.prior), factor * p.std)[0])
        rows.append([p.name, *_digits(p, factor), unit.replace(" ", "\u00a0"), Digits(plain(factor * p.prior)), off, _status(p)])
    if rows:
        page.table(["mass property, whole run", "value", "± 95 %", "unit", "vehicle file", "value - file", "status"], rows)
        page.text("CG and moments of inertia of the body without what it carries, the latter for the mass of the vehicle file.")


def _digits(p: Estimate, factor: float) -> list[object]:
    """Return value and half width of the 95 % interval."""
    return [Digits(text) for text in with_std(factor * p.value, 1.96 * factor * p.std)]


def _of_whole_run(p: Estimate | None, factor: float) -> list[object]:
    return ["", "", ""] if p is None else [*_digits(p, factor), _status(p)]


def _status(p: Estimate) -> str:
    return f"{p.status.value}: {p.reason}" if p.reason else p.status.value


def _told(run: OfflineRun, identifiability: Mapping[str, Any]) -> Iterator[list[object]]:
    """Yield rows of verdict, names and reason; what shares a reason shares a row."""
    for key, value in identifiability.items():
        by_reason: dict[str, list[str]] = {}
        for entry in [value] if isinstance(value, str) else value:
            name, _, reason = str(entry).partition(": ") if key == "not_identifiable" else (str(entry), "", "")
            by_reason.setdefault(reason, []).append(name)
        for reason, names in by_reason.items():
            yield [key.replace("_", " "), ", ".join(names), reason]
    open_ones = [p.name for p in run.parameters if p.status.value in ("starting", "estimating")]
    if open_ones:
        yield ["not settled in this run", ", ".join(open_ones), "needs more excitation or time"]
