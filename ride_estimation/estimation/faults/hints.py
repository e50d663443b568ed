# Copyright 2026 ride_estimation contributors
"""Hints of the online estimator at what its model gets wrong: the cheap part of the diagnosis, while driving.

What the accelerometers of the body show beyond one rigid body is a late, wrongly scaled, turned or displaced sensor: the fault
that :mod:`sensor_faults` found is handed on in the terms of the diagnosis. What the body's motion asks for beyond the forces of
the mounts shows a machine that shakes the body at one frequency, and how much the mount model misses (:mod:`hint_spectra`).
A hint names a suspicion and its size; ``ride-estimation diagnose`` on the recorded run judges it. Not seen: errors that all
sensors of the body share, and those of base accelerometers.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ride_estimation.estimation.sensor_errors.sensor_faults import Fault
from ride_estimation.frames import AXES

#: kind of fault -> cause of the diagnosis, words for its columns, unit
_CAUSES = {
    "gain": ("sensor_gain", AXES, "-"), "misalignment": ("sensor_misalignment", ("roll", "pitch", "yaw"), "rad"),
    "position": ("wrong_sensor_position", AXES, "m"), "delay": ("sensor_delay", ("",), "s"),
}  # fmt: skip


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


def sensor_hint(fault: Fault) -> Hint:
    """Return the fault of a sensor as a hint, of the axis that shows it most clearly."""
    cause, axes, unit = _CAUSES[fault.kind]
    axis = int(np.argmax(np.abs(fault.error) / np.maximum(fault.std, 1e-12)))
    strength, std = fault.error[axis], fault.std[axis]
    number = f"{strength:.3g} +- {std:.1g}{'' if unit == '-' else ' ' + unit}"
    others = f"; {', '.join(fault.rivals)} could be meant as well" if fault.rivals else ""
    words = f"{' '.join((fault.sensor, axes[axis])).strip()} looks like {cause.replace('_', ' ')} ({number}){others}"
    return Hint(cause, fault.sensor, axes[axis], strength, std, unit, words)
