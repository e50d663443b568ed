# Copyright 2026 ride_estimation contributors
"""Hints of the estimator as a status on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from ride_estimation.estimation.faults.hints import Hint
from ride_estimation.nodes.conversions import status


def hint_status(hints: Sequence[Hint], body: str) -> DiagnosticStatus:
    """Return the status ``hints``: OK where nothing is suspected, else the suspicion in words and numbers.

    Parameters
    ----------
    hints
        From :meth:`Pipeline.hints`, strongest first.
    body
        Hardware id of the estimates.
    """
    values: dict[str, object] = {"hints": len(hints)}
    for number, hint in enumerate(hints, start=1):
        place = {"cause": hint.cause, "location": hint.location, "axis": hint.axis}
        size = {"strength": float(hint.strength), "std": float(hint.std), "unit": hint.unit, "words": hint.words}
        values |= {f"hint {number} {key}": value for key, value in {**place, **size}.items()}
    level = DiagnosticStatus.WARN if hints else DiagnosticStatus.OK
    return status(level, "hints", hints[0].words if hints else "nothing suspected", body, values)
