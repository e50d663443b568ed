# Copyright 2026 ride_estimation contributors
"""The primitives every force element is a sum of, and the one compiled kernel that evaluates them.

Sign as everywhere: deflection x and tension F positive in extension. ``force_at`` is pure; ``commit_at`` updates the
memory in place and returns the force of the accepted point, so a fixed-step integrator may use the commit alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements import kernels_curve as curve
from ride_estimation.elements import kernels_filter as filters
from ride_estimation.elements import kernels_hysteresis as hysteresis
from ride_estimation.elements import kernels_memory as memory
from ride_estimation.elements import kernels_network as network
from ride_estimation.elements import kernels_signal as signal
from ride_estimation.elements import kernels_static as static
from ride_estimation.jit import compile_lean_kernel, inline_kernel

Array = NDArray[np.float64]
Codes = NDArray[np.int64]

#: least number of parameter columns of packed terms; terms with tables need more, see :func:`pack_terms`
PARAMETER_COUNT = 8
#: floats of memory per term; the first two are the committed deflection and rate
STATE_SIZE = 12

# Codes and their parameters, SI.
ELASTIC = 0  #: k, k3, c: ``k x + k3 x^3 + c v``
MAXWELL = 1  #: k, Omega = k / c: ``m' = -Omega m + k v``
BERG_FRICTION = 2  #: f_max, x_2, dead band
DAHL = 3  #: f_c, sigma, exponent, dead band
CONTACT = 4  #: side, gap, half width of the entry, k, k3, c
CONTACT_MAXWELL = 5  #: side, contact point, half width, k, Omega; pushes only, forgets when it leaves contact
POWER_SPRING = 6  #: k, x_ref, exponent, rounding: ``k x_ref sign(x) |x / x_ref|^n``
POWER_DAMPER = 7  #: c, v_ref, exponent, rounding: ``c v_ref sign(v) |v / v_ref|^n``
ASYMMETRIC_DAMPER = 8  #: c in extension (v > 0), c in compression (v < 0)
STRIBECK = 9  #: kinetic force, static force, Stribeck speed, rounding speed
CURVE_SPRING = 10  #: side, offset, points, curve: ``side f(side x - offset)``
CURVE_DAMPER = 11  #: points, curve: ``f(v)``
WEIGHTED_DAHL = 12  #: columns of :mod:`kernels_curve`
RATE_FILTER = 13  #: a_1, a_0, c_1, c_0, d: filter of the rate, :mod:`kernels_filter`
LOCAL_LINEAR = 14  #: columns of :mod:`kernels_network`
BOUC_WEN = 15  #: f, k, exponent, share of the unloading slope, dead band
RETURN_POINT = 16  #: f_max, x_2, dead band

#: terms whose force depends on the momentary rate whatever their parameters
_RATE_CODES = frozenset({POWER_DAMPER, ASYMMETRIC_DAMPER, STRIBECK, CURVE_DAMPER, LOCAL_LINEAR})

# Memory slots that terms with their own input use instead of the deflection.
_FRICTION_TURN_X = 3
_FRICTION_EXTREME_X = 5


class Term(NamedTuple):
    """One primitive: its code and its parameters in the order given beside the code."""

    code: int
    parameters: tuple[float, ...]


def needs_rate(terms: Iterable[Term]) -> bool:
    """Return whether the force of any of the terms depends on the momentary rate v."""
    damping_column = {ELASTIC: 2, CONTACT: 5, RATE_FILTER: filters.D}
    return any(
        t.code in _RATE_CODES or (t.code in damping_column and t.parameters[damping_column[t.code]] != 0.0) for t in terms
    )


def pack_terms(terms: Iterable[Term]) -> tuple[Codes, Array]:
    """Return codes, shape (T,), and parameters, shape (T, P), padded with zeros; P is at least ``PARAMETER_COUNT``."""
    listed = tuple(terms)
    width = max([PARAMETER_COUNT, *(len(t.parameters) for t in listed)])
    codes = np.array([t.code for t in listed], dtype=np.int64)
    params = np.zeros((len(listed), width))
    for i, term in enumerate(listed):
        params[i, : len(term.parameters)] = term.parameters
    return codes, params


def initial_states(codes: Codes, params: Array, x0: float = 0.0) -> Array:
    """Return the memories of terms that rest, without stored force, at the deflection x0 [m].

    Shape (T, S) with S at least ``STATE_SIZE``; networks of many local models and stacks of turning points need more.
    """
    networks = params[codes == LOCAL_LINEAR, network.MODELS] if len(codes) else np.zeros(0)
    stacks = [hysteresis.RETURN_POINT_STATE] if np.any(codes == RETURN_POINT) else []
    width = max([STATE_SIZE, *stacks, *(network.FIRST_STATE + int(m) for m in networks)])
    states = np.zeros((len(codes), width))
    for i in range(len(codes)):
        rest_at(int(codes[i]), params, states, i, x0)
    return states


@inline_kernel
def rest_at(code: int, params: Array, states: Array, i: int, x0: float) -> None:
    """Set the memory of term i to rest at the deflection x0."""
    for j in range(states.shape[1]):
        states[i, j] = 0.0
    states[i, 0] = x0
    if code == CONTACT_MAXWELL:
        states[i, 0] = static.penetration(x0, params[i, 0], params[i, 1], params[i, 2])
    elif code == WEIGHTED_DAHL:
        states[i, 0] = params[i, curve.SIDE] * x0 - params[i, curve.OFFSET]
        states[i, _FRICTION_TURN_X] = states[i, 0]
        states[i, _FRICTION_EXTREME_X] = states[i, 0]
    elif code == LOCAL_LINEAR:
        network.network_rest(params, states, i, x0)
    elif code in (BERG_FRICTION, DAHL, BOUC_WEN, RETURN_POINT):
        states[i, _FRICTION_TURN_X] = x0
        states[i, _FRICTION_EXTREME_X] = x0


@inline_kernel
def _memoryless(code: int, p: Array, i: int, x: float, v: float) -> float:
    """Return the tension [N] of a term that needs no memory."""
    if code == CONTACT:
        return static.contact_force(x, v, p[i, 0], p[i, 1], p[i, 2], p[i, 3], p[i, 4], p[i, 5])
    if code == POWER_SPRING:
        return float(p[i, 0] * static.signed_power(x, p[i, 1], p[i, 2], p[i, 3]))
    if code == POWER_DAMPER:
        return float(p[i, 0] * static.signed_power(v, p[i, 1], p[i, 2], p[i, 3]))
    if code == ASYMMETRIC_DAMPER:
        return float(p[i, 0] * v if v > 0.0 else p[i, 1] * v)
    if code == STRIBECK:
        return static.stribeck_force(v, p[i, 0], p[i, 1], p[i, 2], p[i, 3])
    if code == CURVE_SPRING:
        return float(p[i, 0] * curve.curve_value(p, i, 3, int(p[i, 2]), p[i, 0] * x - p[i, 1]))
    if code == CURVE_DAMPER:
        return curve.curve_value(p, i, 1, int(p[i, 0]), v)
    return np.nan


@inline_kernel
def force_at(code: int, p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Return the tension [N] of term i at the deflection x [m] and rate v [m/s], a time h [s] after its memory."""
    if code == ELASTIC:
        return float(x * (p[i, 0] + p[i, 1] * x * x) + p[i, 2] * v)
    if code == MAXWELL:
        return memory.maxwell_trial(s, i, x, h, p[i, 0], p[i, 1])
    if code == BERG_FRICTION:
        return memory.berg_trial(s, i, x, p[i, 0], p[i, 1])
    if code == DAHL:
        return memory.dahl_trial(s, i, x, p[i, 0], p[i, 1], p[i, 2])
    if code == CONTACT_MAXWELL:
        u = static.penetration(x, p[i, 0], p[i, 1], p[i, 2])
        if u <= 0.0:
            return 0.0
        return float(p[i, 0] * max(memory.maxwell_trial(s, i, u, h, p[i, 3], p[i, 4]), 0.0))
    if code == WEIGHTED_DAHL:
        return curve.weighted_dahl_trial(p, s, i, x)
    if code == RATE_FILTER:
        return filters.filter_trial(p, s, i, x, v, h)
    if code == LOCAL_LINEAR:
        return network.network_trial(p, s, i, x, v, h)
    if code == BOUC_WEN:
        return hysteresis.bouc_wen_trial(s, i, x, p[i, 0], p[i, 1], p[i, 2], p[i, 3])
    if code == RETURN_POINT:
        return hysteresis.return_point_trial(s, i, x, p[i, 0], p[i, 1])
    return _memoryless(code, p, i, x, v)


