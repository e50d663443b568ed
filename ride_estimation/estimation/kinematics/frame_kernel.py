# Copyright 2026 ride_estimation contributors
"""Compiled loops of the deformation of the frame: a whole block in one pass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]


@compile_kernel
def straighten(
    relative: Array,
    turn: Array,
    turn_rate: Array,
    turn_map: Array,
    arms: Array,
    flat: Array,
    second_order: Array,
    second_order_rate: Array,
) -> None:
    """Take what a finite rotation strains out of the relative acceleration.

    It strains the mounts in second order like a deformation: ``-theta x (theta x r) / 2`` in body axes.

    Parameters
    ----------
    relative
        Relative acceleration, shape (K, M, 3).
    turn, turn_rate
        theta and its rate, shape (K, 3).
    turn_map
        Angular acceleration from the relative acceleration, shape (3, 3 M).
    arms
        r, shape (M, 3).
    flat
        Output, relative acceleration without that strain, shape (K, 3 M).
    second_order, second_order_rate
        Outputs, the strain and its rate, shape (K, 3 M).
    """
    spin, across, across_rate, round_arm = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(relative.shape[0]):
        for a in range(3):
            spin[a] = 0.0
            for n in range(turn_map.shape[1]):
                spin[a] += turn_map[a, n] * relative[k, n // 3, n % 3]
        for i in range(arms.shape[0]):
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                across[a] = turn[k, b] * arms[i, c] - turn[k, c] * arms[i, b]
                across_rate[a] = turn_rate[k, b] * arms[i, c] - turn_rate[k, c] * arms[i, b]
                round_arm[a] = spin[b] * arms[i, c] - spin[c] * arms[i, b]
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                n = 3 * i + a
                second_order[k, n] = -0.5 * (turn[k, b] * across[c] - turn[k, c] * across[b])
                second_order_rate[k, n] = -0.5 * (
                    turn_rate[k, b] * across[c] - turn_rate[k, c] * across[b]
                    + turn[k, b] * across_rate[c] - turn[k, c] * across_rate[b]
                )  # fmt: skip
                flat[k, n] = relative[k, i, a] + 0.5 * (
                    spin[b] * across[c] - spin[c] * across[b]
                    + 2.0 * (turn_rate[k, b] * across_rate[c] - turn_rate[k, c] * across_rate[b])
                    + turn[k, b] * round_arm[c] - turn[k, c] * round_arm[b]
                )  # fmt: skip

@compile_kernel
def deformation_block(
    acceleration: Array, first: int, stride: int, dt: float, forget: float, transition: Array, old_share: Array, new_share: Array,
    state: Array, value: Array, rate: Array,
) -> None:  # fmt: skip
    """Pass the channels ``first, first + stride, ...`` through their filter.

    Parameters
    ----------
    acceleration
        Q times relative acceleration, shape (K, N).
    dt, forget
        Tick [s]; share of a new sample in the mean that is taken as bias.
    transition, old_share, new_share
        Filter with states ``int int e, int e, e, e'``, shapes (4, 4), (4,), (4,).
    state
        (6, N): states, bias, last acceleration; in place.
    value, rate
        Outputs (K, N).
    """
    new = np.zeros(4)
    for n in range(first, acceleration.shape[1], stride):
        for k in range(acceleration.shape[0]):
            state[4, n] += forget * (acceleration[k, n] - state[4, n])
            u = acceleration[k, n] - state[4, n]
            old = state[5, n]
            for i in range(4):
                total = old_share[i] * old + new_share[i] * u
                for j in range(4):
                    total += transition[i, j] * state[j, n]
                new[i] = total
            for i in range(4):
                state[i, n] = new[i]
            state[5, n] = u
            # linear interpolation between samples loses (omega dt)^2 / 12 of the value; put it back
            value[k, n] = new[2] - dt * dt / 12.0 * u
            rate[k, n] = new[3] - dt / 12.0 * (u - old)

@compile_kernel
def filter_history(samples: Array, b: Array, transition: Array, old_share: Array, new_share: Array, state: Array) -> Array:
    """Pass samples (K, N) through one filter and return its innovations (K, N); ``state`` (4, N) in place."""
    innovation = np.empty_like(samples)
    new = np.zeros(4)
    for n in range(samples.shape[1]):
        old = samples[0, n] if len(samples) else 0.0
        for k in range(samples.shape[0]):
            u = samples[k, n]
            for i in range(4):
                total = old_share[i] * old + new_share[i] * u
                for j in range(4):
                    total += transition[i, j] * state[j, n]
                new[i] = total
            expected = 0.0
            for i in range(4):
                state[i, n] = new[i]
                expected -= b[i] * new[i]
            innovation[k, n] = u - expected
            old = u
    return innovation

@compile_kernel
def _project(rows: Array, projector: Array, out: Array) -> None:
    """Write ``rows Q^T``, shapes (K, N) and (N, N)."""
    for k in range(rows.shape[0]):
        for n in range(projector.shape[0]):
            total = 0.0
            for m in range(projector.shape[1]):
                total += rows[k, m] * projector[n, m]
            out[k, n] = total


@compile_kernel
def frame_block(
    relative: Array, turn: Array, turn_rate: Array, frame_turn: Array, frame_turn_rate: Array, turn_map: Array, arms: Array,
    projector: Array, tilt: Array, trust: float, dt: float, forget: float, transition: Array, old_share: Array, new_share: Array,
    state: Array, flat: Array, value: Array, rate: Array,
) -> None:  # fmt: skip
    """Turn relative accelerations into the deformation of the frame and its rate.

    Parameters
    ----------
    relative
        Relative acceleration of body and bracket without what gravity adds through tilt, shape (K, M, 3) [m/s^2].
    turn, turn_rate
        Rotation of the body against the brackets and its rate, shape (K, M, 3).
    frame_turn, frame_turn_rate
        Rotation of the frame that the brackets do not make and its rate, shape (K, 3).
    turn_map, arms
        As for :func:`straighten`.
    projector
        Q, takes out what a rigid motion makes, shape (3 M, 3 M).
    tilt, trust
        What gravity adds through tilt to the projected acceleration, from vertical deformations, shape (3 M, M); share of it
        that is taken out.
    dt, forget
        As for :func:`deformation_block`.
    transition, old_share, new_share
        Filters of the three axes, shapes (3, 4, 4), (3, 4), (3, 4).
    state
        Of the filters, shape (6, 3 M), in place.
    flat
        Output, projected acceleration without what a finite rotation strains and without tilt, shape (K, 3 M).
    value, rate
        Outputs, deformation and its rate, shape (K, 3 M).
    """
    ticks, size, mounts = relative.shape[0], projector.shape[0], relative.shape[1]
    mean, mean_rate = np.empty((ticks, 3)), np.empty((ticks, 3))
    for k in range(ticks):
        for a in range(3):
            total, total_rate = 0.0, 0.0
            for i in range(mounts):
                total += turn[k, i, a]
                total_rate += turn_rate[k, i, a]
            mean[k, a], mean_rate[k, a] = total / mounts - frame_turn[k, a], total_rate / mounts - frame_turn_rate[k, a]
    raw, second_order, second_order_rate = np.empty((ticks, size)), np.empty((ticks, size)), np.empty((ticks, size))
    straighten(relative, mean, mean_rate, turn_map, arms, raw, second_order, second_order_rate)
    _project(raw, projector, flat)
    own, own_rate = np.zeros((ticks, size)), np.zeros((ticks, size))
    for step in range(3):
        axis = (step + 2) % 3  # vertical first: it tilts the brackets
        if step == 1 and trust > 0.0:
            for k in range(ticks):
                for n in range(size):
                    total = 0.0
                    for i in range(mounts):
                        total += own[k, 3 * i + 2] * tilt[n, i]
                    flat[k, n] += trust * total
        deformation_block(
            flat, axis, 3, dt, forget, transition[axis], old_share[axis], new_share[axis], state, own, own_rate
        )  # fmt: skip
    # bias and rounding leave the range of the projector only through the axes having filters of their own
    for k in range(ticks):
        for n in range(size):
            own[k, n] += second_order[k, n]
            own_rate[k, n] += second_order_rate[k, n]
    _project(own, projector, value)
    _project(own_rate, projector, rate)
