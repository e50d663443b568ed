# Copyright 2026 ride_estimation contributors
"""Stiffness or damping of a mount that changes during the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.common.extension import linear_part, with_linear_part
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.operators import legendre
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, group_of, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: places in the analysed stretch, 0 to 1: its ends, and its outer thirds
_STRETCH = np.array([0.0, 1.0])
_FIRST_THIRD, _LAST_THIRD = np.linspace(0.0, 1.0 / 3.0, 9), np.linspace(2.0 / 3.0, 1.0, 9)
_LEAST = 0.05  # share of a stiffness that a polynomial leaves of it at least


@final
class ParameterDrift(Cause):
    """A mount that warms up, loses air or wears while it is measured."""

    ID = "parameter_drift"
    QUESTION = "Do stiffness or damping of a mount change in the course of the run?"
    NEEDS = "excitation in every part of the run"
    RIVALS = ("mass_change", "stiffness_nonlinearity")
    WOULD_REFUTE = "equal parameters from the first and the last third of the run"
    MEASURE_NEXT = "repeat the run with the mounts warm; log the air-spring pressure"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per group; at ``all`` every mount changes by the same share."""
        out: list[Hypothesis] = []
        for group in port_groups(view):

            def columns(view: RunView, shape: Shapes, s: PortGroup = group) -> list[Column]:
                first, second = legendre(view.data.time_s, 1), legendre(view.data.time_s, 2)
                result: list[Column] = []
                for profile, with_damping in ((first, False), (first, True), (second, False), (second, True)):
                    effects = []
                    for p in s.ports:
                        k, c = view.state.stiffness[p], view.state.damping[p]
                        force = c * view.deflection_rate[:, p] if with_damping else k * view.deflection[:, p]
                        effects.append(Effect(Where.PORT, p, profile * force))
                    result.append(tuple(effects))
                return result

            out.append(Hypothesis(self.ID, group.location, group.axis, columns, run_bound=True))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return stiffness and damping at the end of the analysed stretch over those at its start, minus one.

        How they came there is not known: half of what the change of the first to the last third differs is part of the deviation.
        """
        out = []
        for name, i in (("stiffness", 0), ("damping", 1)):
            first, last = _course(view, fitted, i, _STRETCH)
            change = last / max(first, _LEAST) - 1.0
            early, late = (float(np.mean(_course(view, fitted, i, third))) for third in (_FIRST_THIRD, _LAST_THIRD))
            unsure = 0.5 * abs(change - (late / max(early, _LEAST) - 1.0))
            out.append(Reported(f"{name} change over the run", float(change), float(np.hypot(2.0 * fitted.std(i), unsure)), "-"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the parameters of the end of the run."""
        (stiffer,), (damped,) = (_course(view, fitted, i, _STRETCH[-1:]) for i in (0, 1))
        for p in group_of(view, fitted).ports:
            port = view.plant.ports[p]
            element = vehicle.mounts[port.mount].elements[port.axis]
            k, c = linear_part(element)
            changed = with_linear_part(element, k * max(float(stiffer), _LEAST), c * max(float(damped), 0.0))
            vehicle = vehicle.replace_elements({(port.mount, port.axis): changed})
        return vehicle, ("stiffness and damping of the drifting mounts are those of the end of the run",)


def _course(view: RunView, fitted: Fitted, quantity: int, places: Array) -> Array:
    """Return stiffness (``quantity`` 0) or damping (1) over its middle of the run, shape as ``places``.

    The polynomials hold where the run was analysed and say nothing of its ends, which were left out.
    """
    first, last = view.blocks.time_s[[0, -1]]
    start, end = view.data.time_s[[0, -1]]
    u = 2.0 * (first + (last - first) * places - start) / (end - start) - 1.0
    linear, square = fitted.coefficients[[quantity, quantity + 2]]
    return np.asarray(1.0 + np.polynomial.legendre.legval(u, [0.0, linear, square]))
