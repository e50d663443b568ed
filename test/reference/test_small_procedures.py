# Copyright 2026 ride_estimation contributors
"""Inertia from CAD, leaf spring rates, seat checks (rows 0-20, 1-4, 1-10, 1-13, 1-21, 2-9)."""

import numpy as np
import pytest

from ride_estimation.assessment import seat
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.identification import leaf_spring
from ride_estimation.vehicles import inertia


def box(m, a, b, c):
    return m / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])


def test_the_inertia_document_000_prints_is_refused_with_the_unit_that_fits():
    with pytest.raises(ConfigurationError, match=r"780 m.*kg mm\^2") as error:
        inertia.inertia_to_si(np.diag([7.3e8, 5.4e8, 8.1e8]), "kg m^2", 1200.0)
    assert "possible are" in str(error.value)
    assert inertia.inertia_to_si(np.diag([7.3e8, 5.4e8, 8.1e8]), "kg mm^2", 1200.0)[0, 0] == pytest.approx(730.0)


def test_two_half_boxes_make_the_whole_box():
    half = box(50.0, 1.0, 0.6, 0.4)
    mass, cg, tensor = inertia.combined([(50.0, [0.5, 0.1, 0.2], half), (50.0, [1.5, 0.1, 0.2], half)])
    assert mass == 100.0
    assert np.allclose(cg, [1.0, 0.1, 0.2], atol=1e-14)
    assert np.allclose(tensor, box(100.0, 2.0, 0.6, 0.4), atol=1e-12)


def test_rotation_swaps_axes_and_keeps_eigenvalues():
    j = box(100.0, 2.0, 0.6, 0.4)
    turned = inertia.rotated(j, rotation_from_rpy(0, 0, np.pi / 2))
    assert turned[0, 0] == pytest.approx(j[1, 1], rel=1e-12)
    general = inertia.rotated(j, rotation_from_rpy(0.3, -0.2, 1.0))
    assert np.allclose(np.linalg.eigvalsh(general), np.sort(np.diag(j)), atol=1e-11)


def test_a_locked_fore_aft_joint_adds_the_parallel_axis_share_of_document_001():
    """Row 1-4: 557 kg m^2 about the CG become 839 when the CG 0.676 m above the mounts may not move fore-aft."""
    about_joint = inertia.shifted(np.diag([0.0, 557.46, 0.0]), 615.39, [0.0, 0.0, 0.676])[1, 1]
    assert about_joint == pytest.approx(839.0, abs=1.0)
    assert about_joint / 557.46 == pytest.approx(1.5, abs=0.01)


def test_leaf_spring_rates():
    assert leaf_spring.rate_from_load(10_000.0, 0.030455).value == pytest.approx(328_353, abs=1)  # not 328 407 as printed
    assert leaf_spring.rate_from_load(10_000.0, 0.03045).value == pytest.approx(328_407, abs=1)
    assert leaf_spring.rate_from_load(10_000.0, 0.03, 0.0003).std == pytest.approx(3333.3, abs=0.1)
    one = leaf_spring.semi_elliptic_rate(1.5, 0.09, 0.015, 1)
    assert leaf_spring.semi_elliptic_rate(1.5, 0.09, 0.015, 8).value == pytest.approx(8 * one.value, rel=1e-12)
    # beam of uniform strength: tip rate of a half spring E b t^3 / (6 l^3), two halves in parallel
    assert one.value == pytest.approx(2 * 206e9 * 0.09 * 0.015**3 / (6 * 0.75**3), rel=1e-12)
    with pytest.raises(InputDataError):
        leaf_spring.rate_from_load(1.0, 0.0)


def test_seat_separation_is_flagged_once_per_event():
    a = np.zeros(1000)
    a[200:220] = -11.0
    a[600:605] = -12.0
    assert seat.separation_times(a, 100.0) == [2.0, 6.0]


def test_signal_to_noise_of_document_001():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(50_000)
    assert seat.signal_to_noise_db(398.0 * rng.standard_normal(50_000), noise) == pytest.approx(52.0, abs=0.1)
    with pytest.raises(InputDataError):
        seat.signal_to_noise_db(noise, np.zeros(10))
