# Copyright 2026 ride_estimation contributors
"""The force balance and the response of the simulated body for one vector of parameters.

The vector holds the logarithms of the multipliers, the follow share minus one, the logarithms of the inverse inertias over the
file's and, where the body carries a load that the file does not know, the offsets of the CG from its place in the file. The
online filter and the review of the last seconds each have a model of their own: neither disturbs the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry, weight_at
from ride_estimation.estimation.forces.free_parameters import FreeParameter
from ride_estimation.estimation.forces.mount_forces import static_share
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.parameters.force_balance import OFFSET_UNIT, ForceBalance
from ride_estimation.estimation.parameters.response import ModelResponse
from ride_estimation.estimation.parameters.transducer_balance import MeasuredResponse, TransducerBalance
from ride_estimation.estimation.sensor_errors.installed_errors import InstalledErrors

Array = NDArray[np.float64]


class ParameterModel:
    """Balance and response, made ready for one vector of parameters at a time.

    Parameters
    ----------
    geometry, tilting
        Body and mounts, and how the brackets tilt.
    free_parameters
        Multipliers that are estimated, N of them.
    turns
        Axes (0 to 2) about which the inertia is estimated, R of them.
    offsets
        Axes (0 to 2) along which the CG may lie off its place in the file, O of them.
    errors
        Of the sensors, see :class:`ForceBalance`.
    corner_hz
        Corner of the high-pass of the balance [Hz].
    by_transducers
        Whether displacement transducers instead of accelerometers measure the deflections.
    """

    def __init__(
        self, geometry: Geometry, tilting: BracketTilt, free_parameters: tuple[FreeParameter, ...], turns: tuple[int, ...],
        offsets: tuple[int, ...], errors: InstalledErrors, corner_hz: float, by_transducers: bool,
    ) -> None:  # fmt: skip
        self.geometry, self.free_parameters, self.turns, self.offsets = geometry, free_parameters, turns, offsets
        self.law = MountLaw(geometry)
        #: where inertia is part of the vector
        self.inertial: ForceBalance | None = None
        self.balance: ForceBalance | TransducerBalance
        self.response: ModelResponse | MeasuredResponse
        if by_transducers:
            self.balance = TransducerBalance(geometry, free_parameters, self.law, corner_hz)
            self.response = MeasuredResponse()
        else:
            self.balance = self.inertial = ForceBalance(
                geometry, tilting, free_parameters, self.law, corner_hz, errors, turns, offsets
            )
            self.response = ModelResponse(self.inertial, geometry.vehicle.gravity)
        #: of the CG from its place in the file [m]
        self.offset = np.zeros(3)
        self._static_of: tuple[Array | None, Array] = None, self.offset
        self._static = np.zeros((len(geometry.mounts), 3))

    def spread(self, values: Array, empty: float) -> Array:
        """Return values per parameter as an array (2, M, 3) of role, mount and axis; ``empty`` where nothing is estimated."""
        result = np.full((2, len(self.geometry.mounts), 3), empty)
        for parameter, value in zip(self.free_parameters, values):
            result[parameter.role, parameter.mount, parameter.axis] = value
        return result

    def offset_of(self, theta: Array) -> Array:
        """Return the offset of the CG from its place in the file, shape (3,) [m]; zero where the vector does not hold it."""
        offset, own = np.zeros(3), theta[len(self.free_parameters) + 1 + len(self.turns) :]
        offset[list(self.offsets)] = OFFSET_UNIT * own if len(own) else 0.0
        return offset

    def scale(self, theta: Array) -> None:
        """Take parameters (N,) over into mounts, inertia and CG."""
        count = len(self.free_parameters)
        self.law.scale(self.spread(np.exp(theta[:count]), 1.0))
        if self.inertial is not None:
            self.inertial.scale_inertia(theta[count + 1 : count + 1 + len(self.turns)])
            self.offset = self.offset_of(theta)

    def prepare(self, theta: Array, step: float) -> None:
        """Make the response ready for parameters (N,) and a step [s]."""
        self.scale(theta)
        self.response.prepare(self.static_force(), 1.0 + float(theta[len(self.free_parameters)]), step)

    def static_force(self) -> Array:
        """Return the static force on the body by each mount, shape (M, 3) [N]."""
        if self._static_of[0] is not self.law.stiffness or self._static_of[1] is not self.offset:
            a = self.geometry
            weight = weight_at(a, self.offset)
            stiffness = np.maximum(self.law.stiffness, 0.0).ravel()
            stiffness = stiffness + 1e-9 * max(float(stiffness.max()), 1.0)
            self._static = static_share(a.wrench[a.free], stiffness, weight[a.free]).reshape(len(a.mounts), 3)
            self._static_of = self.law.stiffness, self.offset
        return self._static
