# Copyright 2026 ride_estimation contributors
"""Where a force law can sit: every moving port, the pairs of an axle or a side, and all mounts of an axis together."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted
from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]

ALL = "all"
#: distance from the middle of all mounts from which one belongs to an axle or a side [m]
_APART = 0.1


@dataclasses.dataclass(frozen=True)
class PortGroup:
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

    def label(self, view: RunView, port: int) -> str:
        """Return what follows the name of a quantity of one of the ports: its mount, nothing where there is only one."""
        return "" if len(self.ports) == 1 else f" {view.plant.ports[port].mount}"


def port_groups(view: RunView) -> list[PortGroup]:
    """Return every port that moves, the pairs of an axle or a side, and all mounts of an axis where there are several."""
    noise = 1e-9
    moving = [p for p in range(len(view.plant.ports)) if np.std(view.deflection[:, p]) > noise]
    out = [PortGroup(view.plant.ports[p].mount, view.plant.ports[p].axis, (p,)) for p in moving]
    for axis in dict.fromkeys(view.plant.ports[p].axis for p in moving):
        group = tuple(p for p in moving if view.plant.ports[p].axis == axis)
        if len(group) > 1:
            out += _pairs(view, axis, group)
            out.append(PortGroup(ALL, axis, group))
    return out


def _pairs(view: RunView, axis: str, group: tuple[int, ...]) -> list[PortGroup]:
    """Return the mounts of one axis in front of and behind, left and right of their middle, where each are several."""
    vehicle = view.plant.vehicle
    place = np.array([vehicle.mounts[view.plant.ports[p].mount].position for p in group])
    out = []
    for direction, names in ((0, ("front", "rear")), (1, ("left", "right"))):
        off = place[:, direction] - place[:, direction].mean()
        for sign, name in zip((1.0, -1.0), names):
            ports = tuple(p for p, d in zip(group, off) if sign * d > _APART)
            if 1 < len(ports) < len(group) and name not in vehicle.mounts:
                out.append(PortGroup(name, axis, ports))
    return out


def force_columns(view: RunView, group: PortGroup, law: Callable[[Array, Array, float, float], list[Array]]) -> list[Column]:
    """Return the columns of a law at a group: one set per port.

    Parameters
    ----------
    law
        Takes deflection, rate and their rms and returns pseudo-forces [N] per unit coefficient. Evaluated as densely as
        :attr:`FrequencyGrid.refinement` asks for.
    """
    out: list[Column] = []
    grid, fine = view.grid, view.grid.refinement > 1
    for p in group.ports:
        x, v = view.refined_motion(p) if fine else (view.deflection[:, p], view.deflection_rate[:, p])
        forces = law(x, v, *view.scales[p])
        out += [(Effect(Where.PORT, p, grid.unrefined(force) if fine else force),) for force in forces]
    return out


def group_of(view: RunView, fitted: Fitted) -> PortGroup:
    """Return the group a fitted hypothesis sits at."""
    h = fitted.hypothesis
    if h.ports:
        return PortGroup(h.location, h.axis, h.ports)
    for group in port_groups(view):
        if (group.location, group.axis) == (h.location, h.axis):
            return group
    ports = tuple(i for i, p in enumerate(view.plant.ports) if p.axis == h.axis and h.location in (p.mount, ALL))
    return PortGroup(h.location, h.axis, ports)
