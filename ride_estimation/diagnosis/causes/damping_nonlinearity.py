# Copyright 2026 ride_estimation contributors
"""A damper whose force is not proportional to speed, or differs between extension and compression."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.extension import add_damper_curve
from ride_estimation.diagnosis.hypotheses.characteristic import Family, characteristic_forms, characteristic_hypotheses
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Law, Reported
from ride_estimation.diagnosis.hypotheses.port_groups import group_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_FORMS = (
    (Family.SQUARE, 1.0), (Family.SATURATING, 0.4), (Family.SATURATING, 0.8), (Family.SATURATING, 2.0), (Family.BULGE, 0.5),
    (Family.BULGE, 1.0), (Family.POWER, 0.45), (Family.POWER, 0.7), (Family.KNEE, 1.5),
)  # fmt: skip


@final
class DampingNonlinearity(Cause):
    """Degressive, progressive or lopsided damper."""

    ID = "damping_nonlinearity"
    QUESTION = "Is the damping force of a mount bent over speed, or different in extension and compression?"
    NEEDS = "rates beyond the knee of the damper"
    RIVALS = ("coulomb_friction", "viscoelasticity", "bump_stop")
    WOULD_REFUTE = "the same damping ratio at small and at large speed"
    MEASURE_NEXT = "force-speed curve of the damper at several constant speeds, both directions"
    LAW = Law.VISCOUS

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per group."""
        return characteristic_hypotheses(view, self.ID, _FORMS, over_rate=True)

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the damping force at one rms rate in both directions over the one of the plain damper."""
        group = group_of(view, fitted)
        out: list[Reported] = []
        for i, p in enumerate(group.ports):
            v_rms = view.scales[p][1]
            label, part = group.label(view, p), fitted.part(i)
            for name, u in (("extension 0.5 rms", 0.5), ("extension 2 rms", 2.0), ("compression 2 rms", -2.0)):
                weights = np.array([form.item() for form in characteristic_forms(np.array([u]), fitted.shape, over_rate=True)])
                force = float(view.state.damping[p] * u * v_rms + weights @ fitted.coefficients[part])
                std = float(np.sqrt(max(weights @ fitted.covariance[part, part] @ weights, 0.0) + FORM * force**2))
                out.append(Reported(f"damping force at {name} rate{label}", force, std, "N"))
            out.append(Reported(f"rms rate{label}", v_rms, 0.0, "m/s"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Replace the dashpot of every mount of the group by its force-rate curve."""
        group = group_of(view, fitted)
        notes: list[str] = []
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            v = view.strokes[1][:, p]
            v_rms = view.scales[p][1]
            weights = fitted.coefficients[fitted.part(i)]

            def curve(rate: Array, weights: Array = weights, scale: float = v_rms) -> Array:
                return np.asarray(weights @ np.stack(characteristic_forms(rate / scale, fitted.shape, over_rate=True)))

            vehicle, note = add_damper_curve(vehicle, port.mount, port.axis, v, curve, float(view.state.damping[p]))
            notes += note
        return vehicle, tuple(notes)
