# Copyright 2026 ride_estimation contributors
import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.analysis import identify_records
from ride_estimation.identification.bench.models import LADDER, ladder_for, model_by_name
from ride_estimation.identification.bench.oscillator import OscillatorRecord, identify_oscillator
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.time_domain import fit_time_domain, held_out_stretches, prepare
from ride_estimation.identification.bench.uncertainty import effective_samples, uncertainty

H = 2e-3


def random_motion(seed, low=0.3, high=8.0, rms=2e-3, n=5000):
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(n, H)
    x = np.fft.irfft((f > low) * (f < high) * np.exp(2j * np.pi * rng.random(f.size)), n)
    return np.arange(n) * H, rms * x / np.std(x)


def record(seed, law, noise=3.0, **motion):
    t, x = random_motion(seed, **motion)
    return check_record(
        BenchRecord(f"run {seed}", t, x, law(t, x) + noise * np.random.default_rng(seed + 99).standard_normal(t.size))
    )


def kelvin_voigt(t, x):
    return 1e5 * x + 400 * np.gradient(x, t)


def cubic(t, x):
    return kelvin_voigt(t, x) + 4e9 * x**3


def dahl(t, x):
    w, out = 0.0, np.empty(x.size)
    for i, step in enumerate(np.diff(x, prepend=x[0])):
        for _ in range(4):
            w += step / 4 / 2e-4 * (1 - np.sign(step) * w)
        out[i] = w
    return kelvin_voigt(t, x) + 80 * out


@pytest.mark.parametrize(("law", "expected"), [(kelvin_voigt, "kelvin_voigt"), (cubic, "cubic"), (dahl, "dahl")])
def test_the_law_that_made_the_data_is_chosen(law, expected):
    found = identify_records([record(1, law)], [record(2, law)])
    assert found.best.fit.model.name == expected
    assert "Nothing beyond the noise" in found.unexplained


def test_one_record_is_split_and_the_last_fit_uses_all_of_it():
    found = identify_records([record(3, cubic)], [])
    assert found.best.fit.model.name == "cubic"
    assert found.best.fit.samples < 0.75 * found.fit.samples == 0.75 * 5000
    assert found.fit.values == pytest.approx([1e5, 4e9, 400], rel=0.02)
    assert np.isclose(held_out_stretches(10000, 0.3).mean(), 0.3, atol=0.01)


def test_a_foreign_law_is_not_called_explained():
    # two friction elements and a clearance: in no rung
    def foreign(t, x):
        return dahl(t, x) + 3e5 * np.maximum(np.abs(x) - 3e-3, 0) * np.sign(x)

    found = identify_records([record(4, foreign)], [record(5, foreign)])
    assert "is not in the model" in found.unexplained


def test_uncertainty_covers_with_correlated_residuals():
    # force noise of 1 Hz bandwidth: the white formula is far too small, the stated std must cover
    inside = []
    for seed in range(25):
        t, x = random_motion(seed, n=6000)
        rng = np.random.default_rng(seed + 500)
        noise = np.convolve(rng.standard_normal(x.size + 300), np.hanning(150), mode="same")[150:-150]
        item = prepare(check_record(BenchRecord("r", t, x, kelvin_voigt(t, x) + 20 * noise / np.std(noise))))
        fit = fit_time_domain(model_by_name("kelvin_voigt"), [item])
        spread = uncertainty(fit, [item])
        std = np.array([p.std for p in spread.parameters])
        inside.append(np.abs(fit.values - [1e5, 400]) < 2 * std)
        assert std[0] > 2 * spread.white_std[0]
    # 50 intervals of 2 sigma; fewer than 40 inside has a probability below 1e-4 at 95 % coverage
    assert np.sum(inside) >= 40


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", ["friction rounded by speed", "cubic spring"])
def test_intervals_hold_where_a_part_of_the_law_is_missing(kind, seed):
    # two sines, so that the misfit comes again and again: intervals of noise alone are 10 to 40 times too narrow here
    rng = np.random.default_rng(seed)
    t = np.arange(6000) * H
    x = 3e-3 * np.sin(2 * np.pi * rng.uniform(0.8, 1.5) * t) + 1e-3 * np.sin(2 * np.pi * rng.uniform(4, 6) * t)
    v = np.gradient(x, t)
    extra = 60 * np.tanh(v / 2e-3) if kind.startswith("friction") else 3e9 * x**3
    model, truth = ("dahl", [2e5, 900.0, 60.0]) if kind.startswith("friction") else ("kelvin_voigt", [2e5, 900.0])
    item = prepare(check_record(BenchRecord("r", t, x, 2e5 * x + 900 * v + extra + 3 * rng.standard_normal(t.size))))
    fit = fit_time_domain(model_by_name(model), [item])
    spread = uncertainty(fit, [item])
    off = np.array([p.value for p in spread.parameters[: len(truth)]]) - truth
    assert np.all(np.abs(off) < 3 * np.array([p.std for p in spread.parameters[: len(truth)]]))
    assert np.max(np.abs(off) / spread.white_std[: len(truth)]) > 10
    assert spread.missing_rms > 0.4 * fit.residual_std


