# Copyright 2026 ride_estimation contributors
"""One soft mount among mounts whose files are merely off: chance of a false alarm as stated, real ones found."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ride_estimation.diagnosis.model.plant import Port
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.search.outlier import soft_mount

MOUNTS, AXES = ("fl", "fr", "rl", "rr"), "xyz"
FILE = np.array([3e5, 3e5, 4e4] * 4)


#: a file with other parts in front than in the rear
AXLES = np.array([3e5, 3e5, 4e4] * 2 + [2e5, 4e5, 6e4] * 2)


def judged(logs: np.ndarray, log_std: float = 0.01, file: np.ndarray = FILE):
    """Verdict for stiffness ``file exp(logs)``, logs (4, 3)."""
    ports = tuple(Port(m, a, k, 1e3, 0.3, 0.5) for (m, a), k in zip(((m, a) for m in MOUNTS for a in AXES), file))
    stiffness = file * np.exp(logs.ravel())
    view = SimpleNamespace(
        plant=SimpleNamespace(ports=ports), state=ModelState(stiffness, np.full(12, 1e3)),
        port_index=lambda mount, axis: 3 * MOUNTS.index(mount) + AXES.index(axis),
    )
    calibrated = SimpleNamespace(view=view, adjustables=(), fit=SimpleNamespace(coefficients=np.zeros(0)))
    return soft_mount(calibrated, stiffness, np.full(12, log_std))


@pytest.mark.parametrize("scatter", [0.03, 0.075])
def test_files_that_are_merely_off_raise_no_alarm(scatter):
    rng = np.random.default_rng(1)
    alarms = sum(judged(scatter * rng.standard_normal((4, 3))) is not None for _ in range(400))
    assert alarms <= 12, "1 % of 400 and three standard deviations of that count"


def test_a_soft_mount_is_found_where_it_is():
    rng = np.random.default_rng(2)
    right = 0
    for _ in range(100):
        logs = 0.05 * rng.standard_normal((4, 3)) + 0.2 * rng.standard_normal()
        logs[2, 2] += np.log(0.6)
        found = judged(logs)
        right += found is not None and (found.hypothesis.location, found.hypothesis.axis) == ("rl", "z")
    assert right >= 90


def test_an_uncertain_estimate_is_no_evidence():
    logs = np.zeros((4, 3))
    logs[0, 0] = np.log(0.5)
    assert judged(logs) is not None
    assert judged(logs, log_std=0.2) is None


def _axles(rng: np.random.Generator, scatter: float) -> np.ndarray:
    """Logs (4, 3) of a file that is off by 15 % per part, and mounts of one part that scatter."""
    return np.repeat(0.15 * rng.standard_normal((2, 3)), 2, axis=0) + scatter * rng.standard_normal((4, 3))


@pytest.mark.parametrize("scatter", [0.03, 0.075])
def test_parts_of_which_the_file_is_off_raise_no_alarm(scatter):
    rng = np.random.default_rng(3)
    alarms = sum(judged(_axles(rng, scatter), file=AXLES) is not None for _ in range(400))
    assert alarms <= 12


def test_a_soft_mount_is_found_beside_one_of_the_same_part():
    # against the mounts of the other axle, whose file is off by its own error, few of them stand out
    rng = np.random.default_rng(4)
    right = 0
    for _ in range(100):
        logs = _axles(rng, 0.03)
        logs[1, 2] += np.log(0.6)
        found = judged(logs, file=AXLES)
        right += found is not None and (found.hypothesis.location, found.hypothesis.axis) == ("fr", "z")
    assert right >= 80


def test_of_two_alike_the_stiff_one_makes_the_other_no_soft_mount():
    logs = np.zeros((4, 3))
    logs[0, 2] = np.log(1.9)
    assert judged(logs, file=AXLES) is None
