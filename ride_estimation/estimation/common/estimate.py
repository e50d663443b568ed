# Copyright 2026 ride_estimation contributors
"""What every estimator publishes: a number, how sure, and why not."""

from __future__ import annotations

import dataclasses
import enum


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
        ``<mount>.<axis>.<parameter>`` or ``<body>.mass``.
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
