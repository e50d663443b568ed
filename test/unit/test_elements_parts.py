# Copyright 2026 ride_estimation contributors
"""Sums, lists, damping filters, loop extraction, terms: what the contract tests do not reach."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.elements import harmonic
from ride_estimation.elements import terms as kernel
from ride_estimation.elements.bump_stop import BumpStop, gap_harmonic
from ride_estimation.elements.damping_filter import DampingFilter
from ride_estimation.elements.free_play import FreePlay
from ride_estimation.elements.harmonic import complex_stiffness, loop_loss, loop_stiffness, steady_loop
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell_chain import MaxwellChain
from ride_estimation.elements.modified_berg import ModifiedBerg
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.elements.stability import largest_explicit_step
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import ConfigurationError, InputDataError


class TestSum:
    def test_reports_mistakes_of_all_parts_at_once(self) -> None:
        with pytest.raises(ConfigurationError) as caught:
            element_from_mapping({"kind": "sum", "elements": [
                {"kind": "kelvin_voigt", "stiffness_n_per_m": -5.0, "damping_n_s_per_m": 1.0}, {"kind": "rubber"}, 7,
            ]})
        text = str(caught.value)
        assert "elements[0].stiffness_n_per_m: -5 N/m" in text
        assert "elements[1]" in text
        assert "rubber" in text
        assert "elements[2]: 7" in text

    @pytest.mark.parametrize("entries", [[], None, "kelvin_voigt"])
    def test_needs_parts(self, entries: object) -> None:
        with pytest.raises(ConfigurationError, match="elements"):
            element_from_mapping({"kind": "sum", "elements": entries})

    def test_parts_are_addressed(self) -> None:
        total = SumOfElements.example()
        changed = total.with_values({"elements[0].friction": 10.0, "elements[1].stiffness": 1.0e5})
        assert changed.elements[0].friction == 10.0  # type: ignore[attr-defined]
        assert changed.addressed()["elements[1].stiffness"][1] == 1.0e5
        assert total.scaled("stiffness", 2.0).addressed()["elements[0].stiffness"][1] == pytest.approx(2 * 127.1e3)
        with pytest.raises(ConfigurationError, match="outside"):
            total.with_values({"elements[0].friction": -1.0})

    def test_sums_nest(self) -> None:
        inner = SumOfElements((KelvinVoigt(1e5, 10.0), KelvinVoigt(2e5, 20.0)))
        outer = SumOfElements((inner, KelvinVoigt(3e5, 30.0)))
        assert outer.dynamic_stiffness(10.0, 1e-3) == pytest.approx(6e5 + 600j)
        assert element_from_mapping(outer.to_mapping()) == outer
        assert "elements[0].elements[1].damping" in outer.addressed()


def test_lists_of_different_length_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="2 and cell_dampings_n_s_per_m 1"):
        MaxwellChain(1e5, (1e4, 2e4), (100.0,))
    with pytest.raises(ConfigurationError, match="not a list"):
        element_from_mapping({**MaxwellChain.example().to_mapping(), "cell_dampings_n_s_per_m": 5.0})


def test_points_out_of_order_are_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"deflections_m\[2\]"):
        element_from_mapping({"kind": "curve_spring", "deflections_m": [-1e-2, 1e-2, 0.0], "forces_n": [-1.0, 1.0, 0.0]})
    with pytest.raises(ConfigurationError, match="drive the motion"):
        element_from_mapping({"kind": "curve_damper", "rates_m_per_s": [-1.0, 0.0, 1.0], "forces_n": [-5.0, 0.0, -5.0]})


class TestDampingFilter:
    def test_band_filter_of_table_5(self) -> None:
        # document 000: peak 270 N s/m at 2.005 Hz, half power at 0.83 and 4.84 Hz
        band = DampingFilter.example()
        frequencies = np.geomspace(0.1, 50.0, 20_001)
        size = np.array([abs(band.transfer(2 * np.pi * f)) for f in frequencies])
        assert np.max(size) == pytest.approx(270.0, rel=1e-4)
        assert frequencies[np.argmax(size)] == pytest.approx(2.005, abs=0.003)
        half = frequencies[size >= 270.0 / np.sqrt(2)]
        assert (half[0], half[-1]) == pytest.approx((0.83, 4.84), abs=0.005)

    @pytest.mark.parametrize(("shape", "lowest", "at_hz"), [("low", -33.75, 3.48), ("high", -33.75, 1.16)])
    def test_low_and_high_are_reported_active(self, shape: str, lowest: float, at_hz: float) -> None:
        filter_ = DampingFilter(270.0, 12.6, 0.5, shape)
        report = filter_.passivity()
        assert not report.passive
        assert report.lowest_damping == pytest.approx(lowest, rel=1e-9)
        assert report.at_omega / (2 * np.pi) == pytest.approx(at_hz, abs=0.01)
        scan = [filter_.transfer(w).real for w in np.geomspace(0.01, 1e4, 50_001)]
        assert min(scan) == pytest.approx(lowest, rel=1e-6)
        # at that frequency a cycle yields energy
        x, force = steady_loop(filter_, report.at_omega, 1e-3)
        assert loop_loss(x, force) < 0.0

    @pytest.mark.parametrize("shape", ["low", "band", "high"])
    @pytest.mark.parametrize("quality", [0.2, 0.5, 3.0])
    def test_replacements_are_passive(self, shape: str, quality: float) -> None:
        replacement = DampingFilter(270.0, 12.6, quality, shape).passive_replacement()
        assert replacement.is_passive()
        assert min(replacement.transfer(w).real for w in np.geomspace(1e-3, 1e5, 2001)) >= 0.0
        # the same damping where the filter is meant to damp
        where = {"low": 1e-6, "band": 12.6, "high": 1e9}[shape]
        assert replacement.transfer(where).real == pytest.approx(270.0, rel=1e-6)

    @pytest.mark.parametrize("shape", ["low", "band", "high", "passive_low", "passive_high"])
    @pytest.mark.parametrize("quality", [0.2, 0.5, 4.0])
    def test_time_domain_is_the_transfer_function(self, shape: str, quality: float) -> None:
        # over- and underdamped, aperiodic limit; 1e-5 of the stiffness at high frequency (polygon of 2048 points)
        filter_ = DampingFilter(270.0, 12.6, quality, shape)
        for omega in (2.0, 12.6, 60.0):
            x, force = steady_loop(filter_, omega, 1e-3, cycles=3000, tolerance=1e-9)
            found = harmonic.first_harmonic(force) / harmonic.first_harmonic(x)
            assert abs(found - 1j * omega * filter_.transfer(omega)) < 1e-5 * omega * 270.0 * max(1.0, quality) + 0.05

    def test_unknown_shape_is_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="notch"):
            element_from_mapping({"kind": "damping_filter", "gain_n_s_per_m": 1.0, "centre_rad_per_s": 1.0, "shape": "notch"})


class TestLoops:
    def test_definitions_agree_for_a_spring_and_differ_for_friction(self) -> None:
        spring = steady_loop(KelvinVoigt(1e5, 0.0), 10.0, 1e-3)
        for definition in harmonic.DEFINITIONS:
            assert loop_stiffness(*spring, definition) == pytest.approx(1e5, rel=1e-9)
        # document 003, set T1: other definitions are up to 7 % off the first harmonic
        soft = ModifiedBerg(
            stiffness=60e3, cubic=-0.15e9, cell_1_stiffness=30e3, cell_1_damping=2387.0, cell_2_stiffness=30e3,
            cell_2_damping=238.7, friction=60.0, half_stroke=0.25e-3,
        )
        bushing = steady_loop(soft, 10.0, 10e-3)
        values = [loop_stiffness(*bushing, d) for d in harmonic.DEFINITIONS]
        assert max(values) / min(values) > 1.01

    def test_unknown_definition_and_still_deflection_are_refused(self) -> None:
        x, force = np.sin(np.arange(64) / 64 * 2 * np.pi), np.ones(64)
        with pytest.raises(InputDataError, match="eye"):
            loop_stiffness(x, force, "eye")
        with pytest.raises(InputDataError, match="does not move"):
            loop_stiffness(np.zeros(64), force)

    def test_numeric_fallback_where_there_is_no_closed_form(self) -> None:
        damped = BumpStop(compression_gap=1e-3, extension_gap=1e-3, stiffness=1e5, damping=1.0)
        assert damped.dynamic_stiffness(10.0, 5e-3) is None
        free = FreePlay(gap=1e-3, stiffness=1e5).dynamic_stiffness(10.0, 5e-3)
        assert free is not None
        assert complex_stiffness(damped, 10.0, 5e-3).real == pytest.approx(free.real, rel=1e-3)
        assert gap_harmonic(1.2) == 0.0
        assert gap_harmonic(0.0) == 1.0


def test_one_sided_stop_never_pulls() -> None:
    stop = BumpStop(compression_gap=0.01, stiffness=1e5, damping=1e5, entry=0.002)
    t = np.arange(0, 2, 1e-4)
    force = stop.response(t, 0.02 * np.sin(2 * np.pi * 3 * t))
    assert np.all(force <= 0.0)
    with pytest.raises(ConfigurationError, match="push at rest"):
        BumpStop(compression_gap=0.001, stiffness=1e5, entry=0.002)


def test_elements_without_memory_have_no_step_bound() -> None:
    assert largest_explicit_step(KelvinVoigt(1e5, 100.0), 5.0) == np.inf
    # the stiffer of two cells decides: 20e3 / 159 = 126 rad/s
    assert largest_explicit_step(ModifiedBerg.example(), 1.0) == pytest.approx(2.0 * 159.0 / 20e3)
    with pytest.raises(ConfigurationError, match="euler, rk4"):
        largest_explicit_step(KelvinVoigt(1e5, 100.0), 1.0, "heun")


class TestTerms:
    def test_network_of_axes_is_each_axis_alone(self) -> None:
        axes = [ModifiedBerg.example(), KelvinVoigt(1e5, 100.0), SumOfElements.example()]
        packed = [kernel.pack_terms(e.terms()) for e in axes]
        codes, params = kernel.pack_terms([t for e in axes for t in e.terms()])
        channel = np.repeat(np.arange(3), [len(e.terms()) for e in axes])
        states, alone = kernel.initial_states(codes, params), [kernel.initial_states(*p) for p in packed]
        rng, x, force, trial = np.random.default_rng(1), np.zeros(3), np.zeros(3), np.zeros(3)
        for _ in range(200):
            x = x + rng.normal(0, 1e-3, 3)
            v = rng.normal(0, 0.1, 3)
            kernel.network_force(codes, params, states, channel, x, v, 1e-3, trial)
            kernel.network_commit(codes, params, states, channel, x, v, 1e-3, force)
            single = [kernel.terms_commit(*p, s, x[k], v[k], 1e-3) for k, (p, s) in enumerate(zip(packed, alone))]
            assert force == pytest.approx(single, rel=1e-12)
            assert trial == pytest.approx(force, rel=1e-12)

    def test_changed_parameters_take_effect_at_once(self) -> None:
        # estimators change parameters between steps: no stale exponentials
        codes, params = kernel.pack_terms([kernel.Term(kernel.MAXWELL, (1e4, 50.0))])
        states = kernel.initial_states(codes, params)
        kernel.terms_commit(codes, params, states, 1e-3, 0.0, 1e-3)
        before = kernel.terms_force(codes, params, states, 1e-3, 0.0, 1e-3)
        params[0, 1] = 500.0
        after = kernel.terms_force(codes, params, states, 1e-3, 0.0, 1e-3)
        assert after / before == pytest.approx(np.exp(-0.45), rel=1e-12)

    def test_memory_starts_relaxed_at_any_deflection(self) -> None:
        codes, params = kernel.pack_terms(ModifiedBerg.example().terms())
        states = kernel.initial_states(codes, params, 3e-3)
        force = kernel.terms_force(codes, params, states, 3e-3, 0.0, 1e-3)
        assert force == pytest.approx(127.1e3 * 3e-3 - 0.116e9 * 2.7e-8, rel=1e-12)

    def test_empty_signal_gives_empty_force(self) -> None:
        codes, params = kernel.pack_terms(KelvinVoigt(1.0, 1.0).terms())
        assert kernel.response(codes, params, np.zeros(0), np.zeros(0), 1e-3).size == 0
