# Copyright 2026 ride_estimation contributors
"""What every force element of the registry must do, whatever its law."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml

from ride_estimation.elements import terms as kernel
from ride_estimation.elements import vectorised
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.harmonic import first_harmonic, loop_loss, steady_loop
from ride_estimation.elements.registry import element_from_mapping, kinds
from ride_estimation.errors import ConfigurationError, InputDataError

KINDS = sorted(kinds())
STROKE = 0.045  # m, enough to reach the stops and buffers of the examples


def path(step: float, duration: float = 1.0, stroke: float = STROKE, seed: int = 3) -> tuple[Array, Array, Array]:
    """Return time, a smooth closed deflection that starts and ends at rest at zero, and its rate."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / step) + 1) * step
    window, d_window = np.sin(np.pi * t / duration) ** 2, np.pi / duration * np.sin(2 * np.pi * t / duration)
    x, v = np.zeros_like(t), np.zeros_like(t)
    for f in (1.0, 2.3, 4.1, 7.7):
        a, phase = rng.normal() / f**0.5, rng.uniform(0, 2 * np.pi)
        w = 2 * np.pi * f / duration
        x += a * window * np.sin(w * t + phase)
        v += a * (d_window * np.sin(w * t + phase) + window * w * np.cos(w * t + phase))
    scale = stroke / np.max(np.abs(x))
    return t, scale * x, scale * v


def kernel_response(element: ForceElement, x: Array, v: Array, h: float) -> Array:
    codes, params = kernel.pack_terms(element.terms())
    return kernel.response(codes, params, x, v, h)


def worst_values() -> list[tuple[str, str, float]]:
    """Return (kind, key, value out of bounds) for every declared number."""
    cases = []
    for kind in KINDS:
        for p in kinds()[kind].parameters():
            cases += [(kind, p.key, p.upper * 2.0 + 1.0), (kind, p.key, p.lower - 1.0 - abs(p.lower))]
    return cases


