# Copyright 2026 ride_estimation contributors
"""A recorded run through the code that runs live, with everything that is made of it: quality, loads, comfort, report."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.api.plots import ReplayPlots
from ride_estimation.api.runs import Run, require_layout
from ride_estimation.api.tables import dataframe, dataset, html_table
from ride_estimation.assessment.durability import DEFAULT_SLOPE, checked_slope
from ride_estimation.assessment.run_assessment import EIGHT_HOURS_S, RunAssessment, assess_run
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.carried_points import CarriedPoint, carried_document, carried_points
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.frames import AXES
from ride_estimation.io.json_file import write_json, written_last
from ride_estimation.io.results import output_folder, result_document, write_signals
from ride_estimation.io.run_layout import run_layout
from ride_estimation.io.run_mcap import write_run_mcap
from ride_estimation.io.vehicle_file import body_layout
from ride_estimation.reporting.formats import clear_pages, write_page
from ride_estimation.reporting.numbers import plain, with_std
from ride_estimation.reporting.page import Page
from ride_estimation.reporting.replay_report import replay_page
from ride_estimation.reporting.replay_spectra import tick_rate
from ride_estimation.reporting.side_signals import SideSignals, side_signals
from ride_estimation.sensors.consistency import consistency_findings
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.signals.quality import ChannelQuality
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: fewer say nothing about any signal
LEAST_TICKS = 8
#: what :meth:`Replay.to_dataframe` gives: one row per estimate, or over time
_ESTIMATES = ("parameters", "parameters_smoothed", "mass_properties")
TABLES = (*_ESTIMATES, "forces", "deflections", "motion")


@dataclasses.dataclass(frozen=True, repr=False)
class Replay:
    """What a replay found.

    Attributes
    ----------
    run
        The run that was replayed.
    result
        Signals, parameters, health of the estimator; ``result.force`` has the shape (N, mounts, 3) [N].
    quality
        Judgement of the data by sensor.
    assessment
        Damage and ride comfort.
    side
        Signals of the run beside the estimates.
    warnings
        Everything that is wrong with the data or the estimates, in words.
    layout
        What the sensors of the body tell of its motion, in words.
    document
        Content of ``result.json``.
    """

    run: Run
    result: OfflineRun
    quality: dict[str, ChannelQuality]
    assessment: RunAssessment
    side: SideSignals
    warnings: tuple[str, ...]
    layout: str
    document: dict[str, Any]

    @property
    def parameters(self) -> tuple[Estimate, ...]:
        """Return the parameters with standard deviation and status, as the node publishes them at the end of the run."""
        return self.result.parameters

    @property
    def parameters_smoothed(self) -> tuple[Estimate, ...]:
        """Return stiffness and damping estimated from the whole run at once, none where its model does not explain the run."""
        return self.result.smoothed_parameters

    @property
    def mass_properties(self) -> tuple[Estimate, ...]:
        """Return CG and moments of inertia of the body, estimated from the whole run with :attr:`parameters_smoothed`."""
        return self.result.mass_properties

    @property
    def plot(self) -> ReplayPlots:
        """Return the pictures, one method each."""
        return ReplayPlots(self.result)

    def to_dataframe(self, table: str = "parameters") -> Any:
        """Return one table as ``pandas.DataFrame``, SI.

        Parameters
        ----------
        table
            ``parameters`` (one row each), ``parameters_smoothed`` and ``mass_properties`` (of the whole run), or over time
            ``forces`` (with ``<mount>.<axis>.std``), ``deflections``, ``motion`` (acceleration and angular acceleration of the
            CG).

        Raises
        ------
        ConfigurationError
            Unknown table, or pandas is not installed.
        """
        if table not in TABLES:
            raise ConfigurationError(f"table {table!r}; allowed: {', '.join(TABLES)}")
        if table in _ESTIMATES:
            keys, rows = ("name", "value", "std", "unit", "prior"), getattr(self, table)
            columns: dict[str, Any] = {key: [getattr(p, key) for p in rows] for key in keys}
            return dataframe({**columns, "status": [p.status.value for p in rows]}, "name")
        r = self.result
        columns = {"time_s": r.time_s, "valid": r.valid}
        if table == "motion":
            columns |= {name: r.signals["cg_accel"][:, i] for i, name in enumerate(("x", "y", "z", "roll", "pitch", "yaw"))}
            return dataframe(columns, "time_s")
        values = r.force if table == "forces" else r.deflection
        for m, mount in enumerate(r.mount_names):
            for a, axis in enumerate(AXES):
                columns[f"{mount}.{axis}"] = values[:, m, a]
                if table == "forces":
                    columns[f"{mount}.{axis}.std"] = r.force_std[:, m, a]
        return dataframe(columns, "time_s")

    def to_xarray(self) -> Any:
        """Return motion, deflections and forces over time, mount and axis as ``xarray.Dataset``, SI.

        Raises
        ------
        ConfigurationError
            xarray is not installed.
        """
        r = self.result
        over = ("time_s", "mount", "axis")
        variables = {
            "force": (over, r.force),
            "force_std": (over, r.force_std),
            "deflection": (over, r.deflection),
            "cg_acceleration": (("time_s", "axis"), r.signals["cg_accel"][:, :3]),
            "valid": (("time_s",), r.valid),
        }
        return dataset(variables, {"time_s": r.time_s, "mount": list(r.mount_names), "axis": list(AXES)})

    def page(self, diagnosis: Mapping[str, Any] | None = None) -> Page:
        """Return the report; ``diagnosis`` is the content of a ``diagnosis.json`` of this run."""
        return replay_page(
            self.run.recording, self.run.vehicle, self.result, self.quality, self.document, self.side, self.assessment, diagnosis
        )

    def report(self, path: str | Path) -> Path:
        """Write the report as one HTML file and return its path."""
        self.page().write(Path(path))
        return Path(path)

    def save(
        self, folder: str | Path, formats: Sequence[str] = ("html",), diagnosis: Mapping[str, Any] | None = None,
        mcap: bool = False,
    ) -> list[str]:  # fmt: skip
        """Write ``result.json``, ``signals.npz`` and the report into a folder; return the names of what was written.

        Parameters
        ----------
        folder
            Is created where it does not exist.
        formats
            Of the report: any of ``html``, ``pdf``, ``png``; none where empty.
        diagnosis
            Content of a ``diagnosis.json`` of this run, shown in the report.
        mcap
            Write ``run.mcap`` too: inputs, what the node would have published live, and bounds, with its layout for viewers.
        """
        folder = output_folder(folder)
        clear_pages(folder)
        written = ["result.json", "signals.npz"]
        with written_last(folder / "result.json", self.document):
            self.document["signals_sha256"] = write_signals(folder / "signals.npz", self.result, self.side.carried)
            for name in ("run.mcap", "run_layout.json"):
                (folder / name).unlink(missing_ok=True)  # of an earlier call, beside new results
            if mcap:
                body = geometry_of(self.run.vehicle).body
                write_run_mcap(folder / "run.mcap", self.run.recording, self.run.vehicle, body, self.result)
                write_json(folder / "run_layout.json", run_layout(self.result.mount_names))
                written += ["run.mcap", "run_layout.json"]
            if formats:
                written += write_page(self.page(diagnosis), folder, formats)
        return written

    def summary(self) -> str:
        """Return the short text that the command prints."""
        return summary(self.run.recording, self.result, self.warnings, self.layout, self.side.carried)

    def __repr__(self) -> str:
        known = sum(p.status.value == "valid" for p in self.parameters)
        return (
            f"Replay({self.run.recording.name}: {self.result.time_s[-1]:.1f} s, "
            f"{100.0 * np.mean(self.result.valid):.1f} % valid, "
            f"{known} of {len(self.parameters)} parameters valid, {len(self.warnings)} warnings)"
        )

    def _repr_html_(self) -> str:
        rows = [[p.name, *with_std(p.value, p.std), plain(p.prior), p.unit, p.status.value] for p in self.parameters]
        return html_table(("parameter", "value", "std", "prior", "unit", "status"), rows, repr(self))


def replay(
    run: Run,
    *,
    settings: PipelineSettings | None = None,
    slope: float = DEFAULT_SLOPE,
    daily_exposure_s: float = EIGHT_HOURS_S,
    smoothing: bool = True,
    advance: Callable[[int, int], None] = lambda done, total: None,
    begin: Callable[[str], None] = lambda stage: None,
) -> Replay:
    """Estimate motion, loads, mount parameters and mount forces of a recorded run.

    Parameters
    ----------
    run
        From :func:`~ride_estimation.api.runs.read_run`.
    settings
        Of the estimator; the defaults of the node where None.
    slope
        S-N slope of pseudo-damage [-].
    daily_exposure_s
        Time a day of this vibration, for A(8) and VDV [s].
    smoothing
        Whether smoothed forces, from the whole run, are computed too.
    advance
        Called with samples done since the last call and samples in all.
    begin
        Called with the name of every stage as it begins.

    Raises
    ------
    RideEstimationError
        A sensor layout that cannot tell the motion of the body, a run that is too short, numbers out of range.

    Examples
    --------
    >>> import ride_estimation as re
    >>> found = re.replay(re.read_run("bags/standing", "truck_cab", end_s=4.0), smoothing=False)
    >>> found.result.force.shape[1:]
    (4, 3)
    """
    if not 0.0 < daily_exposure_s <= 86400.0:
        raise ConfigurationError(f"daily_exposure_s {daily_exposure_s:g}; allowed: more than 0, at most 86400 s")
    slope = checked_slope(slope)
    settings = PipelineSettings() if settings is None else settings
    recording, vehicle = run.recording, run.vehicle
    require_layout(vehicle)
    pipeline = Pipeline(vehicle, settings)
    samples = sum(len(c.stamp_ns) for c in recording.channels.values())
    begin("estimating")
    result = run_offline(recording, pipeline, lambda done: advance(done, samples), smoothing, begin)
    if len(result.stamp_ns) < LEAST_TICKS:
        held = len(result.stamp_ns)
        raise InputDataError(f"{recording.name}: the run has {held} ticks of the time base; {LEAST_TICKS} are needed")
    left_out = {name: s.refused for name, s in result.health.sensors.items()}
    quality = judge_sensors(recording, vehicle.sensors, vehicle.gravity, weight=vehicle.weight, left_out=left_out)
    carried = carried_points(recording, pipeline, result)
    # sensors of a carried body serve the comparison with its simulation
    served = tuple(f" samples of {point.sensor}, which the estimator does not use" for point in carried if point.sensor)
    warnings = tuple(w for w in all_warnings(recording, vehicle, quality, result) if not w.endswith(served))
    layout = body_layout(vehicle, pipeline.geometry.body.name).sentence(pipeline.geometry.body.name)
    side = side_signals(recording, vehicle, result, carried)
    assessment = assess_run(
        result.mount_names, result.force, result.force_std, result.valid, tick_rate(result),
        side.accelerations, side.cells, slope, daily_exposure_s,
        mass_relative_std(result, pipeline.geometry.body.name),
    )  # fmt: skip
    document = result_document(recording, vehicle, result, quality, warnings, (layout,), assessment, settings)
    document["carried_bodies"] = carried_document(carried, result.valid)
    document["inertia_kg_m2"] = pipeline.loads.moments(pipeline.geometry.body)
    return Replay(run, result, quality, assessment, side, warnings, layout, document)


def mass_relative_std(result: OfflineRun, body: str) -> float:
    """Return the relative standard deviation of the mass of the body, 0 where it is not among the parameters."""
    for estimate in result.parameters:
        if estimate.name == f"{body}.mass" and estimate.value > 0.0 and math.isfinite(estimate.std):
            return estimate.std / estimate.value
    return 0.0


def all_warnings(
    recording: Recording, vehicle: Vehicle, quality: dict[str, ChannelQuality], result: OfflineRun
) -> tuple[str, ...]:
    """Return every warning of a replay, data quality first."""
    found = list(recording.warnings)
    found += [f"{name}: {finding}" for name, q in quality.items() for finding in q.findings]
    found += exchange_findings(recording, vehicle)
    found += [f"ignored: {reason}: {count}" for reason, count in recording.ignored.items()]
    # the gaps of a sensor are in the findings of its data already, with what was done about them
    told = tuple(f"{name}: {words}" for name, q in quality.items() for words in (f"{q.gaps} gaps", f"{q.gaps} gap,") if q.gaps)
    found += [m for m in result.health.messages if m not in found and not m.startswith(told)]
    if not isinstance(result.smoothed, str) and result.smoothed.load:
        found.append(result.smoothed.load)
    return tuple(found)


def exchange_findings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Return what exchanged topics or axes would explain, over all bodies with accelerometers."""
    motion = [s for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu")]
    found = []
    for body in vehicle.bodies.values():
        own = [s for s in motion if s.body == body.name]
        found += consistency_findings(recording, own, [s for s in motion if s.body != body.name], body.cg)
    return found


def summary(
    recording: Recording, result: OfflineRun, warnings: Sequence[str], layout: str, carried: Sequence[CarriedPoint] = ()
) -> str:
    """Return the short text the command prints."""
    time = result.time_s
    lines = [
        f"{recording.name}: {time[-1]:.1f} s, {len(time)} ticks, {100.0 * result.valid.mean():.1f} % valid",
        layout,
        f"{'parameter':<34}{'value':>12}{'std':>10}{'whole run':>12}{'std':>10}{'prior':>12}  unit    status"
        if result.smoothed_parameters
        else f"{'parameter':<34}{'value':>12}{'std':>10}{'prior':>12}  unit    status",
    ]
    whole = {p.name: with_std(p.value, p.std) for p in result.smoothed_parameters}
    reasons: dict[tuple[str, str], list[str]] = {}
    for p, best in zip(result.parameters, result.best_parameters, strict=True):
        later = "".join(f"{text:>{width}}" for text, width in zip(whole.get(p.name, ("", "")), (12, 10))) if whole else ""
        lines.append(_estimate_line(dataclasses.replace(p, status=best.status), later))
        if best.reason:
            reasons.setdefault((best.status.value, best.reason), []).append(p.name)
    lines += [f"{status} ({len(names)}): {', '.join(names)}: {reason}" for (status, reason), names in reasons.items()]
    if result.mass_properties:
        lines.append(f"{'mass properties, whole run':<34}{'value':>12}{'std':>10}{'prior':>12}  unit    status")
    lines += [_estimate_line(p) for p in result.mass_properties]
    if result.mount_names:
        heads = (_three_words(f"mean {axis}" for axis in AXES), _three_words(f"peak {axis}" for axis in AXES))
        lines.append(f"{'force on the body by mount [N]':<34}{heads[0]:>32}{heads[1]:>32}  (peak: max |F - mean|)")
        force = result.force[result.valid]
        for i, name in enumerate(result.mount_names if len(force) else ()):
            mean = force[:, i].mean(axis=0)
            peak = abs(force[:, i] - mean).max(axis=0)
            lines.append(f"{name:<34}{_three(mean):>32}{_three(peak):>32}")
        lines.append(result.forces_in_words())
    for point in carried:
        for axis, found in point.scores(result.valid).items():
            lines.append(
                f"{point.body} at {point.sensor}, {axis}: measured {found['measured_rms_m_per_s2']:.3g} m/s^2 rms, simulated "
                f"from the motion below it {found['simulated_rms_m_per_s2']:.3g}, error {100.0 * found['nrmse']:.3g} %, "
                f"{100.0 * found['within_two_std']:.3g} % within two standard deviations"
            )
    lines += [f"warning: {text}" for text in warnings[:12]]
    if len(warnings) > 12:
        lines.append(f"... {len(warnings) - 12} more warnings in result.json")
    lines.append(f"digest {result.digest}")
    return "\n".join(lines)


def _estimate_line(p: Estimate, later: str = "") -> str:
    """Return the line of an estimate; ``later`` are the columns between its standard deviation and its prior."""
    value, std = with_std(p.value, p.std)
    return f"{p.name:<34}{value:>12}{std:>10}{later}{plain(p.prior):>12}  {p.unit:<7} {p.status.value}"


def _three(values: Sequence[float]) -> str:
    return _three_words(str(round(v)) for v in values)


def _three_words(words: Iterable[str]) -> str:
    return "  ".join(f"{word:>8}" for word in words)
