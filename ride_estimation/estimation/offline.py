# Copyright 2026 ride_estimation contributors
"""A recorded run through the online pipeline, sample by sample in order of arrival, with everything kept."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Mapping
from concurrent import futures
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.common.estimate import Estimate, best_of
from ride_estimation.estimation.faults.health import Health
from ride_estimation.estimation.model.run_forces import RunForces, run_forces
from ride_estimation.estimation.model.run_readings import without_readings
from ride_estimation.estimation.model.smoothed_forces import Anomalies, SmoothedForces, smoothed_forces
from ride_estimation.estimation.output import REPORT_PERIOD_S, LeftOut, OutputBlock, ReportSchedule, Ticks, left_out_of
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.signals.recording import Recording

Array = NDArray[np.float64]

#: time between two kept points of the parameter history [ns]
HISTORY_STEP = 500_000_000
#: samples between two calls of the progress function
_REPORT_EVERY = 2000
#: why forces are not smoothed where that was not wanted
SWITCHED_OFF = "it was not asked for"


class EstimateDigest:
    """SHA-256 over estimates, to compare a live run in lockstep with a replay.

    It covers per block the stamps, CG acceleration, inertial load, mount forces and their standard deviation, bit by bit.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def update(self, block: OutputBlock) -> None:
        """Add one block."""
        for values in (block.stamp_ns, block.cg_accel, block.inertial_load, block.mount_force, block.mount_force_std):
            self._hash.update(np.ascontiguousarray(values).tobytes())

    def parameters(self, estimates: tuple[Estimate, ...]) -> None:
        """Add the parameters."""
        for estimate in estimates:
            self._hash.update(f"{estimate.name} {estimate.status.value} ".encode())
            self._hash.update(np.array([estimate.value, estimate.std]).tobytes())

    def hexdigest(self) -> str:
        """Return the digest so far."""
        return self._hash.hexdigest()


@dataclasses.dataclass(frozen=True)
class ParameterHistory:
    """How the parameters developed.

    Attributes
    ----------
    names
        Parameters, P of them.
    stamp_ns
        Shape (H,).
    value, std
        Shape (H, P).
    """

    names: tuple[str, ...]
    stamp_ns: NDArray[np.int64]
    value: Array
    std: Array


@dataclasses.dataclass(frozen=True)
class ParameterReport:
    """What the node would have published of the parameters at one time.

    Attributes
    ----------
    stamp_ns
        Newest tick.
    parameters
        With standard deviation and status.
    inertia
        Of the body about its CG, shape (3, 3) [kg m^2].
    """

    stamp_ns: int
    parameters: tuple[Estimate, ...]
    inertia: Array


@dataclasses.dataclass(frozen=True)
class OfflineRun:
    """Everything the pipeline found in one run; arrays as in :class:`OutputBlock`, all blocks joined.

    Attributes
    ----------
    signals
        Name of an ``OutputBlock`` array -> shape (N, ...); standard deviations per tick.
    measured, predicted
        Per accelerometer of the body, shape (N, 3), single precision.
    smoothed
        Forces made again with the whole run known, or why they were not.
    blocks, reports
        What the node would have published live, block by block (views of the joined arrays), and its reports of the parameters.
    """

    mount_names: tuple[str, ...]
    signals: Mapping[str, Array]
    stamp_ns: NDArray[np.int64]
    valid: NDArray[np.bool_]
    measured: Mapping[str, NDArray[np.float32]]
    predicted: Mapping[str, NDArray[np.float32]]
    parameters: tuple[Estimate, ...]
    history: ParameterHistory
    health: Health
    identifiability: Mapping[str, Any]
    digest: str
    smoothed: SmoothedForces | str = SWITCHED_OFF
    blocks: tuple[Ticks, ...] = ()
    reports: tuple[ParameterReport, ...] = ()

    @property
    def force(self) -> Array:
        """Return the best forces there are, shape (N, M, 3): smoothed, else as live."""
        return self.signals["mount_force"] if isinstance(self.smoothed, str) else self.smoothed.force

    @property
    def force_std(self) -> Array:
        """Return the standard deviation of :attr:`force`."""
        return self.signals["mount_force_std"] if isinstance(self.smoothed, str) else self.smoothed.std

    @property
    def deflection(self) -> Array:
        """Return the best deflections there are, shape (N, M, 3)."""
        return self.signals["mount_deflection"] if isinstance(self.smoothed, str) else self.smoothed.deflection

    @property
    def smoothed_parameters(self) -> tuple[Estimate, ...]:
        """Return stiffness and damping estimated from the whole run at once, none where its model does not explain the run."""
        return () if isinstance(self.smoothed, str) else self.smoothed.parameters

    @property
    def best_parameters(self) -> tuple[Estimate, ...]:
        """Return the best parameters there are: of the whole run unless suspect there, else as live."""
        return tuple(best_of(self.parameters, self.smoothed_parameters, lambda e: (e.name, e.status.value)))

    @property
    def mass_properties(self) -> tuple[Estimate, ...]:
        """Return CG and moments of inertia of the body, estimated with :attr:`smoothed_parameters`."""
        return () if isinstance(self.smoothed, str) else self.smoothed.mass_properties

    def forces_in_words(self) -> str:
        """Return what the forces of the run are."""
        if isinstance(self.smoothed, str):
            return f"causal forces, as published live; not smoothed: {self.smoothed}"
        share, reason = self.smoothed.share, self.smoothed.not_modelled
        if not share:
            return f"causal forces, as published live; not smoothed: {reason or 'sensors lost or suspect, or a load'}"
        part = f"horizontal forces ({reason})" if reason else "forces"
        found = f" ({'; '.join(self.smoothed.findings)})" if self.smoothed.findings else ""
        return (
            f"smoothed forces: {100.0 * share:.0f} % of the {part} by one model of the whole run, with the errors of the sensors"
            f"{found}; the rest as published live"
        )

    @property
    def time_s(self) -> Array:
        """Return seconds since the first tick, shape (N,)."""
        return np.asarray((self.stamp_ns - self.stamp_ns[0]) * 1e-9, dtype=np.float64)


