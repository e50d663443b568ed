# Copyright 2026 ride_estimation contributors
"""Free play in a mount."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.common.extension import add_force_table
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Law, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.operators import loose_share
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, force_columns, group_of, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_DAMPER = "damper"
#: share of the damping of a mount that may be lost in the joint of its damper: all of it, but for what the fit of it misses
_MOST_LOST = 1.2


def _missing(x: Array, half: float, centre: float) -> Array:
    """Return the stroke that the spring does not see, without its value at rest."""
    return np.asarray(np.clip(x - centre, -half, half) - np.clip(-centre, -half, half))


@final
class Backlash(Cause):
    """A clearance in which the mount carries no force, or that its damper has to cross after every reversal."""

    ID = "backlash"
    QUESTION = "Is there a clearance in which a mount, or its damper, carries no force?"
    NEEDS = "deflections that cross the clearance"
    RIVALS = ("stiffness_nonlinearity", "coulomb_friction", "one_soft_mount")
    WOULD_REFUTE = "a stiffness that does not fall at small strokes"
    MEASURE_NEXT = "move the mount by hand or with a pry bar through its rest position with a dial gauge"

    LAW = Law.ELASTIC

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return two hypotheses per group: play of the mount and play in the joint of its damper."""
        out: list[Hypothesis] = []
        for group in port_groups(view):

            def columns(view: RunView, shape: Shapes, s: PortGroup = group) -> list[Column]:
                def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
                    half, centre = float(shape["half"]) * x_rms, float(shape["centre"]) * x_rms
                    return [_missing(x, half, centre), np.where(np.abs(x - centre) < half, v, 0.0)]

                return force_columns(view, s, law)

            grid = tuple({"half": h, "centre": c} for h in (0.15, 0.5) for c in (0.0, -0.7, 0.7))
            bounds = (Shape("half", 0.3, 0.02, 1.5), Shape("centre", 0.0, -1.5, 1.5, 0.12))
            signs = (Sign.NEGATIVE, Sign.NEGATIVE)
            out.append(Hypothesis(self.ID, group.location, group.axis, columns, grid, bounds, signs, 1.0, group.ports))
            out += _in_the_damper(view, group)
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the total clearance [m] and where its middle lies [m]; of a damper, the share of the damping it takes away."""
        group = group_of(view, fitted)
        out: list[Reported] = []
        if fitted.hypothesis.variant == _DAMPER:
            for i, p in enumerate(group.ports):
                label = group.label(view, p)
                clearance, damping = 2.0 * fitted.shape["half"] * view.scales[p][0], float(view.state.damping[p])
                lost, std = -float(fitted.coefficients[i]) / damping, fitted.std(i) / damping
                spread = 2.0 * view.scales[p][0] * fitted.spread("half", 0.2 * fitted.shape["half"])
                out.append(Reported(f"clearance of the damper{label}", float(clearance), spread, "m"))
                out.append(Reported(f"share of the damping behind it{label}", lost, std, "-"))
            return tuple(out)
        for i, p in enumerate(group.ports):
            x_rms = view.scales[p][0]
            share = min(1.0, -float(fitted.coefficients[2 * i]) / max(float(view.state.stiffness[p]), 1e-9))
            clearance = 2.0 * fitted.shape["half"] * x_rms * share
            spread = 2.0 * x_rms * share * fitted.spread("half", 0.2 * fitted.shape["half"])
            label, middle = group.label(view, p), float(fitted.shape["centre"] * x_rms)
            out.append(Reported(f"clearance{label}", float(clearance), spread, "m"))
            out.append(Reported(f"middle of the clearance{label}", middle, x_rms * fitted.spread("centre", 0.3), "m"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put the missing force as a curve parallel to every mount of the group."""
        group = group_of(view, fitted)
        if fitted.hypothesis.variant == _DAMPER:
            return vehicle, (f"clearance in the damper of {group.location} {group.axis}: a vehicle file cannot describe that",)
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            x = view.strokes[0][:, p]
            x_rms = view.scales[p][0]
            reach = 1.5 * float(np.max(np.abs(x)))
            grid = np.linspace(-reach, reach, 241)
            half, centre = fitted.shape["half"] * x_rms, fitted.shape["centre"] * x_rms
            force = float(fitted.coefficients[2 * i]) * _missing(grid, half, centre)
            vehicle = add_force_table(vehicle, port.mount, port.axis, grid, force)
        return vehicle, ("damping inside the clearance is left as it was",)


def _in_the_damper(view: RunView, group: PortGroup) -> list[Hypothesis]:
    """Return the play in the joints of the dampers of a group, none where a mount has no damping to lose."""
    ports = [view.plant.ports[p] for p in group.ports]
    damping = view.state.damping[list(group.ports)]
    if np.any(damping <= 0.0):
        return []
    # a linear model takes what the play hides for a weaker damper: what there is to lose is that of the file
    there = np.maximum(damping, [p.damping * np.exp(2.0 * p.damping_log_std) for p in ports])

    def columns(view: RunView, shape: Shapes) -> list[Column]:
        def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
            return [v * loose_share(x, float(shape["half"]) * x_rms)]

        return force_columns(view, group, law)

    def plausible(coefficients: Array, shape: Shapes) -> bool:
        return bool(np.all(np.abs(coefficients) <= _MOST_LOST * there))

    grid = tuple({"half": h} for h in (0.03, 0.1, 0.3))
    bounds = (Shape("half", 0.1, 0.005, 1.0),)
    return [Hypothesis(
        Backlash.ID, group.location, group.axis, columns, grid, bounds, (Sign.NEGATIVE,), ports=group.ports, variant=_DAMPER,
        plausible=plausible,
    )]
