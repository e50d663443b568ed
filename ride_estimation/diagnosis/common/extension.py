# Copyright 2026 ride_estimation contributors
"""Builds found causes into a vehicle: elements in parallel, curves, calibrated linear parameters."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.curve import CurveDamper, CurveSpring
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.data_range import seen_in
from ride_estimation.vehicles.identified import with_parameter, with_seen
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


def parts_of(element: ForceElement) -> tuple[ForceElement, ...]:
    """Return the elements in parallel that an element is made of."""
    return element.elements if isinstance(element, SumOfElements) else (element,)


def _joined(parts: Sequence[ForceElement]) -> ForceElement:
    return parts[0] if len(parts) == 1 else SumOfElements(elements=tuple(parts))


def linear_part(element: ForceElement) -> tuple[float, float]:
    """Return spring rate [N/m] and damping [N s/m] of the plain spring and dashpot of an element.

    Elements without a plain spring and dashpot state their dynamic stiffness at 2 Hz and 5 mm.
    """
    plain = [p for p in parts_of(element) if isinstance(p, KelvinVoigt)]
    if plain:
        return sum(p.stiffness for p in plain), sum(p.damping for p in plain)
    omega = 4.0 * np.pi
    modulus = element.dynamic_stiffness(omega, 0.005)
    if modulus is None:
        x = 0.005 * np.sin(omega * np.linspace(0.0, 1.0, 401))
        v = 0.005 * omega * np.cos(omega * np.linspace(0.0, 1.0, 401))
        force = element.response(np.linspace(0.0, 1.0, 401), x)
        k, c = np.linalg.lstsq(np.stack([x, v], axis=1), force, rcond=None)[0]
        return float(max(k, 0.0)), float(max(c, 0.0))
    return float(modulus.real), float(modulus.imag / omega)


def with_linear_part(element: ForceElement, stiffness: float, damping: float) -> ForceElement:
    """Return the element with the spring rate and damping of its plain part replaced."""
    parts = list(parts_of(element))
    for i, part in enumerate(parts):
        if isinstance(part, KelvinVoigt):
            parts[i] = KelvinVoigt(stiffness=stiffness, damping=damping)
            rest = [p for j, p in enumerate(parts) if j == i or not isinstance(p, KelvinVoigt)]
            return _joined(rest)
    return element


def set_linear(vehicle: Vehicle, ports: Sequence[tuple[str, str]], stiffness: Array, damping: Array) -> Vehicle:
    """Return the vehicle with calibrated spring rates and dampings."""
    changes = {
        (mount, axis): with_linear_part(vehicle.mounts[mount].elements[axis], float(k), float(c))
        for (mount, axis), k, c in zip(ports, stiffness, damping)
    }
    return vehicle.replace_elements(changes)


def with_knowledge(
    vehicle: Vehicle, ports: Sequence[tuple[str, str]], log_std: tuple[Array, Array], deflection: Array, rate_hz: float
) -> Vehicle:
    """Return the vehicle with what a run told of its elements: standard deviations, the motion and the preload in the data.

    Parameters
    ----------
    vehicle
        With the calibrated values in it.
    ports
        Mount and axis of every port.
    log_std
        Standard deviations of ln k and ln c of the plain spring and dashpot of every port, infinite where unknown, (P,) each.
    deflection
        Of the ports [m], shape (N, P).
    rate_hz
        Samples per second.
    """
    mounts = dict(vehicle.mounts)
    assembly = assemble(vehicle)
    preload = dict(zip(assembly.components, assembly.static_tension, strict=True))
    for p, (name, axis) in enumerate(ports):
        mount = mounts[name]
        plain = [i for i, part in enumerate(parts_of(mount.elements[axis])) if isinstance(part, KelvinVoigt)]
        for role, std in zip(("stiffness", "damping"), log_std, strict=True):
            address = f"elements[{plain[0]}].{role}" if plain and len(parts_of(mount.elements[axis])) > 1 else role
            value = mount.elements[axis].addressed()[address][1] if len(plain) == 1 else 0.0
            if value > 0.0 and np.isfinite(std[p]):
                mount = with_parameter(mount, axis, address, value, float(value * std[p]), "calibrated by diagnose")
        mounts[name] = mount
    seen = {port: seen_in(deflection[:, p], 1.0 / rate_hz, float(preload[port])) for p, port in enumerate(ports)}
    return with_seen(dataclasses.replace(vehicle, mounts=mounts), seen)


def add_parallel(vehicle: Vehicle, mount: str, axis: str, kind: str, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with one element more in parallel at a mount axis."""
    element = element_from_mapping({"kind": kind, **values})
    parts = (*parts_of(vehicle.mounts[mount].elements[axis]), element)
    return vehicle.replace_elements({(mount, axis): _joined(parts)})


def add_force_table(vehicle: Vehicle, mount: str, axis: str, deflection: Array, force: Array) -> Vehicle:
    """Return the vehicle with a force-deflection curve in parallel; the force at rest is removed.

    Parameters
    ----------
    deflection, force
        Points, increasing deflection, shape (n,).
    """
    at_rest = float(np.interp(0.0, deflection, force))
    curve = CurveSpring(
        deflections=tuple(float(x) for x in deflection), forces=tuple(float(f) - at_rest for f in force)
    )
    parts = (*parts_of(vehicle.mounts[mount].elements[axis]), curve)
    return vehicle.replace_elements({(mount, axis): _joined(parts)})


def add_damper_curve(
    vehicle: Vehicle, mount: str, axis: str, rate: Array, extra: Callable[[Array], Array], damping: float
) -> tuple[Vehicle, list[str]]:
    """Return the vehicle with the dashpot replaced by a force-rate curve, and a remark where it had to be clipped.

    Parameters
    ----------
    rate
        Rates that occurred [m/s], for the range of the curve.
    extra
        Force beyond ``damping * rate`` [N].
    """
    reach = float(np.max(np.abs(rate)))
    half = reach * np.array([0.01, 0.03, 0.06, 0.1, 0.16, 0.25, 0.4, 0.6, 0.8, 1.0])
    points = np.concatenate([-half[::-1], [0.0], half])
    total = damping * points + extra(points) - extra(np.zeros(1))[0]
    dissipative = np.where(points * total < 0.0, 0.0, total)
    notes = []
    if np.any(dissipative != total):
        notes.append(f"{mount}.{axis}: the fitted damper curve was cut where it would have fed energy")
    element = vehicle.mounts[mount].elements[axis]
    stiffness, _ = linear_part(element)
    curve = CurveDamper(rates=tuple(points.tolist()), forces=tuple(dissipative.tolist()))
    parts = (*parts_of(with_linear_part(element, stiffness, 0.0)), curve)
    return vehicle.replace_elements({(mount, axis): _joined(parts)}), notes


def move_cg(vehicle: Vehicle, body: str, shift: Array) -> Vehicle:
    """Return the vehicle with the CG of a body moved."""
    bodies = dict(vehicle.bodies)
    bodies[body] = dataclasses.replace(bodies[body], cg=np.asarray(bodies[body].cg) + shift)
    return dataclasses.replace(vehicle, bodies=bodies)