_KEPT = (
    "cg_accel",
    "cg_specific_force",
    "angular_rate",
    "tilt",
    "inertial_load",
    "support_load",
    "mount_force",
    "mount_force_std",
    "mount_force_std_equilibrium",
    "mount_force_std_model",
    "mount_deflection",
    "mount_rate",
)


def run_offline(
    recording: Recording,
    pipeline: Pipeline,
    on_progress: Callable[[int], None] = lambda _: None,
    smoothing: bool = True,
    on_stage: Callable[[str], None] = lambda _: None,
) -> OfflineRun:
    """Feed a recording to a pipeline in order of arrival, then smooth the forces.

    Parameters
    ----------
    recording
        The run.
    pipeline
        A fresh pipeline, or one that continues from a saved state.
    on_progress
        Called now and then with the number of samples since the last call.
    smoothing
        Whether the forces are made again with the whole run known; the estimates of the pipeline stay what they are.
    on_stage
        Called with the name of a stage that follows the estimation.

    Raises
    ------
    InputDataError
        The run is too short to give a single tick.
    """
    if not smoothing:
        return _run(recording, pipeline, on_progress, None, on_stage)
    # beside the estimation: the model needs the recording only
    with futures.ThreadPoolExecutor(1) as pool:
        model = pool.submit(run_forces, recording, vehicle := pipeline.geometry.vehicle)

        def describing(left_out: LeftOut) -> RunForces:
            """Return the forces by the model; where it does not describe the run, without the readings that were not used."""
            found = model.result()
            if not found.refused or not left_out:
                return found
            again = run_forces(without_readings(recording, left_out), vehicle)
            return found if again.refused else again

        return _run(recording, pipeline, on_progress, describing, on_stage)


def _run(
    recording: Recording, pipeline: Pipeline, on_progress: Callable[[int], None],
    model: Callable[[LeftOut], RunForces] | None, on_stage: Callable[[str], None],
) -> OfflineRun:  # fmt: skip
    blocks: list[OutputBlock] = []
    digest = EstimateDigest()
    history = _History(pipeline)
    reports = _Reports(pipeline)
    count = 0
    for found, taken in pipeline.replay(recording):
        for block in found:
            blocks.append(block)
            digest.update(block)
            history.note(int(block.stamp_ns[-1]))
        reports.note(found)
        count += taken
        if count >= _REPORT_EVERY:
            on_progress(count)
            count = 0
    last = pipeline.finish()
    for block in last:
        blocks.append(block)
        digest.update(block)
    reports.note(last)
    on_progress(count)
    if not blocks:
        raise InputDataError(f"{recording.name}: too short, or no stamp of the sensors in common: not a single tick")
    parameters = pipeline.parameters()
    digest.parameters(parameters)
    history.note(int(blocks[-1].stamp_ns[-1]), force=True)
    if model is not None:
        on_stage("smoothing")
    return _joined(blocks, pipeline, parameters, history.finished(), digest.hexdigest(), tuple(reports.found), model)


