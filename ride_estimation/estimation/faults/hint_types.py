# Copyright 2026 ride_estimation contributors
"""A hint, and how often hints may be wrong."""

from __future__ import annotations

import dataclasses

#: false hints an hour of all tests together, by theory and on good installations
FALSE_ALARMS_PER_HOUR = 0.01
#: memory of the detectors [s]; looks that far apart are independent
MEMORY = 60.0


@dataclasses.dataclass(frozen=True)
class Hint:
    """A suspicion about the model or a sensor.

    Attributes
    ----------
    cause
        Id of a cause of the diagnosis, or ``unexplained``.
    location, axis
        Sensor or body; axis where there is one.
    strength, std, unit
        Size of what is suspected and its standard deviation (0 where none is stated).
    words
        Sentence for the person in the field.
    """

    cause: str
    location: str
    axis: str
    strength: float
    std: float
    unit: str
    words: str


def level(tests: int) -> float:
    """Return the probability of a false alarm that one test may have.

    Parameters
    ----------
    tests
        Made at every look; an hour has ``3600 / MEMORY`` independent looks.
    """
    return FALSE_ALARMS_PER_HOUR / (3600.0 / MEMORY * max(tests, 1))
