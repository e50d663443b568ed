# Copyright 2026 ride_estimation contributors
"""Force laws of the worlds in one compiled kernel; :mod:`worlds.hiding` sizes those that hide a cause.

A law gives the *extra* force [N] (tension positive) of one mount axis on top of the linear spring and damper, from the
deflection x [m] and the rate v [m/s]. Memory: ``z[0]`` holds the committed deflection, the rest belongs to the law.
"""

from __future__ import annotations

import numpy as np

from worlds.compiled import compiled

MEMORY = 16  # floats of memory of one law
PARAMETERS = 8  # floats of parameters of one law

NONE = 0
LUGRE = 1  # sigma0 N/m, sigma1 N s/m, coulomb N, static N, stribeck speed m/s
BOUC_WEN = 2  # yield force N, yield deflection m, beta (gamma = 1 - beta), exponent
STRIBECK = 3  # coulomb N, static N, stribeck speed m/s, regularisation speed m/s
JENKINS = 4  # total stiffness N/m, total slip force N, number of elements, spread (ratio of slip deflections)
HYPERBOLIC = 5  # stiffness N/m, scale m (softening, Hardin and Drnevich)
CONTOURED = 6  # stiffness N/m, scale m, phase (rolling lobe on a waisted piston: the rate varies with stroke)
OFFSET_SQUARE = 7  # stiffness N/m, scale m, place m (a square to both sides of a place off the middle)
HOLLOW = 8  # stiffness N/m, scale m, gap m (cube in compression)
BLOW_OFF = 9  # damping N s/m taken away in extension, opening speeds of extension and compression m/s, width m/s
RELIEF = 10  # damping N s/m taken away in both directions, opening speed m/s, width m/s
ORIFICE = 11  # damping N s/m, reference speed m/s, speed m/s beyond which the passage resists with the square
FOAM = 12  # force N, gap m, collapse m, densification m, loss ratio, speed scale m/s, side (-1 compression, 1 extension, 0 both)
SOFT_PLAY = 13  # stiffness N/m, damping N s/m, half clearance m, softness of the contact m, centre m
MANY_CELLS = 14  # total stiffness N/m, shortest time s, longest time s, number of cells, exponent (fractional order)
LEVELLING = 15  # largest force N, gain N/(m s), leak 1/s   (out of library: saturating integral actuator)
INERTER = 16  # inertance kg, series stiffness N/m, series damping N s/m   (out of library)

NAMES = {
    "lugre": LUGRE,
    "bouc_wen": BOUC_WEN,
    "stribeck": STRIBECK,
    "jenkins_chain": JENKINS,
    "hyperbolic": HYPERBOLIC,
    "contoured": CONTOURED,
    "offset_square": OFFSET_SQUARE,
    "hollow": HOLLOW,
    "blow_off": BLOW_OFF,
    "relief": RELIEF,
    "orifice": ORIFICE,
    "foam": FOAM,
    "soft_play": SOFT_PLAY,
    "many_cells": MANY_CELLS,
    "levelling": LEVELLING,
    "inerter": INERTER,
}


@compiled
def _opened(y, width):
    """Return a smooth positive part."""
    return 0.5 * (y + np.sqrt(y * y + width * width))


@compiled
def _contact(y, half, softness):
    """Return the stroke behind a clearance whose contact stiffens as it closes, and its slope."""
    depth = abs(y) - half
    if depth <= 0.0:
        return 0.0, 0.0
    closed = 1.0 - np.exp(-depth / softness)
    return (1.0 if y > 0.0 else -1.0) * (depth - softness * closed), closed


