# Copyright 2026 ride_estimation contributors
"""Contact with a stop at large deflection."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.common.extension import add_force_table
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Law, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, force_columns, group_of, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_COLUMNS = 3
#: deflection rms over which the rate of a stop grows by e: one that is nearly a square, and one that is a block
_SQUARE, _STEEP = 5.0, 0.5
_STEEPEST = 30.0  # argument of the exponential, where doubles would overflow long after any data
_BEYOND = 1.1  # multiple of the largest deflection of the run up to which its stops are believed to go on hardening


@dataclasses.dataclass(frozen=True)
class _Reach:
    """Where a stop may begin, in rms deflections, and what is tried first.

    Attributes
    ----------
    gap
        Start and bounds.
    gaps, hardenings
        Tried by the screening.
    inner
        As in :class:`Hypothesis`.
    """

    gap: Shape
    gaps: tuple[float, ...]
    hardenings: tuple[float, ...]
    inner: tuple[str, ...] = ()

    @property
    def grid(self) -> tuple[Shapes, ...]:
        """Return the shape parameters tried by the screening."""
        return tuple({"gap": g, "hardening": s} for s in self.hardenings for g in self.gaps)


#: what is in contact for more than a fifth of the time is a spring and no stop: on both sides from 1.3 on, on one from 0.85. A
#: near one is a spring as well where the nearest gap of all fits best, or where it would grow exponentially from there on
_FAR = _Reach(Shape("gap", 2.0, 1.3, 6.0), (1.3, 1.8, 2.4), (_SQUARE, _STEEP))
_NEAR = _Reach(Shape("gap", 1.0, 0.85, 1.3), (0.9, 1.1), (_SQUARE,), inner=("gap",))
#: variant -> sides and reach
_VARIANTS: dict[str, tuple[tuple[float, ...], _Reach]] = {
    "compression": ((-1.0,), _FAR), "extension": ((1.0,), _FAR), "both sides": ((-1.0, 1.0), _FAR),
    "close, compression": ((-1.0,), _NEAR), "close, extension": ((1.0,), _NEAR),
}  # fmt: skip


def _depth(x: Array, side: float, gap: float) -> Array:
    return np.maximum(side * x - gap, 0.0)


def _hardening(depth: Array, scale: float, known: float) -> Array:
    """Return the part of a stop's force that grows faster than its depth: ``2 s^2 (exp(d / s) - 1 - d / s)``, [m^2].

    A bumper is compressed between a soft skirt and a block: anything from a square (``s`` large) to an exponential.

    Parameters
    ----------
    depth
        [m].
    scale
        Depth ``s`` over which the rate of the stop grows by e [m].
    known
        Depth beyond which the line goes on straight: no run tells how a stop hardens where it never was [m].
    """
    last = min(max(known, 0.0) / scale, _STEEPEST)
    u = np.minimum(depth / scale, last)
    beyond = np.maximum(depth / scale - last, 0.0) * np.expm1(last)
    return np.asarray(2.0 * scale**2 * (np.expm1(u) - u + beyond))


@final
class BumpStop(Cause):
    """A stop on one or both sides that engages beyond a gap."""

    ID = "bump_stop"
    QUESTION = "Does a mount run into a stop at large deflection?"
    NEEDS = "deflections beyond the gap, at least a few times"
    RIVALS = ("stiffness_nonlinearity", "damping_nonlinearity")
    WOULD_REFUTE = "a misfit that is not confined to the largest deflections"
    MEASURE_NEXT = "a drive over single bumps, or the witness marks and the free travel of the stop"

    LAW = Law.ELASTIC

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per group and side."""
        out: list[Hypothesis] = []
        strokes = view.strokes[0]
        reach = tuple(float(x) for x in _BEYOND * np.max(np.abs(strokes), axis=0))
        for group in port_groups(view):
            for variant, (sides, within) in _VARIANTS.items():

                def columns(view: RunView, shape: Shapes, s: PortGroup = group, sd: tuple[float, ...] = sides) -> list[Column]:
                    return _columns(view, s, sd, shape, reach)

                signs = (Sign.POSITIVE, Sign.POSITIVE, Sign.ANY)
                grid = tuple(shape for shape in within.grid if _reached(view, strokes, group, sides, shape["gap"]))
                if grid:
                    out.append(Hypothesis(
                        self.ID, group.location, group.axis, columns, grid, (within.gap,), signs, float(len(sides) - 1),
                        group.ports, variant, inner=within.inner,
                    ))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return gap [m] and force at the largest penetration [N]."""
        group = group_of(view, fitted)
        out: list[Reported] = []
        strokes = view.strokes[0]
        for i, p in enumerate(group.ports):
            x = strokes[:, p]
            x_rms = view.scales[p][0]
            gap = fitted.shape["gap"] * x_rms
            label, spread = group.label(view, p), x_rms * fitted.spread("gap", 0.05 * fitted.shape["gap"])
            out.append(Reported(f"gap{label}", float(gap), float(spread), "m"))
            deepest = np.array([max(max(float(np.max(side * x)) for side in _sides(fitted)) - gap, 0.0)])
            force = float(_elastic(fitted, i, deepest, x_rms, float(deepest[0]))[0])
            out.append(Reported(f"force at the deepest contact{label}", force, 0.1 * force, "N"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put the stop as a force-deflection curve parallel to every mount of the group."""
        group = group_of(view, fitted)
        strokes = view.strokes[0]
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            x = strokes[:, p]
            x_rms = view.scales[p][0]
            gap = fitted.shape["gap"] * x_rms
            reach = 1.5 * float(np.max(np.abs(x)))
            grid = np.linspace(-reach, reach, 121)
            force = np.zeros_like(grid)
            for side in _sides(fitted):
                depth = _depth(grid, side, gap)
                force += side * _elastic(fitted, i, depth, x_rms, _BEYOND * float(np.max(side * x)) - gap)
            vehicle = add_force_table(vehicle, port.mount, port.axis, grid, force)
        return vehicle, ("the loss of the stop is not in the extended vehicle file",)


