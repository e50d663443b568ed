# Copyright 2026 ride_estimation contributors
"""A vehicle with identified values in place of its priors, to be written as a vehicle file that loads again."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from ride_estimation.vehicles.data_range import DataRange
from ride_estimation.vehicles.vehicle import Mount, Prior, Vehicle


def with_identified(vehicle: Vehicle, values: Mapping[str, tuple[float, float]], source: str) -> Vehicle:
    """Return a copy whose elements and masses have identified values, with their standard deviations as priors.

    Parameters
    ----------
    vehicle
        The vehicle file the values were identified with.
    values
        ``<mount>.<axis>.<parameter>`` or ``<body>.mass`` -> (value, standard deviation), SI. Other names are left out.
    source
        Where the values come from, written to the file.
    """
    bodies = dict(vehicle.bodies)
    mounts = dict(vehicle.mounts)
    for name, (value, std) in values.items():
        owner, _, last = name.rpartition(".")
        mount_name, _, axis = owner.rpartition(".")
        if last == "mass" and owner in bodies:
            mass = dataclasses.replace(bodies[owner].mass, value=value, std=std, source=source)
            bodies[owner] = dataclasses.replace(bodies[owner], mass=mass)
        elif mount_name in mounts and axis in mounts[mount_name].elements:
            mounts[mount_name] = with_parameter(mounts[mount_name], axis, last, value, std, source)
    return dataclasses.replace(vehicle, bodies=bodies, mounts=mounts, checksum="")


def with_parameter(mount: Mount, axis: str, name: str, value: float, std: float, source: str) -> Mount:
    """Return the mount with one identified parameter of an element; the mount itself where the element has no such parameter.

    Parameters
    ----------
    mount, axis
        Where the element is.
    name
        Address of the number in the element, such as ``stiffness`` or ``elements[0].stiffness``.
    value, std
        Value and standard deviation, SI; the value is brought within the bounds of the parameter.
    source
        Where the value comes from.
    """
    element = mount.elements[axis]
    addressed = element.addressed()
    if name not in addressed:
        return mount
    declared = addressed[name][0]
    kept = min(max(value, declared.lower), declared.upper)
    old = mount.priors.get((axis, name), Prior(kept))
    prior = dataclasses.replace(
        old, value=kept, std=std, lower=min(old.lower, kept), upper=max(old.upper, kept), source=source
    )
    return dataclasses.replace(
        mount,
        elements={**mount.elements, axis: element.with_values({name: kept})},
        priors={**mount.priors, (axis, name): prior},
    )


def with_seen(vehicle: Vehicle, seen: Mapping[tuple[str, str], DataRange | None]) -> Vehicle:
    """Return a copy whose elements say what the data showed of them.

    Parameters
    ----------
    vehicle
        With the identified values in it.
    seen
        (mount, axis) -> motion and preload in the data; None leaves what the vehicle says.
    """
    mounts = dict(vehicle.mounts)
    for (name, axis), shown in seen.items():
        if shown is not None:
            mounts[name] = dataclasses.replace(mounts[name], seen={**mounts[name].seen, axis: shown})
    return dataclasses.replace(vehicle, mounts=mounts)
