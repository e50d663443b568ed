# Copyright 2026 ride_estimation contributors
"""Compiled loops of the parameter estimators: one common high-pass for all signals, and the response to a wrong parameter.

All signals of the force balance pass the same high-pass ``h(s) = (s / (s + w))^6`` (a linear model commutes with it), so bias,
slow tilt and integration drift vanish. Relative acceleration passes ``h / s^2`` and ``h / s`` instead and becomes deflection and
rate; what gravity adds to the horizontal axes through a tilt that is itself such a deflection passes ``h / s^4``. Sections are
discretised by the trapezoidal rule; its loss, ``(omega dt)^2 / 6`` of a deflection and ``/ 12`` of a rate, is put back, which
leaves an error of fourth order in a deflection.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import COMPILED, compile_kernel, compile_lean_kernel

Array = NDArray[np.float64]


@compile_kernel
def high_pass_block(signals: Array, corner: float, dt: float, state: Array, out: Array) -> None:
    """Apply as many sections ``s / (s + w)`` as the state has rows but one to every column.

    Parameters
    ----------
    signals
        Shape (K, N).
    corner
        w [rad/s].
    state
        Last input and last output of every section, shape (1 + sections, N), in place.
    out
        Shape (K, N).
    """
    pole = (1.0 - 0.5 * corner * dt) / (1.0 + 0.5 * corner * dt)
    gain = 1.0 / (1.0 + 0.5 * corner * dt)
    for k in range(signals.shape[0]):
        for n in range(signals.shape[1]):
            new = signals[k, n]
            old = state[0, n]
            state[0, n] = new
            for s in range(1, state.shape[0]):
                value = pole * state[s, n] + gain * (new - old)
                old = state[s, n]
                state[s, n] = value
                new = value
            out[k, n] = new


@compile_kernel
def low_pass_block(signals: Array, corner: float, dt: float, state: Array, out: Array) -> None:
    """Apply ``1 / (s + w)`` twice to every column; ``state`` (3, N) as for :func:`high_pass_block`."""
    pole = (1.0 - 0.5 * corner * dt) / (1.0 + 0.5 * corner * dt)
    low = 0.5 * dt / (1.0 + 0.5 * corner * dt)
    for k in range(signals.shape[0]):
        for n in range(signals.shape[1]):
            first = pole * state[1, n] + low * (signals[k, n] + state[0, n])
            second = pole * state[2, n] + low * (first + state[1, n])
            state[0, n], state[1, n], state[2, n] = signals[k, n], first, second
            out[k, n] = second


@compile_kernel
def integrate_block(relative: Array, corner: float, dt: float, state: Array, deflection: Array, rate: Array) -> None:
    """Turn relative acceleration into deflection and rate with four sections, ``s^2 / (s + w)^4`` and ``s^3 / (s + w)^4``.

    Parameters
    ----------
    relative
        Shape (K, N) [m/s^2].
    corner
        w [rad/s].
    state
        (9, N), in place: last input, two low-pass states, two high-pass states each of deflection, rate and acceleration.
    deflection, rate
        Outputs, shape (K, N).
    """
    pole = (1.0 - 0.5 * corner * dt) / (1.0 + 0.5 * corner * dt)
    low = 0.5 * dt / (1.0 + 0.5 * corner * dt)
    gain = 1.0 / (1.0 + 0.5 * corner * dt)
    for k in range(relative.shape[0]):
        for n in range(relative.shape[1]):
            u = relative[k, n]
            u_old, a1_old, a2_old = state[0, n], state[1, n], state[2, n]
            a1 = pole * a1_old + low * (u + u_old)
            a2 = pole * a2_old + low * (a1 + a1_old)
            # s / (s + w) of each: value, first and second derivative after two sections
            b_new, b_old = a1 - corner * a2, a1_old - corner * a2_old
            c_new, c_old = u - corner * a1 - corner * b_new, u_old - corner * a1_old - corner * b_old
            d1 = pole * state[3, n] + gain * (a2 - a2_old)
            d2 = pole * state[4, n] + gain * (d1 - state[3, n])
            v1 = pole * state[5, n] + gain * (b_new - b_old)
            v2 = pole * state[6, n] + gain * (v1 - state[5, n])
            w1 = pole * state[7, n] + gain * (c_new - c_old)
            w2 = pole * state[8, n] + gain * (w1 - state[7, n])
            deflection[k, n] = d2 - dt * dt / 6.0 * w2
            rate[k, n] = v2 - dt / 12.0 * (w2 - state[8, n])
            state[0, n], state[1, n], state[2, n] = u, a1, a2
            state[3, n], state[4, n], state[5, n], state[6, n], state[7, n], state[8, n] = d1, d2, v1, v2, w1, w2


@compile_lean_kernel
def _copy(out: Array, rows: Array) -> None:
    """Write rows (I, N); assigning to a slice compiles the words of its error message, for seconds."""
    for i in range(rows.shape[0]):
        for n in range(rows.shape[1]):
            out[i, n] = rows[i, n]


def _by_numpy(out: Array, factors: Array, rows: Array, sign: float) -> None:
    out += sign * (factors @ rows)


def _by_loops(out: Array, factors: Array, rows: Array, sign: float) -> None:
    for i in range(out.shape[0]):
        for j in range(factors.shape[1]):
            factor = sign * factors[i, j]
            for n in range(out.shape[1]):
                out[i, n] += factor * rows[j, n]


#: adds ``sign factors @ rows`` to ``out``, shapes (I, N), (I, J), (J, N); matrix products take seconds to compile and are no
#: faster for matrices this small, loops in plain Python are thirty times as slow
_add_product = compile_lean_kernel(_by_loops) if COMPILED else _by_numpy


@compile_kernel
def response_block(
    residual: Array, columns: Array, elastic: Array, viscous: Array, transition: Array, hold_old: Array, hold_new: Array,
    feedback: Array, gain: Array, direction: Array, state: Array, last: Array, innovation: Array, gradient: Array,
) -> None:  # fmt: skip
    """Let the model respond to its own error: innovations of the simulated body and their gradients.

    With e the displacement of the simulated body from the measured one, ``e'' = a - S z`` (z = [e, e'], S the feedback of mounts
    and gravity), a the residual of the balance with measured deflections. The innovation is ``-(a - S_m z)`` with the mount part
    of S; a column of the gradient obeys the same equation with the force the parameter scales as input.

    Parameters
    ----------
    residual
        Modelled minus measured acceleration with measured deflections, shape (K, 6).
    columns
        Acceleration per unit logarithm of every parameter with measured deflections, shape (K, 6, N).
    elastic, viscous
        (N, 6): what e and e' add to the scaled force of a parameter, along its own direction.
    transition, hold_old, hold_new
        Exact discrete response with linear hold, (12, 12), (12, 6), (12, 6).
    feedback
        S_m, shape (6, 12).
    gain
        Kalman gain of z for the innovation, (12, 6): it keeps the simulated body from gathering the noise of the base sensors.
    direction
        (6, N): the acceleration a unit of a parameter's force causes.
    state
        (12, 1 + N), in place: z of the residual and of every column.
    last
        (12, 1 + N), in place: last inputs, last outputs.
    innovation, gradient
        Outputs (K, 6) and (K, 6, N).
    """
    count = columns.shape[2]
    inputs, old_inputs, output = np.zeros((6, 1 + count)), np.empty((6, 1 + count)), np.empty((6, 1 + count))
    free, e = np.empty((12, 1 + count)), np.empty(12)
    _copy(old_inputs, last[:6])
    _copy(output, last[6:])
    for k in range(residual.shape[0]):
        for i in range(12):
            for n in range(1 + count):
                free[i, n] = 0.0
        _add_product(free, transition, state, 1.0)
        _add_product(free, hold_old, old_inputs, 1.0)
        _add_product(free, gain, output, -1.0)
        # e at this tick follows from the residual alone; the columns need it first
        for r in range(6):
            inputs[r, 0] = residual[k, r]
        for i in range(12):
            e[i] = free[i, 0]
            for r in range(6):
                e[i] += hold_new[i, r] * residual[k, r]
        for n in range(count):
            extra = 0.0
            for r in range(6):
                extra += elastic[n, r] * e[r] + viscous[n, r] * e[6 + r]
            for r in range(6):
                inputs[r, 1 + n] = columns[k, r, n] + direction[r, n] * extra
        _copy(state, free)
        _add_product(state, hold_new, inputs, 1.0)
        _copy(output, inputs)
        _copy(old_inputs, inputs)
        _add_product(output, feedback, state, -1.0)
        for r in range(6):
            innovation[k, r] = -output[r, 0]
            for n in range(count):
                gradient[k, r, n] = output[r, 1 + n]
    _copy(last[:6], old_inputs)
    _copy(last[6:], output)
