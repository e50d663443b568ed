# Copyright 2026 ride_estimation contributors
"""The grey-box jounce bumper: a network of continuous local linear models with a static curve as second input."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements import declarations
from ride_estimation.elements import kernels_network as columns
from ride_estimation.elements.base import Array, ForceElement, parameter, series
from ride_estimation.elements.curve import curve_columns, curve_problems, evaluate_curve
from ride_estimation.elements.terms import LOCAL_LINEAR, Term

_PER_MODEL = (
    "travel_centres", "rate_centres", "travel_widths", "rate_widths", "poles", "offsets", "travel_gains", "travel_inputs",
    "force_gains", "force_inputs",
)


@final
@dataclasses.dataclass(frozen=True)
class LocalLinearNetwork(ForceElement):
    """Local linear models of first order, blended by normalised Gaussians of travel and rate.

    With the travel ``u = -x - clearance`` and the static push ``f(u)`` as second input (Hammerstein), model j of M is
    ``w_j' = -a_j w_j + c_1j u + c_2j f``, ``y_j = g_j + w_j + d_1j u + d_2j f``; ``F = -sum_j Phi_j y_j``,
    ``Phi_j = mu_j / sum mu``, ``mu_j = exp(-((z_1 - p_j)^2 / sigma_1j^2 + (z_2 - q_j)^2 / sigma_2j^2) / 2)`` with travel and
    rate z normalised to the trained range and clipped to it. Every pole -a_j is negative: each model is stable. Out of
    contact (u < 0) both inputs are zero and there is no force.

    Source: document 004 eq. (15)-(26). It prints no factor 1/2 in (18), which only rescales the widths. The gains follow
    from discrete models by :func:`continuous_gains`.
    """

    KIND: ClassVar[str] = "local_linear_network"

    travel_centres: tuple[float, ...] = series(
        "1", key="travel_centres", lower=-1.0, upper=2.0, meaning="normalised travel p_j of the centres", source="004 (18)"
    )
    rate_centres: tuple[float, ...] = series(
        "1", key="rate_centres", lower=-1.0, upper=2.0, meaning="normalised rate q_j of the centres", source="004 (18)"
    )
    travel_widths: tuple[float, ...] = series(
        "1", key="travel_widths", lower=1e-4, upper=1e3, meaning="normalised widths sigma_1j along travel", source="004 (18)"
    )
    rate_widths: tuple[float, ...] = series(
        "1", key="rate_widths", lower=1e-4, upper=1e3, meaning="normalised widths sigma_2j along rate", source="004 (18)"
    )
    poles: tuple[float, ...] = series(
        "1/s", key="poles_per_s", lower=1e-3, upper=1e5, meaning="decay rates a_j of the models; 40 to 70 1/s in document 004",
        source="004 (24)",
    )
    offsets: tuple[float, ...] = series(
        "N", key="offsets_n", lower=-1e8, upper=1e8, meaning="constant pushes g_j", source="004 (23)"
    )
    travel_gains: tuple[float, ...] = series(
        "N/m", key="travel_gains_n_per_m", lower=-1e10, upper=1e10, meaning="direct gains d_1j of the travel",
        role="stiffness", source="004 (25)",
    )
    travel_inputs: tuple[float, ...] = series(
        "N/(m s)", key="travel_inputs", lower=-1e13, upper=1e13, meaning="gains c_1j of the travel into the state [N/(m s)]",
        role="stiffness", source="004 (24)",
    )
    force_gains: tuple[float, ...] = series(
        "1", key="force_gains", lower=-1e5, upper=1e5, meaning="direct gains d_2j of the static push", role="stiffness",
        source="004 (25)",
    )
    force_inputs: tuple[float, ...] = series(
        "1/s", key="force_inputs_per_s", lower=-1e8, upper=1e8, meaning="gains c_2j of the static push into the state",
        role="stiffness", source="004 (24)",
    )
    travels: tuple[float, ...] = series(
        "m", key="travels_m", lower=0.0, upper=10.0, meaning="travels of the static curve, increasing from 0", source="004"
    )
    forces: tuple[float, ...] = series(
        "N", key="forces_n", lower=0.0, upper=1e8, meaning="static push at these travels", source="004"
    )
    lowest_travel: float = parameter(
        "m", key="lowest_travel_m", lower=-10.0, upper=10.0, meaning="trained travel, low end", source="004 discussion"
    )
    highest_travel: float = parameter(
        "m", key="highest_travel_m", lower=-10.0, upper=10.0, meaning="trained travel, high end", source="004 discussion"
    )
    lowest_rate: float = parameter(
        "m/s", key="lowest_rate_m_per_s", lower=-100.0, upper=100.0, meaning="trained rate of the travel, low end",
        source="004 discussion",
    )
    highest_rate: float = parameter(
        "m/s", key="highest_rate_m_per_s", lower=-100.0, upper=100.0, meaning="trained rate of the travel, high end",
        source="004 discussion",
    )
    clearance: float = declarations.clearance()

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        counts = {name: len(getattr(self, name)) for name in _PER_MODEL}
        if len(set(counts.values())) != 1:
            listed = ", ".join(f"{name} {n}" for name, n in counts.items())
            yield f"one entry per local model is needed in every list; given {listed}"
        if not self.poles:
            yield "poles_per_s: at least one local model is needed"
        yield from curve_problems("travels_m", self.travels, "forces_n", self.forces)
        if not self.highest_travel > self.lowest_travel:
            yield f"highest_travel_m: {self.highest_travel:g} m does not exceed lowest_travel_m, {self.lowest_travel:g} m"
        if not self.highest_rate > self.lowest_rate:
            yield f"highest_rate_m_per_s: {self.highest_rate:g} m/s does not exceed lowest_rate_m_per_s, {self.lowest_rate:g} m/s"

    def _curve(self) -> tuple[float, ...]:
        return curve_columns(self.travels, self.forces, flat_ends=(True, False))

    def _inputs(self, x: float) -> tuple[float, float]:
        travel = max(-x - self.clearance, 0.0)
        return travel, evaluate_curve(self._curve(), travel)

    def validity(self, x: float, v: float) -> Array:
        """Return the weights Phi_j of the models at a deflection and rate, shape (M,); their sum is 1."""
        travel = (-x - self.clearance - self.lowest_travel) / (self.highest_travel - self.lowest_travel)
        rate = (-v - self.lowest_rate) / (self.highest_rate - self.lowest_rate)
        a = (min(max(travel, 0.0), 1.0) - np.array(self.travel_centres)) / np.array(self.travel_widths)
        b = (min(max(rate, 0.0), 1.0) - np.array(self.rate_centres)) / np.array(self.rate_widths)
        distance = 0.5 * (a**2 + b**2)
        weights = np.exp(np.min(distance) - distance)
        return np.asarray(weights / np.sum(weights))

    def initial(self) -> Array:
        """Return the steady states of the models at rest at x = 0, shape (M,)."""
        u, f = self._inputs(0.0)
        return np.asarray((np.array(self.travel_inputs) * u + np.array(self.force_inputs) * f) / np.array(self.poles))

    def consistent_state(self, x: float, force: float) -> Array:
        """Return the states [N] that best agree with both rest at x and a measured force, shape (M,).

        Least squares of the initial rates and of the difference to the force, by the pseudo-inverse (document 004 (26),
        restored): ``w_0 = [A; C]^+ [-B u_0; y_0 - g - D u_0]``.
        """
        u, f = self._inputs(x)
        weights = self.validity(x, 0.0)
        direct = np.array(self.offsets) + np.array(self.travel_gains) * u + np.array(self.force_gains) * f
        system = np.vstack([-np.diag(np.array(self.poles)), weights])
        drive = np.array(self.travel_inputs) * u + np.array(self.force_inputs) * f
        return np.asarray(np.linalg.pinv(system) @ np.append(-drive, -force - weights @ direct))

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return the rates of the states [N/s] (document 004 (24))."""
        u, f = self._inputs(x)
        drive = np.array(self.travel_inputs) * u + np.array(self.force_inputs) * f
        return np.asarray(drive - np.array(self.poles) * s)

    def force(self, s: Array, x: float, v: float) -> float:
        """Return ``-sum_j Phi_j y_j`` [N] (document 004 (16), (25)); nothing out of contact."""
        u, f = self._inputs(x)
        if u <= 0.0:
            return 0.0
        outputs = np.array(self.offsets) + s + np.array(self.travel_gains) * u + np.array(self.force_gains) * f
        return -float(self.validity(x, v) @ outputs)

    def is_passive(self) -> bool:
        """Return False: the direct gains and states are fitted, nothing keeps the network from yielding energy."""
        return False

    def fastest_rate(self, peak_speed: float) -> float:
        """Return the fastest pole [1/s]."""
        return max(self.poles)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        head = (
            -1.0, self.clearance, self.lowest_travel, self.highest_travel, self.lowest_rate, self.highest_rate,
            float(len(self.poles)), float(len(self.travels)),
        )
        lists = [getattr(self, name) for name in _PER_MODEL]
        models = tuple(float(entries[j]) for j in range(len(self.poles)) for entries in lists)
        if len(models) != columns.MODEL_SIZE * len(self.poles):
            raise ValueError("the kernel and the element disagree on the numbers per local model")
        return (Term(LOCAL_LINEAR, (*head, *models, *self._curve())),)

    @classmethod
    def example(cls) -> LocalLinearNetwork:
        """Return a network of three models around a static curve."""
        return cls(
            travel_centres=(0.25, 0.75, 0.75), rate_centres=(0.5, 0.25, 0.75), travel_widths=(0.17, 0.17, 0.17),
            rate_widths=(0.33, 0.17, 0.17), poles=(40.0, 55.0, 70.0), offsets=(0.0, 0.0, 0.0),
            travel_gains=(4e3, 8e3, 9e3), travel_inputs=(-1.6e5, -4.4e5, -6.3e5), force_gains=(1.2, 1.3, 1.4),
            force_inputs=(-8.0, -16.5, -28.0), travels=(0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07),
            forces=(0.0, 120.0, 300.0, 560.0, 1000.0, 1900.0, 4000.0, 9000.0), lowest_travel=0.0, highest_travel=0.07,
            lowest_rate=-2.0, highest_rate=2.0,
        )


