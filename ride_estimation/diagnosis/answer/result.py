# Copyright 2026 ride_estimation contributors
"""What a diagnosis says, as frozen objects with the JSON form of interface.md section 3."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

NO_DISCREPANCY, EXPLAINED, UNEXPLAINED, INSUFFICIENT = "no_discrepancy", "explained", "unexplained", "insufficient_data"


#: probability of a right decision from which on a run is said to separate two explanations, and certainty of that decision
DECIDES = 0.8


@dataclasses.dataclass(frozen=True)
class Rival:
    """A cause that was considered instead."""

    id: str
    location: str
    axis: str
    why_less_likely: str
    log_likelihood_deficit: float
    separable_by: str = ""


@dataclasses.dataclass(frozen=True)
class NamedCause:
    """A cause the diagnosis names."""

    id: str
    location: str
    axis: str
    parameters: tuple[Reported, ...]
    confidence: float
    rivals: tuple[Rival, ...]
    would_refute: str
    measure_next: str
    question: str


@dataclasses.dataclass(frozen=True)
class ValidationGain:
    """Error of baseline and extended model on data that neither fitted nor selected.

    Attributes
    ----------
    baseline, extended, noise_floor
        Pooled NRMSE of the compared channels [-].
    ci95
        Block-bootstrap interval of ``baseline - extended``.
    in_range
        ``baseline``, ``extended`` and ``noise_floor`` of the blocks whose strokes and rates the fitted run had at the mounts of
        the named laws, where there are others: beyond them a law is extrapolated, which says nothing of its kind. Where hardly
        any block has, those of the judge blocks of the fitted run.
    """

    run: str
    baseline: float
    extended: float
    ci95: tuple[float, float]
    noise_floor: float
    in_range: tuple[float, float, float] | None = None


@dataclasses.dataclass(frozen=True)
class JudgedBlocks:
    """The blocks that a gain is measured on: run, indices, squared errors of the extended model and squared signal, (B,) each."""

    run: str
    index: IntArray
    errors: Array
    signal: Array


@dataclasses.dataclass(frozen=True)
class Gain:
    """Gain of the extension; ``baseline`` and ``extended`` on the judge blocks of the run itself.

    Attributes
    ----------
    blocks
        Of every entry of ``validation``.
    """

    metric: str
    baseline: float
    extended: float
    noise_floor: float
    validation: tuple[ValidationGain, ...]
    blocks: tuple[JudgedBlocks, ...] = ()


@dataclasses.dataclass(frozen=True)
class Step:
    """One rung of the ladder of models."""

    model: str
    nrmse: float
    misfit_per_degree: float
    log_likelihood: float


@dataclasses.dataclass(frozen=True)
class Calibration:
    """One calibrated parameter.

    Attributes
    ----------
    value, std
        In ``unit``; ``std`` contains what the form of a named law leaves open.
    prior
        Value of the vehicle file.
    status
        ``valid``, ``estimating`` or ``not_identifiable`` by the rule of ``replay``; ``suspect`` where something that no cause
        explains is left in the run, which the value may make up for.
    """

    name: str
    value: float
    std: float
    unit: str
    prior: float
    status: str


@dataclasses.dataclass(frozen=True)
class Evidence:
    """Numbers behind the verdict, for pictures.

    Attributes
    ----------
    frequency_hz
        Shape (F,).
    residual_power, extended_power, noise_power
        Pooled over the channels, those of gyros left out beside others [unit^2 per bin], shape (F,).
    channel_names, channel_nrmse
        Per output channel: baseline, extended, noise floor, shape (ny, 3).
    band_table
        (band, misfit per degree of freedom of baseline and extended model).
    block_time_s, block_misfit
        Baseline and extended model, shape (B,) and (B, 2).
    loops
        By port name: deflection, force of the calibrated and of the extended model, measured force as far as the run tells
        it (what the residual asks for added), (N,) each.
    stretch
        A few seconds of every channel: time, measured, baseline, extended.
    unit
        Of the pooled channels.
    rates
        Names of the channels that are angular rates [rad/s].
    """

    frequency_hz: Array
    residual_power: Array
    extended_power: Array
    noise_power: Array
    channel_names: tuple[str, ...]
    channel_nrmse: Array
    band_table: tuple[tuple[str, float, float], ...]
    block_time_s: Array
    block_misfit: Array
    loops: dict[str, tuple[Array, Array, Array, Array]]
    stretch: dict[str, tuple[Array, Array, Array, Array]]
    unit: str = "m/s^2"
    rates: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class PerturbedCopy:
    """What a copy of the run says, changed so little that the answer should stay.

    Attributes
    ----------
    change
        What was changed, in words.
    agrees
        Whether the answer is the same, None where the copy cannot tell.
    found
        What it says instead, or why it cannot tell.
    """

    change: str
    agrees: bool | None
    found: str


@dataclasses.dataclass(frozen=True)
class Stability:
    """Whether the answer stays on perturbed copies of the run."""

    copies: tuple[PerturbedCopy, ...]

    @property
    def counts(self) -> tuple[int, int]:
        """Return on how many copies the answer is the same, and how many could tell."""
        answers = [c.agrees for c in self.copies if c.agrees is not None]
        return sum(answers), len(answers)

    @property
    def factor(self) -> float:
        """Return the factor of the confidence: the share of the run and its copies that give the answer."""
        same, copies = self.counts
        return (same + 1) / (copies + 1)

    @property
    def sentence(self) -> str:
        """Return the share that agrees in words, with what the others say."""
        same, copies = self.counts
        if not copies:
            return "No perturbed copy of the run shows whether the answer is stable."
        rest = "; ".join(f"{c.change}: {c.found}" for c in self.copies if c.agrees is False)
        return f"The answer is the same on {same} of {copies} perturbed copies of the run{f' ({rest})' if rest else ''}."

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON form."""
        same, copies = self.counts
        return {"same": same, "answers": copies, "copies": [dataclasses.asdict(c) for c in self.copies]}


