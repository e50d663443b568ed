# Copyright 2026 ride_estimation contributors
"""Which hypotheses are the same, which say the same with fewer mounts, and which are tried fully."""

from __future__ import annotations

from collections.abc import Sequence

from ride_estimation.diagnosis.hypotheses.hypothesis import INSIDE, Fitted, Hypothesis
from ride_estimation.diagnosis.search.fitting import FullFit, tolerance_of
from ride_estimation.diagnosis.search.screening import Score

#: a group of mounts of which fewer bring that share are those
MOSTLY = 0.9

#: cause, location, axis and variant of a hypothesis
Identity = tuple[str, str, str, str]


def beyond_tolerance(fit: FullFit, which: int = -1) -> bool:
    """Return whether a hypothesis of a fit, the last one, is more than an installation within its tolerance.

    Beside a cause whose law describes it badly, small errors of sensors and of the CG fit some of the rest; what three
    standard deviations of a good installation hold is calibration and no further cause.
    """
    fitted = fit.fitted[which]
    kind, place, axis = tolerance_of(fitted.hypothesis)
    limits = [
        a.prior_std for a in fit.adjustables
        if a.kind == kind and place in (a.place, "all") and axis in (a.axis, "")
    ]
    return not limits or abs(float(fitted.coefficients[0])) > 3.0 * max(limits)


def at_bounds(fitted: Fitted) -> bool:
    """Return whether all shape parameters of a hypothesis lie at bounds: beside another cause that is a law of another form."""
    shapes = [s for s in fitted.hypothesis.shapes if s.step == 0.0]
    return len(shapes) > 1 and all(
        not s.lower * INSIDE < fitted.shape[s.name] < s.upper / INSIDE for s in shapes
    )


def identity(h: Hypothesis) -> Identity:
    """Return what tells a hypothesis from others."""
    return h.cause, h.location, h.axis, h.variant


def same_model(score: Score, fitted: Fitted) -> bool:
    """Return whether a score is what was fitted already, up to shape parameters that a fit refines."""
    refined = {s.name for s in score.hypothesis.shapes}
    return identity(score.hypothesis) == identity(fitted.hypothesis) and all(
        fitted.shape.get(name) == value for name, value in score.shape.items() if name not in refined
    )


def taken(hypothesis: Hypothesis, kept: Sequence[Fitted]) -> bool:
    """Return whether a cause is in the model already, at that place."""
    return any(hypothesis.cause == f.hypothesis.cause and same_place(hypothesis, f.hypothesis) for f in kept)


def same_place(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses share a place and an axis."""
    shared = bool(set(a.ports) & set(b.ports)) if a.ports and b.ports else a.location == b.location
    place = shared or "all" in (a.location, b.location)
    return place and (a.axis == b.axis or not a.axis or not b.axis)


def within(part: Hypothesis, group: Hypothesis) -> bool:
    """Return whether a hypothesis is the same law at some of the mounts of a group."""
    same = (part.cause, part.axis, part.variant) == (group.cause, group.axis, group.variant)
    return same and 0 < len(part.ports) < len(group.ports) and set(part.ports) <= set(group.ports)


def shortlist(scores: Sequence[Score], count: int, least: int = 3) -> list[Score]:
    """Return the best scores, two of each of two places of one cause at most, and before them what the readings show.

    A group of mounts is left out where fewer of them bring nearly as much.

    Parameters
    ----------
    least
        So many are kept however far they fall behind the first.
    """
    out = [s for s in scores if s.hypothesis.seen_in_readings]
    if not scores:
        return out
    leading = scores[0].gain
    for s in (s for s in scores if not s.hypothesis.seen_in_readings):
        if len(out) >= count:
            break
        if s.gain <= 0.0:
            continue
        places = [o.hypothesis.location for o in out if o.hypothesis.cause == s.hypothesis.cause]
        here = places.count(s.hypothesis.location)
        if here >= 2 or (not here and len(set(places)) >= 2) or _fewer_are_enough(s, scores):
            continue
        if len(out) >= least and s.gain < 0.15 * leading:
            break
        out.append(s)
    return out


def _fewer_are_enough(score: Score, scores: Sequence[Score]) -> bool:
    """Return whether fewer mounts of a group bring nine tenths of what the group brings."""
    fewer = (s.gain for s in scores if within(s.hypothesis, score.hypothesis))
    return max(fewer, default=0.0) > MOSTLY * score.gain
