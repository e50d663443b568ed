# Copyright 2026 ride_estimation contributors
"""A damper whose force is not proportional to speed, or differs between extension and compression."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.effect import Column
from ride_estimation.diagnosis.extension import add_damper_curve
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.sites import Site, force_columns, site_of, sites
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: odd forms: saturating with scale s in units of the rms rate (0 < s < 9), progressive v|v| (0), low-speed bulge (s < 0),
#: power law with exponent s - 9 (s > 9)
_FORMS = (0.0, 0.35, 0.8, 2.0, -0.5, -1.0, 9.45, 9.7)


def _odd(u: Array, form: float) -> Array:
    if form > 9.0:
        return np.asarray(np.sign(u) * np.abs(u) ** (form - 9.0))
    if form > 0.0:
        return np.asarray(form * np.tanh(u / form))
    if form < 0.0:
        return np.asarray(u * np.exp(-((u / form) ** 2)))
    return u * np.abs(u)


def _law(form: float) -> Callable[[Array, Array, float, float], list[Array]]:
    def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
        u = v / v_rms
        return [_odd(u, form), np.abs(u) - np.mean(np.abs(u))]

    return law


@final
class DampingNonlinearity(Cause):
    """Degressive, progressive or lopsided damper."""

    ID = "damping_nonlinearity"
    QUESTION = "Is the damping force of a mount bent over speed, or different in extension and compression?"
    NEEDS = "rates beyond the knee of the damper"
    RIVALS = ("coulomb_friction", "viscoelasticity", "bump_stop")
    WOULD_REFUTE = "the same damping ratio at small and at large speed"
    MEASURE_NEXT = "force-speed curve of the damper at several constant speeds, both directions"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per site."""
        grid = tuple({"form": f} for f in _FORMS)

        def build(site: Site) -> Hypothesis:
            def columns(scene: Scene, shape: Shapes) -> list[Column]:
                return force_columns(scene, site, _law(float(shape["form"])))

            return Hypothesis(self.ID, site.location, site.axis, columns, grid, complexity=1.0, ports=site.ports)

        return [build(site) for site in sites(scene)]

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the damping force at one rms rate in both directions over the one of the plain damper."""
        site = site_of(scene, fitted)
        out: list[Reported] = []
        for i, p in enumerate(site.ports):
            v_rms = scene.scales[p][1]
            label = "" if len(site.ports) == 1 else f" {scene.plant.ports[p].mount}"
            pair = fitted.coefficients[2 * i : 2 * i + 2]
            cov = fitted.covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
            for name, u in (("extension 0.5 rms", 0.5), ("extension 2 rms", 2.0), ("compression 2 rms", -2.0)):
                weights = np.array([float(_odd(np.array([u]), fitted.shape["form"])[0]), abs(u)])
                force = float(scene.state.damping[p] * u * v_rms + weights @ pair)
                std = float(np.sqrt(max(weights @ cov @ weights, 0.0)))
                out.append(Reported(f"damping force at {name} rate{label}", force, std, "N"))
            out.append(Reported(f"rms rate{label}", v_rms, 0.0, "m/s"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Replace the dashpot of every mount of the site by the nearest two-sided power-law damper."""
        site = site_of(scene, fitted)
        notes: list[str] = []
        for i, p in enumerate(site.ports):
            port = scene.plant.ports[p]
            v = scene.deflection_rate[:, p]
            v_rms = scene.scales[p][1]
            pair = fitted.coefficients[2 * i : 2 * i + 2]
            form = float(fitted.shape["form"])

            def curve(rate: Array, pair: Array = pair, form: float = form, scale: float = v_rms) -> Array:
                return np.asarray(pair[0] * _odd(rate / scale, form) + pair[1] * np.abs(rate / scale))

            vehicle, note = add_damper_curve(vehicle, port.mount, port.axis, v, curve, float(scene.state.damping[p]))
            notes += note
        return vehicle, tuple(notes)
