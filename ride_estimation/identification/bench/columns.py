# Copyright 2026 ride_estimation contributors
"""The columns whose weighted sum is the force, their sensitivities, and the Gram matrix of all of them in one pass.

The force of the overlay models is ``F = sum_j a_j B_j(t; theta)``: linear in stiffness, damping and friction force, and
nonlinear only in the rates of the Maxwell cells and the friction displacement. Reversals depend on the displacement
alone. Columns, in this order::

    x  x^3  v                                   (those that the layout names)
    m_i(x; O_i)         Maxwell cells           dm = -O m dt + dx          (document 003 eq. (8), (17), (18))
    phi(x; x2)          friction, unit force    Berg (003 eq. (9)) or Dahl
    dm_i/dlog O_i, dphi/dlog x2                 exact sensitivities
    1                   force offset
    F                   measured force

Maxwell cells use the exact update for a displacement that is linear between samples. Friction is evaluated branch by
branch from its reversal.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.reversals import Motion
from ride_estimation.jit import COMPILED, compile_fused_kernel, compile_kernel, compile_sum_kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

FRICTION_NONE, FRICTION_BERG, FRICTION_DAHL = 0, 1, 2
#: samples per block of the fused pass: the block of columns stays in the cache
BLOCK = 512


@dataclasses.dataclass(frozen=True)
class Layout:
    """Which columns a model has.

    Attributes
    ----------
    spring, cubic, viscous
        Columns x, x^3, v.
    cells
        Number of Maxwell cells.
    friction
        ``FRICTION_NONE``, ``FRICTION_BERG`` or ``FRICTION_DAHL``.
    """

    spring: bool = True
    cubic: bool = False
    viscous: bool = False
    cells: int = 0
    friction: int = FRICTION_NONE

    @property
    def static(self) -> int:
        """Return the number of columns without memory."""
        return int(self.spring) + int(self.cubic) + int(self.viscous)

    @property
    def linear(self) -> int:
        """Return the number of linear coefficients."""
        return self.static + self.nonlinear

    @property
    def nonlinear(self) -> int:
        """Return the number of nonlinear parameters."""
        return self.cells + int(self.friction != FRICTION_NONE)

    @property
    def columns(self) -> int:
        """Return the number of columns including sensitivities, offset and force."""
        return self.linear + self.nonlinear + 2


@compile_kernel
def _friction_point(kind: int, a: float, u: float, length: float) -> tuple[float, float, float]:
    """Return unit friction along a branch and its derivatives by log(length) and by the start value a."""
    if kind == 1:
        rest = length * (1.0 - a)
        total = rest + u
        y = a + u * (1.0 - a) / total
        return y, -u * (1.0 - a) * rest / (total * total), 1.0 - (u / total) ** 2
    decay = np.exp(-u / length)
    return 1.0 - (1.0 - a) * decay, -(1.0 - a) * decay * u / length, decay


@compile_kernel
def branch_states(kind: int, length: float, anchors: Array, directions: Array) -> tuple[Array, Array]:
    """Return unit friction at the start of each branch and its derivative by log(length), shapes (B,)."""
    n = anchors.size
    state, slope = np.zeros(n), np.zeros(n)
    for b in range(n - 1):
        d = directions[b]
        y, dy, da = _friction_point(kind, d * state[b], d * (anchors[b + 1] - anchors[b]), length)
        state[b + 1] = d * y
        slope[b + 1] = d * (dy + da * d * slope[b])
    return state, slope


@compile_sum_kernel
def _friction_block(
    kind: int,
    length: float,
    x: Array,
    lo: int,
    hi: int,
    start: int,
    branch: int,
    starts: IntArray,
    anchors: Array,
    directions: Array,
    state: Array,
    slope: Array,
    out: Array,
    row: int,
    sensitivity_row: int,
) -> int:
    k = lo
    while k < hi:
        while starts[branch + 1] <= k:
            branch += 1
        end = min(hi, starts[branch + 1])
        d, anchor = directions[branch], anchors[branch]
        a, da = d * state[branch], d * slope[branch]
        # slices: an index that may be negative for all the compiler knows is no vector operation
        part, force, by_length = x[k:end], out[row, k - start : end - start], out[sensitivity_row, k - start : end - start]
        if kind == 1:
            free = 1.0 - a
            rest = length * free
            for i in range(part.size):
                u = max(d * (part[i] - anchor), 0.0)
                share = u / (rest + u)
                force[i] = d * (a + free * share)
                by_length[i] = d * (da * (1.0 - share * share) - share * free * (1.0 - share))
        else:
            for i in range(part.size):
                u = max(d * (part[i] - anchor), 0.0) / length
                left = np.exp(-u)
                force[i] = d * (1.0 - (1.0 - a) * left)
                by_length[i] = d * (da * left - (1.0 - a) * left * u)
        k = end
    return branch


@compile_sum_kernel
def _static_rows(x: Array, h: float, lo: int, n: int, spring: bool, cubic: bool, viscous: bool, block: Array) -> None:
    """Write the columns without memory of samples lo to lo + n."""
    row, part = 0, x[lo : lo + n]
    if spring:
        for i in range(part.size):
            block[row, i] = part[i]
        row += 1
    if cubic:
        for i in range(part.size):
            block[row, i] = part[i] * part[i] * part[i]
        row += 1
    if viscous:
        last = x.size - 1
        for i in range(n):
            before, after = max(lo + i - 1, 0), min(lo + i + 1, last)
            block[row, i] = (x[after] - x[before]) / (h * (after - before))


@compile_fused_kernel
def _one_cell(steps: Array, n: int, rule: Array, state: Array, block: Array, row: int, sensitivity_row: int) -> None:
    """Advance one Maxwell cell and its sensitivity over a block."""
    e, g, de, dg = rule[0], rule[1], rule[2], rule[3]
    m, dm = state[0], state[1]
    for i in range(n):
        step = steps[i]
        dm = e * dm + (de * m + dg * step)
        m = e * m + g * step
        block[row, i] = m
        block[sensitivity_row, i] = dm
    state[0], state[1] = m, dm


@compile_fused_kernel
def _two_cells(
    steps: Array, n: int, rules: Array, states: Array, first: int, block: Array, row: int, sensitivity_row: int
) -> None:
    """Advance two Maxwell cells together: their chains of dependent operations overlap in the processor."""
    e, g, de, dg = rules[first, 0], rules[first, 1], rules[first, 2], rules[first, 3]
    e2, g2, de2, dg2 = rules[first + 1, 0], rules[first + 1, 1], rules[first + 1, 2], rules[first + 1, 3]
    m, dm, m2, dm2 = states[first, 0], states[first, 1], states[first + 1, 0], states[first + 1, 1]
    for i in range(n):
        step = steps[i]
        dm = e * dm + (de * m + dg * step)
        dm2 = e2 * dm2 + (de2 * m2 + dg2 * step)
        m = e * m + g * step
        m2 = e2 * m2 + g2 * step
        block[row, i] = m
        block[row + 1, i] = m2
        block[sensitivity_row, i] = dm
        block[sensitivity_row + 1, i] = dm2
    states[first, 0], states[first, 1], states[first + 1, 0], states[first + 1, 1] = m, dm, m2, dm2


@compile_kernel
def _cell_rules(rates: Array, h: float) -> Array:
    """Return decay, gain and their derivatives by log rate for a displacement straight between samples, shape (C, 4)."""
    rules = np.empty((rates.size, 4))
    for j in range(rates.size):
        a = rates[j] * h
        rules[j, 0] = np.exp(-a)
        rules[j, 1] = -np.expm1(-a) / a
        rules[j, 2] = -a * rules[j, 0]
        rules[j, 3] = rules[j, 0] - rules[j, 1]
    return rules


@compile_sum_kernel
def _add_products(block: Array, ones: Array, gram: Array) -> None:
    """Add the products of all rows of a block, and with a row of ones, to the upper triangle of a matrix (R + 1, R + 1).

    Three rows by three: every product needs two thirds of a load from the cache, and nine sums fill the registers.
    """
    rows = block.shape[0]
    for a in range(0, rows, 3):
        for b in range(a, rows, 3):
            s00, s01, s02, s10, s11, s12, s20, s21, s22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(block.shape[1]):
                p0, p1, p2 = block[a, i], block[a + 1, i], block[a + 2, i]
                q0, q1, q2 = block[b, i], block[b + 1, i], block[b + 2, i]
                s00 += p0 * q0
                s01 += p0 * q1
                s02 += p0 * q2
                s10 += p1 * q0
                s11 += p1 * q1
                s12 += p1 * q2
                s20 += p2 * q0
                s21 += p2 * q1
                s22 += p2 * q2
            gram[a, b] += s00
            gram[a, b + 1] += s01
            gram[a, b + 2] += s02
            gram[a + 1, b] += s10
            gram[a + 1, b + 1] += s11
            gram[a + 1, b + 2] += s12
            gram[a + 2, b] += s20
            gram[a + 2, b + 1] += s21
            gram[a + 2, b + 2] += s22
        s0, s1, s2 = 0.0, 0.0, 0.0
        for i in range(block.shape[1]):
            s0 += block[a, i] * ones[i]
            s1 += block[a + 1, i] * ones[i]
            s2 += block[a + 2, i] * ones[i]
        gram[a, rows] += s0
        gram[a + 1, rows] += s1
        gram[a + 2, rows] += s2
    total = 0.0
    for i in range(ones.size):
        total += ones[i] * ones[i]
    gram[rows, rows] += total


@compile_kernel
def gram_kernel(
    x: Array,
    force: Array,
    weight: Array,
    h: float,
    spring: bool,
    cubic: bool,
    viscous: bool,
    rates: Array,
    kind: int,
    length: float,
    starts: IntArray,
    anchors: Array,
    directions: Array,
    stop: int,
) -> Array:
    """Return the Gram matrix of all columns over samples 0 to stop in one pass, shape (C, C)."""
    cells, friction = rates.size, 1 if kind > 0 else 0
    static = int(spring) + int(cubic) + int(viscous)
    linear = static + cells + friction
    columns = linear + cells + friction + 1
    rows = (columns + 2) // 3 * 3  # rows of zeros make whole tiles
    gram, block = np.zeros((rows + 1, rows + 1)), np.zeros((rows, BLOCK))
    steps, ones = np.zeros(BLOCK), np.ones(BLOCK)
    state, slope = branch_states(kind, length, anchors, directions) if friction else (np.zeros(1), np.zeros(1))
    rules, memory = _cell_rules(rates, h), np.zeros((cells, 2))
    branch = 0
    for lo in range(0, stop, BLOCK):
        n = min(BLOCK, stop - lo)
        _static_rows(x, h, lo, n, spring, cubic, viscous, block)
        before, part, force_part = x[max(lo - 1, 0)], x[lo : lo + n], force[lo : lo + n]
        steps[0] = part[0] - before
        for i in range(1, part.size):
            steps[i] = part[i] - part[i - 1]
        for j in range(0, cells - 1, 2):
            _two_cells(steps, n, rules, memory, j, block, static + j, linear + j)
        if cells % 2 == 1:
            j = cells - 1
            _one_cell(steps, n, rules[j], memory[j], block, static + j, linear + j)
        if friction:
            branch = _friction_block(
                kind,
                length,
                x,
                lo,
                lo + n,
                lo,
                branch,
                starts,
                anchors,
                directions,
                state,
                slope,
                block,
                linear - 1,
                linear + cells,
            )
        for i in range(force_part.size):
            block[columns - 1, i] = force_part[i]
        if weight.size > 0:
            ones[:n] = weight[lo : lo + n]
            for c in range(columns):
                for i in range(n):
                    block[c, i] *= ones[i]
        if n < BLOCK:
            block[:, n:] = 0.0
            ones[n:] = 0.0
        _add_products(block, ones, gram)
    # in the order of the layout: the force offset before the force
    place = np.empty(columns + 1, np.int64)
    for a in range(columns + 1):
        place[a] = a if a < columns - 1 else rows if a == columns - 1 else columns - 1
    out = np.empty((columns + 1, columns + 1))
    for a in range(columns + 1):
        for b in range(columns + 1):
            out[a, b] = gram[min(place[a], place[b]), max(place[a], place[b])]
    return out


def fused_gram(layout: Layout, motion: Motion, theta: Array, force: Array, stop: int, weight: Array | None = None) -> Array:
    """Return the Gram matrix over samples 0 to ``stop`` by the compiled pass, shape (C, C).

    Parameters
    ----------
    layout
        Columns of the model.
    motion
        Displacement with its branches.
    theta
        Logarithms of Maxwell rates [1/s] and friction displacement [m], shape (Q,).
    force
        Measured force [N], shape (N,).
    stop
        First sample that is not used.
    weight
        Square roots of sample weights, shape (N,), or None.
    """
    values = np.exp(theta)
    length = float(values[-1]) if layout.friction else 1.0
    gram: Array = gram_kernel(
        motion.x,
        force,
        np.empty(0) if weight is None else weight,
        motion.step_s,
        layout.spring,
        layout.cubic,
        layout.viscous,
        values[: layout.cells],
        layout.friction,
        length,
        motion.starts,
        motion.anchors,
        motion.directions,
        stop,
    )
    return gram


def numpy_columns(layout: Layout, motion: Motion, theta: Array) -> Array:
    """Return all columns but offset and force with numpy and scipy alone, shape (2Q + static, N)."""
    values = np.exp(theta)
    x, h = motion.x, motion.step_s
    out = np.empty((layout.linear + layout.nonlinear, x.size))
    row = 0
    for wanted, make in ((layout.spring, lambda: x), (layout.cubic, lambda: x**3), (layout.viscous, lambda: np.gradient(x, h))):
        if wanted:
            out[row] = make()
            row += 1
    step = np.diff(x, prepend=x[0])
    for j in range(layout.cells):
        a = values[j] * h
        e, g = np.exp(-a), -np.expm1(-a) / a
        m = scipy.signal.lfilter([g], [1.0, -e], step)
        out[row + j] = m
        previous = np.concatenate([[0.0], m[:-1]])
        out[layout.linear + j] = scipy.signal.lfilter([1.0], [1.0, -e], -a * e * previous + (e - g) * step)
    if layout.friction:
        out[layout.linear - 1], out[-1] = numpy_friction(layout.friction, motion, float(values[-1]))
    return out


def numpy_friction(kind: int, motion: Motion, length: float) -> tuple[Array, Array]:
    """Return unit friction and its derivative by log(length), vectorised over branches, shapes (N,)."""
    state, slope = branch_states(kind, length, motion.anchors, motion.directions)
    counts = np.diff(motion.starts)
    d = np.repeat(motion.directions, counts)
    u = np.maximum(d * (motion.x - np.repeat(motion.anchors, counts)), 0.0)
    a = d * np.repeat(state, counts)
    da = d * np.repeat(slope, counts)
    free = 1.0 - a
    if kind == FRICTION_BERG:
        share = u / (length * free + u)
        return d * (a + free * share), d * (da * (1.0 - share * share) - share * free * (1.0 - share))
    u /= length
    left = np.exp(-u)
    return d * (1.0 - free * left), d * (da * left - free * left * u)


def numpy_gram(layout: Layout, motion: Motion, theta: Array, force: Array, stop: int, weight: Array | None = None) -> Array:
    """Return the same matrix as :func:`fused_gram` with numpy and scipy alone, shape (C, C)."""
    columns = np.empty((layout.columns, stop))
    columns[:-2] = numpy_columns(layout, motion, theta)[:, :stop]
    columns[-2] = 1.0
    columns[-1] = force[:stop]
    if weight is not None:
        columns *= weight[:stop]
    gram: Array = columns @ columns.T
    return gram


#: the fused pass where kernels are compiled, else the numpy and scipy pass
best_gram = fused_gram if COMPILED else numpy_gram


def simulate(layout: Layout, motion: Motion, theta: Array, coefficients: Array) -> Array:
    """Return the model force [N] without offset, shape (N,)."""
    force: Array = coefficients @ numpy_columns(layout, motion, theta)[: layout.linear]
    return force