def continuous_gains(
    feedback: float, inputs: tuple[tuple[float, float], ...], offset: float, step_s: float
) -> tuple[float, tuple[tuple[float, float], ...], float]:
    """Return pole, gains and offset of the continuous model of one discrete local model, by the bilinear transformation.

    Discrete: ``y_k = g + a y_(k-1) + sum_j (b_j0 u_j,k + b_j1 u_j,k-1)``. Continuous: ``y = g~ + w + sum_j d_j u_j``,
    ``w' = -alpha w + sum_j c_j u_j`` with ``alpha = (2 / T)(1 - a) / (1 + a)``, ``d_j = (b_j0 - b_j1) / (1 + a)``,
    ``c_j = (2 / T)(b_j0 + b_j1) / (1 + a) - alpha d_j``, ``g~ = g / (1 - a)`` (final value).

    Parameters
    ----------
    feedback
        a, between -1 and 1 (exclusive) for a stable model.
    inputs
        ``(b_j0, b_j1)`` per input.
    offset
        g [N].
    step_s
        T [s].

    Returns
    -------
    tuple
        ``alpha`` [1/s], ``((d_j, c_j), ...)``, ``g~`` [N].

    Raises
    ------
    ValueError
        Feedback outside (-1, 1): the model is not stable.

    Notes
    -----
    Source: document 004 (19)-(25), restored: with plus in (15) the denominator (20) has a minus, ``D = 1 - a z^-1``.
    """
    if not -1.0 < feedback < 1.0 or not math.isfinite(feedback):
        raise ValueError(f"feedback {feedback:g} is outside (-1, 1): the discrete local model is not stable")
    scale = 2.0 / (step_s * (1.0 + feedback))
    alpha = scale * (1.0 - feedback)
    gains = []
    for b0, b1 in inputs:
        direct = (b0 - b1) / (1.0 + feedback)
        gains.append((direct, scale * (b0 + b1) - alpha * direct))
    return alpha, tuple(gains), offset / (1.0 - feedback)
