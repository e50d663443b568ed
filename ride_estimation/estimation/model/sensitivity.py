# Copyright 2026 ride_estimation contributors
"""Derivatives of the model with the slow states, by differences; an error of a sensor changes its own readings only."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.model.readings import combination, constant
from ride_estimation.estimation.model.segments import Model, Projected, Segment
from ride_estimation.estimation.model.states import reading_width, slices_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: step of differences in slow states, in their own unit
_STEP = 1e-5


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """Derivatives with slow states, P of them, of which B describe body, mounts and base and are the first.

    Attributes
    ----------
    model
        Where they are taken.
    places
        Which of the slow states, ascending, shape (P,).
    accel
        Of the accelerations of body and carried bodies, shape (B, 6 + Q, V).
    rows, constants
        Of rows and constant part of the readings, shape (B, C, V) and (P, C).
    own
        Per sensor its readings, which of the P are its errors, E of them, and the derivative of those rows, (E, own C, V).
    force, still
        Of the rows of the forces and of the forces that do not move, shape (B, 3 M, V) and (B, 3 M).
    laws
        Which of the P are a ln k or ln c, and which of those 6 M they are.
    """

    model: Model
    places: NDArray[np.int64]
    accel: Array
    rows: Array
    constants: Array
    own: tuple[tuple[slice, slice, Array], ...]
    force: Array
    still: Array
    laws: tuple[NDArray[np.int64], NDArray[np.int64]]

    @classmethod
    def of(cls, model: Model, places: NDArray[np.int64] | None = None) -> Sensitivity:
        """Return the derivatives at a model, with all free slow states unless places are given."""
        plant, theta = model.plant, model.theta
        slow, rate = plant.slow, plant.states.accelerated
        free = slow.free if places is None else places
        errors = np.searchsorted(free, slow.mean_accel.stop)
        constants, others = np.zeros((len(free), len(model.constant))), []
        for n, i in enumerate(free[:errors].tolist()):
            moved = Model.of(plant, _stepped(theta, i), None if slow.cg.start <= i < slow.cg.stop else model.combinations)
            constants[n] = (moved.constant - model.constant) / _STEP
            others.append(moved)

        def slope(name: Callable[[Model], Array]) -> Array:
            start = name(model)
            return np.asarray((np.array([name(m) for m in others]).reshape(errors, *start.shape) - start) / _STEP)

        own, parts = [], model.dynamics.parts
        for sensor, at in zip(plant.sensors, slices_of([reading_width(s) for s in plant.sensors])):
            found = list(slow.sensors[sensor.name].values())
            begin, end = np.searchsorted(free, [found[0].start, found[-1].stop]).tolist()
            rows = np.zeros((end - begin, at.stop - at.start, plant.states.size))
            for n in range(begin, end):
                stepped = _stepped(theta, int(free[n]))
                change = combination(plant, sensor, stepped, model.constants.cg) - model.combinations[at]
                rows[n - begin] = change @ parts / _STEP
                constants[n, at] = (constant(plant, model.constants, sensor, stepped) - model.constant[at]) / _STEP
            own.append((at, slice(begin, end), rows))
        laws = np.flatnonzero(free < slow.log_damping.stop)
        return cls(
            model, free, slope(lambda m: m.dynamics.A[rate]), slope(lambda m: m.rows), constants, tuple(own),
            slope(lambda m: m.dynamics.force), slope(lambda m: m.still), (laws, free[laws] - slow.log_stiffness.start),
        )  # fmt: skip

    def pushes(self, segment: Segment, v: Complex, at: slice) -> Complex:
        """Return the derivative of the accelerations at given states and inputs v (F, V), lines ``at``: (L, 6 + Q, B).

        With stiffness and damping that of the second order too.
        """
        found = self._shared(_applied(self.accel, v[at]), segment, at)
        found[:, :, self.laws[0]] += segment.second_slopes[at][:, :, self.laws[1]]
        return found

    def readings(self, segment: Segment, p: Projected, v: Complex, at: slice) -> Complex:
        """Return the derivative of the readings at given inputs, lines ``at``, shape (L, C, P)."""
        plant, x = self.model.plant, v[at]
        found = np.zeros((len(x), len(plant.delay_of), len(self.places)), dtype=np.complex128)
        effect = np.matmul(self.model.rows[:, plant.states.motion], p.response.accel[at])
        body = self._shared(_applied(self.rows, x), segment, at) + np.matmul(effect, self.pushes(segment, v, at))
        body[:, :, self.laws[0]] += np.matmul(self.model.direct, segment.second_slopes[at][:, :, self.laws[1]])
        found[:, :, : body.shape[2]] = body
        for channels, errors, rows in self.own:
            found[:, channels, errors] = _applied(rows, x)
        moving = x @ self.model.rows.T
        for channel, place in enumerate(plant.delay_of):
            if place in self.places:
                found[:, channel, np.searchsorted(self.places, place)] = -segment.lines.laplace[at] * moving[:, channel]
        found *= p.late[at][:, :, None]
        return found

    def forces(self, v: Complex) -> Complex:
        """Return the derivative of the moving forces at given states and inputs v (F, V), shape (F, 3 M, B)."""
        return _applied(self.force, v)

    def _shared(self, found: Complex, segment: Segment, at: slice) -> Complex:
        """Take of the effect of bracket tilt the share of the deformations that is twist of the base."""
        tilt, places = self.model.plant.slow.tilt_shares, self.places[: found.shape[2]]
        found[:, :, (places >= tilt.start) & (places < tilt.stop)] *= segment.twisting[at, None, None]
        return found


def _stepped(theta: Array, place: int) -> Array:
    found = theta.copy()
    found[place] += _STEP
    return found


def _applied(derivative: Array, x: Complex) -> Complex:
    """Return what derivatives of rows (K, C, V) make of states and inputs x (L, V), shape (L, C, K)."""
    flat = derivative.transpose(2, 1, 0).reshape(derivative.shape[2], -1)
    return times_real(x, flat).reshape(len(x), derivative.shape[1], len(derivative))


def times_real(values: Complex, matrix: Array) -> Complex:
    """Return the product of complex values (..., I) and a real matrix (I, K), which numpy would make complex first."""
    found = np.empty((*values.shape[:-1], matrix.shape[1]), dtype=np.complex128)
    found.real, found.imag = values.real @ matrix, values.imag @ matrix
    return found
