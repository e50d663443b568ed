# Copyright 2026 ride_estimation contributors
"""Relaxation of the mount material: stiffness and loss that depend on frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.common.effect import Column, Effect, Shape, Where
from ride_estimation.diagnosis.common.extension import add_parallel
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Law, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.operators import relaxed
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, group_of, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

_RATIO = 5.0  # corner of the second cell over the first


def _columns(view: RunView, group: PortGroup, corner_hz: float) -> list[Column]:
    out: list[Column] = []
    for p in group.ports:
        spectrum = view.deflection_spectrum[:, p]
        for corner in (corner_hz, _RATIO * corner_hz):
            out.append((Effect(Where.PORT, p, view.grid.signal(relaxed(view.grid.omega, spectrum, corner))),))
    return out


@final
class Viscoelasticity(Cause):
    """Stiffness that rises with frequency and a loss that does not follow a plain dashpot."""

    ID = "viscoelasticity"
    QUESTION = "Does the mount relax: do its stiffness and loss depend on frequency beyond a spring and a dashpot?"
    NEEDS = "excitation over at least a decade of frequency"
    RIVALS = ("sensor_delay", "coulomb_friction", "missing_degree_of_freedom")
    WOULD_REFUTE = "a relaxation strength that depends on amplitude: repeat the run at half and double roughness"
    MEASURE_NEXT = "dynamic stiffness of the mount on a bench at one amplitude from 0.5 to 30 Hz"
    LAW = Law.RELAXING

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per group."""
        grid = tuple({"corner": c} for c in (0.15, 0.4, 1.0, 2.5, 6.0))
        bounds = (Shape("corner", 1.0, 0.05, 12.0),)

        def build(group: PortGroup) -> Hypothesis:
            def columns(view: RunView, shape: Shapes) -> list[Column]:
                return _columns(view, group, float(shape["corner"]))

            return Hypothesis(self.ID, group.location, group.axis, columns, grid, bounds, (Sign.POSITIVE,), ports=group.ports)

        return [build(group) for group in port_groups(view)]

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the relaxing stiffness as a share of the static one and the corner frequencies [Hz]."""
        group = group_of(view, fitted)
        out: list[Reported] = []
        for i, p in enumerate(group.ports):
            part = slice(2 * i, 2 * i + 2)
            stiffness = float(view.state.stiffness[p])
            label = group.label(view, p)
            relaxing = float(fitted.coefficients[part].sum())
            std = float(np.sqrt(max(fitted.covariance[part, part].sum(), 0.0) + FORM * relaxing**2))
            out.append(Reported(f"relaxing stiffness over static stiffness{label}", relaxing / stiffness, std / stiffness, "-"))
        corner = float(fitted.shape["corner"])
        spread = fitted.spread("corner", 0.3 * corner)
        out.append(Reported("slow corner frequency", corner, spread, "Hz"))
        out.append(Reported("fast corner frequency", _RATIO * corner, _RATIO * spread, "Hz"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put Maxwell cells parallel to every mount of the group."""
        group = group_of(view, fitted)
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            for stiffness, factor in zip(fitted.coefficients[2 * i : 2 * i + 2], (1.0, _RATIO)):
                if stiffness > 0.0:
                    damping = float(stiffness) / (2.0 * np.pi * factor * fitted.shape["corner"])
                    values = {"stiffness_n_per_m": float(stiffness), "damping_n_s_per_m": damping}
                    vehicle = add_parallel(vehicle, port.mount, port.axis, "maxwell", values)
        return vehicle, ()
