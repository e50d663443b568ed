# Copyright 2026 ride_estimation contributors
"""What the attachment forces of a block were made of: kept of a recorded run, so that they can be smoothed."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.forces.mount_forces import MountForceEstimator
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock
from ride_estimation.estimation.motion.loads import InertialLoads

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ForceModel:
    """Parameters that turn motion into forces.

    Attributes
    ----------
    multipliers, std
        Of stiffness and damping, factor of the mass included, and standard deviation of their logarithms, shape (2, M, 3).
    misread
        Variance of the forces for base sensors that read too much or too little, shape (M, 3) [N^2].
    mass, mass_std
        [kg] and its relative standard deviation.
    inertia, inertia_std
        Shape (3, 3) [kg m^2] and its relative standard deviation.
    cg_offset, loaded
        Of the CG from its place in the file, shape (3,) [m], and whether that is a load's.
    follow
        Share of the rotation of the brackets that the mount axes follow.
    """

    multipliers: Array
    std: Array
    misread: Array
    mass: float
    mass_std: float
    inertia: Array
    inertia_std: float
    cg_offset: Array
    loaded: bool
    follow: float


@dataclasses.dataclass(frozen=True)
class ForceBasis:
    """Inputs of the attachment forces of one block.

    Attributes
    ----------
    deflection
        Of the mounts, cab axes, as the online estimator knew it.
    load_covariance, constant_load
        Of the wrench that the mounts carry, (6, 6) each: what equilibrium is judged by, and a constant error.
    complete
        Whether every sensor the deflections rest on was there and none suspect.
    model
        Parameters of the time.
    """

    deflection: DeflectionBlock
    load_covariance: Array
    constant_load: Array
    complete: bool
    model: ForceModel

    @classmethod
    def of(
        cls, forces: MountForceEstimator, loads: InertialLoads, deflection: DeflectionBlock, covariance: Array, complete: bool
    ) -> ForceBasis:
        """Return the basis of the block that was estimated just now; ``covariance`` is that of the wrench."""
        model = ForceModel(
            forces.law.multipliers, forces.parameter_std, forces.misread_variance, forces.mass, forces.mass_relative_std,
            loads.inertia, loads.inertia_relative_std, loads.cg_offset, forces.loaded, forces.follow,
        )  # fmt: skip
        return cls(deflection, covariance, forces.constant_load, complete, model)
