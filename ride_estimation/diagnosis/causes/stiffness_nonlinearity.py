# Copyright 2026 ride_estimation contributors
"""A spring rate that depends on the deflection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.extension import add_force_table
from ride_estimation.diagnosis.hypotheses.characteristic import Family, characteristic_forms, characteristic_hypotheses
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Law, Reported
from ride_estimation.diagnosis.hypotheses.port_groups import group_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_FORMS = (
    (Family.CUBIC, 1.0), (Family.SATURATING, 0.6), (Family.SATURATING, 1.5), (Family.GROWING, 0.9), (Family.GROWING, 1.6),
)  # fmt: skip


@final
class StiffnessNonlinearity(Cause):
    """Hardening, softening or lopsided spring."""

    ID = "stiffness_nonlinearity"
    QUESTION = "Does the spring rate of a mount change smoothly with its deflection?"
    NEEDS = "strokes large enough to bend the force-deflection line"
    RIVALS = ("bump_stop", "backlash", "coulomb_friction")
    WOULD_REFUTE = "the same spring rate on a smooth and on a rough road"
    MEASURE_NEXT = "slow force-deflection line of the mount over its full stroke"

    LAW = Law.ELASTIC

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per group."""
        return characteristic_hypotheses(view, self.ID, _FORMS, over_rate=False)

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return how the spring rate at +-2 rms deflection differs from the one at the middle."""
        group = group_of(view, fitted)
        out: list[Reported] = []
        for i, p in enumerate(group.ports):
            x_rms, part = view.scales[p][0], fitted.part(i)
            label = group.label(view, p)
            slope = float(view.state.stiffness[p])
            std = 0.0
            changes = []
            for u in (2.0, -2.0, 0.0):
                step = 1e-3
                near = np.array([u - step, u + step])
                units = characteristic_forms(near, fitted.shape, over_rate=False)
                weights = np.array([float(np.diff(unit)[0]) / (2.0 * step) for unit in units]) / x_rms
                changes.append(float(weights @ fitted.coefficients[part]))
                if u == 2.0:
                    cov = fitted.covariance[part, part]
                    std = float(np.sqrt(max(float(weights @ cov @ weights), 0.0)))
            middle = max(slope + changes[2], 1e-9)
            for name, change in (("extension", changes[0]), ("compression", changes[1])):
                ratio = (slope + change) / middle - 1.0
                spread = float(np.hypot(std / middle, FORM**0.5 * ratio))
                out.append(Reported(f"spring rate change at 2 rms {name}{label}", ratio, spread, "-"))
            out.append(Reported(f"rms deflection{label}", x_rms, 0.0, "m"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put the nonlinear part of the force-deflection line parallel to every mount of the group."""
        group = group_of(view, fitted)
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            x = view.strokes[0][:, p]
            x_rms = view.scales[p][0]
            grid = np.linspace(x.min(), x.max(), 41)
            forms = np.stack(characteristic_forms(grid / x_rms, fitted.shape, over_rate=False))
            force = fitted.coefficients[fitted.part(i)] @ forms
            vehicle = add_force_table(vehicle, port.mount, port.axis, grid, force)
        return vehicle, ()
