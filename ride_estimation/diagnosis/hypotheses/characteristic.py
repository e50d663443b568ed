# Copyright 2026 ride_estimation contributors
"""Nonlinear characteristics: an odd form of a few families and its asymmetric parts, over deflection or over rate."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis, Shapes
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, force_columns, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]


class Family(enum.IntEnum):
    """How a characteristic departs from a straight line; scales are in units of the rms of its argument."""

    SATURATING = 1  #: ``s tanh(u / s)``
    GROWING = 2  #: ``s sinh(u / s)``
    CUBIC = 3  #: ``u^3``
    SQUARE = 4  #: ``u |u|``, flow through an orifice
    BULGE = 5  #: ``u exp(-(u / s)^2)``, a force around zero that fades
    POWER = 6  #: ``sign(u) |u|^s``
    KNEE = 7  #: ``u`` within ``-s .. s``, a valve that blows off


#: shape parameter that adds corners to a family, for what no family holds
CORNERS = "corners"
#: side and place of every corner, over the rms of the argument
_CORNERS = tuple((sign, place) for sign in (1.0, -1.0) for place in (0.5, 1.0, 1.8, 2.6))
#: share of a run that has to lie beyond a corner: a slope of a few samples would go on far beyond them
_BEYOND = 0.005


#: a damper is nonlinear at rates beyond that share of their rms; a force that levels off below it is friction by name, and the
#: two causes would otherwise hold the same law. Friction is rounded over a tenth of the usual rate at most, the knee of a
#: damper lies at two fifths of it at least; this is the geometric mean
LEAST_RATE_SCALE = 0.2
_STEP = 1e-4  # of the slope at an end, share of the reach
_LEAST = 1e-15  # reach of a port that does not move [m or m/s]
_LIMIT = 6.0  # argument of the growing form, where doubles would overflow long after any data


def odd_form(u: Array, shape: Shapes) -> Array:
    """Return the odd part at normalised deflections or rates, shape as ``u``."""
    scale = float(shape["scale"])
    match Family(int(shape["family"])):
        case Family.SATURATING:
            return np.asarray(scale * np.tanh(u / scale))
        case Family.GROWING:
            return np.asarray(scale * np.sinh(np.clip(u / scale, -_LIMIT, _LIMIT)))
        case Family.CUBIC:
            return np.asarray(u**3)
        case Family.SQUARE:
            return np.asarray(u * np.abs(u))
        case Family.BULGE:
            return np.asarray(u * np.exp(-((u / scale) ** 2)))
        case Family.POWER:
            return np.asarray(np.sign(u) * np.abs(u) ** scale)
        case Family.KNEE:
            return np.asarray(np.clip(u, -scale, scale))


def characteristic_forms(u: Array, shape: Shapes, over_rate: bool) -> list[Array]:
    """Return the forms that make up a characteristic at normalised deflections or rates, shape as ``u`` each.

    Over rate the odd form ``f``, ``|u|`` and ``|f|``: a damper has a slope and a bend of its own in either direction. Over
    deflection ``f`` and ``u^2``, or ``s (cosh(u / s) - 1)`` beside ``s sinh(u / s)``: both together hold a spring that stiffens
    in one direction only, as rubber and gas do in compression. With corners ``max(+-u - b, 0)`` for each of them.
    """
    odd = odd_form(u, shape)
    corners = [np.maximum(sign * u - place, 0.0) for sign, place in _CORNERS] if CORNERS in shape else []
    if over_rate:
        return [odd, np.abs(u), np.abs(odd), *corners]
    if int(shape["family"]) == Family.GROWING:
        scale = float(shape["scale"])
        return [odd, np.asarray(scale * (np.cosh(np.clip(u / scale, -_LIMIT, _LIMIT)) - 1.0)), *corners]
    return [odd, u**2, *corners]


def straight_beyond(u: Array, reach: float, shape: Shapes, over_rate: bool) -> list[Array]:
    """Return the forms of a characteristic, straight beyond ``-reach .. reach``: no run has told how it goes on there.

    A growing form that softens a spring within the strokes of a run turns its force round a little further out. The table of the
    extended vehicle file goes on straight too.
    """
    inner = np.clip(u, -reach, reach)
    ends = np.array([-1.0, -1.0 + _STEP, 1.0 - _STEP, 1.0]) * reach
    out = []
    for form, end in zip(*(characteristic_forms(at, shape, over_rate) for at in (inner, ends))):
        low, high = (end[1] - end[0]) / (_STEP * reach), (end[3] - end[2]) / (_STEP * reach)
        out.append(np.asarray(form + np.where(u > 0.0, high, low) * (u - inner)))
    return out


def characteristic_hypotheses(
    view: RunView, cause: str, forms: Sequence[tuple[Family, float]], over_rate: bool
) -> list[Hypothesis]:
    """Return one hypothesis per group, the family from the grid, its scale refined.

    Parameters
    ----------
    forms
        Families and start values of their scales.
    over_rate
        The characteristic is one over rate, not over deflection.
    """
    grid = tuple({"family": float(family), "scale": scale} for family, scale in forms)
    strokes = view.strokes[1 if over_rate else 0]
    reach = np.maximum(np.max(np.abs(strokes), axis=0), _LEAST)
    shown = np.array([np.mean(sign * strokes > place * np.std(strokes, axis=0), axis=0) > _BEYOND for sign, place in _CORNERS])

    def build(group: PortGroup) -> Hypothesis:
        def columns(view: RunView, shape: Shapes) -> list[Column]:
            out: list[Column] = []
            for p in group.ports:
                def law(x: Array, v: Array, x_rms: float, v_rms: float, port: int = p) -> list[Array]:
                    u, rms = (v, v_rms) if over_rate else (x, x_rms)
                    forms = straight_beyond(u / rms, reach[port] / rms, shape, over_rate)
                    if CORNERS in shape:
                        forms[-len(_CORNERS) :] = [f * told for f, told in zip(forms[-len(_CORNERS) :], shown[:, port])]
                    return [form - np.mean(form) for form in forms]

                out += force_columns(view, dataclasses.replace(group, ports=(p,)), law)
            return out

        bounds = (Shape("scale", 1.0, LEAST_RATE_SCALE if over_rate else 0.1, 6.0),)
        return Hypothesis(
            cause, group.location, group.axis, columns, grid, bounds, complexity=1.0, ports=group.ports, cornered=True
        )

    return [build(group) for group in port_groups(view)]
