# Copyright 2026 ride_estimation contributors
"""Compiled time stepping of the equations of motion with small rotations: classical Runge-Kutta of order four.

Elements with memory are evaluated on trial points between the committed samples (``network_force``) and committed once per
step (``network_commit``), so reversals and contacts are seen only on accepted points. The base moves on cubic Hermite
splines through its samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.terms import network_commit, network_force
from ride_estimation.jit import compile_kernel, compile_lean_kernel

Array = NDArray[np.float64]
Index = NDArray[np.uint32]
Codes = NDArray[np.int64]


class Structure(NamedTuple):
    """The constant part of a model: sparse matrices as (columns, values) of equal row length, and its terms.

    Q coordinates, C components, T terms, W the longest row of a matrix; shorter rows are padded with zeros.

    Attributes
    ----------
    g_columns, g_values
        Deflection map, shape (C, W).
    t_columns, t_values
        Its transpose, shape (Q, W).
    k_columns, k_values
        Geometric stiffness, shape (Q, W).
    m_columns, m_values
        Inverse mass matrix, shape (Q, W).
    codes
        Term codes, shape (T,).
    channel
        Component each term acts on, shape (T,).
    """

    g_columns: Index
    g_values: Array
    t_columns: Index
    t_values: Array
    k_columns: Index
    k_values: Array
    m_columns: Index
    m_values: Array
    codes: Codes
    channel: Codes


class Input(NamedTuple):
    """What drives a run, on uniform samples.

    Attributes
    ----------
    displacement, velocity
        Prescribed base motion per component, shape (N, C), zero where the base is a body.
    load
        Generalised external force, shape (N, Q), or (1, Q) where it is constant.
    """

    displacement: Array
    velocity: Array
    load: Array


class Output(NamedTuple):
    """Results at the samples, filled in place: (N, Q) three times, (N, C) three times."""

    q: Array
    qd: Array
    qdd: Array
    deflection: Array
    rate: Array
    tension: Array


def make_output(samples: int, coordinates: int, components: int) -> Output:
    """Return empty results for N samples, Q coordinates and C components."""
    return Output(
        *(np.empty((samples, coordinates)) for _ in range(3)), *(np.empty((samples, components)) for _ in range(3))
    )


@compile_lean_kernel
def set_base(
    displacement: Array, velocity: Array, sample: int, s: float, sample_time: float, base: Array, base_rate: Array
) -> None:
    """Set base motion the share s of a sample after ``sample``: cubic Hermite spline through values and velocities."""
    following = min(sample + 1, displacement.shape[0] - 1)
    h00 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
    h10 = s * (1.0 - s) * (1.0 - s) * sample_time
    h01 = s * s * (3.0 - 2.0 * s)
    h11 = s * s * (s - 1.0) * sample_time
    d00 = 6.0 * s * (s - 1.0) / sample_time
    d10 = (1.0 - s) * (1.0 - 3.0 * s)
    d11 = s * (3.0 * s - 2.0)
    for c in range(base.shape[0]):
        u0 = displacement[sample, c]
        u1 = displacement[following, c]
        v0 = velocity[sample, c]
        v1 = velocity[following, c]
        base[c] = h00 * u0 + h10 * v0 + h01 * u1 + h11 * v1
        base_rate[c] = d00 * (u0 - u1) + d10 * v0 + d11 * v1


@compile_lean_kernel
def set_load(load: Array, sample: int, s: float, force: Array) -> None:
    """Set the external force by linear interpolation."""
    last = load.shape[0] - 1
    sample = min(sample, last)
    following = min(sample + 1, last)
    for i in range(force.shape[0]):
        force[i] = (1.0 - s) * load[sample, i] + s * load[following, i]


@compile_lean_kernel
def set_deflections(
    columns: Index, values: Array, q: Array, qd: Array, base: Array, base_rate: Array, deflection: Array, rate: Array
) -> None:
    """Set ``x = G q - u`` and its rate for every component."""
    for c in range(deflection.shape[0]):
        x = -base[c]
        v = -base_rate[c]
        for k in range(columns.shape[1]):
            x += values[c, k] * q[columns[c, k]]
            v += values[c, k] * qd[columns[c, k]]
        deflection[c] = x
        rate[c] = v


@compile_lean_kernel
def set_accelerations(
    t_columns: Index,
    t_values: Array,
    k_columns: Index,
    k_values: Array,
    m_columns: Index,
    m_values: Array,
    q: Array,
    tension: Array,
    force: Array,
    qdd: Array,
) -> None:
    """Set ``qdd = M^-1 (force - G^T tension - K_g q)``; ``force`` holds the external force and is overwritten."""
    for i in range(force.shape[0]):
        total = force[i]
        for k in range(t_columns.shape[1]):
            total -= t_values[i, k] * tension[t_columns[i, k]]
        for k in range(k_columns.shape[1]):
            total -= k_values[i, k] * q[k_columns[i, k]]
        force[i] = total
    for i in range(qdd.shape[0]):
        a = 0.0
        for k in range(m_columns.shape[1]):
            a += m_values[i, k] * force[m_columns[i, k]]
        qdd[i] = a


@compile_kernel
def integrate(
    model: Structure,
    parameters: Array,
    states: Array,
    given: Input,
    out: Output,
    q: Array,
    qd: Array,
    sample_time: float,
    substeps: int,
) -> int:
    """Step through all samples; q, qd and the memories are advanced in place.

    Returns
    -------
    int
        Number of samples reached; smaller than N where the motion is no longer finite.
    """
    gc, gv, tc, tv, kc, kv, mc, mv, codes, channel = model
    displacement, velocity, load = given
    out_q, out_qd, out_qdd, out_x, out_v, out_tension = out
    size, components = q.shape[0], displacement.shape[1]
    h = sample_time / substeps
    # stage point and its acceleration, force, base; weighted sums of the slopes
    sq, sv, sa, force = q.copy(), qd.copy(), np.zeros(size), np.zeros(size)
    base, base_rate = np.zeros(components), np.zeros(components)
    x, v, tension = np.zeros(components), np.zeros(components), np.zeros(components)
    q_sum, v_sum = np.zeros(size), np.zeros(size)
    set_base(displacement, velocity, 0, 0.0, sample_time, base, base_rate)
    set_load(load, 0, 0.0, force)
    set_deflections(gc, gv, sq, sv, base, base_rate, x, v)
    network_commit(codes, parameters, states, channel, x, v, 0.0, tension)
    set_accelerations(tc, tv, kc, kv, mc, mv, sq, tension, force, sa)
    for sample in range(displacement.shape[0]):
        for i in range(size):
            out_q[sample, i], out_qd[sample, i], out_qdd[sample, i] = sq[i], sv[i], sa[i]
        for c in range(components):
            out_x[sample, c], out_v[sample, c], out_tension[sample, c] = x[c], v[c], tension[c]
        if not np.isfinite(sq.sum() + sv.sum()):
            return sample
        if sample == displacement.shape[0] - 1:
            break
        for sub in range(substeps):
            for stage in range(4):
                weight = h / 3.0 if stage in (1, 2) else h / 6.0
                reach = 0.5 * h if stage < 2 else h
                for i in range(size):
                    if stage == 0:
                        q_sum[i], v_sum[i] = q[i], qd[i]
                    q_sum[i] += weight * sv[i]
                    v_sum[i] += weight * sa[i]
                    if stage < 3:
                        sq[i], sv[i] = q[i] + reach * sv[i], qd[i] + reach * sa[i]
                    else:
                        q[i], qd[i], sq[i], sv[i] = q_sum[i], v_sum[i], q_sum[i], v_sum[i]
                share = (sub + reach / h) / substeps
                if stage in (0, 2):
                    set_base(displacement, velocity, sample, share, sample_time, base, base_rate)
                set_load(load, sample, share, force)
                set_deflections(gc, gv, sq, sv, base, base_rate, x, v)
                if stage < 3:
                    network_force(codes, parameters, states, channel, x, v, reach, tension)
                else:
                    network_commit(codes, parameters, states, channel, x, v, h, tension)
                set_accelerations(tc, tv, kc, kv, mc, mv, sq, tension, force, sa)
    return int(displacement.shape[0])
