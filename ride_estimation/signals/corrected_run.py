# Copyright 2026 ride_estimation contributors
"""Corrections of sensors on a run that is already on a uniform time base."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.signals.correction import NO_CORRECTION, Correction
from ride_estimation.signals.recording import UniformRun

Array = NDArray[np.float64]


def corrected_run(run: UniformRun, wanted: Mapping[str, Correction]) -> UniformRun:
    """Return the run with the wanted corrections; those it has already are not applied twice.

    Parameters
    ----------
    run
        States in ``corrections`` what was applied when it was aligned.
    wanted
        By sensor name; sensors that are not named keep what they have.
    """
    data, valid, corrections = dict(run.data), dict(run.valid), dict(run.corrections)
    clipped_at = dict(run.clipped_at)
    for name, correction in wanted.items():
        had = run.corrections.get(name, NO_CORRECTION)
        if name not in data or had == correction or (had.empty and correction.empty):
            continue
        values = np.asarray(data[name], dtype=float)
        values = correction.apply(had.reading(values if values.ndim == 2 else values[:, None]))
        shift = (correction.delay_ns - had.delay_ns) * 1e-9 * run.rate_hz
        data[name], valid[name] = _earlier(values, np.asarray(valid[name]), shift) if shift else (values, valid[name])
        corrections[name] = correction
        if name in clipped_at:
            clipped_at[name] = correction.apply(had.reading(clipped_at[name]))
    return dataclasses.replace(run, data=data, valid=valid, corrections=corrections, clipped_at=clipped_at)


def _earlier(values: Array, valid: NDArray[np.bool_], shift: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return signals moved to earlier by ``shift`` ticks; not valid where that needs samples beyond a gap or an end."""
    count = len(values)
    ticks = np.arange(count)
    at = ticks + shift
    inside = np.clip(at, 0, count - 1)
    good = np.isfinite(values).all(axis=1) & valid
    if np.count_nonzero(good) < 2:
        return values, np.zeros(count, dtype=bool)
    bridged = np.stack([np.interp(ticks, ticks[good], column[good]) for column in values.T], axis=1)
    moved = scipy.interpolate.CubicSpline(ticks, bridged, axis=0)(inside)
    known = good[np.floor(inside).astype(int)] & good[np.ceil(inside).astype(int)] & (at >= 0.0) & (at <= count - 1)
    return np.asarray(moved, dtype=float), np.asarray(known)
