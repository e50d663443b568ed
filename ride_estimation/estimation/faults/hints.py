# Copyright 2026 ride_estimation contributors
"""Hints of the online estimator at what its model gets wrong: the cheap part of the diagnosis, while driving.

What the accelerometers of the body show beyond one rigid body tells a late, wrongly scaled, turned or displaced sensor: the fault
that :mod:`sensor_faults` found is handed on in the terms of the diagnosis. What the body's motion asks for beyond the forces of
the mounts tells a machine that shakes the body at one frequency, and how much the mount model misses (:mod:`hint_spectra`).
A hint names a suspicion and its size; ``ride-estimation diagnose`` on the recorded run judges it. Not seen: errors that all
sensors of the body share, and those of base accelerometers.

False alarms: the tests of spectra are made at a level that gives :data:`FALSE_ALARMS_PER_HOUR` in all, counted over the
independent looks of an hour.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.faults.hint_spectra import SpectrumHints
from ride_estimation.estimation.faults.hint_types import FALSE_ALARMS_PER_HOUR, Hint
from ride_estimation.estimation.sensor_errors.sensor_faults import Fault
from ride_estimation.frames import AXES

__all__ = ["FALSE_ALARMS_PER_HOUR", "Hint", "HintBlock", "Hints", "sensor_hint"]

Array = NDArray[np.float64]

#: what is collected before the detectors look [s]
_CHUNK = 2.0
#: kind of fault -> cause of the diagnosis, words for its columns, unit
_CAUSES = {
    "gain": ("sensor_gain", AXES, "-"), "mounting angle": ("sensor_misalignment", ("roll", "pitch", "yaw"), "rad"),
    "place": ("wrong_sensor_position", AXES, "m"), "delay": ("sensor_delay", ("",), "s"),
}  # fmt: skip


def sensor_hint(fault: Fault) -> Hint:
    """Return the fault of a sensor as a hint, of the axis that shows it most clearly."""
    cause, axes, unit = _CAUSES[fault.kind]
    axis = int(np.argmax(np.abs(fault.error) / np.maximum(fault.std, 1e-12)))
    strength, std = fault.error[axis], fault.std[axis]
    number = f"{strength:.3g} +- {std:.1g}{'' if unit == '-' else ' ' + unit}"
    others = f"; {', '.join(fault.rivals)} could be meant as well" if fault.rivals else ""
    words = f"{' '.join((fault.sensor, axes[axis])).strip()} looks like {cause.replace('_', ' ')} ({number}){others}"
    return Hint(cause, fault.sensor, axes[axis], strength, std, unit, words)


@dataclasses.dataclass(frozen=True)
class HintBlock:
    """What the detectors see of K ticks.

    Attributes
    ----------
    support, missing
        What the mounts together carry, and the part of it their model does not explain, shape (K, 6) [N, N m].
    usable
        Whether every sensor contributed and none is suspect.
    """

    support: Array
    missing: Array
    usable: bool


class Hints:
    """Detectors of what the forces of the mounts of a body do not explain.

    Parameters
    ----------
    free
        Which of the six coordinates the body has, shape (6,).
    body
        Its name.
    forces
        Whether the motion of the mounts is measured, so that their forces can be tested.
    """

    def __init__(self, free: NDArray[np.bool_], body: str, forces: bool) -> None:
        self._spectra = SpectrumHints(body, np.asarray(free, dtype=bool)) if forces else None
        self._blocks: list[HintBlock] = []
        self._ticks = 0
        #: look at a chunk that is still to be taken
        self._due: Callable[[], None] = _nothing

    @classmethod
    def of(cls, geometry: Geometry) -> Hints:
        """Return the hints on the mounts of a body."""
        return cls(geometry.free, geometry.body.name, geometry.has_base_motion)

    def reset(self) -> None:
        """Forget everything."""
        self._drop()
        self._due = _nothing
        if self._spectra is not None:
            self._spectra.reset()

    def _drop(self) -> None:
        self._blocks, self._ticks = [], 0

    def observe(self, block: HintBlock, dt: float) -> None:
        """Take one block; the detectors look with the block after two seconds without a gap.

        Parameters
        ----------
        dt
            Tick [s].
        """
        self._look()
        if self._spectra is None:
            return
        if not block.usable:
            self._drop()
            self._spectra.interrupt()
            return
        self._blocks.append(block)
        self._ticks += len(block.support)
        if self._ticks * dt < _CHUNK:
            return
        support, missing = (np.concatenate([getattr(b, name) for b in self._blocks]) for name in ("support", "missing"))
        self._drop()
        self._due = functools.partial(self._spectra.observe, support, missing, dt)

    def _look(self) -> None:
        due, self._due = self._due, _nothing
        due()

    def hints(self) -> tuple[Hint, ...]:
        """Return what is suspected now, strongest evidence first."""
        self._look()
        return () if self._spectra is None else self._spectra.hints()


def _nothing() -> None:
    """Look at nothing."""
