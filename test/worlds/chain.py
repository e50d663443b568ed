# Copyright 2026 ride_estimation contributors
"""Compiled motion of small plants in plane coordinates: masses, links with foreign laws, prescribed inputs.

``M q'' = -G^T T(u, u') + P p(t)`` with link deflections ``u = G q - H w(t)``; coordinates are deviations from static
equilibrium, ``T`` tension. A link with a finite ``lift_off`` cannot pull more than its static load (tyre, seat).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.compiled import compiled
from worlds.laws import MEMORY, PARAMETERS, law_force


@compiled
def _chain_derivative(n, y, w, wd, push, inv_m, g, hh, k, c, lift, codes, lawp, mem, trial, lag, dy, tension, u, ud):
    force = push.copy()
    for i in range(g.shape[0]):
        x, v = 0.0, 0.0
        for j in range(n):
            x += g[i, j] * y[j]
            v += g[i, j] * y[n + j]
        for j in range(hh.shape[1]):
            x -= hh[i, j] * w[j]
            v -= hh[i, j] * wd[j]
        t = k[i] * x + c[i] * v
        for law in range(codes.shape[1]):
            if codes[i, law] != 0:
                t += law_force(codes[i, law], lawp[i, law], mem[i, law], x, v, lag, trial[i, law])
        t = min(t, lift[i])
        tension[i], u[i], ud[i] = t, x, v
        for j in range(n):
            force[j] -= g[i, j] * t
    for j in range(n):
        dy[j] = y[n + j]
        total = 0.0
        for m in range(n):
            total += inv_m[j, m] * force[m]
        dy[n + j] = total


@compiled
def _integrate(h, w, wd, push, inv_m, m_change, g, hh, k, c, lift, codes, lawp, switch):
    n, steps, links = inv_m.shape[0], (w.shape[0] - 1) // 2, g.shape[0]
    out_y, out_a = np.empty((steps + 1, 2 * n)), np.empty((steps + 1, n))
    out_t, out_u, out_v = np.empty((steps + 1, links)), np.empty((steps + 1, links)), np.empty((steps + 1, links))
    mem, trial = np.zeros((links, codes.shape[1], MEMORY)), np.zeros((links, codes.shape[1], MEMORY))
    tension, u, ud = np.empty(links), np.empty(links), np.empty(links)
    y = np.zeros(2 * n)
    k1, k2, k3, k4 = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n)
    im = inv_m
    for i in range(steps + 1):
        if i == switch:
            im = m_change
        a, b, d = 2 * i, 2 * i + 1, 2 * i + 2
        _chain_derivative(n, y, w[a], wd[a], push[a], im, g, hh, k, c, lift, codes, lawp, mem, trial, 0.0, k1, tension, u, ud)
        out_y[i], out_a[i], out_t[i], out_u[i], out_v[i] = y, k1[n:], tension, u, ud
        if i == steps:
            break
        _chain_derivative(
            n, y + 0.5 * h * k1, w[b], wd[b], push[b], im, g, hh, k, c, lift, codes, lawp, mem, trial, 0.5 * h, k2, tension, u, ud
        )
        _chain_derivative(
            n, y + 0.5 * h * k2, w[b], wd[b], push[b], im, g, hh, k, c, lift, codes, lawp, mem, trial, 0.5 * h, k3, tension, u, ud
        )
        _chain_derivative(
            n, y + h * k3, w[d], wd[d], push[d], im, g, hh, k, c, lift, codes, lawp, mem, trial, h, k4, tension, u, ud
        )
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        _chain_derivative(n, y, w[d], wd[d], push[d], im, g, hh, k, c, lift, codes, lawp, mem, trial, h, k4, tension, u, ud)
        mem[:] = trial
    return out_y, out_a, out_t, out_u, out_v


@dataclasses.dataclass(frozen=True)
class Chain:
    """A plane plant. ``links_to_coordinates`` G (L, n), ``links_to_inputs`` H (L, inputs), ``laws`` (link, code, parameters).

    ``lift_off`` [N] per link: largest tension above the static pre-load, inf where it can pull. ``mass_after``: (time s, M).
    """

    mass: np.ndarray
    links_to_coordinates: np.ndarray
    links_to_inputs: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    lift_off: np.ndarray
    laws: tuple[tuple[int, int, tuple[float, ...]], ...] = ()
    mass_after: tuple[float, np.ndarray] | None = None

    def modes(self) -> np.ndarray:
        """Return undamped natural frequencies [Hz]."""
        g = self.links_to_coordinates
        values = np.linalg.eigvals(np.linalg.solve(self.mass, g.T @ (self.stiffness[:, None] * g)))
        return np.sort(np.sqrt(np.maximum(values.real, 0.0))) / (2 * np.pi)


@dataclasses.dataclass(frozen=True)
class ChainRun:
    """Truth on the integration grid: coordinates, rates, accelerations, link tension, deflection, rate, input acceleration."""

    step: float
    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    tension: np.ndarray
    deflection: np.ndarray
    rate: np.ndarray


def simulate_chain(
    chain: Chain, step: float, inputs: np.ndarray, input_rates: np.ndarray, push: np.ndarray | None = None
) -> ChainRun:
    """Integrate from rest. ``inputs``, ``input_rates`` (2N+1, inputs) and ``push`` (2N+1, n) at half steps."""
    n, links = len(chain.mass), len(chain.stiffness)
    codes = np.zeros((links, 2), np.int64)
    lawp = np.zeros((links, 2, PARAMETERS))
    for link, code, parameters in chain.laws:
        slot = int(np.count_nonzero(codes[link]))
        codes[link, slot] = code
        lawp[link, slot, : len(parameters)] = parameters
    steps = (len(inputs) - 1) // 2
    switch, changed = steps + 5, np.linalg.inv(chain.mass)
    if chain.mass_after is not None:
        switch, changed = round(chain.mass_after[0] / step), np.linalg.inv(chain.mass_after[1])
    push = np.zeros((len(inputs), n)) if push is None else push
    y, a, t, u, v = _integrate(
        step, np.ascontiguousarray(inputs), np.ascontiguousarray(input_rates), np.ascontiguousarray(push),
        np.linalg.inv(chain.mass), changed, np.ascontiguousarray(chain.links_to_coordinates, float),
        np.ascontiguousarray(chain.links_to_inputs, float), np.asarray(chain.stiffness, float), np.asarray(chain.damping, float),
        np.asarray(chain.lift_off, float), codes, lawp, switch,
    )  # fmt: skip
    return ChainRun(step, np.arange(steps + 1) * step, y[:, :n], y[:, n:], a, t, u, v)
