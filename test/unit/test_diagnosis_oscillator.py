# Copyright 2026 ride_estimation contributors
"""A driven oscillator integrated here with laws of foreign form: what the diagnosis says of its spring."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.diagnosis.adapters.oscillator import diagnose_oscillator
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.oscillator import OscillatorRecord

RATE = 100.0
OMEGA, ZETA = 2.0 * np.pi * 6.0, 0.05


def record(seed, law=None, count=6000, noise=0.002):
    """Return the response of ``y'' = u - 2 zeta w y' - w^2 (y + law(y, y'))`` to 1 to 15 Hz; unit rms excitation over w^2."""
    rng = np.random.default_rng(seed)
    fine = 10
    f = np.fft.rfftfreq(count * fine, 1.0 / (RATE * fine))
    spectrum = np.where((f > 1.0) & (f < 15.0), np.exp(2j * np.pi * rng.random(f.size)), 0.0)
    u = np.fft.irfft(spectrum, count * fine)
    u *= OMEGA**2 / np.std(u)
    h, y, v = 1.0 / (RATE * fine), 0.0, 0.0
    out = np.empty(count * fine)
    for i, drive in enumerate(u):
        out[i] = y
        v += h * (drive - 2.0 * ZETA * OMEGA * v - OMEGA**2 * (y + (0.0 if law is None else law(y, v))))
        y += h * v
    response = out[::fine]
    response = response + noise * np.std(response) * rng.standard_normal(count)
    return OscillatorRecord(f"seed {seed}", 1.0 / RATE, u[::fine], response)


def test_a_linear_oscillator_shows_no_discrepancy():
    answer = diagnose_oscillator(record(1301), validation=[record(1302)])
    assert (answer.verdict, answer.causes) == ("no_discrepancy", ())
    assert "noise floor" in answer.sentence


def test_a_spring_of_foreign_form_is_named_and_pays_on_the_other_record():
    def sinh(y, v):
        return 4.0 * np.sinh(y / 4.0) - y

    answer = diagnose_oscillator(record(1303, sinh), validation=[record(1304, sinh)])
    assert [c.id for c in answer.causes] == ["stiffness_nonlinearity"]
    assert answer.causes[0].parameters[0].value > 0.0  # hardens
    other = next(g for g in answer.gain.validation if g.run == "seed 1304")
    # a quintic part of the sinh is left to the cubic
    assert other.extended < 0.6 * other.baseline
    assert other.ci95[0] > 0.0


@pytest.mark.parametrize(
    ("cause", "law", "number", "value"),
    [
        ("coulomb_friction", lambda y, v: 0.3 * np.tanh(v / 0.5), "friction", 0.3 * OMEGA**2),
        ("bump_stop", lambda y, v: 2.0 * (max(y - 4.0, 0.0) + min(y + 4.0, 0.0)), "gap", 4.0),
        ("damping_nonlinearity", lambda y, v: 0.002 * abs(v) * v, "square damping", 0.002 * OMEGA**2),
    ],
)
def test_a_law_of_the_library_beside_a_straight_spring_is_named_with_its_number(cause, law, number, value):
    answer = diagnose_oscillator(record(1305, law), validation=[record(1306, law)])
    assert [c.id for c in answer.causes] == [cause] and answer.verdict == "explained"
    stated = next(p for p in answer.causes[0].parameters if number in p.name)
    assert stated.value == pytest.approx(value, rel=0.05)
    other = next(g for g in answer.gain.validation if g.run == "seed 1306")
    assert other.extended < 0.1 * other.baseline


def test_a_hysteretic_loop_is_named_and_predicts_another_excitation():
    """A chain of three sliders, a law that the library does not have in this form."""
    class Chain:
        def __init__(self):
            self.slip, self.last = np.zeros(3), 0.0

        def __call__(self, y, v):
            self.slip = np.clip(self.slip + (y - self.last), [-0.5, -1.0, -2.0], [0.5, 1.0, 2.0])
            self.last = y
            return float(0.2 * self.slip.sum())

    answer = diagnose_oscillator(record(1307, Chain()), validation=[record(1308, Chain())])
    assert answer.causes[0].id == "coulomb_friction"
    other = next(g for g in answer.gain.validation if g.run == "seed 1308")
    assert other.extended < 0.35 * other.baseline


@pytest.mark.parametrize("fault", ["short", "unrelated", "constant"])
def test_what_cannot_be_identified_is_refused_with_the_reason(fault):
    good = record(1306, count=2000 if fault == "short" else 6000)
    u = np.random.default_rng(5).standard_normal(good.u.size) if fault == "unrelated" else good.u
    u = 0.0 * u if fault == "constant" else u
    answer = diagnose_oscillator(OscillatorRecord("r", good.step_s, u, good.y))
    assert (answer.verdict, answer.causes) == ("insufficient_data", ())
    words = {"short": "at least 3000", "unrelated": "no oscillator explains", "constant": "constant"}
    assert words[fault] in answer.sentence


def test_another_rate_and_broken_values_are_input_mistakes():
    good = record(1307, count=3000)
    with pytest.raises(InputDataError, match="sampled at"):
        diagnose_oscillator(good, validation=[OscillatorRecord("other", 0.02, good.u, good.y)])
    with pytest.raises(InputDataError, match="not finite"):
        diagnose_oscillator(OscillatorRecord("torn", good.step_s, good.u, np.where(good.y > 1.0, np.nan, good.y)))


def test_a_fit_range_that_leaves_nothing_to_judge_is_refused(tmp_path, capsys):
    good = record(1308, count=3000)
    table = tmp_path / "r.csv"
    np.savetxt(table, np.stack([good.u, good.y], axis=1), delimiter=",", header="u,y", comments="")
    arguments = ["diagnose", str(table), "--rate", "100", "--out", str(tmp_path / "out")]
    assert main([*arguments, "--oscillator", "u,y", "--fit-range", "0", "29.9"]) == 2
    assert "at most 80 %" in capsys.readouterr().err
    assert main(arguments) == 2
    assert "--oscillator" in capsys.readouterr().err
