# Copyright 2026 ride_estimation contributors
"""Verdict and named causes of a diagnosis of a changed run, in names and axes of the original vehicle."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from relations import Relation

from ride_estimation.diagnosis.answer.result import Diagnosis
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.frames import COORDINATES
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Channel, Recording, UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

#: the analysis band ends at 40 Hz
HIGHEST_RATE_HZ = 400.0


@dataclasses.dataclass(frozen=True)
class Answer:
    """Verdict and (id, place, axis) of every named cause."""

    verdict: str
    causes: frozenset[tuple[str, str, str]]

    def __str__(self) -> str:
        return f"{self.verdict}: {', '.join(' '.join(filter(None, c)) for c in sorted(self.causes)) or '-'}"


def answer(found: Diagnosis, vehicle: Vehicle, relation: Relation) -> Answer:
    """Return what a diagnosis of the changed vehicle says about the original one."""
    mounts = {relation.mounts(name): name for name in vehicle.mounts}
    axes = {relation.axis(a): a for a in COORDINATES}
    return Answer(
        found.verdict, frozenset((c.id, mounts.get(c.location, c.location), axes.get(c.axis, c.axis)) for c in found.causes)
    )


def diagnosed(vehicle: Vehicle, runs: Sequence[Recording], relation: Relation) -> Answer:
    """Diagnose the first run, judged by the others, all of them changed."""
    changed = relation.vehicle(vehicle)
    aligned = [_aligned(relation.recording(vehicle, r)) for r in runs]
    return answer(diagnose(changed, aligned[0], aligned[1:]), vehicle, relation)


def _aligned(run: Recording) -> UniformRun:
    found = align(run)
    return align(run, HIGHEST_RATE_HZ) if found.rate_hz > HIGHEST_RATE_HZ else found


def as_recording(run: UniformRun) -> Recording:
    """Return the samples of a uniform run as messages."""
    stamps = run.start_ns + np.round(run.time_s * 1e9).astype(np.int64)
    return Recording(run.name, {name: Channel(name, stamps, values, stamps) for name, values in run.data.items()})
