# Copyright 2026 ride_estimation contributors
"""The jounce-bumper white box and its records, compression positive (document 004)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.jounce_columns import TravelBasis, contact_cell, friction_state, friction_travel
from ride_estimation.identification.bench.time_domain import PreparedRecord

Array = NDArray[np.float64]

#: a record counts as static below this share of the fastest record's speed, and below 20 mm/s
STATIC_SPEED_SHARE = 0.1
STATIC_SPEED = 0.02
#: samples per record in the search; longer records are thinned in the residual, never in the simulation
_RESIDUALS = 3000
#: travel between two samples below which a record is thinned [m]
_TRAVEL_PER_SAMPLE = 5.0e-5


@dataclasses.dataclass(frozen=True)
class Load:
    """One record seen from the bumper: travel and force positive in compression.

    Attributes
    ----------
    name, step_s
        Of the record.
    travel, friction
        Travel and the travel that drives friction [m], shape (N,).
    force
        Measured compression force [N], shape (N,).
    picked
        Samples used in residuals: loaded ones, thinned evenly.
    scale
        Standard deviation of the force while loaded [N].
    fitted, held_out
        Loaded samples that are fitted and that are kept for validation, shape (N,).
    """

    name: str
    step_s: float
    travel: Array
    friction: Array
    force: Array
    picked: NDArray[np.int64]
    scale: float
    fitted: NDArray[np.bool_]
    held_out: NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class WhiteBox:
    """Parameters of the white box in SI, compression positive.

    Attributes
    ----------
    basis
        Travel basis of both curves.
    static, height
        Coefficients of static force and hysteresis height [N], shape (B,).
    slopes
        s_min, s_max [N/m], exponent.
    contacts, rates, stiffness
        Maxwell cells: contact points [m], rates [1/s], stiffnesses [N/m], shape (C,).
    smooth
        Half width of the entry [m].
    constructed
        Hysteresis height as constructed from the static loops, to which the fitted one is drawn where the records do not
        tell it (near the reference travel), shape (B,).
    """

    basis: TravelBasis
    static: Array
    height: Array
    slopes: Array
    contacts: Array
    rates: Array
    stiffness: Array
    smooth: float
    constructed: Array

    @property
    def reference_height(self) -> float:
        """Return w at the reference travel [N]."""
        return max(float(self.height[-1]), 0.2 * float(self.height.max()), 1.0)

    def force(self, load: Load) -> Array:
        """Return the compression force [N] over a record, shape (N,)."""
        spline = self.basis(load.travel)
        z = self.state(load)
        total = spline @ self.static + 0.5 * z * np.maximum(spline @ self.height, 0.0)
        for contact, rate, k in zip(self.contacts, self.rates, self.stiffness, strict=True):
            if k > 0.0:
                total = total + k * contact_cell(load.travel, load.step_s, contact, self.smooth, rate)
        total[load.travel <= 0.0] = 0.0
        return np.asarray(total, dtype=float)

    def state(self, load: Load, spline: Array | None = None) -> Array:
        """Return unit friction over a record; ``spline`` is the basis at its friction travel where already known."""
        known = self.basis(load.friction) if spline is None else spline
        return friction_state(load.friction, known @ self.height, self.reference_height, self.slopes)


def compression_side(prepared: Sequence[PreparedRecord]) -> float:
    """Return +1 where displacement and force of the records are positive in compression, -1 where negative.

    Raises
    ------
    InputDataError
        Force on both sides of zero: not a jounce bumper.
    """
    force = np.concatenate([p.force for p in prepared])
    low, high = float(-force.min()), float(force.max())
    if min(low, high) > 0.3 * max(low, high):
        raise InputDataError(
            f"the force runs from {-low:g} to {high:g} N: a jounce bumper only pushes; "
            "use another model, or correct the load-cell zero"
        )
    return 1.0 if high > low else -1.0


def as_load(item: PreparedRecord, side: float, *, hold_out: bool = False) -> Load:
    """Return a record as the bumper sees it; ``hold_out`` keeps every fourth load event for validation."""
    travel = side * item.motion.x
    speed = float(np.quantile(np.abs(np.diff(travel)), 0.999)) / item.motion.step_s
    factor = int(np.clip(_TRAVEL_PER_SAMPLE / max(speed * item.motion.step_s, 1e-12), 1, 20))
    if factor > 1:
        # slow records carry no more information at a high rate
        return _as_load(item.thinned(factor), side, hold_out) if factor * 500 < travel.size else _as_load(item, side, hold_out)
    return _as_load(item, side, hold_out)


def _as_load(item: PreparedRecord, side: float, hold_out: bool) -> Load:
    travel = side * item.motion.x
    usable = (travel > 0.0) & item.fitted
    held = np.zeros(travel.size, dtype=bool)
    if hold_out:
        event = np.cumsum(np.diff((travel > 0.0).astype(int), prepend=0) > 0)
        held = usable & (event % 4 == 3)
    fitted = usable & ~held
    loaded = np.flatnonzero(fitted)
    if loaded.size < 50:
        raise InputDataError(f"{item.record.name}: only {loaded.size} samples are loaded (travel above zero)")
    picked = loaded[np.unique(np.linspace(0, loaded.size - 1, min(loaded.size, _RESIDUALS)).astype(int))]
    force = side * item.force
    return Load(
        item.record.name,
        item.motion.step_s,
        np.ascontiguousarray(travel),
        friction_travel(item.motion, side),
        force,
        picked,
        float(np.std(force[loaded])),
        fitted,
        held,
    )


def loaded_nrmse(load: Load, force: Array, part: NDArray[np.bool_] | None = None) -> float:
    """Return NRMSE over loaded samples with the standard deviation as norm (document 004 eq. (2)); default the fitted ones."""
    use = load.fitted if part is None else part
    return float(np.sqrt(np.mean((force - load.force)[use] ** 2)) / np.std(load.force[use]))


def split_static(loads: Sequence[Load]) -> tuple[list[Load], list[Load]]:
    """Return the static and the dynamic records.

    Raises
    ------
    InputDataError
        No slow record.
    """
    speeds = []
    for load in loads:
        v = np.abs(np.diff(load.travel)) / load.step_s
        moving = v[v > 0.05 * np.quantile(v, 0.99)]
        speeds.append(float(np.quantile(moving, 0.9)))
    fastest = max(speeds)
    static = [load for load, v in zip(loads, speeds, strict=True) if v < STATIC_SPEED and v < STATIC_SPEED_SHARE * fastest]
    dynamic = [load for load in loads if load not in static] if static else list(loads)
    if not static or not dynamic:
        listed = ", ".join(f"{load.name} {1e3 * v:.3g} mm/s" for load, v in zip(loads, speeds, strict=True))
        raise InputDataError(
            f"staged jounce identification needs at least one slow record (below {1e3 * STATIC_SPEED:g} mm/s) and one fast one; "
            f"speeds: {listed}"
        )
    return static, dynamic
