# Copyright 2026 ride_estimation contributors
"""Whether the answer is the same on copies of the run that an engineer would call the same run.

Four copies: one per cent more noise, ten per cent shorter, without a sensor that can be spared, another time base. On each the
model is calibrated from where the run ended, and the named causes, their near rivals and the model without them are fitted again
from the numbers that were found: a comparison, no new search. What else the search could have found is not asked.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.gain import refusal
from ride_estimation.diagnosis.answer.result import EXPLAINED, NO_DISCREPANCY, PerturbedCopy, Stability
from ride_estimation.diagnosis.calibration.linear_model import Calibrated, calibrated_at
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.causes.sensor_clipping import NEAR_LIMIT
from ride_estimation.diagnosis.common.splits import LEAST_BLOCKS, Splits
from ride_estimation.diagnosis.common.wording import title
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.model.measurement import Measurement
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.candidates import identity
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.prediction import predict
from ride_estimation.diagnosis.search.selection import Round, Selection, Selector, required_evidence
from ride_estimation.diagnosis.search.work import Work
from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

_NOISE, _SHORTER, _RESAMPLED = 0.01, 0.1, (9, 10)
#: rivals that are fitted beside every named cause, and candidates where none was named
_RIVALS = 2
#: share of the evidence for a named cause that a copy may lack, twice what it lacks on average: noise of (1 + 0.01)^2 the power,
#: a tenth of the time, one of several sensors, and the rounding of another time base. A rival further behind cannot win there
_LACKS_NOISE, _LACKS_TIME, _LACKS_SENSOR, _LACKS_BASE = 0.05, 0.2, 0.5, 0.02
#: passes of a fit that starts from the numbers of another
_PASSES = 2
#: misfit per degree of freedom from which a calibrated model still misses something
_MISSES = 1.1


@dataclasses.dataclass(frozen=True)
class PerturbedRun:
    """A copy of a run: what was changed, and which share of the evidence for a cause that may take away."""

    words: str
    plant: Plant
    data: Measurement
    lacks: float


def perturbed(work: Work) -> Iterator[PerturbedRun]:
    """Yield the copies of a run; the same ones every time."""
    plant, data = work.plant, work.data.measured
    rng = np.random.default_rng(work.settings.seed)
    more = np.sqrt((1.0 + _NOISE) ** 2 - 1.0)
    noisy = [
        signals + more * np.array([s.noise_std for s in channels]) * rng.standard_normal(signals.shape)
        for signals, channels in ((data.outputs, plant.outputs), (data.inputs, plant.inputs))
    ]
    again = dataclasses.replace(data, outputs=noisy[0], inputs=noisy[1])
    yield PerturbedRun(f"{100 * _NOISE:.0f} % more noise", plant, again, _LACKS_NOISE)
    kept = slice(0, round((1.0 - _SHORTER) * len(data.outputs)))
    yield PerturbedRun(f"{100 * _SHORTER:.0f} % shorter", plant, data.at(kept), _LACKS_TIME)
    named = {f.hypothesis.location for f in work.selection.accepted.fitted} if work.selection.accepted is not None else set()
    spare = spare_sensor(plant, named)
    if spare:
        rows = np.array([i for i, s in enumerate(plant.outputs) if s.sensor != spare])
        fewer = dataclasses.replace(
            plant, outputs=tuple(plant.outputs[i] for i in rows), out_acceleration=plant.out_acceleration[rows],
            out_rate=plant.out_rate[rows], out_displacement=plant.out_displacement[rows], out_base=plant.out_base[rows],
        )  # fmt: skip
        without = dataclasses.replace(data, outputs=data.outputs[:, rows], output_limits=data.output_limits[:, rows])
        yield PerturbedRun(f"without {spare}", fewer, without, _LACKS_SENSOR)
    up, down = _RESAMPLED
    outputs, inputs = (resampled(x, up, down) for x in (data.outputs, data.inputs))
    place = np.minimum(np.round(np.arange(len(outputs)) * down / up).astype(int), len(data.valid) - 1)
    rate = data.rate_hz * up / down
    again = dataclasses.replace(data.at(place), rate_hz=rate, outputs=outputs, inputs=inputs)
    yield PerturbedRun(f"time base of {rate:g} Hz", plant, again, _LACKS_BASE)


def resampled(values: Array, up: int, down: int) -> Array:
    """Return signals at ``up / down`` times their rate, shape (N, q), still flat where a sensor has cut them.

    Between two samples at the extreme of a channel a recorder of any rate would have read the limit too, and beyond it nothing.
    """
    # linearly padded: a record does not end where it began
    out = scipy.signal.resample_poly(values, up, down, axis=0, padtype="line")
    least, most = values.min(axis=0), values.max(axis=0)
    near = np.minimum(values - least, most - values) < NEAR_LIMIT * np.std(values, axis=0)
    place = np.minimum(np.arange(len(out)) * down / up, len(values) - 1.0)
    left = np.floor(place).astype(int)
    right, share = np.minimum(left + 1, len(values) - 1), (place - left)[:, None]
    between = (1.0 - share) * values[left] + share * values[right]
    return np.asarray(np.where(near[left] & near[right], between, np.clip(out, least, most)))


def spare_sensor(plant: Plant, named: set[str]) -> str:
    """Return the last sensor of the body whose motion the others tell too, none that was named; empty where none is."""
    sensors = [s for s in dict.fromkeys(s.sensor for s in plant.outputs) if s not in named]
    shown = plant.shown_motion
    full = np.linalg.matrix_rank(shown)
    for sensor in reversed(sensors):
        rest = [i for i, s in enumerate(plant.outputs) if s.sensor != sensor]
        if rest and np.linalg.matrix_rank(shown[rest]) == full:
            return sensor
    return ""


def stability(work: Work, verdict: str) -> Stability:
    """Return on how many copies of a run the same causes are named, or none again.

    Parameters
    ----------
    work
        Of the run, with the causes as they are named.
    verdict
        What was said of the run.
    """
    def judged(copy: PerturbedRun) -> PerturbedCopy:
        try:
            return _on_copy(work, verdict, copy)
        except (InputDataError, np.linalg.LinAlgError) as error:
            return PerturbedCopy(copy.words, None, str(error))

    # one after the other: the views of two copies at once took 150 MB for a run of a minute and saved a second
    return Stability(tuple(map(judged, perturbed(work))))


def _on_copy(work: Work, verdict: str, perturbed_run: PerturbedRun) -> PerturbedCopy:
    settings, accepted, words = work.settings, work.selection.accepted, perturbed_run.words
    view = RunView(RunData(perturbed_run.plant, perturbed_run.data, settings), work.calibrated.view.state)
    if view.blocks.count < LEAST_BLOCKS:
        return PerturbedCopy(words, None, f"fewer than {LEAST_BLOCKS} blocks remain")
    splits = work.splits.of_copy(view.blocks.count)
    calibrated = calibrated_at(view, splits.train)
    selector = Selector(calibrated, splits, lambda _: [], settings)
    copy = _Copy(work, calibrated, splits, selector, perturbed_run.lacks)
    if accepted is not None:
        contests = enumerate(work.selection.contests)
        found = next((changed for place, contest in contests if (changed := copy.changed(accepted, place, contest))), "")
    elif verdict == NO_DISCREPANCY:
        found = copy.named()
    elif verdict == EXPLAINED:
        return PerturbedCopy(words, None, "how stiff the mounts are to one another is not asked again")
    else:
        found = "" if selector.base_excess > _MISSES else "the model misses nothing"
    return PerturbedCopy(words, not found, found)


class _Copy:
    """A perturbed copy on which found causes are fitted again."""

    def __init__(self, work: Work, calibrated: Calibrated, splits: Splits, selector: Selector, lacks: float) -> None:
        self._work, self._calibrated, self._splits, self._lacks = work, calibrated, splits, lacks
        self._selection, self._view, self._fitter = work.selection, calibrated.view, selector.fitter
        self._selector = selector
        self._whole = len(calibrated.view.plant.outputs) == len(work.plant.outputs)
        self._built: dict[str, Sequence[Hypothesis]] = {}
        self._named: FullFit | None = None

    def changed(self, accepted: FullFit, place: int, contest: Round) -> str:
        """Return what the copy says instead of one of the causes of the run, empty where it says the same."""
        named = accepted.fitted[place]
        first = contest.candidates[0]
        near = max(self._lacks * (first.log_likelihood - contest.reference), self._work.settings.significance)
        rivals = [
            c for c in contest.candidates if not overlap(c.hypothesis, named.hypothesis) and c.behind(first) < near
        ][:_RIVALS]
        starts = [self._start(f) for f in accepted.fitted]
        if starts[place] is None:
            return f"no sensor left that shows {_name(named.hypothesis)}"
        before, after = ([s for s in part if s is not None] for part in (starts[:place], starts[place + 1 :]))
        rest = [(c.elsewhere.gap, s) for c in rivals if (s := self._start(c.fit.fitted[c.contested])) is not None]
        if self._named is None:
            self._named = self._fit([s for s in starts if s is not None])
        gaps = [0.0, *(gap for gap, _ in rest)]
        fits = [self._named, *(self._fit([*before, s, *after]) for _, s in rest)]
        others = [*before, *after]
        found = self._selector.compared(fits, len(before), self._fit(others) if others else None)
        # what validation runs say of rivals is no less true of a copy of the run
        elsewhere = {id(f): gap for f, gap in zip(fits, gaps)}
        best = max(found.candidates, key=lambda c: c.log_likelihood - elsewhere[id(c.fit)])
        if best.fit is not fits[0]:
            return f"{_name(best.hypothesis)} instead of {_name(named.hypothesis)}"
        needed = required_evidence(best.fit, best.contested, self._work.settings)
        enough = best.log_likelihood - found.reference >= needed if others else self._selector.names(found)
        return "" if enough else f"too little evidence for {_name(named.hypothesis)}"

    def named(self) -> str:
        """Return the cause that the copy names where the run names none, empty where it names none either.

        As on the run, an evident cause that predicts nothing that matters is not named.
        """
        first = self._selection.rounds[0].candidates[:_RIVALS] if self._selection.rounds else ()
        starts = [s for c in first if (s := self._start(c.fit.fitted[c.contested])) is not None]
        fits = [f for f in (self._fitter.fit([s], _PASSES) for s in starts) if f.meaningful]
        found = self._selector.compared(fits, 0) if fits else None
        if found is None or not self._selector.names(found):
            return ""
        best = found.candidates[0]
        work = dataclasses.replace(
            self._work, calibrated=self._calibrated, splits=self._splits, selector=self._selector,
            selection=Selection(best.fit, (found,), (found,)),
        )
        base, extended = predict(work.data, work.baseline), predict(work.data, work.extended)
        return "" if refusal(work, base, extended) else _name(best.hypothesis)

    def _fit(self, starts: Sequence[Fitted]) -> FullFit:
        """Return the fit of hypotheses from the numbers of the run, without its trajectory: its numbers are compared."""
        return dataclasses.replace(self._fitter.fit(starts, _PASSES), view=self._view, regression=self._calibrated.regression)

    def _start(self, fitted: Fitted) -> Fitted | None:
        """Return a found hypothesis as it is built on the copy, with its numbers; None where its channel is missing."""
        h = fitted.hypothesis
        if h.cause not in self._built:
            self._built[h.cause] = library()[h.cause].hypotheses(self._view)
        # on all channels a hypothesis of the run means the same here
        again = rebuilt(fitted, self._built[h.cause]) or (h if self._whole else None)
        return None if again is None else dataclasses.replace(fitted, hypothesis=again)


def rebuilt(fitted: Fitted, built: Sequence[Hypothesis]) -> Hypothesis | None:
    """Return the one of some hypotheses that a found one is, None where none is.

    Lines of one body differ in their frequency alone: of several the one whose grid is nearest to the numbers that were found.
    """

    def apart(h: Hypothesis) -> float:
        return min(sum(abs(shape.get(n, v) - v) for n, v in fitted.shape.items()) for shape in h.grid)

    return min((b for b in built if identity(b) == identity(fitted.hypothesis)), key=apart, default=None)


def overlap(one: Hypothesis, other: Hypothesis) -> bool:
    """Return whether two hypotheses are one cause at places that share something; no axis stands for all of a sensor."""
    place = one.location == other.location and (one.axis == other.axis or "" in (one.axis, other.axis))
    return one.cause == other.cause and (place or bool(set(one.ports) & set(other.ports)))


def _name(h: Hypothesis) -> str:
    return title(h.cause, h.location, h.axis)
