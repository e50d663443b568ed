# Copyright 2026 ride_estimation contributors
"""What a sensor layout and a run make identifiable, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.parameters.mass_reference import NULL_DIRECTION
from ride_estimation.sensors.layout import check_layout

Array = NDArray[np.float64]

#: share of a parameter in a null direction from which on it is named
_NAMED = 0.25
#: loss of information against the best direction that makes a direction null
_NULL = 1e-6


def null_directions(covariance: Array, prior_std: Array, names: Sequence[str]) -> list[str]:
    """Return the combinations of parameters that the data do not identify, in words.

    Parameters
    ----------
    covariance
        Of the logarithms, shape (N, N).
    prior_std
        Shape (N,).
    names
        Of the parameters.
    """
    scaled = covariance / np.outer(prior_std, prior_std)
    values, basis = np.linalg.eigh(scaled)
    found = []
    for value, direction in zip(values[::-1], basis.T[::-1]):
        if value < 0.5:
            break
        largest = float(np.max(np.abs(direction)))
        parts = [
            f"{'+' if d * direction[np.argmax(np.abs(direction))] > 0 else '-'}{name}"
            for d, name in zip(direction, names) if abs(d) > _NAMED * largest
        ]  # fmt: skip
        found.append(
            "only their combination with others shows, not " + " ".join(parts) if len(parts) > 1 else f"{parts[0][1:]} alone"
        )
    return found


def describe(
    geometry: Geometry, estimates: Sequence[Estimate], has_reference: bool, nulls: Sequence[str], changes: Sequence[str]
) -> dict[str, Any]:
    """Return what is identifiable, what is not and which sensor or manoeuvre would cure it.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    estimates
        Of all parameters.
    has_reference
        Whether the mass has a scale reference.
    nulls
        Unobservable combinations of parameters, in words.
    changes
        Notes on the parameters.

    Returns
    -------
    dict
        ``layout`` sentence, ``identifiable`` names, ``not_identifiable`` sentences, ``advice`` sentences, ``notes``.
    """
    body = geometry.body
    layout = check_layout(geometry.body_sensors, body.cg, body.coordinates)
    missing, advice = [], []
    if not has_reference:
        missing.append(f"{body.name}.mass: {NULL_DIRECTION}")
        advice.append(
            "weigh the body, or give one known stiffness, a load cell, an air-spring pressure or a run with a known added mass"
        )
    if not layout.complete:
        missing.append(f"motion of {body.name}: {', '.join(layout.undetermined)}")
        advice.append("three triaxial accelerometers that are not on one line, or one with gyro, determine all six components")
    if not geometry.mounts:
        missing.append("mount forces and parameters: the vehicle file names no mount between this body and a base")
    travelled = {s.mount for s in geometry.transducers}
    silent = [m.name for m, seen in zip(geometry.mounts, geometry.base_observable[:, 2]) if not seen]
    horizontal = [m.name for m in geometry.mounts] if geometry.base_observable.any() and not geometry.has_base_motion else []
    bare = [name for name in silent if name not in travelled]
    if bare:
        rests = "the split of the forces among the mounts rests on stiffness ratios"
        if len(bare) < len(geometry.mounts):
            rests = "it is that of a rigid frame through the bases that are measured, its vertical force what equilibrium leaves"
        missing.append(
            f"deflection of {', '.join(bare)}: nothing measures the motion of its base, so {rests} and a twist of the frame is "
            "invisible there (34 to 40 % of the dynamic force in pilot runs, up to 80 % on frames that twist much)"
        )
        places = ", ".join(bare)
        advice.append(f"a triaxial accelerometer at the base of {places} makes deflection, stiffness and damping observable")
    if horizontal:
        missing.append(
            "horizontal deflection, stiffness and damping: they take a triaxial accelerometer at every mount base; horizontal "
            "forces are shared by stiffness ratios"
        )
    half = [name for name in silent if name in travelled]
    if half:
        missing.append(f"axes of {', '.join(half)} without transducer: their forces are shared by stiffness ratios")
    missing += [f"{e.name}: {e.reason}" for e in estimates if e.status is Status.NOT_IDENTIFIABLE and not bare and has_reference]
    missing += [n for n in nulls if not bare]
    valid = [e.name for e in estimates if e.status is Status.VALID]
    return {
        "layout": layout.sentence(body.name), "identifiable": valid, "not_identifiable": missing, "advice": advice,
        "notes": list(changes),
    }  # fmt: skip
