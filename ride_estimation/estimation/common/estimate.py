# Copyright 2026 ride_estimation contributors
"""What every estimator publishes: a number, how sure, and why not."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Sequence
from typing import TypeVar

_T = TypeVar("_T")


class Status(enum.Enum):
    """State of one estimate."""

    STARTING = "starting"
    ESTIMATING = "estimating"
    VALID = "valid"
    SUSPECT = "suspect"
    NOT_IDENTIFIABLE = "not_identifiable"
    INVALID = "invalid"


@dataclasses.dataclass(frozen=True)
class Estimate:
    """One estimated parameter.

    Attributes
    ----------
    name
        ``<mount>.<axis>.<parameter>``, ``<body>.mass``, ``<body>.cg.<axis>`` or ``<body>.inertia.<axes>``.
    value, std
        In ``unit``; ``std`` is one standard deviation.
    prior
        Value of the vehicle file.
    status, reason
        State and, unless valid, the reason in words ("needs lateral excitation").
    stamp_ns
        Stamp of the newest sample that was used.
    """

    name: str
    value: float
    std: float
    unit: str
    prior: float
    status: Status
    reason: str
    stamp_ns: int


def best_of(live: Sequence[_T], whole: Sequence[_T], name_and_status: Callable[[_T], tuple[str, str]]) -> list[_T]:
    """Return the best estimates there are: of the whole run unless suspect there, else as live.

    Parameters
    ----------
    live, whole
        As the node publishes them, and estimated from the whole run.
    name_and_status
        Of an estimate, whatever it is kept in.
    """
    better = {}
    for entry in whole:
        name, status = name_and_status(entry)
        if status != Status.SUSPECT.value:
            better[name] = entry
    return [better.get(name_and_status(entry)[0], entry) for entry in live]
