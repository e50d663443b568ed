# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of the mounts as the model estimates them from a whole run, together with the errors of the sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.estimation.model.joint import JointEstimate
from ride_estimation.estimation.parameters.parameter_status import status_of
from ride_estimation.frames import AXES

_NOT_LINEAR = "the force is not that of a linear law"
_OPEN = "the run does not separate it from other parameters or from errors of the sensors"


def run_parameters(joint: JointEstimate, stamp_ns: int) -> tuple[Estimate, ...]:
    """Return stiffness and damping of every mount and axis.

    Parameters
    ----------
    joint
        Slow states of the run.
    stamp_ns
        Stamp of the newest sample.
    """
    plant, slow = joint.plant, joint.plant.slow
    # stiffness, damping and mass are known up to a common factor: where the mass is held its error is that of all
    held = plant.mass_std if slow.std[slow.log_mass][0] == 0.0 else 0.0
    found = []
    for i, mount in enumerate(plant.mounts):
        for a, axis in enumerate(AXES):
            for role, part in zip(ROLES, (slow.log_stiffness, slow.log_damping)):
                at = part.start + 3 * i + a
                factor = float(np.exp(joint.theta[at] - slow.mean[at]))
                std = float(np.hypot(np.sqrt(joint.covariance[at, at]), held))
                if 3 * i + a in plant.freed:
                    status, reason = Status.SUSPECT, _NOT_LINEAR
                else:
                    status = status_of(std, float(np.hypot(slow.std[at], held)))
                    reason = "" if status is Status.VALID else _OPEN
                for p in mount.elements[axis].parameters():
                    if p.role == role:
                        prior = float(getattr(mount.elements[axis], p.name))
                        name, value = f"{mount.name}.{axis}.{p.name}", prior * factor
                        found.append(Estimate(name, value, abs(value) * std, p.unit, prior, status, reason, stamp_ns))
    return tuple(found)


def beside_online(found: Sequence[Estimate], online: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """Return estimates of the whole run of the parameters that the online estimator has, in its order.

    What it found suspect stays so: its tests look at changes and at dependence on the amplitude, the model assumes constants.
    """
    own = {e.name: e for e in found}
    return tuple(
        dataclasses.replace(own[e.name], status=e.status, reason=e.reason)
        if e.status is Status.SUSPECT and own[e.name].status is not Status.SUSPECT
        else own[e.name]
        for e in online
        if e.name in own
    )
