# Copyright 2026 ride_estimation contributors
"""Where a force law can sit: every moving port, the pairs of an axle or a side, and all mounts of an axis together."""

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
#: distance from the middle of all mounts from which one belongs to an axle or a side [m]
_APART = 0.1


@dataclasses.dataclass(frozen=True)
class Site:
    """Ports that share one hypothesis.

    Attributes
    ----------
    location
        Mount name, ``front``, ``rear``, ``left``, ``right`` or ``all``.
    ports
        Rows of the plant's ports.
    """

    location: str
    axis: str
    ports: tuple[int, ...]


def sites(scene: Scene) -> list[Site]:
    """Return every port that moves, the pairs of an axle or a side, and all mounts of an axis where there are several."""
    noise = 1e-9
    moving = [p for p in range(len(scene.plant.ports)) if np.std(scene.deflection[:, p]) > noise]
    out = [Site(scene.plant.ports[p].mount, scene.plant.ports[p].axis, (p,)) for p in moving]
    for axis in dict.fromkeys(scene.plant.ports[p].axis for p in moving):
        group = tuple(p for p in moving if scene.plant.ports[p].axis == axis)
        if len(group) > 1:
            out += _pairs(scene, axis, group)
            out.append(Site(ALL, axis, group))
    return out


def _pairs(scene: Scene, axis: str, group: tuple[int, ...]) -> list[Site]:
    """Return the mounts of one axis in front of and behind, left and right of their middle, where each are several."""
    vehicle = scene.plant.vehicle
    place = np.array([vehicle.mounts[scene.plant.ports[p].mount].position for p in group])
    out = []
    for direction, names in ((0, ("front", "rear")), (1, ("left", "right"))):
        off = place[:, direction] - place[:, direction].mean()
        for sign, name in zip((1.0, -1.0), names):
            ports = tuple(p for p, d in zip(group, off) if sign * d > _APART)
            if 1 < len(ports) < len(group) and name not in vehicle.mounts:
                out.append(Site(name, axis, ports))
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
    if h.ports:
        return Site(h.location, h.axis, h.ports)
    for site in sites(scene):
        if (site.location, site.axis) == (h.location, h.axis):
            return site
    ports = tuple(i for i, p in enumerate(scene.plant.ports) if p.axis == h.axis and h.location in (p.mount, ALL))
    return Site(h.location, h.axis, ports)
