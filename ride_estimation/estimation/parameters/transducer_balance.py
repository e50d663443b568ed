# Copyright 2026 ride_estimation contributors
"""The force balance where displacement transducers, and no accelerometers on the bases, measure the vertical deflections.

Vertical, roll and pitch equations only: ``m f - G_h F_h = -G_z (k x + c v)`` with the horizontal forces F_h shared by
stiffness from the wrench the body needs (three of its equations fix their sums). Deflections are measured here, not
integrated, so their noise is small and the regression on them needs no simulated body.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.free_parameters import FreeParameter
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.parameters.balance_kernel import high_pass_block
from ride_estimation.estimation.parameters.force_balance import BalanceChunk, BalanceInput, inverse_mass

Array = NDArray[np.float64]

#: rate the balance is averaged to: damps the noise of the differentiated deflection [Hz]
_RATE = 60.0


class TransducerBalance:
    """As :class:`ForceBalance`, for the vertical axes and from displacement transducers.

    Parameters
    ----------
    geometry, free_parameters, law, corner_hz
        As there; ``free_parameters`` holds vertical axes only.
    """

    def __init__(self, geometry: Geometry, free_parameters: tuple[FreeParameter, ...], law: MountLaw, corner_hz: float) -> None:
        self.geometry = geometry
        self.free_parameters = free_parameters
        self.law = law
        self.corner = 2.0 * np.pi * corner_hz
        self._count = len(geometry.mounts)
        #: no gains of base sensors are judged
        self.read_square = np.zeros(0)
        # only heave, roll and pitch
        self._inverse = inverse_mass(geometry)
        self._inverse[[0, 1, 5]] = 0.0
        self._push = -self._inverse @ geometry.wrench[:, 2::3]
        self.reset()

    def reset(self) -> None:
        """Start the filters again."""
        self._filters = np.zeros((7, self._count + 6))
        self._offset: Array | None = None
        self._before: Array | None = None
        self._left = np.zeros((0, self._count * 2 + 6))

    def observe(self, data: BalanceInput, static_force: Array, follow: float, dt: float) -> BalanceChunk:
        """Filter a chunk; arguments as in :meth:`ForceBalance.observe`, of which the static force is not needed."""
        ticks = len(data.support)
        horizontal = data.dynamic.copy()
        horizontal[:, :, 2] = 0.0
        wrench = data.support - horizontal.reshape(ticks, -1) @ self.geometry.wrench.T
        raw = np.hstack([data.deflection[:, :, 2], wrench @ self._inverse.T])
        if self._offset is None:
            self._offset = raw.mean(axis=0)
        passed = np.empty_like(raw)
        high_pass_block(raw - self._offset, self.corner, dt, self._filters, passed)
        before = passed[:1] if self._before is None else self._before
        self._before = passed[-1:].copy()
        line = np.concatenate([before, passed])
        # mean and difference of neighbours belong to the same instant
        middle, slope = 0.5 * (line[1:] + line[:-1]), np.diff(line[:, : self._count], axis=0) / dt
        stacked = np.concatenate([self._left, np.hstack([middle, slope])])
        average = max(1, int(np.ceil(1.0 / (dt * _RATE))))
        whole = len(stacked) // average * average
        self._left = stacked[whole:]
        mean = stacked[:whole].reshape(-1, average, stacked.shape[1]).mean(axis=1)
        x, measured, v = mean[:, : self._count], mean[:, self._count : self._count + 6], mean[:, self._count + 6 :]
        elastic, viscous = x * self.law.stiffness[:, 2], v * self.law.damping[:, 2]
        columns = np.zeros((len(mean), 6, len(self.free_parameters) + 1))
        for n, parameter in enumerate(self.free_parameters):
            force = (elastic if parameter.role == 0 else viscous)[:, parameter.mount]
            columns[:, :, n] = force[:, None] * self._push[:, parameter.mount]
        return BalanceChunk(np.ascontiguousarray(measured), (elastic + viscous) @ self._push.T, columns, dt * average)


class MeasuredResponse:
    """As :class:`ModelResponse` without a simulated body: innovations are the residuals of the balance."""

    def __init__(self) -> None:
        self.step = 0.0
        self.state: Array = np.zeros(0)
        self.last: Array = np.zeros(0)

    def reset(self) -> None:
        """Do nothing: there is no state."""

    def take_state(self, other: object) -> None:
        """Do nothing: there is no state."""

    def set_noise(self, covariance: Array, base_variance: float, unseen: Array) -> None:
        """Do nothing: there is no simulated body that could gather noise."""

    def prepare(self, static_force: Array, follow: float, step: float) -> None:
        """Remember the step."""
        self.step = step

    def observe(self, chunk: BalanceChunk) -> tuple[Array, Array]:
        """Return residuals (K, 6) and columns (K, 6, N)."""
        return chunk.measured - chunk.modelled, chunk.columns


def transducers_suffice(geometry: Geometry) -> bool:
    """Return whether every mount has a vertical displacement transducer."""
    having = {s.mount for s in geometry.transducers if s.axis == "z"}
    return bool(geometry.mounts) and all(m.name in having for m in geometry.mounts)
