# Copyright 2026 ride_estimation contributors
"""Compiled loops over the ticks of a block: CG motion with attitude.

Acceleration is integrated with a three-state Kalman filter per channel (value, rate, constant bias of the
acceleration) and a pseudo measurement of the value, whose density sets how fast drift leaks away. With acceleration noise
density ``q = sigma^2 dt`` and pseudo-measurement density r the corner is ``omega^4 = q / r``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]

#: largest angular rate of a body on mounts that is believed where no gyro measures it [rad/s]: centripetal terms of an integral
#: that went astray feed it, faster and faster
LARGEST_RATE = 3.0


@compile_kernel
def advance_covariance(
    p: Array, dt: float, accel_variance: float, bias_density: float, value_variance: float, gain: Array
) -> None:
    """Predict and update the (3, 3) covariance of one group of channels in place and write the gain (3,).

    Parameters
    ----------
    p
        Covariance of (value, rate, bias).
    accel_variance
        Variance of one acceleration sample.
    bias_density
        Growth of the bias variance per second.
    value_variance
        Variance of one pseudo measurement of the value.
    gain
        Output.
    """
    half = 0.5 * dt * dt
    # F = [[1, dt, -dt^2/2], [0, 1, -dt], [0, 0, 1]]
    a00 = p[0, 0] + dt * p[1, 0] - half * p[2, 0]
    a01 = p[0, 1] + dt * p[1, 1] - half * p[2, 1]
    a02 = p[0, 2] + dt * p[1, 2] - half * p[2, 2]
    a11 = p[1, 1] - dt * p[2, 1]
    a12 = p[1, 2] - dt * p[2, 2]
    b00 = a00 + dt * a01 - half * a02 + accel_variance * half * half
    b01 = a01 - dt * a02 + accel_variance * half * dt
    b02 = a02
    b11 = a11 - dt * a12 + accel_variance * dt * dt
    b12 = a12
    b22 = p[2, 2] + bias_density * dt
    s = b00 + value_variance
    g0, g1, g2 = b00 / s, b01 / s, b02 / s
    gain[0], gain[1], gain[2] = g0, g1, g2
    p[0, 0] = b00 - g0 * b00
    p[0, 1] = b01 - g0 * b01
    p[0, 2] = b02 - g0 * b02
    p[1, 1] = b11 - g1 * b01
    p[1, 2] = b12 - g1 * b02
    p[2, 2] = b22 - g2 * b02
    p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]


@compile_kernel
def _without_surge(innovation: float, surge: float, gain: float, slow: Array) -> float:
    """Return the innovation of the pitch, low-passed in two stages, without the acceleration of the vehicle over gravity."""
    slow[0] += gain * (innovation - slow[0])
    slow[1] += gain * (slow[0] - slow[1])
    return float(slow[1] + surge)


@compile_kernel
def follow_speed(speed: Array, there: NDArray[np.bool_], gain: float, dt: float, state: Array, surge: Array) -> None:
    """Write the rate of a speed through two stages of a low-pass, from zero on where the speed begins to be measured.

    Parameters
    ----------
    speed, there
        At the ticks of a block, shape (K,) [m/s], and whether it was measured.
    gain
        Share of a new value in each stage.
    dt
        Tick [s].
    state
        Last speed, both stages, ticks since the speed is there, shape (4,), in place.
    surge
        Output, shape (K,) [m/s^2].
    """
    for k in range(speed.shape[0]):
        if not there[k]:
            state[:] = 0.0
        else:
            rate = (speed[k] - state[0]) / dt if state[3] > 0.0 else 0.0
            state[1] += gain * (rate - state[1])
            state[2] += gain * (state[1] - state[2])
            state[0] = speed[k]
            state[3] += 1.0
        surge[k] = state[2]


@compile_kernel
def cg_block(
    y: Array, directions: Array, points: Array, weights: Array, gyro: Array, use_gyro: bool, gravity: float, dt: float,
    state: Array, p_tilt: Array, p_pitch: Array, p_yaw: Array, noise: Array, surge: Array, surge_gain: float, slow: Array,
    motion: Array, rate: Array, tilt: Array,
) -> None:  # fmt: skip
    """Estimate specific force, angular acceleration, angular rate and tilt at the ticks of a block.

    The specific force shows the tilt but for the horizontal acceleration. Where the speed of the vehicle is measured, its rate
    is the longitudinal one: ``pitch = -(f_x - d(speed)/dt) / g``, both through the same low-pass, which a noisy speed needs.

    Parameters
    ----------
    y
        Accelerometer channels followed by differentiated gyro channels, shape (K, C).
    directions, points
        Of the accelerometer channels, zero rows for gyro channels, shape (C, 3).
    weights
        Weighted pseudo-inverse of the rows, shape (6, C).
    gyro
        Mean angular rate of the gyros, shape (K, 3).
    state
        (5, 3): angle, rate, bias of rate or angular acceleration, last angular acceleration, started flag; in place.
    p_tilt, p_pitch, p_yaw
        Covariances of :func:`advance_covariance`, in place; that of the pitch is its own where the speed is measured.
    noise
        angular acceleration variance, bias density, tilt pseudo variance, yaw pseudo variance, gyro variance, gyro bias
        density, gyro bias variance, pitch pseudo variance where the speed is measured.
    surge, surge_gain
        Low-passed rate of the vehicle's speed, shape (K,) [m/s^2], and the share of a new value in each of two stages of that
        low-pass; share zero: the speed is not measured.
    slow
        Innovation of the pitch after each stage, shape (2,), in place.
    motion, rate, tilt
        Outputs (K, 6), (K, 3), (K, 3).
    """
    gain = np.zeros(3)
    gain_pitch = np.zeros(3)
    gain_yaw = np.zeros(3)
    w = np.zeros(3)
    pseudo = np.zeros(3)
    for k in range(y.shape[0]):
        for a in range(3):
            w[a] = gyro[k, a] - state[2, a] if use_gyro else state[1, a] + dt * state[3, a]
        for a in range(6):
            motion[k, a] = 0.0
        ww = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        for c in range(y.shape[1]):
            wr = w[0] * points[c, 0] + w[1] * points[c, 1] + w[2] * points[c, 2]
            centripetal = 0.0
            for a in range(3):
                centripetal += directions[c, a] * (w[a] * wr - ww * points[c, a])
            value = y[k, c] - centripetal
            for a in range(6):
                motion[k, a] += weights[a, c] * value
        pseudo[0] = np.arctan2(motion[k, 1], np.sqrt(motion[k, 0] ** 2 + motion[k, 2] ** 2))
        pseudo[1] = np.arctan2(-motion[k, 0], np.sqrt(motion[k, 1] ** 2 + motion[k, 2] ** 2))
        pseudo[2] = 0.0
        if state[4, 0] == 0.0:
            state[0, 0], state[0, 1], state[4, 0] = pseudo[0], pseudo[1], 1.0
            for a in range(3):
                state[3, a] = motion[k, 3 + a]
        if use_gyro:
            _advance_gyro(p_tilt, dt, noise[4], noise[5], noise[2], gain)
            if surge_gain > 0.0:
                _advance_gyro(p_pitch, dt, noise[4], noise[5], noise[7], gain_pitch)
            _advance_gyro(p_yaw, dt, noise[4], noise[5], noise[3], gain_yaw)
        else:
            advance_covariance(p_tilt, dt, noise[0], noise[1], noise[2], gain)
            if surge_gain > 0.0:
                advance_covariance(p_pitch, dt, noise[0], noise[1], noise[7], gain_pitch)
            advance_covariance(p_yaw, dt, noise[0], noise[1], noise[3], gain_yaw)
        roll_turn = w[2] * state[0, 1] if use_gyro else 0.0
        pitch_turn = -w[2] * state[0, 0] if use_gyro else 0.0
        for a in range(3):
            g0 = gain[0] if a < 2 else gain_yaw[0]
            g1 = gain[1] if a < 2 else gain_yaw[1]
            g2 = gain[2] if a < 2 else gain_yaw[2]
            if a == 1 and surge_gain > 0.0:
                g0, g1, g2 = gain_pitch[0], gain_pitch[1], gain_pitch[2]
            if use_gyro:
                state[0, a] += dt * w[a]
                if a == 0:
                    state[0, a] += dt * roll_turn
                elif a == 1:
                    state[0, a] += dt * pitch_turn
                innovation = pseudo[a] - state[0, a]
                if a == 1 and surge_gain > 0.0:
                    # linear in the specific force: a ratio of shaking forces has a mean of its own
                    innovation = -motion[k, 0] / gravity - state[0, 1]
                    innovation = _without_surge(innovation, surge[k] / gravity, surge_gain, slow)
                state[0, a] += g0 * innovation
                state[2, a] += g2 * innovation
                state[1, a] = w[a]
            else:
                old = state[3, a] - state[2, a]
                new = motion[k, 3 + a] - state[2, a]
                state[0, a] += dt * state[1, a] + dt * dt * (old / 3.0 + new / 6.0)
                state[1, a] += 0.5 * dt * (old + new)
                innovation = pseudo[a] - state[0, a]
                if a == 1 and surge_gain > 0.0:
                    # linear in the specific force: a ratio of shaking forces has a mean of its own
                    innovation = -motion[k, 0] / gravity - state[0, 1]
                    innovation = _without_surge(innovation, surge[k] / gravity, surge_gain, slow)
                state[0, a] += g0 * innovation
                state[1, a] = min(max(state[1, a] + g1 * innovation, -LARGEST_RATE), LARGEST_RATE)
                state[2, a] += g2 * innovation
            state[3, a] = motion[k, 3 + a]
            rate[k, a] = state[1, a]
            tilt[k, a] = state[0, a]


@compile_kernel
def follow_slow(
    motion: Array, tilt: Array, surge: Array, gravity: float, gain: float, square_gain: float, mean_gain: float, slow: Array,
    square: float,
) -> float:  # fmt: skip
    """Follow the difference between the tilt the specific force shows and the estimated one; return its variance.

    Its mean over a long time is no acceleration but an error of the estimated tilt: it does not count.

    Parameters
    ----------
    motion, tilt
        Of a block, shapes (K, 6) and (K, 3).
    surge
        Rate of the vehicle's speed, which is no error of the tilt, shape (K,) [m/s^2].
    gain, square_gain
        Shares of the block in the slow difference and in its variance.
    mean_gain
        Share of the block in the long-time mean of the slow difference.
    slow
        Roll and pitch, then their long-time means, shape (4,), in place.
    square
        Variance so far.
    """
    ticks = motion.shape[0]
    f0, f1, roll, pitch = 0.0, 0.0, 0.0, 0.0
    for k in range(ticks):
        f0 += motion[k, 0] - surge[k]
        f1 += motion[k, 1]
        roll += tilt[k, 0]
        pitch += tilt[k, 1]
    slow[0] += gain * ((f1 / gravity - roll) / ticks - slow[0])
    slow[1] += gain * ((-f0 / gravity - pitch) / ticks - slow[1])
    slow[2] += mean_gain * (slow[0] - slow[2])
    slow[3] += mean_gain * (slow[1] - slow[3])
    roll, pitch = slow[0] - slow[2], slow[1] - slow[3]
    return float(square + square_gain * (0.5 * (roll * roll + pitch * pitch) - square))


@compile_kernel
def predict_block(motion: Array, rate: Array, rows: Array, directions: Array, points: Array, predicted: Array) -> None:
    """Write what the accelerometers read for a motion.

    Parameters
    ----------
    motion, rate
        Shapes (K, 6) and (K, 3).
    rows
        ``[e, r x e]``, shape (C, 6).
    directions, points
        Of the channels, shape (C or more, 3).
    predicted
        Output, shape (K, C).
    """
    for c in range(rows.shape[0]):
        e0, e1, e2 = directions[c, 0], directions[c, 1], directions[c, 2]
        r0, r1, r2 = points[c, 0], points[c, 1], points[c, 2]
        along = e0 * r0 + e1 * r1 + e2 * r2
        for k in range(motion.shape[0]):
            w0, w1, w2 = rate[k, 0], rate[k, 1], rate[k, 2]
            total = 0.0
            for a in range(6):
                total += rows[c, a] * motion[k, a]
            total += (e0 * w0 + e1 * w1 + e2 * w2) * (r0 * w0 + r1 * w1 + r2 * w2)
            predicted[k, c] = total - (w0 * w0 + w1 * w1 + w2 * w2) * along


@compile_kernel
def motion_at(motion: Array, rate: Array, arms: Array, out: Array) -> None:
    """Write the specific force of a body at points fixed to it, ``f + alpha x r + omega x (omega x r)``.

    Parameters
    ----------
    motion, rate
        CG specific force and angular acceleration (K, 6), angular rate (K, 3).
    arms
        Points relative to the CG, shape (M, 3).
    out
        Shape (K, M, 3).
    """
    for k in range(motion.shape[0]):
        w0, w1, w2 = rate[k, 0], rate[k, 1], rate[k, 2]
        ww = w0 * w0 + w1 * w1 + w2 * w2
        a3, a4, a5 = motion[k, 3], motion[k, 4], motion[k, 5]
        for i in range(arms.shape[0]):
            r0, r1, r2 = arms[i, 0], arms[i, 1], arms[i, 2]
            wr = w0 * r0 + w1 * r1 + w2 * r2
            out[k, i, 0] = motion[k, 0] + (a4 * r2 - a5 * r1) + (w0 * wr - ww * r0)
            out[k, i, 1] = motion[k, 1] + (a5 * r0 - a3 * r2) + (w1 * wr - ww * r1)
            out[k, i, 2] = motion[k, 2] + (a3 * r1 - a4 * r0) + (w2 * wr - ww * r2)


def force_at(motion: Array, rate: Array, arms: Array) -> Array:
    """Return the specific force of a body at points fixed to it, shape (K, M, 3); arguments of :func:`motion_at`."""
    result = np.empty((len(motion), len(arms), 3))
    motion_at(motion, rate, arms, result)
    return result


@compile_kernel
def remove_gravity(motion: Array, tilt: Array, gravity: float, free: NDArray[np.bool_], accel: Array) -> None:
    """Write acceleration (K, 6) from specific force and tilt; coordinates the body does not have are zero.

    Roll and pitch, integrals of body rates, are the components of a rotation vector ``(roll, pitch, 0)``: no axis comes first.
    """
    for k in range(motion.shape[0]):
        roll, pitch = tilt[k, 0], tilt[k, 1]
        angle = np.sqrt(roll * roll + pitch * pitch)
        sideways = gravity * (np.sin(angle) / angle if angle > 0.0 else 1.0)
        for a in range(6):
            accel[k, a] = motion[k, a]
        accel[k, 0] += sideways * pitch
        accel[k, 1] -= sideways * roll
        accel[k, 2] -= gravity * np.cos(angle)
        for a in range(6):
            if not free[a]:
                accel[k, a] = 0.0


@compile_kernel
def add_residuals(
    samples: Array, predicted: Array, motion: Array, keep: float, products: Array, mean: Array, signal_square: Array,
    signal_mean: Array, sums: Array,
) -> None:  # fmt: skip
    """Add a block to fading sums, in place.

    Parameters
    ----------
    samples, predicted, motion
        Shapes (K, C), (K, C), (K, 6).
    keep
        Factor on what was there.
    products, mean
        Of the residuals, shapes (C, C) and (C,).
    signal_square, signal_mean
        Of the samples, shape (C,).
    sums
        Squared angular acceleration, ticks.
    """
    channels = samples.shape[1]
    left = np.empty(channels)
    for i in range(channels):
        mean[i] *= keep
        signal_square[i] *= keep
        signal_mean[i] *= keep
        for j in range(channels):
            products[i, j] *= keep
    turn = 0.0
    for k in range(samples.shape[0]):
        for i in range(channels):
            value = samples[k, i]
            left[i] = value - predicted[k, i]
            mean[i] += left[i]
            signal_square[i] += value * value
            signal_mean[i] += value
        for i in range(channels):
            for j in range(channels):
                products[i, j] += left[i] * left[j]
        turn += motion[k, 3] * motion[k, 3] + motion[k, 4] * motion[k, 4] + motion[k, 5] * motion[k, 5]
    sums[0] = keep * sums[0] + turn
    sums[1] = keep * sums[1] + samples.shape[0]


@compile_kernel
def _advance_gyro(p: Array, dt: float, gyro_variance: float, bias_density: float, value_variance: float, gain: Array) -> None:
    """As :func:`advance_covariance` for (angle, gyro bias) in slots 0 and 2."""
    b00 = p[0, 0] - 2.0 * dt * p[0, 2] + dt * dt * p[2, 2] + gyro_variance * dt * dt
    b02 = p[0, 2] - dt * p[2, 2]
    b22 = p[2, 2] + bias_density * dt
    s = b00 + value_variance
    gain[0], gain[1], gain[2] = b00 / s, 0.0, b02 / s
    p[0, 0] = b00 - gain[0] * b00
    p[0, 2] = b02 - gain[0] * b02
    p[2, 2] = b22 - gain[2] * b02
    p[2, 0] = p[0, 2]
