# Copyright 2026 ride_estimation contributors
"""Dry friction in a mount."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.common.extension import add_parallel
from ride_estimation.diagnosis.hypotheses.characteristic import LEAST_RATE_SCALE
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Law, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.operators import friction_level, loose_friction
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, force_columns, group_of, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


_COLUMNS = 3
_BEHIND, _GUIDED = "behind a spring or a play", "beyond the play of a guide"
#: mean stroke from one reversal to the next of a random motion, in its rms: sqrt(2 pi)
_STROKE = 2.5
#: half of the play in rms deflections at and below which there is none, and the exponent of Bouc-Wen for a spring and a slider
_NO_PLAY, _SHARP = 0.02, 20.0
#: least half of the play of a guide, in the same unit: without play its two sliders fit any rounded friction
_GUIDE = 0.06
#: elements of a vehicle file for what slides at once and for what slides part by part
_SLIDERS: tuple[tuple[str, ...], tuple[dict[str, float], ...]] = (("bouc_wen", "dahl"), ({"exponent": _SHARP}, {}))


def _law(reach: float, rounding: float) -> Callable[[Array, Array, float, float], list[Array]]:
    """Two presliding distances, as a chain of sliding elements has, and a part rounded over the rate, as noise makes it."""

    def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
        return [
            friction_level(x, reach * x_rms), friction_level(x, 4.0 * reach * x_rms), np.tanh(v / (rounding * v_rms)),
        ]

    return law


@final
class CoulombFriction(Cause):
    """A force that opposes sliding and hardly grows with speed or stroke."""

    ID = "coulomb_friction"
    QUESTION = "Does a mount resist sliding with a force that does not grow with speed?"
    NEEDS = "mount deflection from base and body accelerations; strokes beyond the presliding distance"
    RIVALS = ("damping_nonlinearity", "viscoelasticity", "stiffness_nonlinearity")
    WOULD_REFUTE = "a friction level that grows with stroke or speed: repeat the run on a rougher and on a smoother road"
    MEASURE_NEXT = "slow stroke of the mount on a bench at two speeds: the loop height of friction does not change with speed"
    LAW = Law.SLIDING

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return three hypotheses per group: friction, friction behind a play that moves along, beyond that of a guide."""
        grid = tuple({"reach": r, "rounding": w} for r, w in ((0.01, 0.06), (0.03, 0.15), (0.1, 0.06)))
        bounds = (Shape("reach", 0.03, 0.004, 0.5), Shape("rounding", 0.1, 0.02, LEAST_RATE_SCALE))

        def build(group: PortGroup) -> Hypothesis:
            def columns(view: RunView, shape: Shapes) -> list[Column]:
                return force_columns(view, group, _law(float(shape["reach"]), float(shape["rounding"])))

            return Hypothesis(self.ID, group.location, group.axis, columns, grid, bounds, (Sign.POSITIVE,), ports=group.ports)

        return [h for group in port_groups(view) for h in (build(group), _in_series(group, _BEHIND), _in_series(group, _GUIDED))]

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the friction level [N] and, where the run shows one, the sliding distance to 63 % of it [m].

        The standard deviation of the level is that of its fit, 7 % of it, because no law of a library is the real one, and what
        lies beyond the strokes of the run: laws with one sliding distance d that approach their level exponentially or as
        ``x / (x + d)`` differ by ``d / (s + d)`` there after a stroke s.
        """
        group = group_of(view, fitted)
        out: list[Reported] = []
        if fitted.hypothesis.variant:
            columns = len(fitted.coefficients) // len(group.ports)
            for i, p in enumerate(group.ports):
                label, x_rms = group.label(view, p), view.scales[p][0]
                part = slice(columns * i, columns * (i + 1))
                level = float(fitted.coefficients[part].sum())
                half, slope = fitted.shape["half"], fitted.shape["slope"]
                play, stroke = fitted.spread("half", 0.2 * half), fitted.spread("slope", 0.5 * slope)
                # what slides part by part goes on beyond the strokes of the run, as without a play
                gradual = float(fitted.coefficients[part][1:].sum()) / max(level, 1e-12)
                beyond = FORM + (gradual * slope / (slope + max(_STROKE - 2.0 * half, 0.0))) ** 2
                std = float(np.sqrt(max(fitted.covariance[part, part].sum(), 0.0) + beyond * level**2))
                out.append(Reported(f"friction level{label}", level, std, "N"))
                if _has_play(fitted):
                    out.append(Reported(f"clearance before it{label}", float(2.0 * half * x_rms), 2.0 * x_rms * play, "m"))
                out.append(Reported(f"stroke from contact to sliding{label}", float(slope * x_rms), x_rms * stroke, "m"))
            return tuple(out)
        for i, p in enumerate(group.ports):
            part = slice(_COLUMNS * i, _COLUMNS * (i + 1))
            share = fitted.coefficients[part]
            level = float(share.sum())
            reach = fitted.shape["reach"] * float(share[0] + 4.0 * share[1]) / max(level, 1e-12)
            beyond = FORM + (reach / (reach + _STROKE)) ** 2
            std = float(np.sqrt(max(fitted.covariance[part, part].sum(), 0.0) + beyond * level**2))
            label, x_rms = group.label(view, p), view.scales[p][0]
            out.append(Reported(f"friction level{label}", level, std, "N"))
            if reach > 0.0:
                out.append(Reported(f"sliding distance{label}", reach * x_rms, 0.5 * reach * x_rms, "m"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Put a friction element parallel to every mount of the group."""
        group = group_of(view, fitted)
        if fitted.hypothesis.variant:
            if _has_play(fitted):
                return vehicle, (f"friction behind a clearance at {group.location} {group.axis}: not in a vehicle file",)
            columns = len(fitted.coefficients) // len(group.ports)
            for i, p in enumerate(group.ports):
                port, reach = view.plant.ports[p], fitted.shape["slope"] * view.scales[p][0]
                for level, kind, form in zip(fitted.coefficients[columns * i :][:columns], *_SLIDERS):
                    if level > 0.0:
                        values = {"friction_n": float(level), "slope_n_per_m": float(level) / reach}
                        vehicle = add_parallel(vehicle, port.mount, port.axis, kind, values | form)
            return vehicle, ()
        for i, p in enumerate(group.ports):
            port = view.plant.ports[p]
            x_rms = view.scales[p][0]
            v_rms = view.scales[p][1]
            short, long, rounded = (float(c) for c in fitted.coefficients[_COLUMNS * i : _COLUMNS * (i + 1)])
            for level, factor in ((short, 1.0), (long, 4.0)):
                if level > 0.0:
                    # Dahl: initial slope sigma = level / reach
                    slope = level / (factor * fitted.shape["reach"] * x_rms)
                    values = {"friction_n": level, "slope_n_per_m": slope}
                    vehicle = add_parallel(vehicle, port.mount, port.axis, "dahl", values)
            if rounded > 0.0:
                values = {
                    "friction_n": rounded, "breakaway_n": rounded, "stribeck_speed_m_per_s": v_rms,
                    "rounding_m_per_s": fitted.shape["rounding"] * v_rms,
                }
                vehicle = add_parallel(vehicle, port.mount, port.axis, "stribeck_friction", values)
        return vehicle, ()


