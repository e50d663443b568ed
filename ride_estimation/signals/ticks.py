# Copyright 2026 ride_estimation contributors
"""Samples of one sensor at given stamps, for pictures and comparisons after a run (the estimators align by themselves)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ride_estimation.signals.recording import Channel

Array = NDArray[np.float64]

#: samples closer than this share of the period are one (repeated or overtaken messages)
_CLOSEST = 0.3


def channel_at(channel: Channel, stamp_ns: NDArray[np.int64]) -> Array | None:
    """Return the values of a channel at stamps, by a cubic through its samples.

    Parameters
    ----------
    channel
        Samples in any order; samples that are not finite are left out.
    stamp_ns
        Shape (N,).

    Returns
    -------
    ndarray or None
        Shape (N, C), the first and last sample held beyond the ends; None with fewer than four samples.
    """
    good = np.all(np.isfinite(channel.values), axis=1)
    order = np.argsort(channel.stamp_ns[good], kind="stable")
    stamps, values = channel.stamp_ns[good][order], channel.values[good][order]
    if len(stamps) < 4:
        return None
    period = float(np.median(np.diff(np.unique(stamps)))) if len(np.unique(stamps)) > 1 else 0.0
    keep = np.concatenate([[True], np.diff(stamps) > _CLOSEST * period])
    stamps, values = stamps[keep], values[keep]
    if len(stamps) < 4:
        return None
    origin = int(stamps[0])
    time = (stamps - origin) * 1e-9
    return np.asarray(CubicSpline(time, values, axis=0)(np.clip((stamp_ns - origin) * 1e-9, time[0], time[-1])))