class _Reports:
    """Reports of the parameters at the times at which the node makes them."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline, self._schedule = pipeline, ReportSchedule()
        self.found: list[ParameterReport] = []

    def note(self, blocks: tuple[OutputBlock, ...]) -> None:
        """Make a report when one is due after these blocks."""
        if not blocks:
            return
        now = int(blocks[-1].stamp_ns[-1])
        if self._schedule.due(now, round(REPORT_PERIOD_S * 1e9)) == "parameters":
            self.found.append(ParameterReport(now, self._pipeline.parameters(), self._pipeline.loads.inertia.copy()))


class _History:
    """Points of the parameter history."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline
        self._due = 0
        self._stamps: list[int] = []
        self._rows: list[tuple[list[float], list[float]]] = []

    def note(self, stamp: int, force: bool = False) -> None:
        """Keep a point when one is due; a clock that jumped back makes one due at once."""
        if not force and self._due - HISTORY_STEP <= stamp < self._due:
            return
        self._due = stamp + HISTORY_STEP
        estimates = self._pipeline.parameters()
        self._stamps.append(stamp)
        self._rows.append(([e.value for e in estimates], [e.std for e in estimates]))

    def finished(self) -> ParameterHistory:
        """Return the history."""
        names = tuple(e.name for e in self._pipeline.parameters())
        return ParameterHistory(
            names,
            np.array(self._stamps, dtype=np.int64),
            np.array([row[0] for row in self._rows], dtype=float).reshape(len(self._rows), len(names)),
            np.array([row[1] for row in self._rows], dtype=float).reshape(len(self._rows), len(names)),
        )


def _joined(
    blocks: list[OutputBlock], pipeline: Pipeline, parameters: tuple[Estimate, ...], history: ParameterHistory, digest: str,
    reports: tuple[ParameterReport, ...], model: Callable[[LeftOut], RunForces] | None,
) -> OfflineRun:  # fmt: skip
    signals = {name: np.concatenate([getattr(b, name) for b in blocks]) for name in _KEPT}
    ticks = [len(b.stamp_ns) for b in blocks]
    for name in ("cg_accel", "inertial_load"):
        variance = np.array([getattr(b, f"{name}_covariance").diagonal() for b in blocks])
        signals[f"{name}_std"] = np.repeat(np.sqrt(variance), ticks, axis=0)
    sensors = list(blocks[0].measured)
    stamps, valid = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("stamp_ns", "valid"))
    measured = {n: np.concatenate([b.measured[n] for b in blocks], dtype=np.float32, casting="same_kind") for n in sensors}
    predicted = {n: np.concatenate([b.predicted[n] for b in blocks], dtype=np.float32, casting="same_kind") for n in sensors}
    views = _views(blocks, {**signals, "stamp_ns": stamps, "valid": valid})
    anomalies, left_out = Anomalies.of(blocks), left_out_of(blocks)
    blocks.clear()  # a long run is not held twice while it is smoothed
    return OfflineRun(
        mount_names=pipeline.geometry.mount_names,
        signals=signals,
        stamp_ns=stamps,
        valid=valid,
        measured=measured,
        predicted=predicted,
        parameters=parameters,
        history=history,
        health=pipeline.health(),
        identifiability=pipeline.identifiability(),
        digest=digest,
        smoothed=SWITCHED_OFF
        if model is None
        else smoothed_forces({**signals, "stamp_ns": stamps}, anomalies, model(left_out), parameters, pipeline.amplitude_std()),
        blocks=views,
        reports=reports,
    )


def _views(blocks: list[OutputBlock], joined: Mapping[str, NDArray[Any]]) -> tuple[Ticks, ...]:
    """Return what is published of every block, as views of the joined arrays."""
    names = [field.name for field in dataclasses.fields(Ticks)]
    ends = np.cumsum([len(block.stamp_ns) for block in blocks]).tolist()
    found = []
    for block, end in zip(blocks, ends):
        part = slice(end - len(block.stamp_ns), end)
        found.append(Ticks(**{name: joined[name][part] if name in joined else getattr(block, name) for name in names}))
    return tuple(found)
