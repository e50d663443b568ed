# Copyright 2026 ride_estimation contributors
"""What is exported: force elements alone, or the equations of motion of a vehicle, with named variables and constants."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.terms import initial_states, needs_rate, pack_terms
from ride_estimation.export.elements import Constant, ExportedElement, identifier, of_assembly
from ride_estimation.frames import COORDINATES
from ride_estimation.simulation.substeps import choose_substeps
from ride_estimation.vehicles.assembly import Assembly

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: unit of the deflection of an axis, of its rate, of the acceleration and of the force: along x, y, z and about them
_UNITS = {False: ("m", "m/s", "m/s2", "N"), True: ("rad", "rad/s", "rad/s2", "N.m")}


@dataclasses.dataclass(frozen=True)
class Variable:
    """One variable of the interface.

    Attributes
    ----------
    name, unit, meaning
        As printed; the unit empty where the interface declares none.
    role
        ``input``, ``state`` (an output that can be given an initial value), ``output`` or ``constant``.
    value
        Start value.
    derivative_of
        Name of the state this is the time derivative of.
    constant
        The parameter this variable shows.
    """

    name: str
    unit: str
    meaning: str
    role: str
    value: float = 0.0
    derivative_of: str = ""
    constant: Constant | None = None


class PackedTerms(NamedTuple):
    """Terms of all elements (:mod:`ride_estimation.elements.terms`), the component each acts on, floats of memory per term."""

    codes: Index
    channel: Index
    parameters: Array
    memory_size: int


@dataclasses.dataclass(frozen=True)
class ExportModel:
    """A model for other programs. Q coordinates, C components, T terms, B bases.

    ``M qdd = -G^T t(x, v) - K_g q + T u + f``, ``x = G q - u``; with Q = 0 elements alone, ``x = u``.

    Attributes
    ----------
    name
        An identifier of C.
    description
        One sentence.
    terms
        Terms of all elements.
    base_of
        Base that moves each component, -1 where another body does, shape (C,).
    base_sign
        1.0 where an input is the deflection itself, -1.0 where it is the motion of a base.
    deflection_map, geometric_stiffness, inverse_mass, tilt_map
        G (C, Q), K_g (Q, Q), M^-1 (Q, Q), T (Q, B).
    static_force
        Force of each component at static equilibrium as the output counts it, shape (C,).
    internal_step_s
        Longest step of the integrator [s].
    variables
        In the order of the value references: time has 0, they follow from 1.
    constants
        Parameters of the laws.
    """

    name: str
    description: str
    terms: PackedTerms
    base_of: Index
    base_sign: float
    deflection_map: Array
    geometric_stiffness: Array
    inverse_mass: Array
    tilt_map: Array
    static_force: Array
    internal_step_s: float
    variables: tuple[Variable, ...]
    constants: tuple[Constant, ...]


def element_model(name: str, elements: Sequence[ExportedElement], description: str) -> ExportModel:
    """Return elements alone: deflection and rate of each axis in, tension out; the memory starts at rest at deflection zero.

    Parameters
    ----------
    name
        Any text; it becomes an identifier.
    elements
        One or more; where there are several, their prefixes tell the variables apart.
    description
        One sentence.
    """
    inputs: list[Variable] = []
    for e in elements:
        units = _UNITS[e.turned]
        used = "" if needs_rate(e.element.terms()) else "; does not change the force of this element"
        range_seen = "" if e.seen is None else f"; {e.seen.sentence(e.axis)}"
        inputs.append(Variable(f"{e.prefix}deflection", units[0], f"deflection, positive in extension{range_seen}", "input"))
        inputs.append(Variable(f"{e.prefix}rate", units[1], f"its time derivative{used}", "input"))
    passed_on = [
        Variable(f"{e.prefix}deflection_of_force", _unit(e.axis, 0), "deflection the force belongs to", "output")
        for e in elements
    ]
    forces = [Variable(f"{e.prefix}force", _unit(e.axis, 3), "tension, positive in extension", "output") for e in elements]
    constants = tuple(c for e in elements for c in e.constants)
    count = len(elements)
    return ExportModel(
        name=identifier(name),
        description=description,
        terms=_packed(tuple(e.element for e in elements)),
        base_of=np.arange(count, dtype=np.int64),
        base_sign=1.0,
        deflection_map=np.zeros((count, 0)),
        geometric_stiffness=np.zeros((0, 0)),
        inverse_mass=np.zeros((0, 0)),
        tilt_map=np.zeros((0, count)),
        static_force=np.zeros(count),
        internal_step_s=1.0,
        variables=(*inputs, *passed_on, *forces, *_as_variables(constants)),
        constants=constants,
    )


def vehicle_model(assembly: Assembly, rate_hz: float) -> ExportModel:
    """Return a vehicle about static equilibrium, small rotations: base motion and loads in, body motion and mount forces out.

    Parameters
    ----------
    assembly
        The vehicle.
    rate_hz
        Rate at which it will be stepped [Hz]; the integrator's own step follows from it and the fastest mode, as in
        :func:`ride_estimation.simulation.simulate.simulate`.
    """
    mount, axis = assembly.component_index()
    bases = [(m, a) for m in range(len(assembly.mount_names)) for a in range(6) if _is_input(assembly, m, a)]
    number = {base: i for i, base in enumerate(bases)}
    base_of = [number[m, a] if prescribed else -1 for m, a, prescribed in zip(mount, axis, assembly.prescribed, strict=True)]
    tilt = np.zeros((len(assembly.coordinates), len(bases)))
    for (m, a), column in number.items():
        if a >= 3:
            tilt[:, column] = assembly.tilt_map[:, m, a - 3]
    vehicle = assembly.vehicle
    constants = tuple(c for e in of_assembly(assembly) for c in e.constants)
    static = [
        assembly.static_force[m, a] if a < 3 else -tension
        for m, a, tension in zip(mount, axis, assembly.static_tension, strict=True)
    ]
    return ExportModel(
        name=identifier(vehicle.name),
        description=f"{vehicle.name}: rigid bodies on mounts about static equilibrium, small rotations",
        terms=_packed(assembly.elements),
        base_of=np.array(base_of, dtype=np.int64),
        base_sign=-1.0,
        deflection_map=assembly.deflection_map,
        geometric_stiffness=assembly.geometric_stiffness,
        inverse_mass=np.linalg.inv(assembly.mass_matrix).astype(np.float64),
        tilt_map=tilt,
        static_force=np.array(static),
        internal_step_s=1.0 / (rate_hz * choose_substeps(assembly, rate_hz)),
        variables=(*_vehicle_variables(assembly, bases), *_as_variables(constants)),
        constants=constants,
    )


def _is_input(assembly: Assembly, mount: int, axis: int) -> bool:
    """Return whether motion of the base of a mount along an axis is prescribed and does anything."""
    name, word = assembly.mount_names[mount], COORDINATES[axis]
    if (name, word) in assembly.components and assembly.prescribed[assembly.components.index((name, word))]:
        return True
    return axis >= 3 and bool(np.any(assembly.tilt_map[:, mount, axis - 3]))


def _vehicle_variables(assembly: Assembly, bases: list[tuple[int, int]]) -> tuple[Variable, ...]:
    """Return inputs, states, accelerations, deflections and forces in the order of the value references."""
    found: list[Variable] = []
    for m, a in bases:
        where, units = f"{assembly.mount_names[m]}.{COORDINATES[a]}", _UNITS[a >= 3]
        found.append(Variable(f"{where}.base_displacement", units[0], "motion of the base of the mount", "input"))
        found.append(Variable(f"{where}.base_velocity", units[1], "its time derivative", "input"))
    names = [(f"{body}.{c}", _UNITS[c in COORDINATES[3:]]) for body, c in assembly.coordinates]
    found += [Variable(f"{n}.load", u[3], "external force at the centre of gravity", "input") for n, u in names]
    found += [Variable(f"{n}.position", u[0], "motion of the centre of gravity from equilibrium", "state") for n, u in names]
    found += [Variable(f"{n}.velocity", u[1], "velocity", "state", derivative_of=f"{n}.position") for n, u in names]
    found += [
        Variable(f"{n}.acceleration", u[2], "acceleration", "output", derivative_of=f"{n}.velocity") for n, u in names
    ]
    mounts = [(f"{m}.{a}", a) for m, a in assembly.components]
    found += [Variable(f"{n}.deflection", _unit(a, 0), "from equilibrium, positive in extension", "output") for n, a in mounts]
    found += [Variable(f"{n}.force", _unit(a, 3), "force on the body, static share included", "output") for n, a in mounts]
    return tuple(found)


def _unit(axis: str, which: int) -> str:
    return _UNITS[axis in COORDINATES[3:]][which]


def _packed(elements: tuple[ForceElement, ...]) -> PackedTerms:
    terms = [e.terms() for e in elements]
    codes, parameters = pack_terms(t for group in terms for t in group)
    channel = np.repeat(np.arange(len(terms), dtype=np.int64), [len(t) for t in terms])
    return PackedTerms(codes, channel, parameters, initial_states(codes, parameters).shape[1])


def _as_variables(constants: tuple[Constant, ...]) -> tuple[Variable, ...]:
    return tuple(Variable(c.name, "", c.sentence(), "constant", c.value, constant=c) for c in constants)