def _reached(view: RunView, strokes: Array, group: PortGroup, sides: tuple[float, ...], gap: float) -> bool:
    """Return whether some mount of the group goes beyond a gap given in units of its rms deflection."""
    return any(float(np.max(side * strokes[:, p])) > gap * view.scales[p][0] for p in group.ports for side in sides)


def _elastic(fitted: Fitted, place: int, depth: Array, x_rms: float, known: float) -> Array:
    """Return the force of a fitted stop at some depths, its loss left out [N]."""
    linear, hard = fitted.coefficients[_COLUMNS * place : _COLUMNS * place + 2]
    return np.asarray(linear * depth + hard * _hardening(depth, fitted.shape["hardening"] * x_rms, known) / x_rms)


def _columns(
    view: RunView, group: PortGroup, sides: tuple[float, ...], shape: Shapes, reach: tuple[float, ...]
) -> list[Column]:
    """Return linear part, hardening part and loss of every mount of a group; what loses is the part that carries most."""
    out: list[Column] = []
    for p in group.ports:
        def law(x: Array, v: Array, x_rms: float, v_rms: float, known: float = reach[p]) -> list[Array]:
            gap = float(shape["gap"]) * x_rms
            linear, hard, loss = (np.zeros(len(x)) for _ in range(_COLUMNS))
            for side in sides:
                depth = _depth(x, side, gap)
                grown = _hardening(depth, float(shape["hardening"]) * x_rms, known - gap) / x_rms
                linear += side * depth
                hard += side * grown
                loss += (grown if shape["hardening"] < _SQUARE else depth) * np.tanh(v / v_rms)
            return [linear, hard, loss]

        out += force_columns(view, dataclasses.replace(group, ports=(p,)), law)
    return out


def _sides(fitted: Fitted) -> tuple[float, ...]:
    return _VARIANTS[fitted.hypothesis.variant][0]
