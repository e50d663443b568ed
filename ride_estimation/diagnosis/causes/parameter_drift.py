# Copyright 2026 ride_estimation contributors
"""Stiffness or damping of a mount that changes during the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.extension import linear_part, with_linear_part
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.operators import legendre
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.sites import Site, site_of, sites
from ride_estimation.vehicles.vehicle import Vehicle


@final
class ParameterDrift(Cause):
    """A mount that warms up, loses air or wears while it is measured."""

    ID = "parameter_drift"
    QUESTION = "Do stiffness or damping of a mount change in the course of the run?"
    NEEDS = "excitation in every part of the run"
    RIVALS = ("mass_change", "stiffness_nonlinearity")
    WOULD_REFUTE = "equal parameters from the first and the last third of the run"
    MEASURE_NEXT = "repeat the run with the mounts warm; log the air-spring pressure"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per site; at ``all`` every mount changes by the same share."""
        out: list[Hypothesis] = []
        for site in sites(scene):

            def columns(scene: Scene, shape: Shapes, s: Site = site) -> list[Column]:
                first, second = legendre(scene.time_s, 1), legendre(scene.time_s, 2)
                result: list[Column] = []
                for profile, with_damping in ((first, False), (first, True), (second, False), (second, True)):
                    effects = []
                    for p in s.ports:
                        k, c = scene.state.stiffness[p], scene.state.damping[p]
                        force = c * scene.deflection_rate[:, p] if with_damping else k * scene.deflection[:, p]
                        effects.append(Effect(Where.PORT, p, profile * force))
                    result.append(tuple(effects))
                return result

            out.append(Hypothesis(self.ID, site.location, site.axis, columns, run_bound=True))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return stiffness and damping at the end over those at the start, minus one."""
        k1, c1, k2, c2 = fitted.coefficients
        out = []
        for name, first, second, i in (("stiffness", k1, k2, 0), ("damping", c1, c2, 1)):
            start = max(1.0 - first + second, 0.05)
            change = float((1.0 + first + second) / start - 1.0)
            out.append(Reported(f"{name} change over the run", change, 2.0 * fitted.std(i), "-"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the parameters of the end of the run."""
        k1, c1, k2, c2 = fitted.coefficients
        for p in site_of(scene, fitted).ports:
            port = scene.plant.ports[p]
            element = vehicle.mounts[port.mount].elements[port.axis]
            k, c = linear_part(element)
            changed = with_linear_part(element, k * max(1.0 + k1 + k2, 0.05), c * max(1.0 + c1 + c2, 0.0))
            vehicle = vehicle.replace_elements({(port.mount, port.axis): changed})
        return vehicle, ("stiffness and damping of the drifting mounts are those of the end of the run",)