@inline_kernel
def commit_at(code: int, p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Accept the point (x, v) a time h [s] after the memory of term i: update it in place and return the tension [N]."""
    if code == ELASTIC:
        s[i, 0] = x
        s[i, 1] = v
        return float(x * (p[i, 0] + p[i, 1] * x * x) + p[i, 2] * v)
    if code == MAXWELL:
        return memory.maxwell_commit(s, i, x, v, h, p[i, 0], p[i, 1])
    if code == BERG_FRICTION:
        return memory.berg_commit(s, i, x, v, p[i, 0], p[i, 1], p[i, 2])
    if code == DAHL:
        return memory.dahl_commit(s, i, x, v, p[i, 0], p[i, 1], p[i, 2], p[i, 3])
    if code == CONTACT_MAXWELL:
        u = static.penetration(x, p[i, 0], p[i, 1], p[i, 2])
        if u <= 0.0:
            rest_at(code, p, s, i, x)
            return 0.0
        return float(p[i, 0] * max(memory.maxwell_commit(s, i, u, v, h, p[i, 3], p[i, 4]), 0.0))
    if code == WEIGHTED_DAHL:
        return curve.weighted_dahl_commit(p, s, i, x, v)
    if code == RATE_FILTER:
        return filters.filter_commit(p, s, i, x, v, h)
    if code == LOCAL_LINEAR:
        return network.network_commit(p, s, i, x, v, h)
    if code == BOUC_WEN:
        return hysteresis.bouc_wen_commit(s, i, x, v, p[i, 0], p[i, 1], p[i, 2], p[i, 3], p[i, 4])
    if code == RETURN_POINT:
        return hysteresis.return_point_commit(s, i, x, v, p[i, 0], p[i, 1], p[i, 2])
    s[i, 0] = x
    s[i, 1] = v
    return _memoryless(code, p, i, x, v)


@compile_lean_kernel
def terms_force(codes: Codes, params: Array, states: Array, x: float, v: float, h: float) -> float:
    """Return the summed tension [N] of terms at one deflection; changes nothing."""
    total = 0.0
    for i in range(codes.shape[0]):
        total += force_at(codes[i], params, states, i, x, v, h)
    return total


@compile_lean_kernel
def terms_commit(codes: Codes, params: Array, states: Array, x: float, v: float, h: float) -> float:
    """Accept one deflection for all terms: update their memories in place and return the summed tension [N]."""
    total = 0.0
    for i in range(codes.shape[0]):
        total += commit_at(codes[i], params, states, i, x, v, h)
    return total


@compile_lean_kernel
def network_force(
    codes: Codes, params: Array, states: Array, channel: Codes, x: Array, v: Array, h: float, force: Array
) -> None:
    """Write the tension of every channel into ``force``, shape (C,); term i acts on ``x[channel[i]]``. Changes no memory."""
    force[:] = 0.0
    for i in range(codes.shape[0]):
        c = channel[i]
        force[c] += force_at(codes[i], params, states, i, x[c], v[c], h)


@compile_lean_kernel
def network_commit(
    codes: Codes, params: Array, states: Array, channel: Codes, x: Array, v: Array, h: float, force: Array
) -> None:
    """Accept the deflections of all channels: update every memory and write the tensions into ``force``, shape (C,)."""
    force[:] = 0.0
    for i in range(codes.shape[0]):
        c = channel[i]
        force[c] += commit_at(codes[i], params, states, i, x[c], v[c], h)


@compile_lean_kernel
def _continue(codes: Codes, params: Array, states: Array, x: Array, v: Array, h: float, force: Array) -> None:
    """Add the tension over a signal whose first sample is a step h after the memory."""
    if x.shape[0] == 0:
        return
    for t in range(codes.shape[0]):
        if codes[t] == ELASTIC:
            signal.elastic_signal(states, t, x, v, params[t, 0], params[t, 1], params[t, 2], force)
        elif codes[t] == MAXWELL:
            signal.maxwell_signal(states, t, x, v, h, params[t, 0], params[t, 1], force)
        elif codes[t] == BERG_FRICTION:
            signal.berg_signal(states, t, x, v, params[t, 0], params[t, 1], params[t, 2], force)
        else:
            for i in range(x.shape[0]):
                force[i] += commit_at(codes[t], params, states, t, x[i], v[i], h)


def continued(codes: Codes, params: Array, states: Array, x: Array, v: Array, h: float) -> Array:
    """Return the tension [N] over a signal that follows what ``states`` has seen; ``states`` is advanced. Shape (N,)."""
    force = np.zeros(len(x))
    _continue(codes, params, states, np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(v, dtype=float), h, force)
    return force


def response(codes: Codes, params: Array, x: Array, v: Array, h: float, states: Array | None = None) -> Array:
    """Return the tension [N] of terms over a uniformly sampled signal.

    Parameters
    ----------
    codes, params
        From :func:`pack_terms`.
    x, v
        Deflection [m] and rate [m/s], shape (N,).
    h
        Step [s].
    states
        Memories to start from, advanced in place; at rest at ``x[0]`` where None.

    Returns
    -------
    Array
        Shape (N,).
    """
    if states is None:
        states = initial_states(codes, params, float(x[0]) if x.size else 0.0)
    if x.size == 0:
        return np.zeros(0)
    # the first sample sets the memory without time passing
    first = terms_commit(codes, params, states, float(x[0]), float(v[0]), 0.0)
    return np.concatenate([[first], continued(codes, params, states, x[1:], v[1:], h)])
