# Copyright 2026 ride_estimation contributors
"""What a state of the model does on a run: its linear response with accepted effects and second-order kinematics."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.model.body_trajectories import BodyMotion, Trajectories
from ride_estimation.diagnosis.model.kinematics import (
    Brackets,
    base_correction,
    output_correction,
    transducer_correction,
    wrench_correction,
)
from ride_estimation.diagnosis.model.response import LinearResponse, respond
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.frames import AXES

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
#: deflection and rate of the ports, shape (N, P) each
Travel = tuple[Array, Array]

#: largest number of passes over the terms of second order; a lightly damped mode that the vertical load modulates needs many
_KINEMATIC_PASSES = 8
_SETTLED = 0.25  # change of the outputs in one pass, as a share of the tolerated model error, at which the passes end


@dataclasses.dataclass(frozen=True)
class ModelState:
    """What the model currently is: port parameters and accepted effects with their coefficients applied.

    Attributes
    ----------
    stiffness, damping
        Of every port, shape (P,).
    effects
        Accepted effects, less what ``held`` holds of them.
    held
        Equivalent stiffness and damping of the law forces of every port, part of the linear response, shape (2, P). A law
        may carry more of a port than its spring and dashpot; its force along an estimated deflection, fed back through the
        spring and dashpot alone, would then run away.
    """

    stiffness: Array
    damping: Array
    effects: tuple[Effect, ...] = ()
    held: Array | None = None

    @property
    def linear(self) -> tuple[Array, Array]:
        """Return stiffness and damping of the linear response, shape (P,) each."""
        if self.held is None:
            return self.stiffness, self.damping
        return self.stiffness + self.held[0], self.damping + self.held[1]


class ModelRun:
    """The response of a model to the measured base motion of a run.

    Parameters
    ----------
    data, state
        The run and the model.

    Attributes
    ----------
    base_spectrum
        Base accelerations, shape (F, nb).
    brackets
        How the bases turn.
    coordinate_spectrum, deflection_spectrum
        Of the coordinates of the bodies, shape (F, n), and of the ports, shape (F, P).
    slow_deflection, slow_rate
        Of the ports below the band, at rest under what the bases lean and brake and what force laws hold there, shapes (N, P).
    motion
        Motion of the bodies over time.
    ideal_spectrum
        What ideal sensors would show, before accepted measurement effects, shape (F, ny).
    predicted_spectrum
        With accepted measurement effects, shape (F, ny).
    output_rectified
        Mean readings that full rotation brings, shape (ny,).
    """

    def __init__(self, data: RunData, state: ModelState) -> None:
        self._data, self.state = data, state
        self.response: LinearResponse = respond(data.plant, *state.linear, data.grid.omega)
        self._move_base()
        self._simulate()

    def _move_base(self) -> None:
        """Form base accelerations with the full bracket rotation."""
        data, plant, grid = self._data, self._data.plant, self._data.grid
        spectrum = data.input_spectrum.copy()
        for effect in self.state.effects:
            if effect.where is Where.INPUT:
                spectrum[:, effect.index] += grid.spectrum(effect.signal)
        twice = spectrum / (-grid.omega**2)[:, None]
        slope = twice @ plant.slope.T
        self.brackets = Brackets(grid.signal(slope), grid.signal(1j * grid.omega[:, None] * slope))
        direct = plant.base_direct + plant.lever_motion(plant.slope)
        base = spectrum @ direct.T
        specific = grid.signal(base)
        specific[:, 2::3] += plant.vehicle.gravity
        base += twice @ plant.gravity_tilt(plant.slope).T
        self.base_spectrum = base + grid.spectrum(base_correction(plant, specific, self.brackets))

    def _simulate(self) -> None:
        data, plant, r, grid = self._data, self._data.plant, self.response, self._data.grid
        wrench = np.zeros((len(grid.omega), len(plant.coordinates)), dtype=complex)
        extra_output = np.zeros((len(grid.omega), len(plant.outputs)), dtype=complex)
        for effect in self.state.effects:
            if effect.where is Where.PORT:
                wrench -= np.outer(grid.spectrum(effect.signal), plant.port_map[effect.index])
            elif effect.where is Where.WRENCH:
                wrench[:, effect.index] += grid.spectrum(effect.signal)
            elif effect.where is Where.OUTPUT:
                extra_output[:, effect.index] += grid.spectrum(effect.signal)
        second_order = np.zeros_like(wrench)
        lean = self._lean(data.slow_force)
        at_ports = [e for e in self.state.effects if e.where is Where.PORT]
        self.slow_deflection = self._lean(data.left_force) @ plant.port_map.T
        if at_ports:
            forces = np.stack([e.signal for e in at_ports], axis=1)
            self.slow_deflection += self.slow_from_ports([e.index for e in at_ports], forces)
        self.slow_rate = self.slow_rate_of(self.slow_deflection)
        enough = (_SETTLED * data.settings.adequacy) ** 2 * float(np.sum(np.abs(data.output_spectrum) ** 2))
        from_base = (r.coordinate_from_base @ self.base_spectrum[:, :, None])[:, :, 0]
        sizes: list[float] = []
        while len(sizes) < _KINEMATIC_PASSES:
            q, x, travel = self._moved(from_base, wrench + second_order, lean)
            before, second_order = second_order, grid.spectrum(data.tapered(self.rotation_wrench("base", *travel)))
            change = r.output_from_wrench @ (second_order - before)[:, :, None]
            sizes.append(float(np.sum(np.abs(change) ** 2)))
            if sizes[-1] < enough or sizes[-1] >= min(sizes[:-1], default=np.inf):
                break
        if sizes[-1] > max(sizes[0], enough):
            # a body that leans far on a soft mode: a series that grows says nothing, and the linear motion is the nearest known
            q, x, travel = self._moved(from_base, wrench, lean)
        self.coordinate_spectrum, self.deflection_spectrum = q, x
        outputs = r.outputs(q[:, :, None], self.base_spectrum[:, :, None])[:, :, 0]
        bodies = Trajectories(plant, self.motion).bodies
        beyond = output_correction(plant, bodies)
        beyond += transducer_correction(plant, bodies, self._of_mounts(travel[0]), self.brackets)
        self.output_rectified = beyond.mean(axis=0)
        self.ideal_spectrum = outputs + grid.spectrum(data.tapered(beyond - self.output_rectified))
        self.predicted_spectrum = self.ideal_spectrum + extra_output

    def _moved(self, from_base: ComplexArray, wrench: ComplexArray, lean: Array) -> tuple[ComplexArray, ComplexArray, Travel]:
        """Form the motion under a wrench on the coordinates (F, n).

        Returns
        -------
        tuple
            Spectra of coordinates (F, n) and ports (F, P), and deflection and rate of the ports over time, (N, P) each.
        """
        plant, grid = self._data.plant, self._data.grid
        iw = 1j * grid.omega[:, None]
        q = from_base + (self.response.coordinate_from_wrench @ wrench[:, :, None])[:, :, 0]
        x = q @ plant.port_map.T - (self.base_spectrum / (-grid.omega**2)[:, None]) @ plant.port_base.T
        self.motion = BodyMotion(grid.signal(q) + lean, grid.signal(iw * q), grid.signal(iw**2 * q))
        # integration drift below the band stretches the base and must not reach the products of full rotation
        real = x * grid.low_flank[:, None]
        return q, x, (grid.signal(real) + self.slow_deflection, grid.signal(iw * real))

    def _lean(self, force: Array) -> Array:
        """Return how bodies lean on their bases under a slowly changing specific force (N, 3), shape (N, n).

        Below the band bodies follow as at rest, ``K q = -M f``: braking, a bend, a slope turn a body and with it its forces and
        readings in the band. Where the bases go is left out: what turns with everything changes nothing.
        """
        plant = self._data.plant
        along = np.array([[float(c == axis) for axis in AXES] for _, c in plant.coordinates])
        return -plant.at_rest(self.state.linear[0], plant.mass @ along @ force.T, self._data.grid.duration_s).T

    def slow_from_ports(self, ports: Sequence[int], forces: Array) -> Array:
        """Return what port forces, shape (N, ports), deflect all ports below the band, their means included, shape (N, P).

        Deflections count from rest, where no law holds a force: a stop that is hit again and again lifts the body off itself.
        """
        plant = self._data.plant
        left = self._data.grid.below(forces, flank=True)
        wrench = -plant.port_map[list(ports)].T @ left.T
        return (plant.port_map @ plant.at_rest(self.state.linear[0], wrench, self._data.grid.duration_s)).T

    def slow_rate_of(self, slow: Array) -> Array:
        """Return the rates of slow deflections, shape (N, P)."""
        return np.asarray(np.gradient(slow, 1.0 / self._data.grid.rate_hz, axis=0))

    def rotation_wrench(self, axes: str, deflection: Array, rate: Array) -> Array:
        """Return what full rotation adds to the linear wrench when the mount axes turn with ``axes``, shape (N, n).

        Parameters
        ----------
        deflection, rate
            Of the ports, shape (N, P).
        """
        plant = self._data.plant
        size = 3 * len(plant.mounts)
        modulus = (np.zeros(size), np.zeros(size))
        stiffness, damping = self.state.linear
        for p, i in self._translations():
            modulus[0][i], modulus[1][i] = stiffness[p], damping[p]
        relative = self._of_mounts(deflection), self._of_mounts(rate)
        return wrench_correction(plant, self.motion, relative, self.brackets, modulus, axes)

    def _translations(self) -> list[tuple[int, int]]:
        """Return (port, column among three axes per mount) of the ports along x, y and z."""
        plant = self._data.plant
        return [
            (p, 3 * plant.mounts.index(port.mount) + AXES.index(port.axis))
            for p, port in enumerate(plant.ports) if port.axis in AXES
        ]

    def _of_mounts(self, of_ports: Array) -> Array:
        """Return a signal of the ports for all axes of all mounts, zero where there is no port, shape (N, 3 M)."""
        out = np.zeros((len(of_ports), 3 * len(self._data.plant.mounts)))
        for p, i in self._translations():
            out[:, i] = of_ports[:, p]
        return out
