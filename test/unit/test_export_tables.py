# Copyright 2026 ride_estimation contributors
"""Exported tables: values of the laws, intervals that are those of the parameters, units of the formats."""

from __future__ import annotations

import csv
import math
import re

import numpy as np
import pytest

from ride_estimation.elements.berg import Berg
from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.free_play import FreePlay
from ride_estimation.elements.harmonic import complex_stiffness
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import ConfigurationError
from ride_estimation.export.adams import bushing_text
from ride_estimation.export.elements import exported
from ride_estimation.export.simscape import script_text
from ride_estimation.export.tables import static_curve, stiffness_table, table_text
from ride_estimation.vehicles.data_range import DataRange, RangeMeter, seen_in, union
from ride_estimation.vehicles.vehicle import Prior

SEEN = DataRange(0.004, (0.5, 20.0), (900.0, 1100.0))
BERG = Berg.example()


def known(correlation: float = 0.0):
    """Return Berg's bushing with all numbers known to 3 %, stiffness and friction correlated."""
    addressed = BERG.addressed()
    priors = {a: Prior(v, 0.03 * v) for a, (_, v) in addressed.items() if v > 0.0}
    matrix = np.eye(len(addressed))
    i, j = list(addressed).index("stiffness"), list(addressed).index("friction")
    matrix[i, j] = matrix[j, i] = correlation
    return exported("bush", "z", BERG, priors, SEEN, correlation=matrix), priors, matrix


@pytest.mark.parametrize("correlation", [0.0, -0.9])
def test_the_interval_is_the_scatter_of_drawn_parameters(correlation: float) -> None:
    element, priors, matrix = known(correlation)
    table = stiffness_table(element, (1.0, 15.0), (2e-4, 2e-3))
    std = np.array([priors[a].std if a in priors else 0.0 for a in BERG.addressed()])
    mean = np.array([v for _, v in BERG.addressed().values()])
    draws = np.random.default_rng(4).multivariate_normal(mean, matrix * np.outer(std, std), size=1500)
    for i, a in enumerate(table.amplitude):
        for j, f in enumerate(table.frequency):
            laws = (BERG.with_values(dict(zip(BERG.addressed(), d))) for d in np.maximum(draws, 0.0))
            drawn = [complex_stiffness(law, 2 * math.pi * f, a) for law in laws]
            for bounds, values in ((table.stiffness_bounds, np.abs(drawn)), (table.loss_angle_bounds, np.angle(drawn))):
                inside = np.mean((bounds[0, i, j] <= values) & (values <= bounds[1, i, j]))
                assert 0.93 < inside < 0.97, (f, a, inside)
    assert table.stiffness[0, 0] == pytest.approx(abs(complex_stiffness(BERG, 2 * math.pi, 2e-4)), rel=1e-12)


def test_the_table_says_what_the_data_showed() -> None:
    text = table_text([known()[0]], ["bench"], (1.0, 50.0), (1e-3, 0.02))
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    assert [row["seen_in_data"] for row in rows] == ["yes", "no", "no", "no"]
    assert "preload 900 to 1100 N" in text
    plain = table_text([exported("bush", "z", BERG, {}, None)], [], (1.0,), (1e-3,))
    (row,) = csv.DictReader(line for line in plain.splitlines() if not line.startswith("#"))
    assert (row["stiffness_low"], row["loss_angle_low_deg"], row["seen_in_data"]) == ("", "", ""), "nothing is known of it"
    assert float(row["stiffness"]) == pytest.approx(abs(complex_stiffness(BERG, 2 * math.pi, 1e-3)), rel=1e-8)


def test_data_of_one_sine_give_one_frequency_and_numbers_beyond_all_laws_are_refused() -> None:
    element = exported("bush", "z", BERG, {}, DataRange(1e-3, (3.0, 3.0)))
    assert stiffness_table(element).frequency.tolist() == [3.0]
    cubic = exported("bush", "z", CubicSpring(6e4, -1.5e9), {}, None)
    for amplitude in (1e150, 1e300):
        with pytest.raises(ConfigurationError, match="bush"):
            stiffness_table(cubic, (1.0,), (amplitude,))


def test_free_play_has_a_table_without_absurd_numbers() -> None:
    table = stiffness_table(exported("gap", "z", FreePlay.example(), {}, None), (1.0,), (1e-6, 0.05))
    assert np.all(np.isfinite(table.stiffness)) and np.all(np.isfinite(table.loss_angle))


@pytest.mark.parametrize(
    ("element", "expected"),
    [
        (CubicSpring(stiffness=6e4, cubic=-1.5e9), lambda x: 6e4 * x - 1.5e9 * x**3),
        (BERG, lambda x: BERG.stiffness * x),
    ],
)
def test_the_static_curve_has_no_hysteresis(element, expected) -> None:
    x, force = static_curve(exported("e", "z", element, {}, SEEN))
    assert x[-1] == SEEN.deflection
    # the mean of both ways of friction that starts at equal and opposite forces is zero only in the middle of the cycle
    assert np.abs(force - expected(x))[5:-5].max() < 0.06 * np.abs(force).max()


