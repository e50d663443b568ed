# Copyright 2026 ride_estimation contributors
"""Compiled loops over the ticks of a block: the deflection of the mounts.

The filter of :mod:`~ride_estimation.estimation.motion.motion_kernel` per mount and axis. What it is fed back of its own states
(rotation against the brackets, products of rates) is bounded, so that no input drives it away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.motion.motion_kernel import advance_covariance
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]

#: largest rotation of the body against a bracket that is believed [rad]
_LARGEST_TURN = 0.3
#: shortest time in which a mount goes through its largest travel [s]: 100 m/s at a metre, beyond any drop of a vehicle
SHORTEST_TRAVEL = 0.01


@compile_kernel
def advance_with_lag(
    p: Array, dt: float, accel_variance: float, bias_density: float, value_variance: float, lag: float, gain: Array
) -> None:
    """As :func:`advance_covariance` for a measurement of ``value + lag * rate``.

    Parameters
    ----------
    lag
        Damping over stiffness of a mount [s]: its force over its stiffness is that sum.
    """
    gain[0], gain[1], gain[2] = 0.0, 0.0, 0.0
    advance_covariance(p, dt, accel_variance, bias_density, np.inf, gain)
    c0, c1, c2 = p[0, 0] + lag * p[0, 1], p[1, 0] + lag * p[1, 1], p[2, 0] + lag * p[2, 1]
    s = c0 + lag * c1 + value_variance
    gain[0], gain[1], gain[2] = c0 / s, c1 / s, c2 / s
    p[0, 0] -= gain[0] * c0
    p[0, 1] -= gain[0] * c1
    p[0, 2] -= gain[0] * c2
    p[1, 1] -= gain[1] * c1
    p[1, 2] -= gain[1] * c2
    p[2, 2] -= gain[2] * c2
    p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]


@compile_kernel
def come_to_rest(state: Array, p: Array, left: float, square: float, rate_ratio: float) -> None:
    """Let value and rate go on where nothing measures them: a damped motion comes to rest, what was known of it is lost.

    Integrated, the rate of the last moment would carry a mount out of its travel within a second.

    Parameters
    ----------
    state
        Value, rate, bias, last acceleration, shape (4,), in place; the bias stays.
    p
        Covariance of value, rate and bias, in place.
    left
        Share of the motion that is left after the tick.
    square, rate_ratio
        Mean squared value of a motion that nothing is known of, and its rate over its value [1/s].
    """
    state[0] *= left
    state[1] *= left
    state[3] = state[2]
    lost = 1.0 - left * left
    p[0, 0] = left * left * p[0, 0] + lost * square
    p[1, 1] = left * left * p[1, 1] + lost * square * rate_ratio * rate_ratio
    p[0, 1] *= left * left
    p[0, 2] *= left
    p[1, 2] *= left
    p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]


@compile_kernel
def _turn_against_brackets(state: Array, dt: float, tilt_maps: Array, frame_turn: Array, turn: Array) -> None:
    """Write the rotation of the body against every bracket at the next tick (M, 3), from where the deflections go."""
    mounts = tilt_maps.shape[0]
    for i in range(mounts):
        for a in range(3):
            total = frame_turn[a]
            for j in range(mounts):
                for b in range(3):
                    total += tilt_maps[i, a, 3 * j + b] * (state[0, j, b] + dt * state[1, j, b])
            # a faulty sensor must not turn the cab over: beyond this the tilt would feed itself
            turn[i, a] = min(max(total, -_LARGEST_TURN), _LARGEST_TURN)


@compile_kernel
def _relative_acceleration(
    motion: Array, rate: Array, arm: Array, theta: Array, base: Array, deflection: Array, speed: Array, u: Array
) -> None:
    """Write ``D''`` of one mount at one tick (3,); see :func:`deflection_block`."""
    w0, w1, w2 = rate[0], rate[1], rate[2]
    ww = w0 * w0 + w1 * w1 + w2 * w2
    r0, r1, r2 = arm[0], arm[1], arm[2]
    wr = w0 * r0 + w1 * r1 + w2 * r2
    a3, a4, a5 = motion[3], motion[4], motion[5]
    u[0] = motion[0] + a4 * r2 - a5 * r1 + w0 * wr - ww * r0
    u[1] = motion[1] + a5 * r0 - a3 * r2 + w1 * wr - ww * r1
    u[2] = motion[2] + a3 * r1 - a4 * r0 + w2 * wr - ww * r2
    # R f = f - theta x f + theta x (theta x f) / 2
    c0 = theta[1] * base[2] - theta[2] * base[1]
    c1 = theta[2] * base[0] - theta[0] * base[2]
    c2 = theta[0] * base[1] - theta[1] * base[0]
    u[0] -= base[0] - c0 + 0.5 * (theta[1] * c2 - theta[2] * c1)
    u[1] -= base[1] - c1 + 0.5 * (theta[2] * c0 - theta[0] * c2)
    u[2] -= base[2] - c2 + 0.5 * (theta[0] * c1 - theta[1] * c0)
    # V' = u - omega x V, D' = V - omega x D; carried as D'' with the rate of D
    d0, d1, d2 = deflection[0], deflection[1], deflection[2]
    v0, v1, v2 = speed[0], speed[1], speed[2]
    wd = w0 * d0 + w1 * d1 + w2 * d2
    u[0] -= 2.0 * (w1 * v2 - w2 * v1) + a4 * d2 - a5 * d1 + w0 * wd - ww * d0
    u[1] -= 2.0 * (w2 * v0 - w0 * v2) + a5 * d0 - a3 * d2 + w1 * wd - ww * d1
    u[2] -= 2.0 * (w0 * v1 - w1 * v0) + a3 * d1 - a4 * d0 + w2 * wd - ww * d2


@compile_kernel
def deflection_block(
    motion: Array, rate: Array, body_ok: NDArray[np.bool_], base: Array, base_ok: NDArray[np.bool_], arms: Array,
    tilt_maps: Array, frame_turn: Array, gravity: float, dt: float, state: Array, p: Array, noise: Array, displaced: Array,
    displaced_ok: NDArray[np.bool_],
    displaced_variance: Array, drawn: Array, lag: Array, travel: float, rests: float, rate_ratio: float,
    deflection: Array, speed: Array, relative: Array, turn: Array,
) -> None:  # fmt: skip
    """Integrate the relative acceleration of body and base at every mount, cab axes.

    ``D'' = f + alpha x r + omega x (omega x r) - R f_base`` with R the rotation from bracket to cab axes (gravity cancels
    but for R), and ``D' = V - omega x D``.

    Parameters
    ----------
    motion, rate
        CG specific force and angular acceleration (K, 6), angular rate (K, 3).
    body_ok
        Whether the motion of the body is known, shape (K,); where it is not, mounts without a transducer come to rest.
    base, base_ok
        Specific force of the brackets in bracket axes (K, M, 3); a bracket without sample (K, M) coasts with its own variance.
    arms, tilt_maps, gravity
        (M, 3), (M, 3, 3 M), [m/s^2].
    frame_turn
        Rotation of the frame that the brackets do not make, shape (K, 3) [rad].
    state, p
        In place: value, rate, bias, last relative acceleration (4, M, 3); covariance per channel (M, 3, 3, 3).
    noise
        (M, 3, 5): acceleration variance, bias density, variance of the pseudo measurement of the value, acceleration
        variance while body or base is silent, mean squared deflection that nothing measures.
    rests, rate_ratio
        What is left after a tick of a motion that nothing measures; rate over deflection of such a motion [1/s].
    displaced, displaced_ok, displaced_variance
        Displacement transducers: values (K, M, 3), whether one spoke (K, M, 3), variance (M, 3).
    drawn, lag
        Pseudo measurement of value plus lag [s] times rate where no transducer speaks, shapes (K, M, 3) and (M, 3).
    travel
        Largest deflection a mount can have [m]; its rate is at most that over :data:`SHORTEST_TRAVEL`.
    deflection, speed, relative, turn
        Outputs (K, M, 3): deflection [m], its rate, relative acceleration without what gravity adds through the relative tilt in
        first order, rotation of cab against bracket [rad].
    """
    gain, first_order, u = np.zeros(3), np.zeros(3), np.zeros(3)
    fastest = travel / SHORTEST_TRAVEL
    for k in range(motion.shape[0]):
        _turn_against_brackets(state, dt, tilt_maps, frame_turn[k], turn[k])
        # what a guess of the motion of the body does is rigid: where all bases speak the deformation of the frame goes on
        measured = body_ok[k] or base_ok[k].all()
        for i in range(arms.shape[0]):
            _relative_acceleration(motion[k], rate[k], arms[i], turn[k, i], base[k, i], state[0, i], state[1, i], u)
            first_order[0], first_order[1] = turn[k, i, 1] * gravity, -turn[k, i, 0] * gravity
            for a in range(3):
                relative[k, i, a] = u[a] - first_order[a] if measured and base_ok[k, i] else 0.0
            for a in range(3):
                accel_variance, target, target_variance = noise[i, a, 0], drawn[k, i, a], noise[i, a, 2]
                late = lag[i, a]
                if not (base_ok[k, i] and body_ok[k]):
                    u[a] = state[2, i, a]
                    accel_variance = noise[i, a, 3]
                if not (body_ok[k] or displaced_ok[k, i, a]):
                    come_to_rest(state[:, i, a], p[i, a], rests, noise[i, a, 4], rate_ratio)
                    deflection[k, i, a], speed[k, i, a] = state[0, i, a], state[1, i, a]
                    continue
                if displaced_ok[k, i, a]:
                    target, target_variance, late = displaced[k, i, a], displaced_variance[i, a], 0.0
                if late == 0.0:
                    advance_covariance(p[i, a], dt, accel_variance, noise[i, a, 1], target_variance, gain)
                else:
                    advance_with_lag(p[i, a], dt, accel_variance, noise[i, a, 1], target_variance, late, gain)
                old = state[3, i, a] - state[2, i, a]
                new = u[a] - state[2, i, a]
                state[0, i, a] += dt * state[1, i, a] + dt * dt * (old / 3.0 + new / 6.0)
                state[1, i, a] += 0.5 * dt * (old + new)
                innovation = target - state[0, i, a]
                if late != 0.0:
                    innovation -= late * state[1, i, a]
                # no input drives a mount beyond its travel, and so what is fed back from these states is bounded
                state[0, i, a] = min(max(state[0, i, a] + gain[0] * innovation, -travel), travel)
                state[1, i, a] = min(max(state[1, i, a] + gain[1] * innovation, -fastest), fastest)
                state[2, i, a] += gain[2] * innovation
                state[3, i, a] = u[a]
                # the linear hold between samples loses (omega dt)^2 / 12 of the value; put it back
                deflection[k, i, a] = state[0, i, a] - dt * dt / 12.0 * new
                speed[k, i, a] = state[1, i, a] - dt / 12.0 * (new - old)
