# Copyright 2026 ride_estimation contributors
"""Where a force law can sit: every moving port, and all mounts of an axis together."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypothesis import Fitted
from ride_estimation.diagnosis.scene import Scene

Array = NDArray[np.float64]

ALL = "all"


@dataclasses.dataclass(frozen=True)
class Site:
    """Ports that share one hypothesis.

    Attributes
    ----------
    location
        Mount name or ``all``.
    ports
        Rows of the plant's ports.
    """

    location: str
    axis: str
    ports: tuple[int, ...]


def sites(scene: Scene) -> list[Site]:
    """Return every port that moves, and all mounts of an axis where there are several."""
    noise = 1e-9
    moving = [p for p in range(len(scene.plant.ports)) if np.std(scene.deflection[:, p]) > noise]
    out = [Site(scene.plant.ports[p].mount, scene.plant.ports[p].axis, (p,)) for p in moving]
    for axis in dict.fromkeys(scene.plant.ports[p].axis for p in moving):
        group = tuple(p for p in moving if scene.plant.ports[p].axis == axis)
        if len(group) > 1:
            out.append(Site(ALL, axis, group))
    return out


def force_columns(scene: Scene, site: Site, law: Callable[[Array, Array, float, float], list[Array]]) -> list[Column]:
    """Return the columns of a law at a site: one set per port.

    Parameters
    ----------
    law
        Takes deflection, rate and their rms and returns pseudo-forces [N] per unit coefficient. Evaluated as densely as
        :attr:`FrequencyGrid.refinement` asks for.
    """
    out: list[Column] = []
    grid, fine = scene.grid, scene.grid.refinement > 1
    for p in site.ports:
        x, v = scene.deflection[:, p], scene.deflection_rate[:, p]
        if fine:
            spectrum = scene.deflection_spectrum[:, p]
            x, v = grid.refined(spectrum), grid.refined(1j * grid.omega * spectrum)
        forces = law(x, v, *scene.scales[p])
        out += [(Effect(Where.PORT, p, grid.unrefined(force) if fine else force),) for force in forces]
    return out


def site_of(scene: Scene, fitted: Fitted) -> Site:
    """Return the site a fitted hypothesis sits at."""
    h = fitted.hypothesis
    for site in sites(scene):
        if (site.location, site.axis) == (h.location, h.axis):
            return site
    ports = tuple(i for i, p in enumerate(scene.plant.ports) if p.axis == h.axis and h.location in (p.mount, ALL))
    return Site(h.location, h.axis, ports)

