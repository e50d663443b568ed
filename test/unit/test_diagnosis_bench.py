# Copyright 2026 ride_estimation contributors
"""One mount on a bench: multisine displacement, force from laws of the worlds, white noise on both channels."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.bench import mount_force
from worlds.hiding import Site, law_of

from ride_estimation.diagnosis.adapters.bench import BenchSample, diagnose_bench, driven_band, incoherent_noise
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.errors import InputDataError

RATE = 200.0
K, C = 120e3, 2e3  # N/m, N s/m


def record(seed, law=None, seconds=40.0):
    """Return a record of 4 mm rms stroke in 0.5 to 12 Hz, noise 10 um and 5 N."""
    rng = np.random.default_rng(seed)
    n = round(RATE * seconds)
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    inside = (frequency > 0.5) & (frequency < 12.0)
    spectrum = np.where(inside, np.exp(2j * np.pi * rng.random(len(frequency))) / np.maximum(frequency, 0.5), 0.0)
    x = np.fft.irfft(spectrum, n)
    v = np.fft.irfft(2j * np.pi * frequency * spectrum, n)
    scale = 0.004 / np.std(x)
    x, v = x * scale, v * scale
    force = K * x + C * v + (0.0 if law is None else law(x, v))
    return BenchSample(f"seed {seed}", RATE, x + 1e-5 * rng.standard_normal(n), force + 5.0 * rng.standard_normal(n))


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in range(1, 5))])
def test_a_linear_mount_is_explained_and_its_rates_come_out(seed):
    answer = diagnose_bench(record(seed))
    assert answer.verdict == "no_discrepancy"
    assert answer.causes == ()
    by_name = {p.name: p.value for p in answer.parameters}
    # noise of 0.6 % of the force over 40 s
    assert by_name["mount.z.stiffness"] == pytest.approx(K, rel=0.005)
    assert by_name["mount.z.damping"] == pytest.approx(C, rel=0.04)


@pytest.mark.parametrize(
    ("cause", "form", "size"),
    [
        ("coulomb_friction", "bouc_wen", 0.3),
        ("stiffness_nonlinearity", "hyperbolic", 0.3),
        ("damping_nonlinearity", "blow_off", 0.8),
        ("viscoelasticity", "six_cells", 0.5),
        ("bump_stop", "foam_one_side", 0.3),
        ("backlash", "soft_play", 0.4),
    ],
)
def test_a_planted_law_is_named_and_pays_on_the_other_record(cause, form, size):
    def law(x, v):
        site = Site(K, C, 300.0, float(np.std(x)), float(np.std(v)), K * float(np.std(x)))
        return mount_force(np.arange(len(x)) / RATE, x, v, 0.0, 0.0, (law_of(form, site, size),))

    answer = diagnose_bench(record(1, law), (record(2, law),))
    assert answer.verdict == "explained"
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [(cause, "mount", "z")]
    judged = answer.gain.validation[0]
    assert judged.extended < judged.baseline / 2.0


def test_what_a_rig_does_at_frequencies_that_carry_no_force_hides_no_friction():
    """Friction of 30 % of the force beside chatter of 5 % between 10 and 40 Hz, noise of 6 N against 13 kN."""
    def shaken(seed, slowest):
        rng = np.random.default_rng(seed)
        n = round(RATE * 40.0)
        frequency = np.fft.rfftfreq(n, 1.0 / RATE)

        def motion(low, high, power):
            inside = (frequency > low) & (frequency < high)
            size = np.where(inside, np.maximum(frequency, low) ** -power, 0.0)
            values = np.fft.irfft(size * np.exp(2j * np.pi * rng.random(len(frequency))), n)
            return values / np.std(values)

        x = 0.01 * motion(slowest, 2.0, 1.5)
        slider, force = 0.0, np.empty(n)
        for i, step in enumerate(np.diff(x, prepend=0.0)):
            slider = float(np.clip(slider + 2e7 * step, -13e3, 13e3))
            force[i] = 4e5 * x[i] + slider
        force += 0.05 * np.std(force) * motion(10.0, 40.0, 0.0) + 6.0 * rng.standard_normal(n)
        return BenchSample(f"seed {seed}", RATE, x + 1e-6 * rng.standard_normal(n), force)

    answer = diagnose_bench(shaken(1, 0.3), (shaken(2, 0.15),))
    assert [c.id for c in answer.causes] == ["coulomb_friction"] and answer.verdict == "explained"
    level = answer.causes[0].parameters[0]
    assert abs(level.value - 13e3) < 2.0 * level.std


def sine(law=None, frequency=1.5, seed=1305):
    """Return a record of a steady sine of 3 mm, noise 1 um and 0.5 N."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 40.0, 1.0 / RATE)
    w = 2.0 * np.pi * frequency
    x, v = 0.003 * np.sin(w * time), 0.003 * w * np.cos(w * time)
    force = K * x + C * v + (0.0 if law is None else law(x, v))
    x, force = x + 1e-6 * rng.standard_normal(x.size), force + 0.5 * rng.standard_normal(x.size)
    return BenchSample("sine", RATE, x, force)


def test_one_frequency_names_nothing_that_needs_two_and_says_so():
    answer = diagnose_bench(sine())
    assert (answer.verdict, answer.causes) == ("no_discrepancy", ())
    assert any("one frequency" in w and "second frequency" in w for w in answer.warnings)
    rubbing = diagnose_bench(sine(lambda x, v: 40.0 * np.tanh(v / 0.002)))
    assert [c.id for c in rubbing.causes] == ["coulomb_friction"]
    assert not any("one frequency" in w for w in diagnose_bench(record(3)).warnings)


def test_noise_is_what_the_other_channel_does_not_explain():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(8000)
    y = np.convolve(x, [1.0, -0.4], mode="same") + 0.05 * rng.standard_normal(8000)
    # 83 groups of 15 degrees of freedom each: standard error about 2 %; the filter bends little within a group
    assert incoherent_noise(y, x) == pytest.approx(0.05, rel=0.08)


def test_the_band_begins_below_the_lowest_driven_frequency():
    low, high = driven_band(record(1), Settings())
    assert 0.2 < low < 0.5
    assert high == pytest.approx(40.0)


def test_a_short_record_is_insufficient_and_lengths_must_agree():
    answer = diagnose_bench(record(1, seconds=6.0))
    assert answer.verdict == "insufficient_data"
    # the least it asks for is what it takes
    assert "lasts 6.0 s; at least 11 s are needed" in answer.sentence
    assert diagnose_bench(record(1, seconds=11.0)).verdict != "insufficient_data"
    sample = record(1)
    with pytest.raises(InputDataError, match="one length"):
        diagnose_bench(BenchSample("torn", RATE, sample.displacement, sample.force[:-1]))