@pytest.mark.parametrize("kind", KINDS)
class TestEveryElement:
    def test_is_silent_at_rest(self, kind: str) -> None:
        # no force without deflection, not even a rounding error: rest is a steady state
        element = kinds()[kind].example()
        assert element.force(element.initial(), 0.0, 0.0) == 0.0
        t = np.arange(50) * 1e-3
        assert np.all(element.response(t, np.zeros(50)) == 0.0)

    def test_creates_no_energy_over_a_closed_path(self, kind: str) -> None:
        # energy taken up over a closed path from rest, relative to the energy moved to and fro;
        # 2e-5 is the quadrature error of the path at 0.1 ms
        element = kinds()[kind].example()
        # the fitted network is the only law of the registry whose example may yield energy, and says so
        assert element.is_passive() == (kind != "local_linear_network")
        if not element.is_passive():
            return
        for seed in range(4):
            for stroke in (0.2 * STROKE, STROKE, 1.4 * STROKE):
                _, x, v = path(1e-4, stroke=stroke, seed=seed)
                power = kernel_response(element, x, v, 1e-4) * v
                assert np.sum(power) >= -2e-5 * np.sum(np.abs(power))

    def test_agrees_with_its_closed_forms(self, kind: str) -> None:
        # 2048 points per cycle: straight pieces are (2 pi / 2048)^2 / 12 = 8e-7 off a sine, and their corners excite the
        # stiffness of high frequencies as much: that of springs up to 2048 omega (dampers see the true rate)
        element = kinds()[kind].example()
        for omega, amplitude in ((3.0, 0.4e-3), (20.0, 5e-3), (150.0, 30e-3)):
            closed, loss = element.dynamic_stiffness(omega, amplitude), element.loss_energy(omega, amplitude)
            if loss is None:
                assert closed is None
                continue
            if closed is None:
                # rate-independent laws may know the loss alone; the polygon through the samples is then no approximation
                x, force = steady_loop(element, omega, amplitude, cycles=3000, tolerance=1e-8)
                assert loop_loss(x, force) == pytest.approx(loss, rel=1e-6)
                continue
            x, force = steady_loop(element, omega, amplitude, cycles=3000, tolerance=1e-8)
            numeric = first_harmonic(force) / first_harmonic(x)
            high, highest = (element.dynamic_stiffness(factor * omega, amplitude) for factor in (30.0, 2048.0))
            assert high is not None
            assert highest is not None
            tolerance = 1e-6 * max(abs(closed), abs(high), highest.real)
            assert abs(numeric - closed) <= tolerance
            assert loss is not None
            assert abs(loop_loss(x, force) - loss) <= math.pi * amplitude**2 * tolerance

    def test_converges_with_the_step_at_its_order(self, kind: str) -> None:
        # halving the step twice, rms over several paths (where a reversal falls between samples is chance): the error goes
        # down by 4^order, less a third of an order for kinks of the law
        element = kinds()[kind].example()
        squares, size = np.zeros(2), 0.0
        for seed in range(6):
            t, x, _ = path(1.0 / 32000, seed=seed)
            reference = element.response(t, x)
            size += float(np.sum(reference[::32] ** 2))
            for k, every in enumerate((32, 8)):
                error = element.response(t[::every], x[::every]) - reference[::every]
                squares[k] += np.sum(error[:: 32 // every] ** 2)
        coarse, fine = np.sqrt(squares / size)
        assert fine <= max(coarse / 4.0 ** (element.ORDER - 0.34), 1e-11)
        assert fine < 2e-3

    def test_readable_form_agrees_with_the_kernel(self, kind: str) -> None:
        # memory by classical Runge-Kutta and commits at 1 ms against the kernel, 5e-3 of rms (kinks inside a step)
        element = kinds()[kind].example()
        h = 1e-3
        _, x, v = path(h, stroke=0.9 * STROKE)
        _, xm, vm = path(h / 2, stroke=0.9 * STROKE)
        s = element.initial()
        forces = [element.force(s, x[0], v[0])]
        for k in range(x.size - 1):
            k1 = element.rate(s, x[k], v[k])
            k2 = element.rate(s + 0.5 * h * k1, xm[2 * k + 1], vm[2 * k + 1])
            k3 = element.rate(s + 0.5 * h * k2, xm[2 * k + 1], vm[2 * k + 1])
            k4 = element.rate(s + h * k3, x[k + 1], v[k + 1])
            s = element.commit(s + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4), x[k + 1], v[k + 1])
            forces.append(element.force(s, x[k + 1], v[k + 1]))
        expected = kernel_response(element, x, v, h)
        assert np.sqrt(np.mean((np.array(forces) - expected) ** 2)) <= 5e-3 * np.sqrt(np.mean(expected**2))

    def test_trial_is_pure_and_equals_the_commit(self, kind: str) -> None:
        codes, params = kernel.pack_terms(kinds()[kind].example().terms())
        states = kernel.initial_states(codes, params)
        rng = np.random.default_rng(5)
        x = 0.0
        for _ in range(300):
            x, v, h = x + rng.normal(0, 0.004), rng.normal(0, 0.3), rng.choice([0.0, 5e-4, 1e-3, 2e-3])
            before = states.copy()
            trial = kernel.terms_force(codes, params, states, x, v, h)
            assert np.array_equal(states, before)
            accepted = kernel.terms_commit(codes, params, states, x, v, h)
            assert abs(trial - accepted) <= 1e-9 * (1.0 + abs(accepted))

    def test_half_steps_add_up(self, kind: str) -> None:
        # two half steps along a straight deflection are one whole step for laws that are exact there; else 2nd order
        codes, params = kernel.pack_terms(kinds()[kind].example().terms())
        one, two = kernel.initial_states(codes, params), kernel.initial_states(codes, params)
        speed, h, largest, worst = -0.3, 1e-3, 0.0, 0.0
        for k in range(100):
            start = -0.3 * k * h
            whole = kernel.terms_commit(codes, params, one, start + speed * h, speed, h)
            kernel.terms_commit(codes, params, two, start + 0.5 * speed * h, speed, 0.5 * h)
            halves = kernel.terms_commit(codes, params, two, start + speed * h, speed, 0.5 * h)
            largest, worst = max(largest, abs(whole)), max(worst, abs(whole - halves))
        assert worst <= 2e-3 * max(largest, 1.0)

    def test_signal_passes_agree_with_single_commits(self, kind: str) -> None:
        # compiled passes and the path without compiler against sample by sample, with repeated samples and noise
        element = kinds()[kind].example()
        _, x, v = path(2e-3)
        x = x + np.random.default_rng(7).normal(0, 2e-5, x.size)
        x[100:140] = x[100]
        codes, params = kernel.pack_terms(element.terms())
        states = kernel.initial_states(codes, params, x[0])
        single = [kernel.terms_commit(codes, params, states, x[0], v[0], 0.0)]
        single += [kernel.terms_commit(codes, params, states, x[k], v[k], 2e-3) for k in range(1, x.size)]
        size = np.max(np.abs(single))
        assert np.max(np.abs(kernel_response(element, x, v, 2e-3) - single)) <= 1e-10 * size
        assert np.max(np.abs(vectorised.response(element.terms(), x, v, 2e-3) - single)) <= 1e-10 * size

    def test_survives_yaml(self, kind: str) -> None:
        element = kinds()[kind].example()
        again = element_from_mapping(yaml.safe_load(yaml.safe_dump(element.to_mapping())))
        assert again == element

    def test_refuses_unknown_and_missing_keys_at_once(self, kind: str) -> None:
        with pytest.raises(ConfigurationError) as caught:
            element_from_mapping({"kind": kind, "colour": 3})
        assert "colour" in str(caught.value)
        assert len(caught.value.problems) >= 2

    def test_refuses_text_and_not_a_number(self, kind: str) -> None:
        mapping = kinds()[kind].example().to_mapping()
        for key in (p.key for p in kinds()[kind].parameters()):
            for wrong in ("many", float("nan"), True, None):
                with pytest.raises(ConfigurationError) as caught:
                    element_from_mapping({**mapping, key: wrong})
                assert key in str(caught.value)
                assert str(wrong) in str(caught.value)

    def test_every_number_is_declared(self, kind: str) -> None:
        for p in (*kinds()[kind].parameters(), *kinds()[kind].series_parameters()):
            assert p.unit
            assert p.meaning
            assert p.source
            assert p.lower < p.upper
            assert p.role in ("stiffness", "damping", "friction", "shape")

    def test_numbers_have_addresses(self, kind: str) -> None:
        element = kinds()[kind].example()
        for address, (p, value) in element.addressed().items():
            if p.name == "travels":
                continue  # the first travel is the origin
            moved = element.with_values({address: value})
            assert moved == element
        with pytest.raises(ConfigurationError, match="nonsense"):
            element.with_values({"nonsense": 1.0})

    def test_force_scales_with_its_roles(self, kind: str) -> None:
        # stiffness, damping and friction together multiply the force; shapes do not
        element = kinds()[kind].example()
        doubled = element.scaled("stiffness", 2.0).scaled("damping", 2.0).scaled("friction", 2.0)
        _, x, v = path(1e-3)
        if kind == "local_linear_network":
            assert doubled != element
            return
        once, twice = kernel_response(element, x, v, 1e-3), kernel_response(doubled, x, v, 1e-3)
        assert np.max(np.abs(twice - 2.0 * once)) <= 1e-9 * np.max(np.abs(once))

    def test_refuses_bad_signals(self, kind: str) -> None:
        element = kinds()[kind].example()
        t = np.arange(10) * 1e-3
        for time, x in ((t, np.full(10, np.nan)), (t[::-1], np.zeros(10)), (t[:1], np.zeros(1)), (t, np.zeros(9)), (t**2, t)):
            with pytest.raises(InputDataError):
                element.response(time, x)


@pytest.mark.parametrize(("kind", "key", "value"), worst_values())
def test_refuses_values_out_of_bounds_naming_value_and_unit(kind: str, key: str, value: float) -> None:
    mapping = {**kinds()[kind].example().to_mapping(), key: value}
    unit = next(p.unit for p in kinds()[kind].parameters() if p.key == key)
    with pytest.raises(ConfigurationError) as caught:
        element_from_mapping(mapping)
    assert any(problem.startswith(f"{key}: {value:g} {unit} is outside") for problem in caught.value.problems)


def test_refuses_entries_of_lists_out_of_bounds() -> None:
    for kind in KINDS:
        for p in kinds()[kind].series_parameters():
            mapping = kinds()[kind].example().to_mapping()
            mapping[p.key] = [*mapping[p.key][:-1], 2.0 * p.upper + 1.0]
            with pytest.raises(ConfigurationError, match=rf"{p.key}\[{len(mapping[p.key]) - 1}\]") as caught:
                element_from_mapping(mapping)
            assert p.unit in str(caught.value)


def test_unknown_kind_lists_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match="rubber") as caught:
        element_from_mapping({"kind": "rubber"})
    assert "modified_berg" in str(caught.value)


def test_elements_of_the_issue_are_all_there() -> None:
    assert {
        "kelvin_voigt", "maxwell", "maxwell_chain", "berg_friction", "berg", "modified_berg", "cubic_spring", "power_spring",
        "power_damper", "asymmetric_damper", "dahl", "weighted_dahl", "bump_stop", "free_play", "jounce_bumper",
        "local_linear_network", "damping_filter", "sum", "fractional", "bouc_wen", "return_point_friction",
    } <= set(KINDS)
