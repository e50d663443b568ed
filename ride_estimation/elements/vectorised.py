# Copyright 2026 ride_estimation contributors
"""Whole-signal forces with numpy and scipy alone, for machines without the compiler: same results as the kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.kernels_memory import dahl_branch

Array = NDArray[np.float64]


def response(terms: tuple[kernel.Term, ...], x: Array, v: Array, h: float) -> Array:
    """Return the tension [N] of terms over a uniformly sampled signal, starting at rest at the first sample, shape (N,).

    Springs, Maxwell cells, Berg and Dahl friction are vectorised (friction branch by branch); other terms run through the
    sample-by-sample kernel.
    """
    force = np.zeros(x.size)
    for term in terms:
        p = term.parameters
        if term.code == kernel.ELASTIC:
            force += x * (p[0] + p[1] * x * x)
            if p[2] != 0.0:
                force += p[2] * v
        elif term.code == kernel.MAXWELL:
            force += _maxwell(x, h, p[0], p[1])
        elif term.code in (kernel.BERG_FRICTION, kernel.DAHL):
            force += _friction(term, x)
        else:
            codes, params = kernel.pack_terms([term])
            force += kernel.response(codes, params, x, v, h)
    return force


def reversals(x: Array, dead_band: float = 0.0) -> NDArray[np.intp]:
    """Return the indices of the turning points of a signal, in order.

    A reversal counts once the way back from the extreme is longer than the dead band; its index is that of the extreme.
    The first and the last sample are no reversals.
    """
    steps = np.diff(x)
    moving = np.flatnonzero(steps)
    if moving.size == 0:
        return np.zeros(0, dtype=np.intp)
    signs = np.sign(steps[moving])
    extremes = moving[:-1][signs[1:] != signs[:-1]] + 1
    if dead_band <= 0.0:
        return np.asarray(extremes, dtype=np.intp)
    found = []
    direction, extreme = 0.0, 0
    for k in (*extremes.tolist(), x.size - 1):
        way = x[k] - x[extreme]
        if direction == 0.0:
            if abs(x[k] - x[0]) > dead_band:
                direction, extreme = float(np.sign(x[k] - x[0])), k
        elif direction * way >= 0.0:
            extreme = k
        elif abs(way) > dead_band:
            found.append(extreme)
            direction, extreme = -direction, k
    return np.array(found, dtype=np.intp)


def _maxwell(x: Array, h: float, stiffness: float, corner: float) -> Array:
    from scipy.signal import lfilter  # takes a second to import, which a player of recordings need not wait for

    z = corner * h
    gain = stiffness * (-np.expm1(-z) / z if z > 1e-12 else 1.0)
    return np.asarray(lfilter([gain], [1.0, -np.exp(-z)], np.diff(x, prepend=x[:1])))


def _friction(term: kernel.Term, x: Array) -> Array:
    """Return the force of Berg or Dahl friction: turning points first, then every sample from the branch it is on."""
    berg = term.code == kernel.BERG_FRICTION
    limit, p, dead_band = term.parameters[0], term.parameters[1:], term.parameters[2 if berg else 3]
    if limit <= 0.0:
        return np.zeros(x.size)

    turns = reversals(x, dead_band)
    bounds = np.concatenate([[0], turns, [x.size]])
    start_x = x[bounds[:-1]]
    start_f = _turning_forces(berg, start_x, limit, p)
    counts = np.diff(bounds)
    branch_x, branch_f = np.repeat(start_x, counts), np.repeat(start_f, counts)
    force = _branch(berg, branch_x, branch_f, x, limit, p)
    if dead_band > 0.0:
        for k in range(start_x.size):
            part = slice(bounds[k], bounds[k + 1])
            back, extreme = _behind_extreme(x[part], dead_band)
            own_x, own_f = x[part], force[part].copy()
            force[part][back] = _branch(berg, own_x[extreme], own_f[extreme], own_x[back], limit, p)
    return force


def _turning_forces(berg: bool, turn_x: Array, limit: float, p: tuple[float, ...]) -> Array:
    """Return the force at the turning points, from one to the next; the only loop, over strokes instead of samples."""
    force = 0.0
    found = [force]
    for stroke in np.diff(turn_x).tolist():
        if not berg:
            force = dahl_branch(0.0, force, stroke, limit, p[0], p[1])
        elif stroke > 0.0:
            room = 1.0 - force / limit
            force += stroke * limit * room / (p[0] * room + stroke)
        elif stroke < 0.0:
            room = 1.0 + force / limit
            force += stroke * limit * room / (p[0] * room - stroke)
        found.append(force)
    return np.array(found)


def _behind_extreme(x: Array, quiet: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the samples of a stroke that lie behind its running extreme, and the index of that extreme for each.

    The stroke runs from its first sample to its farthest one; until it has left ``quiet`` around the first there is no extreme.
    """
    away = np.abs(x - x[0])
    started = np.flatnonzero(away > quiet)
    if started.size == 0:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    first = int(started[0])
    along = np.sign(x[first] - x[0]) * x[first:]
    running = np.maximum.accumulate(along)
    index = np.maximum.accumulate(np.where(along >= running, np.arange(along.size), 0))
    back = np.flatnonzero(along < running)
    return back + first, index[back] + first


def _branch(berg: bool, start_x: Array, start_f: Array, x: Array, limit: float, p: tuple[float, ...]) -> Array:
    d = x - start_x
    sign = np.sign(d)
    room = np.maximum(1.0 - sign * start_f / limit, 0.0)
    d = np.abs(d)
    if berg:
        reach = p[0] * room + d
        return np.asarray(start_f + sign * limit * room * np.divide(d, reach, out=np.zeros_like(d), where=reach > 0.0))
    stroke = p[0] * d / limit
    if p[1] == 1.0:
        return np.asarray(start_f - sign * limit * room * np.expm1(-stroke))
    base = np.where(room > 0.0, np.power(np.where(room > 0.0, room, 1.0), 1.0 - p[1]) + (p[1] - 1.0) * stroke, 1.0)
    left = np.power(np.where(base > 0.0, base, 1.0), 1.0 / (1.0 - p[1])) * (base > 0.0)
    return np.asarray(np.where((room > 0.0) & (d > 0.0), sign * limit * (1.0 - left), start_f))
