# Copyright 2026 ride_estimation contributors
"""Planar machine: cab (bounce, pitch) with a seat mass on a chassis (bounce, pitch) on two tyres; five coordinates.

Independent truth for the planar machine of document 001; kinematics linear in the small pitch, laws foreign.
Pitch is positive nose down: a point at x rises by ``z - x pitch``.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import GRAVITY
from worlds.chain import Chain, ChainRun, simulate_chain


@dataclasses.dataclass(frozen=True)
class Machine:
    """Masses, inertias and links (tyre front, rear, cab mount front, rear, seat); ``laws`` (link index, code, parameters)."""

    chassis_mass: float = 6000.0
    chassis_inertia: float = 9000.0
    cab_mass: float = 700.0
    cab_inertia: float = 560.0
    seat_mass: float = 90.0
    tyre_x: tuple[float, float] = (1.3, -1.0)
    mount_x: tuple[float, float] = (0.1, -1.3)
    cab_x: float = -0.6
    seat_x: float = -0.8
    stiffness: tuple[float, float, float, float, float] = (7e5, 9e5, 4.5e5, 5e5, 2.2e4)
    damping: tuple[float, float, float, float, float] = (6e3, 8e3, 4e3, 4.5e3, 900.0)
    laws: tuple[tuple[int, int, tuple[float, ...]], ...] = ()

    @property
    def chain(self) -> Chain:
        """Return the plane plant; coordinates chassis z, pitch, cab z, pitch, seat z; inputs the two tyre contact heights."""
        tf, tr = self.tyre_x
        mf, mr = self.mount_x
        c, s = self.cab_x, self.seat_x
        links = np.array(
            [
                [1.0, -tf, 0.0, 0.0, 0.0],
                [1.0, -tr, 0.0, 0.0, 0.0],
                [-1.0, mf, 1.0, -(mf - c), 0.0],
                [-1.0, mr, 1.0, -(mr - c), 0.0],
                [0.0, 0.0, -1.0, s - c, 1.0],
            ]
        )
        inputs = np.zeros((5, 2))
        inputs[0, 0] = inputs[1, 1] = 1.0
        total = self.chassis_mass + self.cab_mass + self.seat_mass
        lift = np.array([0.5 * total * GRAVITY] * 2 + [np.inf, np.inf, self.seat_mass * GRAVITY])
        mass = np.diag([self.chassis_mass, self.chassis_inertia, self.cab_mass, self.cab_inertia, self.seat_mass])
        return Chain(mass, links, inputs, np.array(self.stiffness), np.array(self.damping), lift, self.laws)

    def drive(self, height: np.ndarray, rate: np.ndarray, step: float, speed: float) -> ChainRun:
        """Integrate over a road under the front tyre; the rear follows by wheelbase over speed."""
        delay = (self.tyre_x[0] - self.tyre_x[1]) / speed
        t = np.arange(len(height)) * 0.5 * step
        rear, rear_rate = np.interp(t - delay, t, height), np.interp(t - delay, t, rate)
        return simulate_chain(self.chain, step, np.column_stack([height, rear]), np.column_stack([rate, rear_rate]))

    def accelerometer(self, run: ChainRun, body: str, x: float) -> np.ndarray:
        """Return vertical specific force at x [m] on ``chassis`` (origin x = 0), ``cab`` (its CG at ``cab_x``) or ``seat``."""
        a = run.qdd
        if body == "seat":
            return GRAVITY + a[:, 4]
        first, origin = {"chassis": (0, 0.0), "cab": (2, self.cab_x)}[body]
        return GRAVITY + a[:, first] - (x - origin) * a[:, first + 1]
