# Copyright 2026 ride_estimation contributors
"""The extended Kalman filter of the parameters, and the memory of the last intervals its standard deviations rest on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.parameters.guarded_ekf import GuardedEkf
from ride_estimation.estimation.parameters.interval import Interval, IntervalMemory
from ride_estimation.estimation.parameters.parameter_change import RECENT, moved
from ride_estimation.estimation.parameters.rls import forgetting_noise

Array = NDArray[np.float64]

#: standard deviation a change of the vehicle opens in every logarithm
_CHANGE_STD = 0.15
#: refused intervals in a row that make a change
_REFUSED = 2
#: factor on the innovation covariance from here on a change is suspected
_SUSPECT_RATIO = 16.0
#: intervals after which the innovation covariance is trusted enough for that
_ESTABLISHED = 8


class ParameterFilter:
    """What is known of the parameters after the intervals learned so far.

    Parameters
    ----------
    theta
        Parameters at the start, shape (N,).
    prior_std, lower, upper
        Standard deviation before anything was learned, and bounds, shape (N,).
    kept
        Share of what was learned that an interval leaves in the directions it excites.
    common
        Directions along which all change alike, shape (N, C).
    considered
        Number of quantities that are not estimated but whose uncertainty is considered.
    """

    def __init__(
        self, theta: Array, prior_std: Array, lower: Array, upper: Array, kept: float, common: Array, considered: int
    ) -> None:
        self._common = common
        self._prior_std, self._lower, self._upper, self._kept = prior_std, lower, upper, kept
        self._ekf = GuardedEkf(theta, np.diag(prior_std**2))
        self.theta = np.array(theta, dtype=float)
        self.std = np.array(prior_std, dtype=float)
        self.memory = IntervalMemory(len(theta), considered)
        #: mean over ten intervals of the normalised innovation squared: one is expected
        self.innovation_ratio = 0.0
        #: intervals learned, and changes of the vehicle that were noticed
        self.learned, self.changes = 0, 0
        self.rejected: dict[str, int] = {}
        self._refused = 0

    @property
    def covariance(self) -> Array:
        """Return the covariance of the filter, shape (N, N)."""
        return self._ekf.p

    def hold(self, theta: Array) -> None:
        """Put the parameters to ``theta`` (N,); what is known of their scatter stays."""
        self.theta = np.array(theta, dtype=float)
        if not np.array_equal(self._ekf.x, self.theta):
            self._ekf.replace(x=self.theta)

    def learn(self, interval: Interval, centre: Array) -> bool:
        """Take an interval that was linearised at ``centre`` (N,); return whether it was accepted.

        An innovation far beyond its covariance is refused; a few in a row are a change of the vehicle: the covariance opens and
        the scatter of before is forgotten.
        """
        ekf, scale = self._ekf, self.memory.inflation
        values, basis = np.linalg.eigh(interval.information)
        keep = values > 1e-9 * max(float(values[-1]), 1e-30)
        if not np.any(keep):
            return self._reject("no information")
        root = np.sqrt(values[keep])
        jacobian = root[:, None] * basis[:, keep].T
        residual = (basis[:, keep].T @ interval.gradient) / root - jacobian @ (ekf.x - centre)
        ekf.predict(forgetting_noise(ekf.p, interval.information / scale, self._kept))
        established = self.memory.length >= _ESTABLISHED
        noise = scale * np.eye(len(root))
        ratio = ekf.nis(residual, jacobian, noise) / len(root)
        if established and ratio > _SUSPECT_RATIO:
            self._refused += 1
            if self._refused <= _REFUSED:
                return self._reject("innovation beyond the gate")
            self._open()
        self._refused = 0
        self.innovation_ratio += 0.1 * (min(ratio, _SUSPECT_RATIO) - self.innovation_ratio)
        refused = ekf.update(residual, jacobian, noise)
        if refused:
            return self._reject(refused)
        self._keep_within_bounds()
        self.memory.add(interval, centre)
        self._reweigh(self.memory.weigh(ekf.x))
        self._follow()
        self.theta = ekf.x
        self.std = self.memory.standard_deviation(ekf.p, self.theta)
        self.learned += 1
        return True

    def _reweigh(self, ratio: float) -> None:
        """Let what was learned weigh as its intervals scatter now, this much more than before; the prior stays what it was."""
        scaled, own = self._ekf.p / np.outer(self._prior_std, self._prior_std), self._prior_std
        values, basis = np.linalg.eigh(scaled)
        learned = np.maximum(1.0 / values - 1.0, 0.0)
        values = np.where(learned > 0.0, 1.0 / (1.0 + learned / ratio), values)
        self._ekf.replace(p=np.outer(own, own) * ((basis * values) @ basis.T))

    def _follow(self) -> None:
        """Go along where the last intervals contradict what was learned before them."""
        if self.memory.length:
            step, added = moved(*self.memory.scores(self._ekf.x), self._ekf.p, self._common)
            if np.any(step):
                self._ekf.replace(x=self._ekf.x + step, p=self._ekf.p + added)
                self.memory.carry(step, RECENT)
                self._keep_within_bounds()

    def _open(self) -> None:
        """The vehicle has changed: open the covariance and forget the scatter of before."""
        self.changes += 1
        self.memory.clear()
        self._ekf.replace(p=self._ekf.p + _CHANGE_STD**2 * np.eye(len(self.theta)))

    def _keep_within_bounds(self) -> None:
        x = np.clip(self._ekf.x, self._lower, self._upper)
        if not np.array_equal(x, self._ekf.x):
            self._ekf.replace(x=x)

    def _reject(self, reason: str) -> bool:
        self.rejected[reason] = self.rejected.get(reason, 0) + 1
        return False

    def load(self, saved: dict[str, Any], std: Array) -> None:
        """Continue with the covariance ``p``, the ``memory`` and the ``innovation_ratio`` of a state; ``std`` has shape (N,)."""
        self._ekf.replace(p=np.array(saved["p"], dtype=float))
        self.std = np.array(std, dtype=float)
        self.memory.load(saved["memory"])
        self.innovation_ratio = float(saved["innovation_ratio"])
