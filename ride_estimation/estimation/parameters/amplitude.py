# Copyright 2026 ride_estimation contributors
"""Stiffness and damping that depend on the amplitude: the innovations show a law that is not linear.

A linear law has one stiffness at every amplitude. Friction, play, relaxation and nonlinear springs have an equivalent stiffness
(and damping) that changes with the rms deflection (rate) a of an interval, in first order as a power of it:
``log k_j = log k + beta log a_j``. The exponents beta are estimated jointly with the parameters from the gradients g_j and the
information A_j of the intervals, ``T_j = [I, diag(log a_j)]``,
``sum T_j^T A_j T_j (theta, beta) = sum T_j^T (g_j + A_j theta_j)``, with a covariance from their scatter (sandwich, each
interval with its neighbour). A linear law has beta = 0; Coulomb friction alone has beta = -1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.saved_state import take_fields
from ride_estimation.estimation.parameters.interval import Interval

Array = NDArray[np.float64]

#: standard deviation of an exponent before anything was learned: between linear (0) and Coulomb friction (-1)
PRIOR_STD = 0.5
#: intervals after which what they said has faded to 1 / e: two minutes of half a second each
_MEMORY = 240.0
#: intervals whose amplitudes have to differ before an exponent is stated
_FEWEST = 16
#: change of a logarithm over a factor of e in amplitude that is worth a sentence
_RELEVANT = 0.05
#: standard deviations beyond which it is said: chance makes one of two dozen larger once in a thousand runs
_CLEAR = 4.0
#: standard deviations of an exponent that count as scatter
_SCATTER = 2.0
#: attributes that are part of a saved state
_SAVED = ("_information", "_target", "_scatter", "_last", "_reference", "_intervals")


class AmplitudeDependence:
    """Exponents of stiffness and damping over the amplitude.

    Parameters
    ----------
    prior_std
        Standard deviations of the parameters before anything was learned, shape (N,).
    free_parameters
        Number of multipliers S among them, the first ones.
    """

    def __init__(self, prior_std: Array, free_parameters: int) -> None:
        self._count, self._free_parameters = len(prior_std), free_parameters
        self._prior = np.concatenate([prior_std, np.full(free_parameters, PRIOR_STD)]) ** -2.0
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        size = self._count + self._free_parameters
        self._information, self._target = np.zeros((size, size)), np.zeros(size)
        self._scatter, self._last = np.zeros((size, size)), np.zeros(size)
        self._reference = np.zeros(self._free_parameters)
        self._intervals = 0
        #: exponents and their standard deviations, shape (S,) each
        self.exponents: tuple[Array, Array] = np.zeros(self._free_parameters), np.full(self._free_parameters, PRIOR_STD)

    def observe(self, interval: Interval, centre: Array, amplitude: Array, inflation: float) -> None:
        """Add an interval.

        Parameters
        ----------
        interval
            Linearised at ``centre``, shape (N,).
        amplitude
            Rms deflection or rate of what every multiplier scales, shape (S,) [m or m/s].
        inflation
            Scatter of the gradients over what white noise of the stated size would make.
        """
        logs = np.log(np.maximum(amplitude, 1e-12))
        if not self._intervals:
            self._reference = logs
        transform = np.hstack([np.eye(self._count), np.zeros((self._count, self._free_parameters))])
        own = np.arange(self._free_parameters)
        transform[own, self._count + own] = logs - self._reference
        information = transform.T @ interval.information @ transform
        target = transform.T @ interval.gradient + information[:, : self._count] @ centre
        keep = 1.0 - 1.0 / _MEMORY
        # new arrays: copies of the state share them
        self._information = keep * self._information + information
        self._target = keep * self._target + target
        inverse = np.linalg.inv(self._information + max(inflation, 1.0) * np.diag(self._prior))
        value = inverse @ self._target
        score = target - information @ value
        pair = score + self._last
        if self._intervals:
            self._scatter = keep * self._scatter + 0.5 * np.outer(pair, pair)
        self._last = score
        self._intervals += 1
        if self._intervals >= _FEWEST:
            spread = np.einsum("ij,jk,ik->i", inverse, self._scatter, inverse)
            self.exponents = value[self._count :], np.sqrt(spread[self._count :])

    @property
    def std(self) -> Array:
        """Return what the dependence adds to the logarithm of every multiplier, shape (S,): its change over a factor of e in
        amplitude, as far as it is more than scatter.
        """
        value, spread = self.exponents
        return np.asarray(np.sqrt(np.maximum(value**2 - (_SCATTER * spread) ** 2, 0.0)))

    def notes(self, names: Sequence[str]) -> list[str]:
        """Return which multipliers depend on the amplitude, in words.

        Parameters
        ----------
        names
            Of the multipliers, S of them.
        """
        value, spread = self.exponents
        clear = np.abs(value) > np.maximum(_RELEVANT, _CLEAR * spread)
        words = [f"{name} by {100.0 * (2.0 ** value[n] - 1.0):+.0f} %" for n, name in enumerate(names) if clear[n]]
        if not words:
            return []
        return [
            f"these change when the amplitude doubles: {', '.join(words)}: friction, play or a nonlinear law; the values hold "
            "for the motion of this run only, `diagnose` names the law"
        ]

    def snapshot(self) -> dict[str, Any]:
        """Return the state; its arrays are shared and never change."""
        return {**{name[1:]: getattr(self, name) for name in _SAVED}, "exponents": list(self.exponents)}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`snapshot`."""
        take_fields(self, _SAVED, saved)
        value, std = (np.array(v, dtype=float).reshape(self._free_parameters) for v in saved["exponents"])
        self.exponents = value, std
