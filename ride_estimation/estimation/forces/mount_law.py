# Copyright 2026 ride_estimation contributors
"""Forces of all mount elements from deflection and rate, with stiffness and damping multipliers and their memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.terms import ELASTIC, STATE_SIZE, Term, initial_states, pack_terms, terms_commit
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.frames import AXES
from ride_estimation.jit import compile_kernel
from ride_estimation.vehicles.tangent import tangent

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROLES = ("stiffness", "damping")


def scaled(element: ForceElement, stiffness: float, damping: float) -> ForceElement:
    """Return the element with all stiffnesses times one factor and all dampings times another, lists and sums included.

    Parameters
    ----------
    element
        Force law.
    stiffness, damping
        Factors [-]; a parameter stays within its bounds.
    """
    factor = {"stiffness": stiffness, "damping": damping}
    return element.with_values({
        address: min(max(value * factor[p.role], p.lower), p.upper)
        for address, (p, value) in element.addressed().items()
        if p.role in factor and factor[p.role] != 1.0
    })


@compile_kernel
def law_block(
    codes: IntArray, params: Array, states: Array, owner: IntArray, deflection: Array, rate: Array, dt: float, tension: Array
) -> None:
    """Write the tension of every mount axis at the ticks of a block and advance the memories.

    Parameters
    ----------
    codes, params, states
        Packed terms of all elements.
    owner
        (E, 4): mount, axis, first term, one past the last term of each element.
    deflection, rate
        Shape (K, M, 3).
    tension
        Output (K, M, 3).
    """
    for k in range(deflection.shape[0]):
        for e in range(owner.shape[0]):
            i, a, first, last = owner[e, 0], owner[e, 1], owner[e, 2], owner[e, 3]
            tension[k, i, a] = terms_commit(
                codes[first:last], params[first:last], states[first:last], deflection[k, i, a], rate[k, i, a], dt
            )


class MountLaw:
    """The elements of all mounts of a geometry, scaled.

    Parameters
    ----------
    geometry
        Mounts and their elements.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._elements: list[tuple[int, int, ForceElement]] = [
            (i, a, mount.elements[axis]) for i, mount in enumerate(geometry.mounts) for a, axis in enumerate(AXES)
            if axis in mount.elements
        ]  # fmt: skip
        self._count = len(geometry.mounts)
        self.multipliers = np.ones((2, self._count, 3))
        self._pack()
        self.reset()

    def _pack(self) -> None:
        terms: list[Term] = []
        owner: list[tuple[int, int, int, int]] = []
        self.stiffness, self.damping = np.zeros((self._count, 3)), np.zeros((self._count, 3))
        for i, a, element in self._elements:
            own = scaled(element, self.multipliers[0, i, a], self.multipliers[1, i, a])
            self.stiffness[i, a], self.damping[i, a] = tangent(own)
            listed = own.terms()
            owner.append((i, a, len(terms), len(terms) + len(listed)))
            terms.extend(listed)
        self._codes, self._params = pack_terms(terms)
        self._owner = np.array(owner, dtype=np.int64).reshape(len(owner), 4)
        #: whether all are springs and dampers: those need no kernel, whose compilation takes longest of all
        self._linear = bool(np.all(self._codes == ELASTIC) and np.all(self._params[:, 1] == 0.0))
        self._rates = np.zeros((2, self._count, 3))
        if self._linear:
            for i, a, first, last in owner:
                self._rates[:, i, a] = self._params[first:last, [0, 2]].sum(axis=0)

    def reset(self) -> None:
        """Forget what the elements remember of their motion; springs and dampers remember nothing."""
        self.states = np.zeros((len(self._codes), STATE_SIZE)) if self._linear else initial_states(self._codes, self._params)

    def scale(self, multipliers: Array) -> None:
        """Set the stiffness and damping multipliers, shape (2, M, 3); memories stay."""
        if not np.array_equal(multipliers, self.multipliers):
            self.multipliers = np.array(multipliers, dtype=float)
            self._pack()

    def tension(self, deflection: Array, rate: Array, dt: float) -> Array:
        """Return the element forces (tension) at the ticks of a block, shape (K, M, 3) [N]; advances the memories.

        Parameters
        ----------
        deflection, rate
            Of the mounts, shape (K, M, 3) [m, m/s].
        dt
            Tick [s].
        """
        if self._linear:
            return np.asarray(deflection * self._rates[0] + self._rates[1] * rate)
        result = np.zeros(deflection.shape)
        law_block(
            self._codes,
            self._params,
            self.states,
            self._owner,
            np.ascontiguousarray(deflection),
            np.ascontiguousarray(rate),
            dt,
            result,
        )
        return result