def test_a_stop_stands_in_the_static_curve_on_its_side() -> None:
    x, force = static_curve(exported("stop", "z", BumpStop.example(), {}, DataRange(0.03, (0.5, 5.0))))
    assert np.interp(-0.03, x, force) == pytest.approx(-4e5 * (0.03 - 0.012), rel=1e-3)
    assert np.interp(0.03, x, force) == pytest.approx(0.0, abs=1e-9)


def test_a_bushing_file_is_in_millimetre_newton_and_degree() -> None:
    along = exported("m.z", "z", KelvinVoigt(5e4, 1500.0), {}, SEEN)
    about = exported("m.roll", "roll", KelvinVoigt(200.0, 3.0), {}, None)
    text = bushing_text([along, about], ["mount m"])
    sections = dict(re.findall(r"^\[(\w+)\]\n((?:[^\[$].*\n)*)", text, re.M))
    damping = dict(re.findall(r"(\w+) = (\S+)", sections["DAMPING"]))
    assert float(damping["FZ_DAMPING"]) == pytest.approx(1.5)  # N s/mm
    assert float(damping["TX_DAMPING"]) == pytest.approx(3.0 * 1e3 * math.pi / 180.0)  # N mm s/degree
    for name, slope in (("FZ", 50.0), ("TX", 200.0 * 1e3 * math.pi / 180.0), ("FX", 0.0), ("TZ", 0.0)):
        points = np.array([line.split() for line in sections[f"{name}_CURVE"].splitlines()[1:]], dtype=float)
        assert np.allclose(points[:, 1], slope * points[:, 0], rtol=1e-6, atol=1e-6), name
    assert abs(np.array(sections["FZ_CURVE"].splitlines()[1].split(), dtype=float)[0]) == pytest.approx(4.0), "4 mm were seen"


def test_a_script_holds_tables_by_amplitude_and_frequency() -> None:
    element = known()[0]
    text = script_text([element], ["bench"], (1.0, 5.0, 20.0), (1e-3, 3e-3))
    found = {}
    for name, values in re.findall(r"^mount\.bush\.([\w.]+) = (.*);$", text, re.M):
        found[name] = np.array([[float(v) for v in row.split()] for row in values.strip("[]").split("; ")])
    table = stiffness_table(element, (1.0, 5.0, 20.0), (1e-3, 3e-3))
    assert found["stiffness"].shape == (2, 3)
    assert np.array_equal(found["stiffness"], table.stiffness)
    assert np.array_equal(found["stiffness_high"], table.stiffness_bounds[1])
    assert np.array_equal(found["loss_angle"], table.loss_angle)
    assert found["parameters.stiffness"][0, :2].tolist() == [BERG.stiffness, 0.03 * BERG.stiffness]
    assert np.isnan(found["parameters.stiffness"][0, 2])


def test_what_data_show_is_their_reach_and_their_band() -> None:
    t = np.arange(4000) / 200.0
    one = seen_in(0.003 * np.sin(2 * np.pi * 2.0 * t) + 0.05, 0.005, 1000.0)
    other = seen_in(0.001 * np.sin(2 * np.pi * 9.0 * t), 0.005)
    assert one.deflection == pytest.approx(0.003, rel=1e-3)
    assert one.frequency == pytest.approx((2.0, 2.0), abs=0.11)
    together = union([one, None, other])
    assert together.frequency[0] == one.frequency[0] and together.frequency[1] == pytest.approx(9.0, abs=0.11)
    assert (together.deflection, together.preload) == (one.deflection, (1000.0, 1000.0))
    assert seen_in(np.full(100, 3.0), 0.005) is None


def test_what_data_show_while_they_arrive_is_what_their_record_shows() -> None:
    t = np.arange(13000) / 200.0
    x = np.stack([0.003 * np.sin(2 * np.pi * 2.2 * t) + 0.05, 0.001 * np.sin(2 * np.pi * 9.0 * t), 0.0 * t], axis=1)
    meter = RangeMeter(1000.0, None, 0.0)
    for k in range(0, 1900, 20):
        meter.observe(x[k : k + 20], 0.005)
    assert meter.ranges() == (None, None, None), "less than a stretch"
    for k in range(1900, len(x), 20):
        meter.observe(x[k : k + 20], 0.005)
    first, second, still = meter.ranges()
    assert (first.preload, second.preload, still) == ((1000.0, 1000.0), None, None)
    for found, record in ((first, seen_in(x[:, 0], 0.005)), (second, seen_in(x[:, 1], 0.005))):
        assert found.deflection == pytest.approx(record.deflection, rel=1e-3)
        assert found.frequency == pytest.approx(record.frequency, abs=0.11)
    meter.observe(x[:20], 0.01)
    assert meter.ranges() == (None, None, None), "spectra of another rate are not added"