@compiled
def law_force(code, p, z, x, v, h, zn):
    """Return the force a time h after the committed memory z and write the memory at that moment into zn."""
    for i in range(MEMORY):
        zn[i] = z[i]
    zn[0] = x
    if code == STRIBECK:
        return (p[0] + (p[1] - p[0]) * np.exp(-((v / p[2]) ** 2))) * np.tanh(v / p[3])
    if code == LUGRE:
        g = p[2] + (p[3] - p[2]) * np.exp(-((v / p[4]) ** 2))
        lam = p[0] * abs(v) / g
        # exact solution of dz/dt = v - lam z over h with the speed frozen
        decay = np.exp(-lam * h)
        held = h if lam * h < 1e-9 else (1.0 - decay) / lam
        bristle = z[1] * decay + v * held
        zn[1] = bristle
        return p[0] * bristle + p[1] * (v - lam * bristle)
    if code == BOUC_WEN:
        w = z[1]
        steps = 4
        dx = (x - z[0]) / p[1] if h > 0.0 else 0.0
        for _ in range(steps):
            w += (dx - p[2] * abs(dx) * abs(w) ** (p[3] - 1.0) * w - (1.0 - p[2]) * dx * abs(w) ** p[3]) / steps
        w = min(max(w, -1.0), 1.0)
        zn[1] = w
        return p[0] * w
    if code == JENKINS:
        n = int(p[2])
        total = 0.0
        dx = x - z[0] if h > 0.0 else 0.0
        for j in range(n):
            reach = p[1] / p[0] * p[3] ** (j / max(n - 1.0, 1.0) - 0.5)
            slip = p[1] / n
            f = z[1 + j] + slip / reach * dx
            f = min(max(f, -slip), slip)
            zn[1 + j] = f
            total += f
        return total
    if code == HYPERBOLIC:
        return p[0] * (x / (1.0 + abs(x) / p[1]) - x)
    if code == CONTOURED:
        return p[0] * (p[1] * (np.sin(x / p[1] + p[2]) - np.sin(p[2])) - x)
    if code == OFFSET_SQUARE:
        return p[0] * ((x - p[2]) * abs(x - p[2]) + p[2] * abs(p[2])) / p[1]
    if code == HOLLOW:
        return -p[0] * max(-x - p[2], 0.0) ** 3 / p[1] ** 2
    if code == BLOW_OFF:
        extension = _opened(v - p[1], p[3]) - _opened(-p[1], p[3])
        compression = _opened(-v - p[2], p[3]) - _opened(-p[2], p[3])
        return p[0] * (0.5 * compression - extension)
    if code == RELIEF:
        return -p[0] * (_opened(v - p[1], p[2]) - _opened(-v - p[1], p[2]))
    if code == ORIFICE:
        return p[0] / p[1] * (max(v - p[2], 0.0) ** 2 - max(-v - p[2], 0.0) ** 2)
    if code == FOAM:
        total = 0.0
        for side in (-1.0, 1.0):
            if p[6] * side < 0.0:
                continue
            depth = side * x - p[1]
            if depth > 0.0:
                loss = 1.0 + p[4] * np.tanh(side * v / p[5])
                total += side * p[0] * (1.0 - np.exp(-depth / p[2]) + (depth / p[3]) ** 3) * max(loss, 0.0)
        return total
    if code == SOFT_PLAY:
        contact, rate = _contact(x - p[4], p[2], p[3])
        at_rest, _ = _contact(-p[4], p[2], p[3])
        return p[0] * (contact - at_rest - x) + p[1] * (rate - 1.0) * v
    if code == MANY_CELLS:
        n = int(p[3])
        total = 0.0
        norm = 0.0
        ratio = p[2] / p[1]
        rate = (x - z[0]) / h if h > 0.0 else 0.0
        for j in range(n):
            tau = p[1] * ratio ** (j / max(n - 1.0, 1.0))
            share = tau ** (-p[4])
            norm += share
            decay = np.exp(-h / tau)
            y = z[1 + j] * decay + rate * tau * (1.0 - decay)
            zn[1 + j] = y
            total += share * y
        return p[0] * total / norm
    if code == LEVELLING:
        decay = np.exp(-p[2] * h)
        y = z[1] * decay + 0.5 * (x + z[0]) * (1.0 - decay) / p[2]
        zn[1] = y
        return p[0] * np.tanh(p[1] * y / p[0])
    if code == INERTER:
        y, w = z[1], z[2]
        steps = 4
        if h > 0.0:
            mean_rate = (x - z[0]) / h
            for i in range(steps):
                dt = h / steps
                xi = z[0] + (x - z[0]) * (i + 0.5) / steps
                w += dt * (p[1] * (xi - y) + p[2] * (mean_rate - w)) / p[0]
                y += dt * w
        zn[1] = y
        zn[2] = w
        return p[1] * (x - y) + p[2] * (v - w)
    return 0.0
