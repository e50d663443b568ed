# Copyright 2026 ride_estimation contributors
"""Dry friction in a mount."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.bent import BENT_ABOVE
from ride_estimation.diagnosis.effect import Column, Shape
from ride_estimation.diagnosis.extension import add_parallel
from ride_estimation.diagnosis.hypothesis import FORM, Cause, Fitted, Hypothesis, Reported, Shapes, Sign
from ride_estimation.diagnosis.operators import friction_level
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.sites import Site, force_columns, site_of, sites
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


_COLUMNS = 3


def _law(reach: float, rounding: float) -> Callable[[Array, Array, float, float], list[Array]]:
    """Two presliding distances, as a chain of sliding elements has, and a part rounded over the rate, as noise makes it."""

    def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
        return [
            friction_level(x, reach * x_rms), friction_level(x, 4.0 * reach * x_rms), np.tanh(v / (rounding * v_rms)),
        ]

    return law


@final
class CoulombFriction(Cause):
    """A force that opposes sliding and hardly grows with speed or stroke."""

    ID = "coulomb_friction"
    QUESTION = "Does a mount resist sliding with a force that does not grow with speed?"
    NEEDS = "mount deflection from base and body accelerations; strokes beyond the presliding distance"
    RIVALS = ("damping_nonlinearity", "viscoelasticity", "stiffness_nonlinearity")
    WOULD_REFUTE = "a friction level that grows with stroke or speed: repeat the run on a rougher and on a smoother road"
    MEASURE_NEXT = "slow stroke of the mount on a bench at two speeds: the loop height of friction does not change with speed"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per site."""
        grid = tuple({"reach": r, "rounding": w} for r, w in ((0.01, 0.06), (0.03, 0.15), (0.1, 0.06)))
        bounds = (Shape("reach", 0.03, 0.004, 0.5), Shape("rounding", 0.1, 0.02, BENT_ABOVE))

        def build(site: Site) -> Hypothesis:
            def columns(scene: Scene, shape: Shapes) -> list[Column]:
                return force_columns(scene, site, _law(float(shape["reach"]), float(shape["rounding"])))

            return Hypothesis(self.ID, site.location, site.axis, columns, grid, bounds, (Sign.POSITIVE,), ports=site.ports)

        return [build(site) for site in sites(scene)]

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the friction level [N] and, where the run shows one, the sliding distance to 63 % of it [m].

        The standard deviation of the level is that of its fit and, because no law of a library is the real one, 7 % of it.
        """
        site = site_of(scene, fitted)
        out: list[Reported] = []
        for i, p in enumerate(site.ports):
            part = slice(_COLUMNS * i, _COLUMNS * (i + 1))
            share = fitted.coefficients[part]
            level = float(share.sum())
            std = float(np.sqrt(max(fitted.covariance[part, part].sum(), 0.0) + FORM * level**2))
            label = "" if len(site.ports) == 1 else f" {scene.plant.ports[p].mount}"
            out.append(Reported(f"friction level{label}", level, std, "N"))
            reach = fitted.shape["reach"] * scene.scales[p][0]
            mean = float(reach * (share[0] + 4.0 * share[1]) / max(level, 1e-12))
            if mean > 0.0:
                out.append(Reported(f"sliding distance{label}", mean, 0.5 * mean, "m"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put a friction element parallel to every mount of the site."""
        site = site_of(scene, fitted)
        for i, p in enumerate(site.ports):
            port = scene.plant.ports[p]
            x_rms = scene.scales[p][0]
            v_rms = scene.scales[p][1]
            short, long, rounded = (float(c) for c in fitted.coefficients[_COLUMNS * i : _COLUMNS * (i + 1)])
            for level, factor in ((short, 1.0), (long, 4.0)):
                if level > 0.0:
                    # Dahl: initial slope sigma = level / reach
                    slope = level / (factor * fitted.shape["reach"] * x_rms)
                    values = {"friction_n": level, "slope_n_per_m": slope}
                    vehicle = add_parallel(vehicle, port.mount, port.axis, "dahl", values)
            if rounded > 0.0:
                values = {
                    "friction_n": rounded, "breakaway_n": rounded, "stribeck_speed_m_per_s": v_rms,
                    "rounding_m_per_s": fitted.shape["rounding"] * v_rms,
                }
                vehicle = add_parallel(vehicle, port.mount, port.axis, "stribeck_friction", values)
        return vehicle, ()
