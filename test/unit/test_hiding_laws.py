# Copyright 2026 ride_estimation contributors
"""No law that hides a cause is the finder's own: every family of the library leaves a part of each.

A test that hides an effect with the formula that the library fits to it finds that formula again, whatever the library is worth.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize
from worlds.bench import mount_force, random_motion
from worlds.hiding import FORMS, Site, law_of

from ride_estimation.diagnosis.adapters.bench import bench_run, bench_vehicle
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.effect import Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.hypotheses.characteristic import Family, odd_form
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.elements.kelvin_voigt import KelvinVoigt

RATE, STIFFNESS, DAMPING, RMS = 250.0, 1e5, 1e3, 0.004
LEAST_LEFT = 0.05  #: share of the non-linear part, rms


@functools.cache
def view() -> RunView:
    """Return 20 s of random stroke, 0.5 to 20 Hz, of a mount whose linear part is known."""
    _, x, _ = random_motion(RMS, 20.0, 3, step=1.0 / RATE)
    settings = Settings(over_band=True, band_hz=(0.25, 40.0), block_s=1.0, trim_s=2.5)
    plant = build_plant(bench_vehicle(KelvinVoigt(STIFFNESS, DAMPING), 1.0), {"force": 3, "motion": 3})
    run = bench_run("stroke", RATE, x, STIFFNESS * x, settings.band_hz)
    return RunView(RunData(plant, measurement(plant, run), settings), ModelState(np.array([STIFFNESS]), np.array([DAMPING])))


def hidden_force(form: str, u: float, w: float) -> np.ndarray:
    """Return the force of a hiding law along the stroke of :func:`view` [N]."""
    x, v = view().deflection[:, 0], view().deflection_rate[:, 0]
    rms, rate = float(np.std(x)), float(np.std(v))
    code = law_of(form, Site(STIFFNESS, DAMPING, 300.0, rms, rate, STIFFNESS * rms), 0.4, u, w)
    return mount_force(np.arange(len(x)) / RATE, x, v, 0.0, 0.0, (code,))


def left_by(h: Hypothesis, force: np.ndarray) -> float:
    """Return the share of the part of a force beyond a spring and a damper that a hypothesis leaves at its best shape."""
    x, v = view().deflection[:, 0], view().deflection_rate[:, 0]
    inner = slice(round(2.0 * RATE), -round(2.0 * RATE))
    linear = np.column_stack([x / np.std(x), v / np.std(v), np.ones_like(x)])

    def rest(columns: np.ndarray) -> float:
        used = columns[inner]
        used = used / np.maximum(np.sqrt(np.mean(used**2, axis=0)), 1e-300)
        return float(np.linalg.norm(force[inner] - used @ np.linalg.lstsq(used, force[inner], rcond=None)[0]))

    whole = rest(linear)

    def left(shape: dict[str, float]) -> float:
        own = [e.signal for column in h.columns(view(), shape) for e in column if e.where is Where.PORT]
        return rest(np.column_stack([linear, *own])) / whole

    return min(_refined(h, left, dict(entry)) for entry in sorted(h.grid, key=left)[:2])


def _refined(h: Hypothesis, left: Callable[[dict[str, float]], float], entry: dict[str, float]) -> float:
    """Return the least that is left around an entry of the grid, every scale free within the bounds of the library."""
    free = [s for s in h.shapes if s.name in entry]

    def at(point: np.ndarray) -> dict[str, float]:
        values = ((s, q if s.step > 0.0 else np.exp(q)) for s, q in zip(free, point))
        return {**entry, **{s.name: float(np.clip(value, s.lower, s.upper)) for s, value in values}}

    if not free:
        return left(entry)
    start = np.array([entry[s.name] if s.step > 0.0 else np.log(entry[s.name]) for s in free])
    corners = np.vstack([start, start + 0.3 * np.eye(len(free))])
    found = minimize(
        lambda point: left(at(point)), start, method="Nelder-Mead",
        options={"maxfev": 30, "xatol": 0.01, "fatol": 1e-4, "initial_simplex": corners},
    )  # fmt: skip
    # what fits best where the hypothesis means nothing is not fitted by it
    return float(found.fun) if h.possible(at(found.x)) else 1.0


def left_by_library(force: np.ndarray) -> dict[str, float]:
    """Return the least that any hypothesis of every cause of the library leaves, by cause; force laws only."""
    hypotheses = {name: [h for h in cause.hypotheses(view()) if h.ports] for name, cause in library().items()}
    return {name: min(left_by(h, force) for h in found) for name, found in hypotheses.items() if found}


def test_the_measure_sees_a_formula_of_the_library():
    u = view().deflection[:, 0] / np.std(view().deflection[:, 0])
    force = 300.0 * odd_form(u, {"family": float(Family.GROWING), "scale": 1.2})
    left = left_by_library(force)
    assert set(left) >= set(FORMS), "every cause that a law hides is compared"
    assert left["stiffness_nonlinearity"] < 0.01


@pytest.mark.parametrize(
    ("cause", "form", "shape"),
    [
        pytest.param(cause, form, shape, marks=[] if shape == (0.5, 0.5) and number == 0 else pytest.mark.slow)
        for cause, forms in FORMS.items()
        for number, form in enumerate(forms)
        for shape in ((0.5, 0.5), *itertools.product((0.0, 1.0), repeat=2))
    ],
)
def test_a_part_of_every_hiding_law_is_left_by_every_family(cause, form, shape):
    left = left_by_library(hidden_force(form, *shape))
    assert min(left.values()) >= LEAST_LEFT, sorted(left.items(), key=lambda item: item[1])[:2]
    # else the law would hide another cause than the one that a test demands
    assert min(left, key=lambda name: left[name]) == cause, sorted(left.items(), key=lambda item: item[1])[:2]
