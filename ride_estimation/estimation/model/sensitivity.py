# Copyright 2026 ride_estimation contributors
"""Derivatives of the model with the slow states, by differences; an error of a sensor changes its own readings only."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.model.readings import reading
from ride_estimation.estimation.model.segments import Model, Projected, Segment
from ride_estimation.estimation.model.states import reading_width

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: step of differences in slow states, in their own unit
_STEP = 1e-5


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """Derivatives with slow states, P of them, at a model.

    Attributes
    ----------
    model
        Where they are taken.
    places
        Which of the slow states, ascending, shape (P,).
    accel
        Of the accelerations of body and carried bodies, shape (P, 6 + Q, V).
    rows, constants
        Of rows and constant part of the readings, shape (P, C, V) and (P, C).
    force, still
        Of the rows of the forces and of the forces that do not move, shape (P, 3 M, V) and (P, 3 M).
    laws
        Which of the P are a ln k or ln c, and which of those 6 M they are.
    """

    model: Model
    places: NDArray[np.int64]
    accel: Array
    rows: Array
    constants: Array
    force: Array
    still: Array
    laws: tuple[NDArray[np.int64], NDArray[np.int64]]

    @classmethod
    def of(cls, model: Model, places: NDArray[np.int64] | None = None) -> Sensitivity:
        """Return the derivatives at a model, with all free slow states unless places are given."""
        plant = model.plant
        slow, rate = plant.slow, plant.states.accelerated
        free = slow.free if places is None else places
        accel = np.zeros((len(free), rate.stop - rate.start, plant.states.size))
        rows, constants = np.zeros((len(free), *model.rows.shape)), np.zeros((len(free), len(model.constant)))
        force, still = np.zeros((len(free), *model.dynamics.force.shape)), np.zeros((len(free), len(model.still)))
        owners = {
            place: sensor for sensor in plant.sensors for part in slow.sensors[sensor.name].values()
            for place in range(part.start, part.stop)
        }  # fmt: skip
        first = dict(zip((s.name for s in plant.sensors), np.cumsum([0, *(reading_width(s) for s in plant.sensors)]).tolist()))
        for n, i in enumerate(free.tolist()):
            theta = model.theta.copy()
            theta[i] += _STEP
            if i in owners:
                sensor = owners[i]
                at = slice(first[sensor.name], first[sensor.name] + reading_width(sensor))
                own, constant = reading(plant, model.dynamics, sensor, theta)
                rows[n, at], constants[n, at] = (own - model.rows[at]) / _STEP, (constant - model.constant[at]) / _STEP
            else:
                other = Model.of(plant, theta)
                accel[n] = (other.dynamics.A[rate] - model.dynamics.A[rate]) / _STEP
                rows[n], constants[n] = (other.rows - model.rows) / _STEP, (other.constant - model.constant) / _STEP
                force[n] = (other.dynamics.force - model.dynamics.force) / _STEP
                still[n] = (other.still - model.still) / _STEP
        laws = np.flatnonzero(free < slow.log_damping.stop)
        return cls(model, free, accel, rows, constants, force, still, (laws, free[laws] - slow.log_stiffness.start))

    def pushes(self, segment: Segment, v: Complex, at: slice) -> Complex:
        """Return the derivative of the accelerations at given states and inputs v (F, V), lines ``at``: (L, 6 + Q, P).

        With stiffness and damping that of the second order too.
        """
        found = self._shared(self._applied(self.accel, v[at]), segment, at)
        found[:, :, self.laws[0]] += segment.second_slopes[at][:, :, self.laws[1]]
        return found

    def readings(self, segment: Segment, p: Projected, v: Complex, at: slice) -> Complex:
        """Return the derivative of the readings at given inputs, lines ``at``, shape (L, C, P)."""
        plant, x = self.model.plant, v[at]
        effect = np.matmul(self.model.rows[:, plant.states.motion], p.response.accel[at])
        found = np.matmul(effect, self.pushes(segment, v, at)) + self._shared(self._applied(self.rows, x), segment, at)
        found[:, :, self.laws[0]] += np.matmul(self.model.direct, segment.second_slopes[at][:, :, self.laws[1]])
        moving = x @ self.model.rows.T
        for channel, place in enumerate(plant.delay_of):
            if place in self.places:
                found[:, channel, np.searchsorted(self.places, place)] = -segment.lines.laplace[at] * moving[:, channel]
        return np.asarray(p.late[at][:, :, None] * found)

    def forces(self, v: Complex) -> Complex:
        """Return the derivative of the moving forces at given states and inputs v (F, V), shape (F, 3 M, P)."""
        return self._applied(self.force, v)

    def _applied(self, derivative: Array, x: Complex) -> Complex:
        flat = derivative.transpose(2, 1, 0).reshape(derivative.shape[2], -1)
        return times_real(x, flat).reshape(len(x), derivative.shape[1], len(derivative))

    def _shared(self, found: Complex, segment: Segment, at: slice) -> Complex:
        """Take of the effect of bracket tilt the share of the deformations that is twist of the base."""
        tilt = self.model.plant.slow.tilt_shares
        found[:, :, (self.places >= tilt.start) & (self.places < tilt.stop)] *= segment.twisting[at, None, None]
        return found


def times_real(values: Complex, matrix: Array) -> Complex:
    """Return the product of complex values (..., I) and a real matrix (I, K), which numpy would make complex first."""
    found = np.empty((*values.shape[:-1], matrix.shape[1]), dtype=np.complex128)
    found.real, found.imag = values.real @ matrix, values.imag @ matrix
    return found
