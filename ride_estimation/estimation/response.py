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

from ride_estimation.estimation.balance_kernel import response_block
from ride_estimation.estimation.force_balance import BalanceChunk, ForceBalance

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
        self._count = len(balance.slots) + 1
        self._gravity = gravity
        self._step = 0.0
        self.reset()

    def reset(self) -> None:
        """Put the simulated body where the measured one is."""
        self.state = np.zeros((12, 1 + self._count))
        self.last = np.zeros((6, 1 + self._count))

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
        gravity[~balance.arrangement.free] = 0.0
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
        p = balance.arrangement.wrench.T
        self.elastic, self.viscous = np.zeros((self._count, 6)), np.zeros((self._count, 6))
        k, c = balance.law.stiffness, balance.law.damping
        for n, slot in enumerate(balance.slots):
            row = p[3 * slot.mount + slot.axis]
            if slot.role == 0:
                self.elastic[n] = k[slot.mount, slot.axis] * row
            else:
                self.viscous[n] = c[slot.mount, slot.axis] * row
        self._step = step

    def observe(self, chunk: BalanceChunk) -> tuple[Array, Array]:
        """Return innovations (K, 6) and gradients (K, 6, N) of a chunk."""
        innovation = np.empty_like(chunk.measured)
        gradient = np.empty_like(chunk.columns)
        response_block(
            chunk.modelled - chunk.measured, chunk.columns, self.elastic, self.viscous, self.transition, self.hold_old,
            self.hold_new, self.feedback, self._balance.direction, self.state, self.last, innovation, gradient,
        )  # fmt: skip
        return innovation, gradient
