# Copyright 2026 ride_estimation contributors
"""Status and reason of every parameter, with hysteresis."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.free_parameters import FreeParameter

Array = NDArray[np.float64]

_DIRECTION = ("longitudinal", "lateral", "vertical")
#: standard deviation of a logarithm below which an estimate is valid, above which it stops being valid
_VALID = (0.05, 0.08)
#: share of the prior standard deviation that must be gone before a parameter counts as seen at all
_SEEN = 0.7
#: intervals of excitation after which what is not seen counts as not identifiable
_PATIENCE = 40


def status_of(std: float, prior_std: float, valid_below: float = _VALID[0]) -> Status:
    """Return the status of a parameter that has seen all of its data, from standard deviations of its logarithm.

    Parameters
    ----------
    std, prior_std
        With the data and before them.
    valid_below
        Largest ``std`` that is valid.
    """
    if std < valid_below:
        return Status.VALID
    return Status.ESTIMATING if std < _SEEN * prior_std else Status.NOT_IDENTIFIABLE


class StatusTracker:
    """Status of every parameter.

    Parameters
    ----------
    free_parameters
        The multipliers.
    geometry
        For names.
    possible
        Whether parameters can be estimated at all.
    reason
        Why not, where they cannot.
    """

    def __init__(self, free_parameters: tuple[FreeParameter, ...], geometry: Geometry, possible: bool, reason: str) -> None:
        self._free_parameters = free_parameters
        self._possible = possible
        self._reason = reason
        self._status = [Status.STARTING if possible else Status.NOT_IDENTIFIABLE] * len(free_parameters)
        self._intervals = 0
        self._at_bound = np.zeros(len(free_parameters), dtype=bool)

    def of(self, n: int) -> tuple[Status, str]:
        """Return status and reason of one parameter."""
        status = self._status[n]
        if not self._possible:
            return status, self._reason
        axis = _DIRECTION[self._free_parameters[n].axis]
        if status is Status.VALID:
            return status, ""
        if status is Status.SUSPECT:
            return status, "at its bound: the mount model or the mass may be wrong"
        if status is Status.NOT_IDENTIFIABLE:
            return (
                status,
                f"the motion so far does not separate it from other parameters; needs {axis} excitation of this mount alone",
            )
        if status is Status.ESTIMATING:
            return status, f"still uncertain; needs more {axis} excitation"
        return status, f"needs {axis} excitation"

    def follow(self, std: Array, prior: Array, theta: Array, intervals: int, lower: Array, upper: Array) -> None:
        """Update the status of all parameters.

        Parameters
        ----------
        std, prior
            Standard deviations of the logarithms now and in the file, shape (N,).
        theta, lower, upper
            Logarithms and their bounds, shape (N,).
        intervals
            Learned since the last update.
        """
        self._intervals += intervals
        for n in range(len(self._free_parameters)):
            if theta[n] <= lower[n] + 1e-9 or theta[n] >= upper[n] - 1e-9:
                self._status[n] = Status.SUSPECT
                continue
            status = status_of(std[n], prior[n], _VALID[1] if self._status[n] is Status.VALID else _VALID[0])
            early = status is Status.NOT_IDENTIFIABLE and self._intervals < _PATIENCE
            self._status[n] = Status.STARTING if early else status

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {"status": [s.value for s in self._status], "intervals": self._intervals}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._status = [Status(s) for s in saved["status"]]
        self._intervals = int(saved["intervals"])
