# Copyright 2026 ride_estimation contributors
"""One mount much softer than its file says while the others are not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle


@final
class OneSoftMount(Cause):
    """A torn or leaking mount. The calibration finds it; :mod:`outlier` judges it against the other mounts."""

    ID = "one_soft_mount"
    QUESTION = "Is one mount much softer than its vehicle file, relative to the others?"
    NEEDS = "two or more mounts whose stiffness the run identifies"
    RIVALS = ("cg_offset", "backlash", "parameter_drift")
    WOULD_REFUTE = "a static ride height at that mount that is as designed"
    MEASURE_NEXT = "ride height and visual inspection of that mount; swap two mounts and repeat"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return none: a soft mount leaves nothing in the residual of the calibrated model."""
        return ()

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return stiffness over the one the file and the other mounts imply, minus one, and the stiffness [N/m]."""
        p = view.port_index(fitted.hypothesis.location, fitted.hypothesis.axis)
        ratio, std = float(np.exp(fitted.coefficients[0])), fitted.std(0)
        stiffness = float(view.state.stiffness[p])
        return (
            Reported("stiffness change against file and other mounts", ratio - 1.0, ratio * std, "-"),
            Reported("stiffness", stiffness, stiffness * std, "N/m"),
        )

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Leave the vehicle as calibrated: the soft mount is in it."""
        return vehicle, ()
