# Copyright 2026 ride_estimation contributors
"""Kalman filter and fixed-interval smoother with stationary gain, and how innovations change with the slow states.

``x+ = F x + B u + w``, ``y = H x + e``. The gain of a time-invariant system converges within a second, so it is solved for once
(algebraic Riccati equation by structured doubling, Chu, Fan and Lin, Int. J. Control 77, 2004). Smoother: Bryson and Frazier
(1963), which needs no inverse of a state covariance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

#: samples handled together where sensitivities are propagated: bounds the memory
CHUNK = 100


@dataclasses.dataclass(frozen=True)
class Filter:
    """Time-invariant system with its stationary gain.

    Attributes
    ----------
    F, H
        Transition (N, N) and readings (C, N).
    K
        Gain of the update, shape (N, C).
    S
        Covariance of the innovations, shape (C, C).
    P
        Covariance of the predicted state, shape (N, N).
    """

    F: Array
    H: Array
    K: Array
    S: Array
    P: Array

    @property
    def closed(self) -> Array:
        """Return the transition of the prediction error, ``F (1 - K H)``."""
        return np.asarray(self.F - self.F @ self.K @ self.H)

    def whitening(self) -> Array:
        """Return W with ``W S W^T = 1``."""
        return np.asarray(sl.solve_triangular(np.linalg.cholesky(self.S), np.eye(len(self.S)), lower=True))

    def log_determinant(self) -> float:
        """Return ``ln det S``."""
        return float(np.linalg.slogdet(self.S)[1])

    def smoothed_covariance(self) -> Array:
        """Return the covariance of the smoothed state far from both ends, shape (N, N)."""
        information = self.H.T @ np.linalg.solve(self.S, self.H)
        total = sl.solve_discrete_lyapunov(self.closed.T, information)
        return np.asarray(self.P - self.P @ total @ self.P)


def stationary(F: Array, H: Array, Q: Array, R: Array) -> Filter:
    """Return the filter of a time-invariant system.

    Parameters
    ----------
    F, H, Q, R
        Transition (N, N), readings (C, N), covariance of process noise per sample (N, N) and of readings (C, C).

    Raises
    ------
    InputDataError
        The Riccati equation has no finite solution.
    """
    a, g, h = F.T.copy(), H.T @ np.linalg.solve(R, H), Q.copy()
    one, n = np.eye(len(F)), len(F)
    largest = 1e12 * max(float(np.abs(Q).max()), float(np.abs(R).max()))
    for _ in range(50):
        if not np.abs(h).max() <= largest:
            break
        w = np.linalg.solve(one + g @ h, np.hstack([a, g @ a.T]))
        step = a.T @ h @ w[:, :n]
        g, a = g + a @ w[:, n:], a @ w[:, :n]
        h = h + 0.5 * (step + step.T)
        if np.abs(step).max() <= 1e-12 * np.abs(h).max():
            return _filter(F, H, H @ h @ H.T + R, h)
    raise InputDataError("the Kalman gain of this vehicle and noise has no stationary value; check masses, stiffness and noise")


def _filter(F: Array, H: Array, S: Array, P: Array) -> Filter:
    symmetric = np.asarray(0.5 * (S + S.T), dtype=np.float64)
    return Filter(F, H, np.asarray(np.linalg.solve(symmetric, H @ P).T, dtype=np.float64), symmetric, P)


def run(f: Filter, y: Array, known: Array | None = None) -> tuple[Array, Array]:
    """Return innovations (T, C) and predicted states (T, N) of one segment of readings.

    Parameters
    ----------
    y
        Moving readings, shape (T, C).
    known
        What is added to the next state, shape (T, N), None for nothing.
    """
    push = y @ (f.F @ f.K).T
    if known is not None:
        push += known
    closed = np.ascontiguousarray(f.closed)
    x = np.zeros(len(closed))
    out = np.empty_like(push)
    for t in range(len(push)):
        out[t] = x
        x = closed @ x + push[t]
    return y - out @ f.H.T, out


def smooth(f: Filter, innovations: Array, predicted: Array) -> Array:
    """Return smoothed states (T, N) of one segment."""
    closed = np.ascontiguousarray(f.closed.T)
    push = innovations @ np.linalg.solve(f.S, f.H)
    adjoint = np.zeros(closed.shape[0])
    out = np.empty_like(predicted)
    for t in range(len(push) - 1, -1, -1):
        adjoint = closed @ adjoint + push[t]
        out[t] = adjoint
    return predicted + out @ f.P


@dataclasses.dataclass(frozen=True)
class Derivatives:
    """Derivatives of a system with respect to P parameters.

    Attributes
    ----------
    F, Q
        Of the first Ps parameters, shape (Ps, N, N); the others leave them alone.
    H, constant
        Of rows and constant part of the readings, shapes (P, C, N) and (P, C).
    R
        Diagonal of the covariance of the readings, of the first Ps parameters, shape (Ps, C).
    own
        Parameter that is the delay of a channel, -1 for none, shape (C,).
    """

    F: Array
    Q: Array
    H: Array
    constant: Array
    R: Array
    own: NDArray[np.int64]


def filter_derivatives(f: Filter, d: Derivatives) -> tuple[Array, Array]:
    """Return derivatives of the predictor gain ``L = F K`` and of S, shapes (P, N, C) and (P, C, C).

    With the optimal gain the covariance of the prediction error changes by
    ``dP = A dP A^T + sym((dF - L dH) P A^T) + L dR L^T + dQ``, ``A = F - L H``; the Lyapunov equations are solved by doubling.
    """
    A, L, count, system = f.closed, f.F @ f.K, len(d.H), len(d.F)
    touched = np.flatnonzero(np.any(d.H != 0.0, axis=(1, 2)) | (np.arange(count) < system))
    dH = d.H[touched]
    turn = -np.matmul(L, dH)
    turn[:system] += d.F
    part = np.matmul(turn, f.P @ A.T)
    total = part + part.transpose(0, 2, 1)
    total[:system] += d.Q + np.einsum("nc,pc,mc->pnm", L, d.R, L, optimize=True)
    power = A
    for _ in range(50):
        step = np.matmul(np.matmul(power, total), power.T)
        total += step
        power = power @ power
        if np.abs(step).max() <= 1e-10 * np.abs(total).max():
            break
    cross = np.matmul(dH, f.P @ f.H.T)
    dS = cross + cross.transpose(0, 2, 1) + np.matmul(np.matmul(f.H, total), f.H.T)
    dS[:system, np.arange(len(f.S)), np.arange(len(f.S))] += d.R
    dL = np.matmul(f.F, np.matmul(total, f.H.T) + np.matmul(f.P, dH.transpose(0, 2, 1))) - np.matmul(L, dS)
    dL[:system] += np.matmul(d.F, f.P @ f.H.T)
    gains, covariances = np.zeros((count, *L.shape)), np.zeros((count, *f.S.shape))
    gains[touched], covariances[touched] = np.matmul(dL, np.linalg.inv(f.S)), dS
    return gains, covariances


def sensitivities(
    f: Filter, innovations: Array, predicted: Array, d: Derivatives, gains: Array, known: Array | None = None
) -> Iterator[tuple[int, Array]]:
    """Yield how the innovations of one segment change with the parameters, chunk by chunk: first sample and (L, C, P).

    Parameters
    ----------
    known
        Derivatives of the readings with their own parameter ``d.own`` that no state holds, shape (T, C), None for nothing.
    """
    channels = np.flatnonzero(d.own >= 0)
    size, count, system = len(f.F), len(d.H), len(d.F)
    closed, gain = np.ascontiguousarray(f.closed), f.F @ f.K
    by_state, by_innovation = d.F.reshape(-1, size).T, gains.reshape(count * size, -1).T
    rows = d.H.reshape(-1, size).T
    state = np.zeros((size, count))
    for first in range(0, len(predicted), CHUNK):
        x, nu = predicted[first : first + CHUNK], innovations[first : first + CHUNK]
        length = len(x)
        read = (x @ rows).reshape(length, count, -1).transpose(0, 2, 1) + d.constant.T
        if known is not None:
            read[:, channels, d.own[channels]] += known[first : first + CHUNK, channels]
        push = (nu @ by_innovation).reshape(length, count, size).transpose(0, 2, 1) - np.matmul(gain, read)
        push[:, :, :system] += (x @ by_state).reshape(length, system, size).transpose(0, 2, 1)
        states = np.empty((length, size, count))
        for t in range(length):
            states[t] = state
            state = closed @ state + push[t]
        yield first, -read - np.matmul(f.H, states)
