# Copyright 2026 ride_estimation contributors
"""Compiled time stepping of the equations of motion with small rotations: classical Runge-Kutta of order four.

Elements with memory are evaluated on trial points between the committed samples (``force_at``) and committed once per
step (``commit_at``), so reversals and contacts are seen only on accepted points. The base moves on cubic Hermite
splines through its samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.terms import commit_at, force_at
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Structure(NamedTuple):
    """The constant part of a model in compressed rows. Q coordinates, C components, T terms.

    Attributes
    ----------
    g_start, g_column, g_value
        Rows of the deflection map.
    m_start, m_column, m_value
        Rows of the inverse mass matrix.
    k_start, k_column, k_value
        Rows of the geometric stiffness.
    term_start
        First term of each component, shape (C + 1,).
    codes
        Term codes, shape (T,).
    """

    g_start: Index
    g_column: Index
    g_value: Array
    m_start: Index
    m_column: Index
    m_value: Array
    k_start: Index
    k_column: Index
    k_value: Array
    term_start: Index
    codes: Index


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


class Work(NamedTuple):
    """Scratch of one run: stage coordinates, rates, accelerations (Q), forces (Q), base (C), deflections, tensions (C)."""

    q: Array
    qd: Array
    qdd: Array
    force: Array
    base: Array
    base_rate: Array
    deflection: Array
    rate: Array
    tension: Array


def make_work(coordinates: int, components: int) -> Work:
    """Return scratch for Q coordinates and C components."""
    q = [np.zeros(coordinates) for _ in range(4)]
    c = [np.zeros(components) for _ in range(5)]
    return Work(*q, *c)


@compile_kernel
def set_base(given: Input, work: Work, sample: int, fraction: float, sample_time: float) -> None:
    """Set base displacement and velocity a fraction of a sample after ``sample`` by the cubic Hermite spline."""
    last = given.displacement.shape[0] - 1
    following = min(sample + 1, last)
    s = fraction
    h00 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
    h10 = s * (1.0 - s) * (1.0 - s) * sample_time
    h01 = s * s * (3.0 - 2.0 * s)
    h11 = s * s * (s - 1.0) * sample_time
    d00 = 6.0 * s * (s - 1.0) / sample_time
    d10 = (1.0 - s) * (1.0 - 3.0 * s)
    d11 = s * (3.0 * s - 2.0)
    for c in range(work.base.shape[0]):
        u0 = given.displacement[sample, c]
        u1 = given.displacement[following, c]
        v0 = given.velocity[sample, c]
        v1 = given.velocity[following, c]
        work.base[c] = h00 * u0 + h10 * v0 + h01 * u1 + h11 * v1
        work.base_rate[c] = d00 * (u0 - u1) + d10 * v0 + d11 * v1


@compile_kernel
def set_load(given: Input, work: Work, sample: int, fraction: float) -> None:
    """Set the external force by linear interpolation."""
    if given.load.shape[0] == 1:
        for i in range(work.force.shape[0]):
            work.force[i] = given.load[0, i]
        return
    following = min(sample + 1, given.load.shape[0] - 1)
    for i in range(work.force.shape[0]):
        work.force[i] = (1.0 - fraction) * given.load[sample, i] + fraction * given.load[following, i]


@compile_kernel
def set_acceleration(
    model: Structure, parameters: Array, states: Array, work: Work, h: float, commit: bool
) -> None:
    """Set deflections, tensions and accelerations of the stage in ``work``; ``work.force`` holds the external force."""
    for c in range(model.term_start.shape[0] - 1):
        x = -work.base[c]
        v = -work.base_rate[c]
        for k in range(model.g_start[c], model.g_start[c + 1]):
            x += model.g_value[k] * work.q[model.g_column[k]]
            v += model.g_value[k] * work.qd[model.g_column[k]]
        tension = 0.0
        for t in range(model.term_start[c], model.term_start[c + 1]):
            if commit:
                tension += commit_at(model.codes, parameters, states, t, x, v, h)
            else:
                tension += force_at(model.codes, parameters, states, t, x, v, h)
        work.deflection[c] = x
        work.rate[c] = v
        work.tension[c] = tension
        for k in range(model.g_start[c], model.g_start[c + 1]):
            work.force[model.g_column[k]] -= model.g_value[k] * tension
    for i in range(work.force.shape[0]):
        for k in range(model.k_start[i], model.k_start[i + 1]):
            work.force[i] -= model.k_value[k] * work.q[model.k_column[k]]
    for i in range(work.qdd.shape[0]):
        a = 0.0
        for k in range(model.m_start[i], model.m_start[i + 1]):
            a += model.m_value[k] * work.force[model.m_column[k]]
        work.qdd[i] = a


@compile_kernel
def record(out: Output, work: Work, sample: int) -> None:
    """Copy the stage in ``work`` to the output."""
    for i in range(work.q.shape[0]):
        out.q[sample, i] = work.q[i]
        out.qd[sample, i] = work.qd[i]
        out.qdd[sample, i] = work.qdd[i]
    for c in range(work.tension.shape[0]):
        out.deflection[sample, c] = work.deflection[c]
        out.rate[sample, c] = work.rate[c]
        out.tension[sample, c] = work.tension[c]


@compile_kernel
def integrate(
    model: Structure,
    parameters: Array,
    states: Array,
    given: Input,
    work: Work,
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
    size = q.shape[0]
    h = sample_time / substeps
    q_sum = np.zeros(size)
    v_sum = np.zeros(size)
    for i in range(size):
        work.q[i] = q[i]
        work.qd[i] = qd[i]
    set_base(given, work, 0, 0.0, sample_time)
    set_load(given, work, 0, 0.0)
    set_acceleration(model, parameters, states, work, 0.0, True)
    record(out, work, 0)
    for sample in range(given.displacement.shape[0] - 1):
        for sub in range(substeps):
            for stage in range(4):
                weight = h / 3.0 if stage in (1, 2) else h / 6.0
                reach = 0.5 * h if stage < 2 else h
                for i in range(size):
                    if stage == 0:
                        q_sum[i] = q[i]
                        v_sum[i] = qd[i]
                    q_sum[i] += weight * work.qd[i]
                    v_sum[i] += weight * work.qdd[i]
                    # the next stage, or after the fourth slope the accepted point
                    next_rate = qd[i] + reach * work.qdd[i] if stage < 3 else v_sum[i]
                    work.q[i] = q[i] + reach * work.qd[i] if stage < 3 else q_sum[i]
                    work.qd[i] = next_rate
                    if stage == 3:
                        q[i] = q_sum[i]
                        qd[i] = v_sum[i]
                fraction = (sub + reach / h) / substeps
                if stage in (0, 2):
                    set_base(given, work, sample, fraction, sample_time)
                set_load(given, work, sample, fraction)
                set_acceleration(model, parameters, states, work, reach, stage == 3)
        record(out, work, sample + 1)
        if not np.isfinite(q.sum() + qd.sum()):
            return sample + 1
    return given.displacement.shape[0]
