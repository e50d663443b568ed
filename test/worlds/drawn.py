# Copyright 2026 ride_estimation contributors
"""Vehicle files that err by what they state: every value off by a draw from its standard deviation.

Intervals can only be judged where what they allow for happens: beside a file whose mass, CG and static loads are exact, an
interval that holds their stated errors is right and looks too wide.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ride_estimation.frames import skew
from ride_estimation.sensors.installation import USUAL

from .cab import CabVehicle
from .vehicle_text import Belief

#: relative standard deviation of the static loads of mounts of one model: levelling, free lengths and rates keep them within 5 %
STATIC_LOAD_STD = 0.025


def drawn_belief(belief: Belief, seed: int) -> Belief:
    """Return a belief whose errors are drawn from what it states."""
    rng = np.random.default_rng([seed, 11])
    return dataclasses.replace(
        belief, stiffness_off=belief.stiffness_std, damping_off=belief.damping_std,
        mass_off=belief.mass_std * rng.standard_normal(), cg_off=tuple(belief.cg_std * rng.standard_normal(3)),
        # the file draws its factor evenly
        inertia_off=math.sqrt(3.0) * belief.inertia_std,
    )  # fmt: skip


def drawn_split(cab: CabVehicle, seed: int, draw: int = 0) -> np.ndarray:
    """Return what the static forces differ by from upright shares by stiffness, shape (M, 3) [N]: drawn, and without a wrench.

    Loads err as those of mounts of one model, and brackets lean at rest as the sensors on them do. No accelerometer sees a split:
    one recording can be judged with many draws.
    """
    size = STATIC_LOAD_STD * cab.static_force[:, 2]
    arms = cab.mounts - cab.cg
    wrench = np.vstack([np.ones(len(arms)), arms[:, 0], arms[:, 1]])
    drawn = size * np.random.default_rng([seed, 12, draw]).standard_normal(len(arms))
    spread = size[:, None] ** 2 * wrench.T
    split = np.zeros((len(arms), 3))
    split[:, 2] = drawn - spread @ np.linalg.solve(wrench @ spread, wrench @ drawn)
    lean = np.random.default_rng([seed, 13, draw]).normal(scale=USUAL.misalignment, size=(len(arms), 2))
    sideways = np.hstack([np.vstack([np.eye(3), skew(arm)])[:, :2] for arm in arms])
    pushed = (cab.static_force[:, 2:] * lean).ravel()
    split[:, :2] = (pushed - np.linalg.pinv(sideways) @ (sideways @ pushed)).reshape(-1, 2)
    return split
