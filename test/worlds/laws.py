# Copyright 2026 ride_estimation contributors
"""Foreign force laws of the worlds: one compiled kernel, functional forms the product's library does not use.

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
SINH = 5  # stiffness N/m, scale m
TANGENT = 6  # stiffness N/m, asymptote m
ARCTANGENT = 7  # stiffness N/m, scale m (softening)
POLYTROPIC = 8  # stiffness N/m, height m, exponent (air spring; negative deflection hardens)
TANH_DAMPER = 9  # damping N s/m, speed m/s (degressive)
ASYMMETRIC_DAMPER = 10  # extra damping of extension N s/m, corner speed m/s
GAUSS_DAMPER = 11  # extra damping around zero speed N s/m, speed m/s
BUMPER = 12  # force scale N, gap m, length scale m, loss ratio, speed scale m/s, side (-1 compression, 1 extension, 0 both)
FREE_PLAY = 13  # stiffness N/m, damping N s/m, half clearance m, smoothing m, centre m
MANY_CELLS = 14  # total stiffness N/m, shortest time s, longest time s, number of cells, exponent (fractional order)
LEVELLING = 15  # largest force N, gain N/(m s), leak 1/s   (out of library: saturating integral actuator)
INERTER = 16  # inertance kg, series stiffness N/m, series damping N s/m   (out of library)
POWER_DAMPER = 17  # damping N s/m at the reference speed, reference speed m/s, exponent: extra over linear

NAMES = {
    "lugre": LUGRE,
    "bouc_wen": BOUC_WEN,
    "stribeck": STRIBECK,
    "jenkins_chain": JENKINS,
    "sinh": SINH,
    "tangent": TANGENT,
    "arctangent": ARCTANGENT,
    "polytropic": POLYTROPIC,
    "tanh_damper": TANH_DAMPER,
    "asymmetric_damper": ASYMMETRIC_DAMPER,
    "gauss_damper": GAUSS_DAMPER,
    "bumper": BUMPER,
    "free_play": FREE_PLAY,
    "many_cells": MANY_CELLS,
    "levelling": LEVELLING,
    "inerter": INERTER,
    "power_damper": POWER_DAMPER,
}


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
    if code == SINH:
        r = min(max(x / p[1], -12.0), 12.0)
        return p[0] * (p[1] * np.sinh(r) - x)
    if code == TANGENT:
        r = min(max(x / p[1], -0.9), 0.9)
        f = p[1] * 2.0 / np.pi * np.tan(np.pi * r / 2.0)
        slope = 1.0 / np.cos(np.pi * r / 2.0) ** 2
        return p[0] * (f + slope * (x - r * p[1]) - x)
    if code == ARCTANGENT:
        return p[0] * (p[1] * np.arctan(x / p[1]) - x)
    if code == POLYTROPIC:
        r = max(1.0 + x / p[1], 0.15)
        return p[0] * (p[1] / p[2] * (1.0 - r ** (-p[2])) - x)
    if code == TANH_DAMPER:
        return p[0] * (p[1] * np.tanh(v / p[1]) - v)
    if code == POWER_DAMPER:
        return p[0] * (p[1] * np.sign(v) * (abs(v) / p[1]) ** p[2] - v)
    if code == ASYMMETRIC_DAMPER:
        return p[0] * 0.5 * (v + np.sqrt(v * v + p[1] * p[1]) - p[1])
    if code == GAUSS_DAMPER:
        return p[0] * v * np.exp(-((v / p[1]) ** 2))
    if code == BUMPER:
        total = 0.0
        for side in (-1.0, 1.0):
            if p[5] * side < 0.0:
                continue
            depth = side * x - p[1]
            if depth > 0.0:
                r = min(depth / p[2], 30.0)
                loss = 1.0 + p[3] * np.tanh(side * v / p[4])
                total += side * p[0] * (np.exp(r) - 1.0) * max(loss, 0.0)
        return total
    if code == FREE_PLAY:
        y = x - p[4]
        up = np.sqrt((y - p[2]) ** 2 + p[3] ** 2)
        down = np.sqrt((y + p[2]) ** 2 + p[3] ** 2)
        dead = y + 0.5 * (up - down)
        slope = 1.0 + 0.5 * ((y - p[2]) / up - (y + p[2]) / down)
        up0 = np.sqrt((-p[4] - p[2]) ** 2 + p[3] ** 2)
        down0 = np.sqrt((-p[4] + p[2]) ** 2 + p[3] ** 2)
        dead0 = -p[4] + 0.5 * (up0 - down0)
        return p[0] * (dead - dead0 - x) + p[1] * (slope - 1.0) * v
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