def test_noise_is_no_missing_part_of_the_law():
    t, x = random_motion(4, n=6000)
    rng = np.random.default_rng(4)
    slow = np.convolve(rng.standard_normal(x.size + 300), np.hanning(150), mode="same")[150:-150]
    for noise in (20 * rng.standard_normal(x.size), 20 * slow / np.std(slow)):
        item = prepare(check_record(BenchRecord("r", t, x, kelvin_voigt(t, x) + noise)))
        fit = fit_time_domain(model_by_name("kelvin_voigt"), [item])
        assert uncertainty(fit, [item]).missing_rms < 0.25 * fit.residual_std


def test_a_value_near_zero_is_not_compared_in_per_cent():
    t, x = random_motion(6)
    item = prepare(check_record(BenchRecord("r", t, x, 1e5 * x + 0.01 * np.random.default_rng(6).standard_normal(x.size))))
    spread = uncertainty(fit_time_domain(model_by_name("three_cell_berg"), [item]), [item])
    said = " ".join([spread.null_direction, *(p.reason for p in spread.parameters)])
    assert max(len(word) for word in said.split()) < 20, said


def test_effective_samples_of_white_and_correlated_noise():
    rng = np.random.default_rng(0)
    white = rng.standard_normal(20000)
    assert effective_samples(white) == pytest.approx(20000, rel=0.1)
    a = 0.95
    red = np.zeros(20000)
    for i in range(1, red.size):
        red[i] = a * red[i - 1] + white[i]
    # first-order process: sum of rho^2 over all lags is (1 + a^2) / (1 - a^2)
    assert effective_samples(red) == pytest.approx(20000 * (1 - a**2) / (1 + a**2), rel=0.25)


def test_a_single_slow_frequency_names_what_is_not_identifiable():
    t = np.arange(10000) * H
    x = 2e-3 * np.sin(2 * np.pi * 1.0 * t)
    item = prepare(
        check_record(BenchRecord("sine", t, x, kelvin_voigt(t, x) + 2 * np.random.default_rng(0).standard_normal(t.size)))
    )
    fit = fit_time_domain(model_by_name("modified_berg"), [item])
    spread = uncertainty(fit, [item])
    assert {p.status for p in spread.parameters} & {"not_identifiable", "at_bound"}
    assert "hardly sensitive" in spread.null_direction and "up" in spread.null_direction


def test_named_models():
    assert ladder_for("auto") == LADDER
    assert ladder_for("modified_berg")[-1].name == "modified_berg"
    with pytest.raises(InputDataError, match="allowed: linear_spring"):
        ladder_for("magic")


def duffing(cubic_rate, seed, n=3000, rate=600.0):
    """Mass-spring oscillator at 60 Hz by Runge-Kutta with five steps a sample; excitation held between samples."""
    rng = np.random.default_rng(seed)
    u = np.convolve(rng.standard_normal(n), np.ones(3) / 3, mode="same")
    w, zeta, h = 2 * np.pi * 60.0, 0.05, 1.0 / rate / 5

    def slope(s, force):
        return np.array([s[1], w**2 * force - 2 * zeta * w * s[1] - w**2 * s[0] - cubic_rate * s[0] ** 3])

    s, y = np.zeros(2), np.empty(n)
    for k in range(n):
        y[k] = s[0]
        for _ in range(5):
            a = slope(s, u[k])
            b = slope(s + 0.5 * h * a, u[k])
            c = slope(s + 0.5 * h * b, u[k])
            s = s + h / 6 * (a + 2 * b + 2 * c + slope(s + h * c, u[k]))
    return OscillatorRecord(f"duffing {seed}", 1.0 / rate, u, y + 1e-3 * rng.standard_normal(n))


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_oscillator_ladder_finds_the_cubic_spring_only_where_it_is(share):
    w2 = (2 * np.pi * 60.0) ** 2
    record, other = duffing(share * w2, 1), duffing(share * w2, 2)
    rungs, chosen = identify_oscillator(record, np.ones(record.u.size, dtype=bool), [other])
    assert rungs[chosen].physical["frequency_hz"] == pytest.approx(60.0, abs=1.0)
    assert rungs[chosen].physical["damping_ratio"] == pytest.approx(0.05, abs=0.01)
    if share == 0.0:
        assert rungs[chosen].name == "linear"
    else:
        assert "cubic" in rungs[chosen].name
        # cubic over linear rate; the recursion takes y at the sample before, hence 15 %
        assert rungs[chosen].physical["cubic"] / rungs[chosen].physical["stiffness"] == pytest.approx(share, rel=0.15)


def test_oscillator_refuses_what_it_cannot_use():
    good = duffing(0.0, 1, n=1500)
    with pytest.raises(InputDataError, match="no held-out samples"):
        identify_oscillator(good, np.ones(1500, dtype=bool))
    with pytest.raises(InputDataError, match="constant"):
        identify_oscillator(OscillatorRecord("x", good.step_s, good.u * 0, good.y), np.arange(1500) < 1000)
