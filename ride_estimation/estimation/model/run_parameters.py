# Copyright 2026 ride_estimation contributors
"""Stiffness, damping and mass properties as the model estimates them from a whole run, together with errors of sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.estimation.model.joint import DETERMINED, JointEstimate
from ride_estimation.estimation.parameters.parameter_status import status_of
from ride_estimation.frames import AXES

_NOT_LINEAR = "the force is not that of a linear law"
_AMPLITUDE = "depends on the amplitude: friction, play or a nonlinear law"
_OPEN = {
    Status.VALID: "",
    Status.ESTIMATING: "uncertain by more than 5 %",
    Status.NOT_IDENTIFIABLE: "the run does not separate it from other parameters or errors of the sensors",
}


def run_parameters(joint: JointEstimate, stamp_ns: int) -> tuple[Estimate, ...]:
    """Return stiffness and damping of every mount and axis, and the mass with a load that the file does not contain.

    Parameters
    ----------
    joint
        Slow states of the run.
    stamp_ns
        Stamp of the newest sample.
    """
    plant, slow = joint.plant, joint.stated
    # stiffness, damping and mass are known up to a common factor: where the mass is held its error is that of all
    of_mass, held = plant.mass_factor
    found = []
    for i, mount in enumerate(plant.mounts):
        for a, axis in enumerate(AXES):
            for role, part in zip(ROLES, (slow.log_stiffness, slow.log_damping)):
                at = part.start + 3 * i + a
                factor = of_mass * float(np.exp(joint.theta[at] - slow.mean[at]))
                std = float(np.hypot(np.sqrt(joint.covariance[at, at]), held))
                if 3 * i + a in plant.freed:
                    status, reason = Status.SUSPECT, _NOT_LINEAR
                else:
                    status = status_of(std, float(np.hypot(slow.std[at], held)))
                    reason = _OPEN[status]
                for p in mount.elements[axis].parameters():
                    if p.role == role:
                        prior = float(getattr(mount.elements[axis], p.name))
                        name, value = f"{mount.name}.{axis}.{p.name}", prior * factor
                        found.append(Estimate(name, value, abs(value) * std, p.unit, prior, status, reason, stamp_ns))
    if plant.load.presence:
        body = plant.geometry.body
        mass, status = body.mass.value * of_mass, status_of(held, np.inf)
        words = "with a load that the vehicle file does not contain, or with a wrong CG there"
        found.append(Estimate(f"{body.name}.mass", mass, mass * held, "kg", body.mass.value, status, words, stamp_ns))
    return tuple(found)


def mass_properties(joint: JointEstimate, stamp_ns: int) -> tuple[Estimate, ...]:
    """Return CG [m] and moments of inertia about it [kg m^2] of the body, without what it carries.

    A value is ``valid`` where the run at least halved the standard deviation that the vehicle file states. The moments are
    known over the mass: its standard deviation is in theirs.

    Parameters
    ----------
    joint, stamp_ns
        As in :func:`run_parameters`.
    """
    plant, slow = joint.plant, joint.stated
    body, constants = plant.geometry.body, plant.constants(joint.theta)
    factor, held = plant.mass_factor
    std = np.sqrt(np.diag(joint.covariance))
    moments = factor * np.diag(constants.inertia)
    stds = [moments * np.hypot(s[slow.log_inertia], own) for s, own in ((std, held), (slow.std, plant.mass_std))]
    columns = [(f"inertia.{axis}{axis}" for axis in AXES), moments, np.diag(body.inertia), *stds, 3 * ("kg m^2",)]
    cg = plant.load.own(constants.cg)
    rows = [*zip((f"cg.{axis}" for axis in AXES), cg, body.cg, std[slow.cg], slow.std[slow.cg], 3 * ("m",))]
    return tuple(
        Estimate(f"{body.name}.{name}", float(value), float(own), unit, float(prior), *_learned(own, before), stamp_ns)
        for name, value, prior, own, before, unit in [*rows, *zip(*columns)]
    )


def _learned(std: float, prior_std: float) -> tuple[Status, str]:
    """Return status and reason of a value by how much surer a run made it."""
    if std <= DETERMINED * prior_std:
        return Status.VALID, ""
    return Status.NOT_IDENTIFIABLE, "the run says little more than the vehicle file"


def load_in_words(joint: JointEstimate) -> str:
    """Return what a run shows of a load, empty where the CG is where the vehicle file states it."""
    geometry, load = joint.plant.geometry, joint.plant.load
    if not load.presence:
        return ""
    distance, mass = 1e3 * float(np.linalg.norm(joint.cg_offset())), geometry.body.mass.value
    ways = "the place of the CG, the stiffness in the file" + " and static travel" * bool(joint.plant.transducers)
    stands = f"leans by {np.degrees(np.linalg.norm(load.leans)):.1f} degrees" if load.leaning else "stands level"
    return (
        f"the CG of {geometry.body.name!r} is {distance:.0f} mm from where the vehicle file states it: a load that the file does "
        f"not contain ({load.presence:.0%}) or a wrong CG; mass {load.share * mass:+.0f} +- {load.std * mass:.0f} kg by {ways}, "
        f"the body {stands}"
    )


def beside_online(
    found: Sequence[Estimate], online: Sequence[Estimate], amplitude_std: Mapping[str, float]
) -> tuple[Estimate, ...]:
    """Return estimates of the whole run of the parameters that the online estimator has, in its order.

    The model assumes constants and linear laws. What the online estimator found suspect stays so, and what depends on the
    amplitude is as uncertain as it says (``amplitude_std``, by name, of the logarithm).
    """
    own = {e.name: e for e in found}
    out = []
    for live in (e for e in online if e.name in own):
        e = own[live.name]
        std = float(np.hypot(e.std, abs(e.value) * amplitude_std.get(e.name, 0.0)))
        if e.status is Status.VALID and live.status is Status.SUSPECT:
            e = dataclasses.replace(e, status=live.status, reason=live.reason)
        elif e.status is Status.VALID and status_of(std / abs(e.value), np.inf) is not Status.VALID:
            e = dataclasses.replace(e, status=Status.SUSPECT, reason=_AMPLITUDE)
        out.append(dataclasses.replace(e, std=std))
    return tuple(out)
