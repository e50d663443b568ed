# Copyright 2026 ride_estimation contributors
"""Nonlinear time simulation of an assembled vehicle.

One run::

    assembly = assemble(vehicle)
    base = BaseMotion.from_displacement(displacement, rate_hz)      # (N, M, 3) [m], or .from_acceleration(...)
    response = simulate(assembly, base)                             # or full_rotation=True

Many runs with changed elements (identification, diagnosis)::

    model = CompiledModel(assembly, base)
    response = model.run()                                          # elements of the vehicle file
    response = model.run({("front_left", "z"): other_element})      # any element, also one with more terms
    outputs  = model.run_raw({...})                                 # arrays only, nothing derived: the cheapest

``Response`` has time_s (N), coordinates/rates/accelerations (N, Q), deflection/rate/tension (N, C) per mount component,
``mount_array("deflection" | "rate" | "tension")`` -> (N, M, 3), ``mount_force()`` -> (N, M, 3) force on the body with the
static share, ``specific_force(sensor_name)`` -> (N, channels) in sensor axes, ``body_motion(body)`` -> (N, 6) etc.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.terms import initial_states, pack_terms
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.kernel import Input, Output, Structure, integrate, make_output
from ride_estimation.simulation.response import Response
from ride_estimation.simulation.rotation import simulate_full_rotation
from ride_estimation.simulation.substeps import choose_substeps
from ride_estimation.vehicles.assembly import Assembly

Array = NDArray[np.float64]
Changes = Mapping[tuple[str, str], ForceElement]


def simulate(
    assembly: Assembly,
    base_motion: BaseMotion,
    *,
    load: Array | None = None,
    substeps: int | None = None,
    full_rotation: bool = False,
) -> Response:
    """Simulate one run from rest at static equilibrium.

    Parameters
    ----------
    assembly
        The vehicle.
    base_motion
        Motion of every mount base, M as in the vehicle.
    load
        Generalised external force per coordinate, shape (N, Q) or (1, Q) [N, N m].
    substeps
        Internal steps per sample; chosen from the fastest mode where None.
    full_rotation
        Use exact rigid-body kinematics (finite rotations, gyroscopic moment, forces that turn with the bracket) instead
        of small rotations; every body needs all six coordinates.

    Raises
    ------
    InputDataError
        Shapes that do not fit; a motion that leaves every bound (named with its time).
    """
    if full_rotation:
        return simulate_full_rotation(assembly, base_motion, load=load, substeps=substeps)
    return CompiledModel(assembly, base_motion, load=load, substeps=substeps).run()


class CompiledModel:
    """An assembled vehicle on one base motion, ready to be run many times with changed elements.

    Parameters
    ----------
    assembly, base_motion, load, substeps
        As :func:`simulate`. ``substeps`` is fixed at construction, so that runs are comparable.
    """

    def __init__(
        self,
        assembly: Assembly,
        base_motion: BaseMotion,
        *,
        load: Array | None = None,
        substeps: int | None = None,
    ) -> None:
        if base_motion.displacement.shape[1] != len(assembly.mount_names):
            raise InputDataError(
                f"base motion: {base_motion.displacement.shape[1]} mounts; the vehicle has {len(assembly.mount_names)}:"
                f" {', '.join(assembly.mount_names)}"
            )
        self.assembly = assembly
        self.base_motion = base_motion
        self.substeps = choose_substeps(assembly, base_motion.rate_hz) if substeps is None else int(substeps)
        if self.substeps < 1:
            raise ConfigurationError(f"substeps: {substeps}; allowed: 1 or more")
        self._matrices = (
            *_sparse(assembly.deflection_map),
            *_sparse(assembly.deflection_map.T),
            *_sparse(assembly.geometric_stiffness),
            *_sparse(np.linalg.inv(assembly.mass_matrix).astype(np.float64)),
        )
        self._input = self._make_input(load)
        self._elements = dict(zip(assembly.components, assembly.elements))
        self._packed: tuple[Structure, Array, Array] | None = None

    def _make_input(self, load: Array | None) -> Input:
        mount, axis = self.assembly.component_index()
        base = self.base_motion
        both = np.concatenate([base.displacement, base.angle], axis=2)
        both_rate = np.concatenate([base.velocity, base.angular_rate], axis=2)
        mask = self.assembly.prescribed
        size = len(self.assembly.coordinates)
        total = np.zeros((1, size))
        if np.any(base.angle) and np.any(self.assembly.tilt_map):
            total = np.einsum("qma,nma->nq", self.assembly.tilt_map, base.angle)
        if load is not None:
            load = np.atleast_2d(np.asarray(load, dtype=float))
            if load.shape not in ((base.samples, size), (1, size)):
                raise InputDataError(f"load: shape {load.shape}; allowed: ({base.samples}, {size}) or (1, {size})")
            total = total + load
        return Input(
            np.ascontiguousarray(both[:, mount, axis] * mask),
            np.ascontiguousarray(both_rate[:, mount, axis] * mask),
            np.ascontiguousarray(total),
        )

    def pack(self, changes: Changes | None = None) -> tuple[Structure, Array, Array]:
        """Return (structure, parameters, states at rest) of the elements with some replaced.

        Raises
        ------
        ConfigurationError
            A (mount, axis) the vehicle does not have.
        """
        if not changes and self._packed is not None:
            structure, parameters, states = self._packed
            return structure, parameters, states.copy()
        elements = dict(self._elements)
        for key, element in (changes or {}).items():
            if key not in elements:
                raise ConfigurationError(
                    f"{key[0]}.{key[1]}: no such mount component; allowed: "
                    + ", ".join(f"{m}.{a}" for m, a in elements)
                )
            elements[key] = element
        terms = [e.terms() for e in elements.values()]
        channel = np.repeat(np.arange(len(terms), dtype=np.int64), [len(t) for t in terms])
        codes, parameters = pack_terms(t for group in terms for t in group)
        structure = Structure(*self._matrices, codes, channel)
        states = initial_states(codes, parameters)
        if not changes:
            self._packed = (structure, parameters, states.copy())
        return structure, parameters, states

    def run_raw(self, changes: Changes | None = None) -> Output:
        """Run from rest and return the arrays at the samples.

        Raises
        ------
        InputDataError
            The motion left every bound; the message names the time.
        """
        structure, parameters, states = self.pack(changes)
        size, components = len(self.assembly.coordinates), len(self.assembly.components)
        samples = self.base_motion.samples
        out = make_output(samples, size, components)
        reached = integrate(
            structure, parameters, states, self._input, out, np.zeros(size), np.zeros(size),
            1.0 / self.base_motion.rate_hz, self.substeps,
        )
        if reached < samples:
            raise InputDataError(
                f"the simulated motion is not finite any more at t = {reached / self.base_motion.rate_hz:.3f} s; "
                f"take more substeps (now {self.substeps}) or check stiffness and damping of the elements"
            )
        return out

    def run(self, changes: Changes | None = None) -> Response:
        """Run from rest and return the response."""
        out = self.run_raw(changes)
        return Response(
            self.assembly, self.base_motion, out.q, out.qd, out.qdd, out.deflection, out.rate, out.tension
        )


def _sparse(matrix: Array) -> tuple[NDArray[np.uint32], Array]:
    """Return the columns and values of the nonzero entries, rows padded with zeros to equal length."""
    scale = np.abs(matrix).max(axis=1, keepdims=True) if matrix.size else matrix
    used = [np.flatnonzero(row) for row in np.abs(matrix) > 1e-14 * scale]
    width = max((len(u) for u in used), default=0)
    columns = np.zeros((len(matrix), width), dtype=np.uint32)
    values = np.zeros((len(matrix), width))
    for i, u in enumerate(used):
        columns[i, : len(u)] = u
        values[i, : len(u)] = matrix[i, u]
    return columns, values
