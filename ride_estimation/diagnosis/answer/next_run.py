# Copyright 2026 ride_estimation contributors
"""Which run to drive next where two explanations are alive: the one whose expected evidence separates them best.

Both explanations were fitted to the run. Each is taken for true in turn and drives every candidate run in simulation; both are
fitted to what it would measure, stiffness, damping and tolerances free. Without noise in what is simulated the difference g of
their log-likelihoods against the noise of the sensors is the expected one; noise scatters it by ``sqrt(2 g)``, and the form of a
law that is not quite the real one by a share of its effect. A run decides where the false one is then ruled out with the
certainty that a run is recommended with, by the odds that a diagnosis of it will state. A candidate is as good as the worse of
the two cases (Hunter and Reiner 1965, Technometrics 7, with the probability of a right decision in place of the distance of the
predictions).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ride_estimation.diagnosis.answer.isolability import separation
from ride_estimation.diagnosis.answer.result import DECIDES, CandidateRun, NextRun
from ride_estimation.diagnosis.answer.verdict import ALIVE, rivals_of
from ride_estimation.diagnosis.calibration.linear_model import calibrated_at
from ride_estimation.diagnosis.common.splits import LEAST_BLOCKS, make_splits
from ride_estimation.diagnosis.common.wording import title
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Fitted
from ride_estimation.diagnosis.model.measurement import Measurement
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit, FullFitter
from ride_estimation.diagnosis.search.prediction import predict
from ride_estimation.diagnosis.search.selection import Selector
from ride_estimation.diagnosis.search.work import Work, model_of

Array = NDArray[np.float64]

#: sizes of the motion and speeds that are tried, as factors of those of the run
_SIZES, _SPEEDS = (0.5, 2.0), (0.7, 1.4)
#: single bumps: height and length [m], vehicle speed [m/s], time between two [s]
_BUMP = (0.04, 1.5, 4.0, 4.0)
#: deflection over that of the run from which on nobody knows the form of a law
_KNOWN_RANGE = 2.5
#: passes of a fit that starts from the numbers of another
_PASSES = 2


def next_run(work: Work) -> NextRun | None:
    """Return the run that separates the named cause from the rival that is alive, None where there is no such rival.

    Parameters
    ----------
    work
        Of the run, with the causes as they are named.
    """
    accepted, blocks = work.selection.accepted, work.splits.train
    if accepted is None:
        return None
    for place, contest in enumerate(work.selection.contests):
        alive = [pair for pair in rivals_of(contest, blocks) if pair[1] >= ALIVE]
        if not alive:
            continue
        rival, odds = alive[0]
        mine, its = accepted.fitted[place], rival.fit.fitted[rival.contested]
        others = tuple(f for i, f in enumerate(accepted.fitted) if i != place)
        fitter = FullFitter(work.calibrated, work.splits)
        fits = [fitter.fit([*others, f], _PASSES) for f in (mine, its)]
        pair = [f.fitted[-1] for f in fits]
        runs = candidate_runs(work.plant, work.data.measured)
        tried = tuple(CandidateRun(words, *(_right(work, fits, others, data, truth) for truth in (0, 1))) for words, data in runs)
        names = [title(f.hypothesis.cause, f.hypothesis.location, f.hypothesis.axis) for f in pair]
        return NextRun(names[0], names[1], odds, tried, separation(mine.hypothesis.cause, its.hypothesis.cause))
    return None


def candidate_runs(plant: Plant, data: Measurement) -> Iterator[tuple[str, Measurement]]:
    """Yield runs that could be driven next, as what would move the bases; their outputs are not those of the model yet."""
    rest_in, rest_out = (signals[data.valid].mean(axis=0) for signals in (data.inputs, data.outputs))

    def moved(inputs: Array, outputs: Array) -> Measurement:
        valid = np.ones(len(inputs), dtype=bool)
        return dataclasses.replace(data, inputs=rest_in + inputs, outputs=rest_out + outputs, valid=valid)

    shaken, answered = data.inputs - rest_in, data.outputs - rest_out
    yield "this run once more", moved(shaken, answered)
    for size in _SIZES:
        yield f"the same with {size:g} times the motion (a road {'rougher' if size > 1 else 'smoother'})", moved(
            size * shaken, size * answered
        )
    # over the same ground the acceleration of a base grows with the square of the speed, its displacement does not
    power = np.array([2.0 if s.kind == "acceleration" else 0.0 for s in plant.inputs])
    for speed in _SPEEDS:
        count = min(len(shaken), int(len(shaken) / speed))
        at = np.arange(count) * speed
        faster, answer = (
            np.stack([np.interp(at, np.arange(len(x)), column) for column in x.T], axis=1) for x in (shaken, answered)
        )
        yield f"the same road at {speed:g} times the speed", moved(faster * speed**power, answer)
    bumps = _bumps(plant, data, rest_in)
    if bumps is not None:
        height, length, velocity, _ = _BUMP
        words = f"single bumps of {1e3 * height:.0f} mm over {length:g} m at {3.6 * velocity:.0f} km/h"
        yield words, moved(bumps, np.zeros_like(answered))


def _bumps(plant: Plant, data: Measurement, rest: Array) -> Array | None:
    """Return the readings of the base sensors over single bumps, gravity left out, shape (N, nu); None without accelerometers."""
    if any(s.kind != "acceleration" for s in plant.inputs):
        return None
    height, length, speed, period = _BUMP
    time, out = np.arange(len(data.inputs)) / data.rate_hz, np.zeros_like(data.inputs)
    vehicle = plant.vehicle
    front = max(m.position[0] for m in vehicle.mounts.values())
    for sensor in dict.fromkeys(s.sensor for s in plant.inputs):
        rows = [i for i, s in enumerate(plant.inputs) if s.sensor == sensor]
        mount = vehicle.sensors[sensor].mount
        behind = front - float(vehicle.mounts[mount].position[0]) if mount in vehicle.mounts else 0.0
        phase = np.mod(time - behind / speed, period) * speed / length
        omega = 2.0 * np.pi * speed / length
        vertical = np.where(phase < 1.0, 0.5 * height * omega**2 * np.cos(2.0 * np.pi * phase), 0.0)
        # up is where gravity is read, however the sensor is mounted
        out[:, rows] = vertical[:, None] * rest[rows] / max(float(np.linalg.norm(rest[rows])), 1e-9)
    return out


def _right(work: Work, fits: Sequence[FullFit], others: tuple[Fitted, ...], data: Measurement, truth: int) -> float:
    """Return the probability that a candidate run decides between two explanations where that of number ``truth`` is true."""
    plant, settings = work.plant, work.settings
    predicted = predict(RunData(plant, data, settings), model_of(fits[truth]), at_rest=True)
    moved, known = (float(np.abs(s.deflection).max()) for s in (predicted.view, work.calibrated.view))
    if not predicted.settled or moved > _KNOWN_RANGE * known:
        return 0.0
    outputs = predicted.view.grid.signal(predicted.spectrum) + data.outputs.mean(axis=0)
    measured = dataclasses.replace(data, outputs=outputs)
    view = RunView(RunData(plant, measured, settings), work.calibrated.view.state)
    if view.blocks.count < LEAST_BLOCKS:
        return 0.0
    splits = make_splits(view.blocks.count, view.blocks.begins)
    selector = Selector(calibrated_at(view, splits.train), splits, lambda _: [], settings)
    both = [selector.fitter.fit([*others, f.fitted[-1]], _PASSES) for f in fits]
    before = selector.fitter.fit(others, _PASSES) if others else None
    found = selector.compared(both, len(others), before)
    mine, its = (next(c for c in found.candidates if c.fit is f) for f in (both[truth], both[1 - truth]))
    gap, effect = mine.log_likelihood - its.log_likelihood, mine.log_likelihood - found.reference
    if effect < settings.significance:
        return 0.0  # too little of it shows to name either
    return decision_probability(gap, effect)


def decision_probability(gap: float, effect: float) -> float:
    """Return the probability that a run rules out the false one of two explanations.

    It is ruled out where another stretch of road would rank the two the other way round with a probability below
    ``1 - DECIDES``, as :func:`verdict.reversal_odds` says of a run that was driven.

    Parameters
    ----------
    gap
        Expected log-likelihood of the true one over the false one [nat].
    effect
        What the true one gains over the model without either [nat].
    """
    spread = float(np.sqrt(2.0 * abs(gap) + (FORM * max(effect, 0.0)) ** 2))
    return float(ndtr(gap / max(spread, 1e-9) - ndtri(DECIDES)))
