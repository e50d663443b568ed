# Copyright 2026 ride_estimation contributors
"""Which changes of parameters no sensor notices, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def names_in_words(names: Sequence[str]) -> str:
    """Return a list of parameters with stiffness and damping of one mount axis together and mounts gathered by axis."""
    groups: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    quantities: dict[str, list[str]] = {}
    for name in names:
        owner, _, quantity = name.rpartition(".")
        quantities.setdefault(owner, []).append(quantity)
    for owner, found in quantities.items():
        place, _, axis = owner.rpartition(".")
        groups.setdefault((axis if place else "", tuple(found)), []).append(place or owner)
    return "; ".join(
        f"{' and '.join(found)}{f' along {axis}' if axis and found[0] != 'mass' else ''} of {', '.join(places)}"
        for (axis, found), places in groups.items()
    )


def null_directions_in_words(names: Sequence[str], directions: Array) -> list[str]:
    """Say which changes of the log parameters leave every signal as it is.

    The common scale of all masses, stiffnesses and dampings is looked for first; what remains is reduced to directions
    with few members.

    Parameters
    ----------
    directions
        Basis of the null space in log parameters, shape (P, K).
    """
    if directions.shape[1] == 0:
        return []
    basis, _ = np.linalg.qr(directions)
    found = []
    common = np.full(len(names), 1.0 / math.sqrt(len(names)))
    if np.linalg.norm(common - basis @ (basis.T @ common)) < 1e-3:
        groups = sorted({n.rpartition(".")[2] for n in names})
        found.append(f"{len(names)} parameters scale together without changing any signal: every {', every '.join(groups)}")
        remaining = basis - np.outer(common, common @ basis)
        left, size, _ = np.linalg.svd(remaining, full_matrices=False)
        basis = left[:, size > 1e-3]
    for direction in _few_members(basis.T):
        parts = sorted(((n, d) for n, d in zip(names, direction) if abs(d) > 0.05), key=lambda part: -abs(part[1]))
        listed = ", ".join(f"{n} {'up' if d > 0 else 'down'} {abs(d):.2g}" for n, d in parts[:6])
        more = f" and {len(parts) - 6} more" if len(parts) > 6 else ""
        found.append(f"only a combination is seen, these change together unnoticed: {listed}{more}")
    return found


def _few_members(rows: Array) -> Array:
    """Return the reduced row echelon form by full pivoting, each row scaled to a largest entry of 1."""
    reduced = rows.copy()
    for i in range(reduced.shape[0]):
        j = int(np.argmax(np.abs(reduced[i])))
        reduced[i] /= reduced[i, j]
        for other in range(reduced.shape[0]):
            if other != i:
                reduced[other] -= reduced[other, j] * reduced[i]
    return np.asarray(reduced / np.max(np.abs(reduced), axis=1, initial=1e-300)[:, None])
