# Copyright 2026 ride_estimation contributors
"""A force element stepped by another program: motion in, force out, once per communication step.

This is how document 000 couples its damping filter to a multibody code. The element sees the relative motion of the mount
(the document's figure feeds the absolute velocity of the attachment point, which makes a skyhook damper).
"""

from __future__ import annotations

import math

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.terms import initial_states, pack_terms, terms_commit
from ride_estimation.errors import ConfigurationError, InputDataError


class ElementStepper:
    """One force element with its memory between communication steps.

    Parameters
    ----------
    element
        Any force element.
    step_s
        Communication step [s].
    """

    def __init__(self, element: ForceElement, step_s: float) -> None:
        if not step_s > 0.0:
            raise ConfigurationError(f"communication step {step_s:g} s must be greater than zero")
        self._codes, self._params = pack_terms(element.terms())
        self._states = initial_states(self._codes, self._params)
        self._step = step_s

    def step(self, deflection: float, rate: float) -> float:
        """Accept the relative motion at the end of a step and return the tension [N] there.

        Parameters
        ----------
        deflection, rate
            Body side minus base side [m], [m/s].

        Raises
        ------
        InputDataError
            Motion that is not finite; the memory stays as it was.
        """
        if not (math.isfinite(deflection) and math.isfinite(rate)):
            raise InputDataError(f"deflection {deflection} m and rate {rate} m/s must be finite")
        return float(terms_commit(self._codes, self._params, self._states, deflection, rate, self._step))
