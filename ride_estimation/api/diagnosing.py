# Copyright 2026 ride_estimation contributors
"""What the simulation of a run gets wrong, by which cause, and what the extended model gains."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ride_estimation.api.runs import Run
from ride_estimation.api.tables import dataframe, html_table
from ride_estimation.diagnosis.adapters.travel import diagnose_travel, needs_travel, require_travel
from ride_estimation.diagnosis.answer.result import Diagnosis
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose as diagnose_run
from ride_estimation.diagnosis.diagnose import require_testable
from ride_estimation.errors import ConfigurationError, RideEstimationError
from ride_estimation.io.json_file import written_last
from ride_estimation.io.results import output_folder, software
from ride_estimation.io.vehicle_file import save_vehicle
from ride_estimation.reporting.numbers import plain, with_std
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Recording, UniformRun

# pictures are imported when one is asked for: they take a second
if TYPE_CHECKING:
    from ride_estimation.api.plots import DiagnosisPlots
    from ride_estimation.reporting.diagnosis_report import Truth

_HIGHEST_RATE_HZ = 400.0  # the analysis band ends at 40 Hz; more samples cost time and tell nothing


@dataclasses.dataclass(frozen=True, repr=False)
class DiagnosedRun:
    """The answer of a diagnosis and what it was asked about.

    Attributes
    ----------
    answer
        Verdict, causes, gain, extended vehicle.
    name
        Of the run or record.
    run_facts, vehicle_facts
        What ``diagnosis.json`` says about both.
    """

    answer: Diagnosis
    name: str
    run_facts: dict[str, Any]
    vehicle_facts: dict[str, Any]

    @property
    def verdict(self) -> str:
        """Return ``no_discrepancy``, ``explained``, ``unexplained`` or ``insufficient_data``."""
        return self.answer.verdict

    @property
    def plot(self) -> DiagnosisPlots:
        """Return the pictures, one method each."""
        from ride_estimation.api.plots import DiagnosisPlots

        return DiagnosisPlots(self.answer)

    def to_dataframe(self, table: str = "causes") -> Any:
        """Return ``causes`` (one row per cause and parameter) or the calibrated ``parameters`` as ``pandas.DataFrame``, SI.

        Raises
        ------
        ConfigurationError
            Unknown table, or pandas is not installed.
        """
        if table == "parameters":
            keys = ("name", "value", "std", "unit", "prior", "status")
            return dataframe({key: [getattr(p, key) for p in self.answer.parameters] for key in keys}, "name")
        if table != "causes":
            raise ConfigurationError(f"table {table!r}; allowed: causes, parameters")
        pairs = [(c, p) for c in self.answer.causes for p in (c.parameters or (None,))]
        columns: dict[str, Any] = {key: [getattr(c, key) for c, _ in pairs] for key in ("id", "location", "axis", "confidence")}
        columns |= {key: [getattr(p, key, None) for _, p in pairs] for key in ("name", "value", "std", "unit")}
        return dataframe(columns)

    def report(self, path: str | Path, truth: Truth | None = None) -> Path:
        """Write the report as one HTML file and return its path; ``truth`` of a simulated run is shown beside what was found."""
        from ride_estimation.reporting.diagnosis_report import write_diagnosis_report

        write_diagnosis_report(self.answer, self.name, Path(path), truth)
        return Path(path)

    def save(self, folder: str | Path, *, report: bool = True, truth: Truth | None = None) -> None:
        """Write ``diagnosis.json``, ``vehicle_extended.yaml`` and ``report.html`` (see :meth:`report`) into a folder."""
        folder = output_folder(folder)
        document = self.answer.to_mapping()
        document |= {"software": software(), "run": self.run_facts, "vehicle": self.vehicle_facts}
        with written_last(folder / "diagnosis.json", document):
            save_vehicle(self.answer.extended, folder / "vehicle_extended.yaml")
            if report:
                self.report(folder / "report.html", truth)

    def __repr__(self) -> str:
        return f"DiagnosedRun({self.name}: {self.verdict}; {self.answer.sentence})"

    def _repr_html_(self) -> str:
        rows = [[p.name, *with_std(p.value, p.std), plain(p.prior), p.unit, p.status] for p in self.answer.parameters]
        return html_table(("parameter", "value", "std", "prior", "unit", "status"), rows, self.answer.sentence)


def diagnose(
    run: Run,
    validate: Sequence[Run] = (),
    *,
    settings: Settings | None = None,
    rate_hz: float | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> DiagnosedRun:
    """Find what the simulation of a recorded run gets wrong, name the cause, extend the model, measure the gain.

    Parameters
    ----------
    run
        From :func:`~ride_estimation.api.runs.read_run`.
    validate
        Validation runs of the same vehicle: they neither fit nor select.
    settings
        Analysis band and limits of the search; where None, as they are by default, and perturbed copies of the run are asked
        too.
    rate_hz
        Of the common time base [Hz]; the fastest sensor, 400 Hz at most, where None.
    report
        Called with the share of the work that is done.

    Raises
    ------
    RideEstimationError
        A run that validates itself, or a vehicle or run that cannot be diagnosed.
    """
    for other in validate:
        if other.recording.checksum == run.recording.checksum and other.recording.name == run.recording.name:
            raise ConfigurationError(f"{other.recording.name}: is the run that is fitted; only another one can judge the gain")
    measured = _uniform(run.recording, rate_hz)
    others = [_uniform(other.recording, rate_hz) for other in validate]
    by_travel = needs_travel(run.vehicle, measured)
    chain = diagnose_travel if by_travel else diagnose_run
    chosen = Settings(stability=True) if settings is None else settings
    answer = chain(run.vehicle, measured, others, chosen, report)
    if by_travel:
        answer = dataclasses.replace(answer, warnings=(*answer.warnings, *_unused_rates(measured)))
    checksum, duration = run.recording.checksum, measured.samples / measured.rate_hz
    facts = {"path": run.recording.name, "checksum": checksum, "duration_s": duration}
    return DiagnosedRun(answer, measured.name, facts, {"name": run.vehicle.name, "checksum": run.vehicle.checksum})


def refusal(run: Run) -> str:
    """Return why :func:`diagnose` cannot test the model with what a run measures, empty where it can."""
    try:
        measured = _uniform(run.recording, None)
        check = require_travel if needs_travel(run.vehicle, measured) else require_testable
        check(run.vehicle, measured)
    except RideEstimationError as error:
        return str(error)
    return ""


def _unused_rates(run: UniformRun) -> tuple[str, ...]:
    """Return words on gyros where measured deflections stand in for base motion."""
    gyros = [name for name, values in run.data.items() if values.ndim > 1 and values.shape[1] > 3]
    if not gyros:
        return ()
    return (f"the angular rates of {', '.join(gyros)} are not used: without base accelerometers only accelerations are compared",)


def _uniform(recording: Recording, rate_hz: float | None) -> UniformRun:
    uniform = align(recording, rate_hz)
    if rate_hz is None and uniform.rate_hz > _HIGHEST_RATE_HZ:
        uniform = align(recording, _HIGHEST_RATE_HZ)
    return uniform
