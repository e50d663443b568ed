# Copyright 2026 ride_estimation contributors
"""A periodic force that the road does not explain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.lines import mean_frequency, residual_lines, residual_orders, tracked_phase
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import COORDINATES
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


@final
class HarmonicDisturbance(Cause):
    """A rotating machine, a pump or an engine order on the body."""

    ID = "harmonic_disturbance"
    QUESTION = "Does a periodic force act on the body that no base motion explains?"
    NEEDS = "a run much longer than the period"
    RIVALS = ("missing_degree_of_freedom", "flexible_mode")
    WOULD_REFUTE = "a line that vanishes with the road excitation: measure standing with the machine running"
    MEASURE_NEXT = "a run standing still with engine and auxiliaries running; engine speed in the recording"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and line of the residual, over time or over the distance driven."""
        out: list[Hypothesis] = []
        bodies = list(dict.fromkeys(b for b, _ in view.plant.coordinates))
        for line in residual_lines(view):
            phase = tracked_phase(view, line)
            # the phase was drawn from the data: two numbers per second of track bandwidth
            bandwidth = 2.0 * line.half_width_hz * float(view.data.time_s[-1])
            out += [self._turning(view, body, phase, bandwidth, {}) for body in bodies]
        for order in residual_orders(view):
            shape = {"order": order.cycles_per_m, "order std": order.std}
            out += [self._turning(view, body, order.phase, 1.0, shape) for body in bodies]
        return out

    def _turning(self, view: RunView, body: str, phase: Array, complexity: float, further: Shapes) -> Hypothesis:
        """Return a force and a moment on a body that turn with a phase, shape (N,)."""
        rows = [row for row, _ in view.plant.coordinate_rows(body)]

        def columns(view: RunView, shape: Shapes) -> list[Column]:
            return [(Effect(Where.WRENCH, r, f(phase)),) for r in rows for f in (np.cos, np.sin)]

        frequency, spread = mean_frequency(phase, view)
        grid = ({"frequency": frequency, "spread": spread, **further},)
        return Hypothesis(self.ID, body, "", columns, grid, complexity=complexity, run_bound=True)

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return frequency [Hz] and force or moment amplitude along the strongest coordinate."""
        strongest, amplitudes = strongest_coordinate(view, fitted)
        unit = "N" if strongest < 3 else "N m"
        name, shape = COORDINATES[strongest], fitted.shape
        found = (
            Reported("frequency", float(shape["frequency"]), float(shape["spread"]), "Hz"),
            Reported(f"amplitude {name}", float(amplitudes[strongest]), fitted.std(0), unit),
        )
        if "order" not in shape:
            return found
        return (*found, Reported("cycles per metre driven", float(shape["order"]), float(shape["order std"]), "1/m"))

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Leave the vehicle alone: the force belongs to the scenario."""
        f, amplitude = self.parameters(view, fitted)[:2]
        text = f"periodic force on {fitted.hypothesis.location}: {amplitude.value:.4g} {amplitude.unit} at {f.value:.3f} Hz"
        if "order" in fitted.shape:
            text += f" in the mean, {fitted.shape['order']:.4g} times per metre driven"
        return vehicle, (text + "; a vehicle file cannot describe it",)


def strongest_coordinate(view: RunView, fitted: Fitted) -> tuple[int, dict[int, float]]:
    """Return the body coordinate with the largest share in the response, and all amplitudes by coordinate."""
    body = fitted.hypothesis.location
    columns = [column for _, column in view.plant.coordinate_rows(body)]
    amplitudes = {
        c: float(np.hypot(fitted.coefficients[2 * i], fitted.coefficients[2 * i + 1])) for i, c in enumerate(columns)
    }
    forces = [c for c in columns if c < 3]
    return max(forces or columns, key=lambda c: amplitudes[c]), amplitudes
