# Copyright 2026 ride_estimation contributors
"""Output error online: the simulated body instead of the measured one, as a correction of the measured balance.

Least squares on the balance of measured signals is biased because the measured deflections carry the noise of the sensors on the
body (sideways by tens of per cent). The simulated body moves by e relative to the measured one, ``e'' = a - S z`` with a the
residual of the balance; the innovations of the simulation and their exact gradients follow from the same small filter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ride_estimation.estimation.parameters.balance_kernel import response_block
from ride_estimation.estimation.parameters.force_balance import BalanceChunk, ForceBalance
from ride_estimation.estimation.parameters.transducer_balance import MeasuredResponse

Array = NDArray[np.float64]


class ModelResponse:
    """Innovations of the simulated body and their gradients.

    Parameters
    ----------
    balance
        Gives stiffness and damping of the present parameters.
    gravity
        [m/s^2].
    """

    def __init__(self, balance: ForceBalance, gravity: float) -> None:
        self._balance = balance
        self._count = balance.direction.shape[1]
        self._gravity = gravity
        #: step the response is prepared for [s], 0 before
        self.step = 0.0
        self._covariance, self._base_variance = np.eye(6), 0.0
        self._unseen = np.zeros((6, 6))
        points = balance.geometry.wrench[balance.geometry.free]
        self._rigid = np.linalg.pinv(points @ points.T, hermitian=True)
        self.reset()

    def reset(self) -> None:
        """Put the simulated body where the measured one is."""
        self.state: Array = np.zeros((12, 1 + self._count))
        self.last: Array = np.zeros((12, 1 + self._count))

    def take_state(self, other: ModelResponse | MeasuredResponse) -> None:
        """Go on where another response stands."""
        self.state, self.last = other.state.copy(), other.last.copy()

    def prepare(self, static_force: Array, follow: float, step: float) -> None:
        """Discretise the response for the present parameters.

        Parameters
        ----------
        static_force
            Shape (M, 3) [N].
        follow
            See :meth:`ForceBalance.observe`.
        step
            [s].
        """
        balance = self._balance
        elastic, viscous = balance.stiffness_matrices()
        mounts = np.hstack([-elastic, -viscous])
        mounts[:, 3:6] -= balance.static_turn(static_force, follow)
        gravity = np.zeros((6, 12))
        gravity[0, 4], gravity[1, 3] = -self._gravity, self._gravity
        gravity[~balance.geometry.free] = 0.0
        system = np.zeros((24, 24))
        system[:6, 6:12] = np.eye(6)
        system[6:12, :12] = -(mounts + gravity)
        system[6:12, 12:18] = np.eye(6)
        system[12:18, 18:24] = np.eye(6) / step
        exact = linalg.expm(system * step)
        self.transition = np.ascontiguousarray(exact[:12, :12])
        self.hold_new = np.ascontiguousarray(exact[:12, 18:24])
        self.hold_old = np.ascontiguousarray(exact[:12, 12:18] - exact[:12, 18:24])
        self.feedback = np.ascontiguousarray(mounts)
        self.gain = self._kalman_gain(step)
        p = balance.geometry.wrench.T
        self.elastic, self.viscous = np.zeros((self._count, 6)), np.zeros((self._count, 6))
        k, c = balance.law.stiffness, balance.law.damping
        for n, parameter in enumerate(balance.free_parameters):
            row = p[3 * parameter.mount + parameter.axis]
            if parameter.role == 0:
                self.elastic[n] = k[parameter.mount, parameter.axis] * row
            else:
                self.viscous[n] = c[parameter.mount, parameter.axis] * row
        for n, a in enumerate(balance.turns, start=len(balance.free_parameters) + 1):
            self.elastic[n], self.viscous[n] = -mounts[3 + a, :6], -mounts[3 + a, 6:]
        self.step = step

    def set_noise(self, covariance: Array, base_variance: float, unseen: Array) -> None:
        """State the noise that ``prepare`` uses.

        Parameters
        ----------
        covariance
            Of the body's measured acceleration, shape (6, 6).
        base_variance
            Of a base sensor [(m/s^2)^2].
        unseen
            Covariance of the body's acceleration by forces of mounts whose base is not measured, shape (6, 6).
        """
        self._covariance, self._base_variance, self._unseen = covariance, base_variance, unseen

    def _kalman_gain(self, step: float) -> Array:
        """Return the gain (12, 6) that balances the noise of the base sensors, seen through the mounts, with that of the body's.

        Near a resonance the mounts pass the base acceleration on as if the base were rigid, so that is the process noise:
        ``sigma^2 (P^T P)^-1``, P the motion of the mount points. Forces of unseen mounts move the body and are in its measured
        acceleration at once: process and measurement noise correlate, ``S = B U``, and with
        ``A - S R^-1 C``, ``Q - S R^-1 S^T`` the equations are those of uncorrelated noise (Anderson and Moore, Optimal Filtering,
        5.4). The more of it there is, the more the simulated body follows the measured one along these directions.
        """
        free = self._balance.geometry.free
        gain = np.zeros((12, 6))
        states = np.flatnonzero(np.concatenate([free, free]))
        outputs = np.flatnonzero(free)
        accel = self._base_variance * self._rigid
        drive = (self.hold_old + self.hold_new)[np.ix_(states, outputs)]
        process = drive @ accel @ drive.T
        seen = -self.feedback[np.ix_(outputs, states)]
        noise = self._covariance[np.ix_(outputs, outputs)]
        transition = self.transition[np.ix_(states, states)]
        cross = np.zeros((len(states), len(outputs)))
        if self._unseen.any():
            unseen = self._unseen[np.ix_(outputs, outputs)]
            noise, cross = noise + unseen, drive @ unseen
            share = np.linalg.solve(noise, cross.T).T
            p = _riccati(transition - share @ seen, seen, process + drive @ unseen @ drive.T - share @ cross.T, noise)
        else:
            p = _riccati(transition, seen, process, noise)
        innovation = seen @ p @ seen.T + noise
        gain[np.ix_(states, outputs)] = np.linalg.solve(innovation, seen @ p @ transition.T + cross.T).T
        return gain

    def observe(self, chunk: BalanceChunk) -> tuple[Array, Array]:
        """Return innovations (K, 6) and gradients (K, 6, N) of a chunk."""
        innovation = np.empty_like(chunk.measured)
        gradient = np.empty_like(chunk.columns)
        response_block(
            chunk.modelled - chunk.measured, chunk.columns, self.elastic, self.viscous, self.transition, self.hold_old,
            self.hold_new, self.feedback, self.gain, self._balance.direction, self.state, self.last, innovation, gradient,
        )  # fmt: skip
        return innovation, gradient


def _riccati(a: Array, c: Array, q: Array, r: Array) -> Array:
    """Return the stationary covariance of ``P = A P A^T - A P C^T (C P C^T + R)^-1 C P A^T + Q`` by doubling, 2^12 steps."""
    identity = np.eye(len(a))
    alpha, beta, p = a.T, c.T @ np.linalg.solve(r, c), q
    for _ in range(12):
        w = identity + beta @ p
        inverse = np.linalg.inv(w)
        p_new = p + alpha.T @ p @ inverse @ alpha
        beta = beta + alpha @ inverse @ beta @ alpha.T
        alpha = alpha @ inverse @ alpha
        if np.max(np.abs(p_new - p)) <= 1e-9 * np.max(np.abs(p_new)):
            return np.asarray(0.5 * (p_new + p_new.T))
        p = p_new
    return np.asarray(0.5 * (p + p.T))
