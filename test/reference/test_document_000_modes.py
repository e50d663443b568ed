# Copyright 2026 ride_estimation contributors
"""Modes and equivalent stiffness of document 000 (rows 0-6 to 0-10)."""

import math

import numpy as np
import pytest

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import InputDataError
from ride_estimation.identification import modal_stiffness as ms
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

MASS, INERTIA = 1200.0, np.array([730.0, 540.0, 810.0])
TABLE_4 = np.array([[7976e3, 4600e3, 52.1e3]] * 2 + [[7976e3, 4600e3, 41.7e3]] * 2)
TABLE_3 = {"fore-aft": (30.6, 31.5), "lateral": (34.7, 33.7), "bounce": (2.2, 2.6), "roll": (1.7, 2.4), "pitch": (1.2, 1.5),
           "yaw": (18.7, 13.6)}


def arms(height: float, front: float = 0.8, rear: float = 0.8, half: float = 0.5) -> np.ndarray:
    return np.array([[front, half, height], [front, -half, height], [-rear, half, height], [-rear, -half, height]])


def cab(height: float, stiffness: np.ndarray, gravity: float = 0.0) -> Vehicle:
    body = Body("cab", Prior(MASS), np.zeros(3), np.diag(INERTIA))
    mounts = {
        f"m{i}": Mount(f"m{i}", p, "cab", "chassis", {a: KelvinVoigt(k, 0.0) for a, k in zip("xyz", row)})
        for i, (p, row) in enumerate(zip(arms(height), stiffness))
    }
    return Vehicle("cab", {"cab": body}, mounts, {}, gravity=gravity)


def test_table_4_with_the_stated_mass_gives_these_translational_modes_not_table_3():
    found = ms.uncoupled_modes(MASS, INERTIA, arms(0.0), TABLE_4).frequency_hz
    assert found["fore-aft"] == pytest.approx(25.95, abs=0.005)
    assert found["lateral"] == pytest.approx(19.71, abs=0.005)
    assert found["bounce"] == pytest.approx(1.99, abs=0.005)


@pytest.mark.parametrize(("column", "mass"), [(0, 863.0), (1, 387.0), (2, 982.0)])
def test_no_single_mass_repairs_table_3(column, mass):
    frequency = [30.6, 34.7, 2.2][column]
    assert TABLE_4[:, column].sum() / (2 * math.pi * frequency) ** 2 == pytest.approx(mass, abs=1.0)


def test_equivalent_stiffness_inverts_its_own_modes():
    k = np.array([[4e5, 3e5, 5e4]] * 4)
    found = ms.uncoupled_modes(MASS, INERTIA, arms(0.0), k).frequency_hz
    for axis, name in enumerate(("fore-aft", "lateral", "bounce")):
        assert ms.equivalent_stiffness(found[name], MASS, 4) == pytest.approx(k[0, axis], rel=1e-9)


def test_closed_form_equals_the_eigenvalue_problem_for_level_symmetric_mounts():
    k = np.array([[7976e3, 4600e3, 46.9e3]] * 4)
    closed = ms.uncoupled_modes(MASS, INERTIA, arms(0.0), k)
    assert closed.limitations == ()
    full = ms.labelled_frequencies(cab(0.0, k))
    for name, value in closed.frequency_hz.items():
        assert full[name] == pytest.approx(value, rel=1e-6)
    assert closed.frequency_hz["yaw"] == pytest.approx(24.853, abs=5e-4)
    printed_11 = math.sqrt(np.sum(k[:, 0] * 0.0 + k[:, 2] * 0.8**2) / INERTIA[1]) / (2 * math.pi)
    assert printed_11 == pytest.approx(2.37, abs=0.01)  # (11) as printed repeats the pitch formula


def test_mounts_below_the_cg_are_questioned_and_the_eigenvalue_problem_differs():
    closed = ms.uncoupled_modes(MASS, INERTIA, arms(-0.7), TABLE_4)
    assert any("off the CG plane" in limitation for limitation in closed.limitations)
    assert closed.frequency_hz["roll"] == pytest.approx(17.7, abs=0.1)
    values = sorted(ms.labelled_frequencies(cab(-0.7, TABLE_4)).values())
    assert values[0] == pytest.approx(0.95, abs=0.02)


def test_table_3_errors_print_as_the_document_should_have_printed_them():
    rows = ms.compare_modes({n: poster for n, (_, poster) in TABLE_3.items()}, {n: s for n, (s, _) in TABLE_3.items()})
    assert [round(row.error_percent, 1) for row in rows] == [-2.9, 3.0, -15.4, -29.2, -20.0, 37.5]


def test_stiffness_comes_back_from_its_own_six_modes():
    k = np.array([[4e5, 3e5, 5e4]] * 4)
    true_modes = ms.labelled_frequencies(cab(-0.3, k, gravity=9.80665))
    start = cab(-0.3, k * np.array([1.4, 0.7, 1.2]), gravity=9.80665)
    fit = ms.fit_stiffness(start, true_modes)
    assert fit.reachable
    assert fit.factors["x"] == pytest.approx(1 / 1.4, rel=1e-4)
    assert fit.factors["y"] == pytest.approx(1 / 0.7, rel=1e-4)
    assert fit.factors["z"] == pytest.approx(1 / 1.2, rel=1e-4)


def test_an_axis_that_no_measured_mode_depends_on_keeps_its_stiffness():
    k = np.array([[4e5, 3e5, 5e4]] * 4)
    fit = ms.fit_stiffness(cab(0.0, k), {"bounce": 2.5})
    # m (2 pi f)^2 = sum of k_z: fore-aft and lateral stiffness are in no vertical equation
    factor = 900.0 * (2.0 * np.pi * 2.5) ** 2 / k[:, 2].sum()
    assert fit.factors["z"] == pytest.approx(factor * cab(0.0, k).bodies["cab"].mass.value / 900.0, rel=1e-4)
    assert fit.not_identifiable == ("x", "y") and fit.factors["x"] == fit.factors["y"] == 1.0


def test_table_3_is_reported_as_not_reachable():
    fit = ms.fit_stiffness(cab(-0.7, TABLE_4, gravity=9.80665), {n: s for n, (s, _) in TABLE_3.items()})
    assert not fit.reachable
    assert "not reachable" in fit.statement


def test_bad_input_is_refused():
    with pytest.raises(InputDataError):
        ms.fit_stiffness(cab(0.0, TABLE_4), {"bounce": -1.0})
    with pytest.raises(InputDataError, match="no mode named"):
        ms.fit_stiffness(cab(0.0, TABLE_4), {"hop": 3.0})
    with pytest.raises(InputDataError):
        ms.equivalent_stiffness(0.0, 1.0, 4)


def test_an_axis_that_drifts_is_not_reported():
    """Roll asks for more than any lateral stiffness gives: the fit would send it to infinity and no mode would notice."""
    vehicle = cab(-0.45, np.array([[4e5, 3e5, 5e4]] * 4))
    own = ms.labelled_frequencies(vehicle)
    fit = ms.fit_stiffness(vehicle, {"bounce": own["bounce"], "roll": 1.6 * own["roll"]})
    assert "y" in fit.not_identifiable
    assert fit.factors["y"] == 1.0
    assert not fit.reachable