@dataclasses.dataclass(frozen=True)
class CandidateRun:
    """A run that could be driven next.

    Attributes
    ----------
    words
        Road, speed or manoeuvre.
    first, second
        Probability that the run rules out the false one of two explanations if the first, or the second, is true.
    """

    words: str
    first: float
    second: float

    @property
    def worse(self) -> float:
        """Return the smaller of both."""
        return min(self.first, self.second)


@dataclasses.dataclass(frozen=True)
class NextRun:
    """What separates two explanations that a run leaves alive.

    Attributes
    ----------
    first, second
        The named cause and its rival, in words.
    odds
        Of the rival over the named cause after this run.
    tried
        Runs that were simulated with both; the first is this run once more, for comparison.
    sensor
        What else separates such causes: a sensor or a test.
    """

    first: str
    second: str
    odds: float
    tried: tuple[CandidateRun, ...]
    sensor: str

    @property
    def best(self) -> CandidateRun:
        """Return the other run that separates them best whichever is true; the earlier one of equals."""
        return max(self.tried[1:], key=lambda c: round(c.worse, 3))

    @property
    def sentence(self) -> str:
        """Return what to drive next, in words."""
        best, pair = self.best, f"{self.first} from {self.second}"
        if best.worse < DECIDES:
            return f"No simulated run is expected to distinguish {pair}; what separates them: {self.sensor}."
        return (
            f"Next run: {best.words}. It is expected to distinguish {pair}, rightly with a probability of "
            f"{100 * best.first:.0f} % if the first is true and {100 * best.second:.0f} % if the second is."
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "first": self.first, "second": self.second, "odds": self.odds, "run": self.best.words, "sensor": self.sensor,
            "sentence": self.sentence, "tried": [dataclasses.asdict(c) for c in self.tried],
        }  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Attributes
    ----------
    sentence
        The verdict in words.
    extended
        The vehicle with the calibrated parameters and the found causes.
    isolability
        Causes this run cannot tell apart and what would separate them, in words; they are among the warnings too.
    stability
        Whether perturbed copies of the run give the same answer, already part of the confidence; None where it was not asked.
    next_run
        What to drive next where a rival of a named cause is alive; None where none is, or it was not asked.
    """

    verdict: str
    sentence: str
    causes: tuple[NamedCause, ...]
    gain: Gain | None
    residual: dict[str, Any]
    warnings: tuple[str, ...]
    extended: Vehicle
    ladder: tuple[Step, ...] = ()
    parameters: tuple[Calibration, ...] = ()
    remarks: tuple[str, ...] = ()
    evidence: Evidence | None = None
    isolability: tuple[str, ...] = ()
    stability: Stability | None = None
    next_run: NextRun | None = None

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "schema": "ride_estimation/diagnosis/1",
            "verdict": self.verdict,
            "sentence": self.sentence,
            "causes": [_cause_mapping(c) for c in self.causes],
            "gain": _gain_mapping(self.gain),
            "residual": self.residual,
            "ladder": [_finite(dataclasses.asdict(step)) for step in self.ladder],
            "parameters": [_finite(dataclasses.asdict(p)) for p in self.parameters],
            "remarks": list(self.remarks),
            "isolability": list(self.isolability),
            "stability": None if self.stability is None else self.stability.to_mapping(),
            "next_run": None if self.next_run is None else self.next_run.to_mapping(),
            "warnings": list(self.warnings),
        }


def _finite(mapping: dict[str, Any]) -> dict[str, Any]:
    return {k: (None if isinstance(v, float) and not np.isfinite(v) else v) for k, v in mapping.items()}


def _cause_mapping(cause: NamedCause) -> dict[str, Any]:
    return {
        "id": cause.id,
        "location": cause.location,
        "axis": cause.axis,
        "parameters": [_finite(dataclasses.asdict(p)) for p in cause.parameters],
        "confidence": cause.confidence,
        "rivals": [_finite(dataclasses.asdict(r)) for r in cause.rivals],
        "would_refute": cause.would_refute,
        "measure_next": cause.measure_next,
    }


def _gain_mapping(gain: Gain | None) -> dict[str, Any]:
    if gain is None:
        return {"metric": "", "baseline": None, "extended": None, "noise_floor": None, "validation": []}
    return {
        "metric": gain.metric,
        "baseline": gain.baseline,
        "extended": gain.extended,
        "noise_floor": gain.noise_floor,
        "validation": [{**dataclasses.asdict(v), "ci95": list(v.ci95)} for v in gain.validation],
    }
