# Copyright 2026 ride_estimation contributors
"""Static weighings and lifts: axle loads, centre of gravity, tyre stiffness (document 001 eq. (3.4)-(3.7))."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

from ride_estimation.errors import InputDataError


def axle_loads(weight: float, cg_from_rear: float, wheelbase: float) -> tuple[float, float]:
    """Return (front, rear) static axle loads [N] from the moment balance about the axles.

    ``F_front = W b / L``, ``F_rear = W (L - b) / L`` (document 001 eq. (3.6), (3.7)).

    Parameters
    ----------
    weight
        Total weight W [N].
    cg_from_rear
        Horizontal distance of the CG from the rear axle b [m], between 0 and the wheelbase.
    wheelbase
        L [m].
    """
    if not (weight > 0.0 and np.isfinite(weight)):
        raise InputDataError(f"weight {weight:g} N must be positive and finite")
    if not (wheelbase > 0.0 and 0.0 <= cg_from_rear <= wheelbase):
        raise InputDataError(f"CG {cg_from_rear:g} m from the rear axle must lie within the wheelbase of {wheelbase:g} m")
    front = weight * cg_from_rear / wheelbase
    return front, weight - front


@dataclasses.dataclass(frozen=True)
class StiffnessResult:
    """Slope of a force against deflection line with its standard deviation and the residual scatter."""

    stiffness: float
    std: float
    residual_rms: float


def lifting_load(lift_force: float, lift_arm: float, axle_arm: float) -> float:
    """Return the load taken off an axle by a vertical lift, both about the other axle [N]: ``dF = P l / L`` (eq. (3.4))."""
    if axle_arm <= 0.0:
        raise InputDataError(f"arm of the axle {axle_arm:g} m must be positive")
    return lift_force * lift_arm / axle_arm


def tyre_stiffness_from_lift(unloading: ArrayLike, rise: ArrayLike, tyres: int = 2) -> StiffnessResult:
    """Regress the load taken off an axle on the rise of the axle (document 001 eq. (3.5)).

    Parameters
    ----------
    unloading
        Load taken off the axle [N], shape (N,), N >= 3.
    rise
        Rise of the axle [m], shape (N,).
    tyres
        Tyres on the axle; the result is per tyre.
    """
    f, x = np.asarray(unloading, dtype=float).ravel(), np.asarray(rise, dtype=float).ravel()
    if f.size != x.size or f.size < 3:
        raise InputDataError(f"at least three pairs of load and rise are needed; given {f.size} and {x.size}")
    if np.ptp(x) == 0.0 or not (np.all(np.isfinite(f)) and np.all(np.isfinite(x))):
        raise InputDataError("the rise of the axle must vary and all values must be finite")
    design = np.column_stack([x, np.ones_like(x)])
    solution, *_ = np.linalg.lstsq(design, f, rcond=None)
    residual = f - design @ solution
    variance = float(residual @ residual) / (f.size - 2)
    covariance = variance * np.linalg.inv(design.T @ design)
    return StiffnessResult(
        float(solution[0]) / tyres, float(np.sqrt(covariance[0, 0])) / tyres, float(np.sqrt(np.mean(residual**2)))
    )


def stiffness_ratio(model_hz: float, measured_hz: float) -> str:
    """Say by which factor k/m of a model is off, from one natural frequency (document 001: 1.1 Hz against 1.5 Hz).

    ``(k/m)_true = (k/m)_model (f_measured / f_model)^2``.
    """
    if model_hz <= 0.0 or measured_hz <= 0.0:
        raise InputDataError(
            f"natural frequencies {model_hz:g} Hz (model) and {measured_hz:g} Hz (measured); allowed: both greater than zero"
        )
    factor = (measured_hz / model_hz) ** 2
    return (
        f"the model's mode at {model_hz:.3g} Hz is measured at {measured_hz:.3g} Hz: "
        f"stiffness over mass must be {factor:.2f} times the model's"
    )
