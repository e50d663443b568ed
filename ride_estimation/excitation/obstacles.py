# Copyright 2026 ride_estimation contributors
"""Single obstacles: bumps, blocks, what a rolling wheel makes of them, and cobbled surfaces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]


def cosine_bump(distance: Array, begin: float, length: float, height: float) -> Array:
    """Return ``h/2 (1 - cos(2 pi (s - s0) / L))`` on the bump, zero elsewhere [m].

    Parameters
    ----------
    distance
        [m], shape (N,).
    begin, length, height
        s0, L, h [m]; a negative height is a dip.
    """
    _positive(length=length)
    s = (np.asarray(distance, dtype=float) - begin) / length
    return np.where((s >= 0.0) & (s <= 1.0), 0.5 * height * (1.0 - np.cos(2.0 * math.pi * s)), 0.0)


def block(distance: Array, begin: float, length: float, height: float) -> Array:
    """Return a rectangular obstacle [m] that begins at ``begin`` and is ``length`` long and ``height`` high [m]."""
    _positive(length=length)
    s = np.asarray(distance, dtype=float) - begin
    return np.where((s >= 0.0) & (s <= length), height, 0.0)


def ramp(distance: Array, begin: float, length: float, height: float) -> Array:
    """Return a rise from 0 to ``height`` [m] over ``length`` [m] that stays up (a kerb ramp)."""
    _positive(length=length)
    s = np.clip((np.asarray(distance, dtype=float) - begin) / length, 0.0, 1.0)
    return height * s


def wheel_over_block(distance: Array, begin: float, length: float, height: float, radius: float) -> Array:
    """Return the path of the hub of a rigid wheel rolling over a rectangular block, ground level zero [m].

    Before the edge at s0 the wheel turns about it: ``z = sqrt(R^2 - (s0 - s)^2) - (R - h)`` for
    ``s0 - s <= sqrt(2 R h - h^2)``; after the end likewise. Height 0.1 m, R 0.5 m: rise 0.3 m, whole path 0.7 m for a
    block 0.1 m long, 0.504 s at 5 km/h (document 002, experiment; a step instead spoils every identified value).

    Parameters
    ----------
    distance
        Of the hub [m], shape (N,).
    begin, length, height
        Block [m].
    radius
        Wheel radius R [m], greater than the height.

    Raises
    ------
    ConfigurationError
        A block higher than the radius.
    """
    _positive(length=length, height=height, radius=radius)
    if height >= radius:
        raise ConfigurationError(f"obstacle height {height:g} m; allowed: less than the wheel radius {radius:g} m")
    s = np.asarray(distance, dtype=float)
    beside = np.maximum(np.maximum(begin - s, s - begin - length), 0.0)
    inside = np.minimum(beside, radius)
    return np.maximum(np.sqrt(radius**2 - inside**2) - (radius - height), 0.0)


def rolled_envelope(height: Array, spacing: float, radius: float) -> Array:
    """Return the hub path of a rigid wheel over any profile: ``z(s) = max_d h(s + d) + sqrt(R^2 - d^2) - R``.

    Parameters
    ----------
    height
        Profile [m], shape (N,).
    spacing
        [m].
    radius
        R [m].
    """
    _positive(spacing=spacing, radius=radius)
    reach = math.floor(radius / spacing)
    padded = np.pad(np.asarray(height, dtype=float), reach, mode="edge")
    result = np.full(len(height), -np.inf)
    for step in range(-reach, reach + 1):
        drop = math.sqrt(max(radius**2 - (step * spacing) ** 2, 0.0)) - radius
        np.maximum(result, padded[reach + step : reach + step + len(height)] + drop, out=result)
    return result


def belgian_pave(distance: Array, seed: int, *, stone: float = 0.13, height_std: float = 0.008, joint: float = 0.015) -> Array:
    """Return a cobbled track: stones of scattered length and height with joints between them [m].

    Stone lengths vary by 20 %, each stone has its own height and a rounded top whose edge is ``joint`` wide. Assumed
    form and numbers in the range of proving-ground pave; no published profile is copied.

    Parameters
    ----------
    distance
        [m], shape (N,), increasing.
    seed
        Of numpy's default generator.
    stone, height_std, joint
        Mean stone length, standard deviation of stone heights, width of the rounded edge [m].
    """
    _positive(stone=stone, joint=joint)
    generator = np.random.default_rng(seed)
    s = np.asarray(distance, dtype=float)
    count = math.ceil((s[-1] - s[0]) / (0.5 * stone)) + 2
    ends = s[0] + np.cumsum(np.maximum(stone * (1.0 + 0.2 * generator.standard_normal(count)), 0.5 * stone))
    heights = height_std * generator.standard_normal(count)
    index = np.searchsorted(ends, s, side="right")
    begins = np.concatenate([[s[0]], ends[:-1]])
    edge = np.minimum(s - begins[index], ends[index] - s)
    depth = 0.5 * height_std * (1.0 + np.cos(math.pi * np.clip(edge / joint, 0.0, 1.0)))
    return np.asarray(heights[index] - depth, dtype=float)


def _positive(**values: float) -> None:
    problems = [f"{name}: {value:g} m; allowed: greater than zero" for name, value in values.items() if not value > 0.0]
    if problems:
        raise ConfigurationError(problems, where="obstacle")
