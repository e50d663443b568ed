# Copyright 2026 ride_estimation contributors
"""How many internal steps a sample needs."""

from __future__ import annotations

import numpy as np

from ride_estimation.vehicles.assembly import Assembly
from ride_estimation.vehicles.modes import linearise, undamped_modes

#: radians of the fastest undamped mode per internal step that keep the Runge-Kutta phase error below 1e-5 per step
_STEP_PHASE = 0.25
_MOST_SUBSTEPS = 64


def choose_substeps(assembly: Assembly, rate_hz: float) -> int:
    """Return internal steps per sample such that the fastest mode advances at most 0.25 rad a step, 1 to 64."""
    model = linearise(assembly, 10.0, 1.0e-3)
    fastest = max(abs(m.frequency_hz) for m in undamped_modes(model)) * 2.0 * np.pi
    dampers = np.linalg.eigvals(np.linalg.solve(model.mass, model.damping))
    fastest = max(fastest, 0.25 * float(np.abs(dampers).max()))
    return int(np.clip(np.ceil(fastest / rate_hz / _STEP_PHASE), 1, _MOST_SUBSTEPS))