def _has_play(fitted: Fitted) -> bool:
    """Return whether the play is more than the none at the bound by its standard deviation."""
    half = fitted.shape["half"]
    return half > _NO_PLAY + fitted.spread("half", 0.2 * half)


def _in_series(group: PortGroup, variant: str) -> Hypothesis:
    """Return a slider behind a spring and a clearance; either may be nothing.

    The clearance moves with what slides, as that of a clamped bolt in an oversize hole, or stays, as that of a guide: what counts
    there is the stroke beyond it, and what slides does so at once or part by part.
    """

    def columns(view: RunView, shape: Shapes) -> list[Column]:
        def law(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
            half, slope = float(shape["half"]) * x_rms, float(shape["slope"]) * x_rms
            if variant == _BEHIND:
                return [loose_friction(x, half, slope)]
            beyond = x - np.clip(x, -half, half)
            return [loose_friction(beyond, 0.0, slope), friction_level(beyond, slope)]

        return force_columns(view, group, law)

    grid = tuple({"half": h, "slope": 0.1} for h in (_GUIDE, 0.2, 0.6))
    bounds = (Shape("half", 0.2, _NO_PLAY if variant == _BEHIND else _GUIDE, 1.5), Shape("slope", 0.1, 0.01, 1.0))
    return Hypothesis(
        CoulombFriction.ID, group.location, group.axis, columns, grid, bounds, (Sign.POSITIVE,), ports=group.ports,
        variant=variant,
    )
