# Copyright 2026 ride_estimation contributors
"""Compiled loops of the attachment forces: the short blocks cost less in one pass than in many calls of numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@compile_kernel
def with_deformation(total: Array, projector: Array, deformation: Array, measured: BoolArray, out: Array) -> None:
    """Replace the part of deflections no rigid motion makes, ``d - Q d + e``, but where a transducer measures the whole.

    Parameters
    ----------
    total, deformation
        d and e, shape (K, M, 3).
    projector
        Q, shape (3 M, 3 M).
    measured
        Shape (3 M,).
    out
        Shape (K, M, 3).
    """
    for k in range(total.shape[0]):
        for n in range(measured.shape[0]):
            i, a = n // 3, n % 3
            value = total[k, i, a]
            if not measured[n]:
                value += deformation[k, i, a]
                for m in range(measured.shape[0]):
                    value -= projector[n, m] * total[k, m // 3, m % 3]
            out[k, i, a] = value


@compile_kernel
def turned_motion(
    value: Array, rate: Array, turn: Array, turn_rate: Array, follow: float, known: BoolArray, x: Array, v: Array
) -> None:
    """Turn deflection and rate from cab axes into those of mounts that follow a share of their bracket's rotation.

    ``x = d + theta x d + theta x (theta x d) / 2``, ``v = d' + theta x d' + theta' x d``; zero where no sensor
    determines the deflection.

    Parameters
    ----------
    value, rate
        d and d' in cab axes, shape (K, M, 3).
    turn, turn_rate
        Rotation of the body against the brackets and its rate, shape (K, M, 3).
    follow
        Share that the mounts follow.
    known
        Shape (M, 3).
    x, v
        Outputs, shape (K, M, 3).
    """
    for k in range(value.shape[0]):
        for i in range(value.shape[1]):
            d0, d1, d2 = value[k, i, 0], value[k, i, 1], value[k, i, 2]
            along = follow * follow * (turn[k, i, 0] * d0 + turn[k, i, 1] * d1 + turn[k, i, 2] * d2)
            square = follow * follow * (turn[k, i, 0] ** 2 + turn[k, i, 1] ** 2 + turn[k, i, 2] ** 2)
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                if known[i, a]:
                    t_b, t_c = follow * turn[k, i, b], follow * turn[k, i, c]
                    r_b, r_c = follow * turn_rate[k, i, b], follow * turn_rate[k, i, c]
                    d_b, d_c = value[k, i, b], value[k, i, c]
                    second = 0.5 * (turn[k, i, a] * along - square * value[k, i, a])
                    x[k, i, a] = value[k, i, a] + (t_b * d_c - t_c * d_b) + second
                    v[k, i, a] = rate[k, i, a] + (t_b * rate[k, i, c] - t_c * rate[k, i, b]) + (r_b * d_c - r_c * d_b)
                else:
                    x[k, i, a], v[k, i, a] = 0.0, 0.0


@compile_kernel
def follow_scaled(signals: Array, scale: Array, gain: float, square: Array) -> None:
    """Let ``square`` (M, 3) follow the mean square of ``scale`` (M, 3) times ``signals`` (K, M, 3), in place."""
    ticks = signals.shape[0]
    for i in range(square.shape[0]):
        for a in range(3):
            total = 0.0
            for k in range(ticks):
                scaled = scale[i, a] * signals[k, i, a]
                total += scaled * scaled
            square[i, a] += gain * (total / ticks - square[i, a])


@compile_kernel
def balanced_forces(
    tension: Array, turn: Array, follow: float, static: Array, support: Array, measured: BoolArray, wrench: Array, gain: Array,
    gain_slow: Array, share: float, slow: Array, square: Array, missing: Array, force: Array,
) -> None:  # fmt: skip
    """Correct the forces of the mount law by equilibrium.

    Parameters
    ----------
    tension
        Of the mount elements in mount axes, shape (K, M, 3) [N].
    turn, follow
        As for :func:`turned_motion`.
    static
        Static force on the body, shape (M, 3) [N].
    support
        Wrench the mounts together carry, shape (K, 6).
    measured
        Whether the wrench is more than a guess, shape (K,); forces stay those of the law and of the slow residual where not.
    wrench
        Wrench of unit forces, shape (6, 3 M).
    gain, gain_slow
        What of a fast and of a slow residual every force takes, shape (3 M, 6).
    share
        Of a new residual in the slow one.
    slow
        Slow residual, shape (6,), in place.
    square
        Sum of the squared residuals, shape (6,), in place.
    missing
        Output, residual of equilibrium, shape (K, 6).
    force
        Output, force on the body in cab axes, shape (K, M, 3).
    """
    mounts = tension.shape[1]
    fast = np.empty(6)
    for k in range(tension.shape[0]):
        for r in range(6):
            missing[k, r] = support[k, r]
        for i in range(mounts):
            f0, f1, f2 = static[i, 0] - tension[k, i, 0], static[i, 1] - tension[k, i, 1], static[i, 2] - tension[k, i, 2]
            t0, t1, t2 = follow * turn[k, i, 0], follow * turn[k, i, 1], follow * turn[k, i, 2]
            # R f = f - theta x f + theta x (theta x f) / 2
            c0, c1, c2 = t1 * f2 - t2 * f1, t2 * f0 - t0 * f2, t0 * f1 - t1 * f0
            force[k, i, 0] = f0 - c0 + 0.5 * (t1 * c2 - t2 * c1)
            force[k, i, 1] = f1 - c1 + 0.5 * (t2 * c0 - t0 * c2)
            force[k, i, 2] = f2 - c2 + 0.5 * (t0 * c1 - t1 * c0)
            for a in range(3):
                for r in range(6):
                    missing[k, r] -= wrench[r, 3 * i + a] * force[k, i, a]
        for r in range(6):
            if not measured[k]:
                missing[k, r], fast[r] = 0.0, 0.0
                continue
            square[r] += missing[k, r] * missing[k, r]
            slow[r] += share * (missing[k, r] - slow[r])
            fast[r] = missing[k, r] - slow[r]
        for i in range(mounts):
            for a in range(3):
                for r in range(6):
                    force[k, i, a] += gain[3 * i + a, r] * fast[r] + gain_slow[3 * i + a, r] * slow[r]
