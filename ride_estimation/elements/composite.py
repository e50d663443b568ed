# Copyright 2026 ride_estimation contributors
"""Elements that are the sum of simpler ones under the same deflection."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Iterator

import numpy as np

from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.terms import Term


@functools.lru_cache(maxsize=256)
def _built(element: CompositeElement) -> tuple[ForceElement, ...]:
    """Return the parts of an element, built and checked once."""
    return element.parts()


@dataclasses.dataclass(frozen=True)
class CompositeElement(ForceElement):
    """A force element that is the sum of its parts; force, memory, harmonics and terms follow from them."""

    @abc.abstractmethod
    def parts(self) -> tuple[ForceElement, ...]:
        """Return the parts, all under the same deflection."""

    def _memories(self, s: Array) -> Iterator[tuple[ForceElement, Array]]:
        first = 0
        for part in _built(self):
            last = first + part.initial().size
            yield part, s[first:last]
            first = last

    def initial(self) -> Array:
        """Return the memories of the parts one after the other."""
        return np.concatenate([np.zeros(0), *(part.initial() for part in _built(self))])

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return the rates of the memories of the parts."""
        return np.concatenate([np.zeros(0), *(part.rate(own, x, v) for part, own in self._memories(s))])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the sum of the forces of the parts [N]."""
        return sum(part.force(own, x, v) for part, own in self._memories(s))

    def commit(self, s: Array, x: float, v: float) -> Array:
        """Return the committed memories of the parts."""
        return np.concatenate([np.zeros(0), *(part.commit(own, x, v) for part, own in self._memories(s))])

    def terms(self) -> tuple[Term, ...]:
        """Return the primitives of all parts."""
        return tuple(term for part in _built(self) for term in part.terms())

    def is_passive(self) -> bool:
        """Return whether all parts are passive."""
        return all(part.is_passive() for part in _built(self))

    def fastest_rate(self, peak_speed: float) -> float:
        """Return the fastest rate among the parts [1/s]."""
        return max((part.fastest_rate(peak_speed) for part in _built(self)), default=0.0)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return the sum over the parts [N/m], exact because all see the same deflection; None if one has none."""
        total = 0j
        for part in _built(self):
            own = part.dynamic_stiffness(omega, amplitude)
            if own is None:
                return None
            total += own
        return total

    def loss_energy(self, omega: float, amplitude: float) -> float | None:
        """Return the sum over the parts [J] per cycle; None if one has none."""
        total = 0.0
        for part in _built(self):
            own = part.loss_energy(omega, amplitude)
            if own is None:
                return None
            total += own
        return total
