# Copyright 2026 ride_estimation contributors
"""End to end: ``ride-estimation procedure``."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main

VEHICLE = str(Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml")


def write(path, header, *columns):
    rows = "\n".join(",".join(f"{v:.10g}" for v in row) for row in zip(*columns))
    path.write_text(f"{header}\n{rows}\n")
    return str(path)


def loop_file(tmp_path, frequency, friction):
    t = np.linspace(0, 3 / frequency, 3001)
    w = 2 * np.pi * frequency
    x, v = 2e-3 * np.sin(w * t), 2e-3 * w * np.cos(w * t)
    force = 1e5 * x + (50 * np.sign(v) if friction else 500 * v)
    return write(tmp_path / f"loop_{frequency}.csv", "time_s,displacement_mm,force_n", t, 1000 * x, force)


def test_loops_of_a_friction_mount_print_the_warning(tmp_path, capsys):
    files = [loop_file(tmp_path, f, True) for f in (0.02, 4.5)]
    assert main(["procedure", "loop", *files, "--frequency", "0.02", "4.5"]) == 0
    text = capsys.readouterr().out
    stiffness = float(text.split("stiffness ")[1].split(" N/m")[0])
    assert stiffness == pytest.approx(1e5, rel=2e-3)  # 1000 samples a cycle smear the jump of friction by one sample
    assert "225 times" in text


def test_tyre_lift_axle_loads_and_mode_ratio(tmp_path, capsys):
    rise = np.linspace(0, 50, 11)
    file = write(tmp_path / "lift.csv", "unloading_kn,rise_mm", 0.8 * rise, rise)
    assert main(["procedure", "tyre-lift", file]) == 0
    assert "4e+05" in capsys.readouterr().out
    assert main(["procedure", "axle-loads", "--weight-n", "80000", "--cg-from-rear-m", "1.1", "--wheelbase-m", "2.2"]) == 0
    assert "front axle 40000 N, rear axle 40000 N" in capsys.readouterr().out


def test_drop_test_uses_the_inertia_about_the_pivot(tmp_path, capsys):
    t = np.arange(0, 8, 0.002)
    w = 2 * np.pi * 1.7
    y = np.exp(-0.06 * w * t) * np.cos(w * np.sqrt(1 - 0.06**2) * t)
    file = write(tmp_path / "drop.csv", "time_s,motion_mm", t, y)
    options = ["--stiffness-n-per-m", "8e5", "--pivot-inertia-kg-m2", "9000", "--arm-m", "2.2"]
    assert main(["procedure", "drop-test", file, *options]) == 0
    text = capsys.readouterr().out
    assert "damping ratio 0.06" in text
    assert "1859.5 kg" in text


def test_spectrum_refuses_the_claimed_resolution(tmp_path, capsys):
    t = np.arange(0, 60, 0.01)
    file = write(tmp_path / "run.csv", "time_s,seat_m_per_s2", t, np.sin(2 * np.pi * 1.6 * t))
    assert main(["procedure", "spectrum", file, "--column", "seat", "--block", "1024"]) == 0
    assert "resolution 0.09766 Hz" in capsys.readouterr().out
    claim = ["--claimed-resolution-hz", "0.2"]
    assert main(["procedure", "spectrum", file, "--column", "seat", "--block", "1024", *claim]) == 2
    assert "0.09766" in capsys.readouterr().err


def test_leaf_spring_from_geometry_and_from_the_load_of_document_002(capsys):
    assert main(["procedure", "leaf-spring", "--force-n", "10000", "--deflection-m", "0.030455"]) == 0
    assert "spring rate 328353 N/m" in capsys.readouterr().out  # document 002 prints 328 407
    size = ["--span-m", "1.5", "--width-m", "0.09", "--thickness-m", "0.015", "--leaves", "8"]
    assert main(["procedure", "leaf-spring", *size]) == 0
    rate = 8 * 2 * 206e9 * 0.09 * 0.015**3 / (6 * 0.75**3)  # two cantilevers of uniform strength
    assert float(capsys.readouterr().out.split()[2]) == pytest.approx(rate, rel=1e-5)
    assert main(["procedure", "leaf-spring", "--span-m", "1.5"]) == 2
    assert "--deflection-m" in capsys.readouterr().err


def test_velocity_of_a_biased_sine_is_written(tmp_path, capsys):
    t = np.arange(0, 60, 0.01)
    w = 2 * np.pi * 2.0
    file = write(tmp_path / "axle.csv", "time_s,axle_m_per_s2", t, w * 0.1 * np.cos(w * t) + 0.05)
    out = tmp_path / "velocity.csv"
    assert main(["procedure", "velocity", file, "--column", "axle", "--out", str(out)]) == 0
    assert "would drift to 3 m/s in 60 s" in capsys.readouterr().out
    found = np.loadtxt(out, delimiter=",", skiprows=1)
    inner = (found[:, 0] > 10) & (found[:, 0] < 50)
    np.testing.assert_allclose(found[inner, 1], 0.1 * np.sin(w * found[inner, 0]), atol=2e-3)  # trapezoids at 50 points a cycle


def test_seat_pad_separation_and_signal_to_noise(tmp_path, capsys):
    t = np.arange(0, 20, 0.01)
    a = 3.98 * np.sqrt(2) * np.sin(2 * np.pi * 1.1 * t)
    a[500:510] = -11.0
    file = write(tmp_path / "seat.csv", "time_s,seat_m_per_s2", t, a)
    rest = write(tmp_path / "rest.csv", "time_s,seat_m_per_s2", t, 0.01 * np.where(np.arange(t.size) % 2, 1.0, -1.0))
    assert main(["procedure", "seat", file, "--column", "seat", "--standstill", rest]) == 0
    text = capsys.readouterr().out
    assert "left the seat 1 times (at 5.00 s)" in text
    assert "signal to noise 52." in text


def test_peaks_of_the_input_are_distinguished_from_modes(tmp_path, capsys):
    rng = np.random.default_rng(4)
    t = np.arange(30_000) / 100.0
    ground = rng.standard_normal(t.size) + 2.0 * np.sin(2 * np.pi * 1.6 * t)
    w, z = 2 * np.pi * 4.5, 0.05
    h = np.exp(-z * w * t[:1000]) * np.sin(w * t[:1000]) * w / 100.0
    file = write(tmp_path / "run.csv", "time_s,axle_m_per_s2,cab_m_per_s2", t, ground, np.convolve(ground, h)[: t.size])
    common = ["procedure", "peaks", file, "--input", "axle", "--output", "cab", "--block", "2048"]
    assert main([*common, "--modes-hz", "1.0", "4.5", "21.7"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"1\.6\d+ Hz +input", text) or re.search(r"1\.5[89]\d* Hz +input", text)
    assert re.search(r"4\.\d+ Hz +mode +natural frequency 4\.5 Hz", text)
    assert "resolution 0.04883 Hz" in text
    assert main(common) == 2
    assert "--modes-hz" in capsys.readouterr().err


def test_modes_that_cannot_be_reached_are_named(capsys):
    assert main(["procedure", "modes", "--vehicle", VEHICLE, "--measured", "bounce=2.6", "roll=9.0", "lateral=3.0"]) == 0
    text = capsys.readouterr().out
    assert "not reachable" in text
    assert "times the model's" in text


def test_voigt_limits_prints_the_error_at_the_other_resonances(tmp_path, capsys):
    text = (Path(VEHICLE).parent / "planar_cab_seat_set_b.yaml").read_text(encoding="utf-8")
    rubber = "{kind: sum, elements: [{kind: kelvin_voigt, stiffness_n_per_m: 7.81e6, damping_n_s_per_m: 0.0}, "
    rubber += "{kind: maxwell, stiffness_n_per_m: 2.0e6, damping_n_s_per_m: 6.0e4}]}"
    old = next(line for line in text.splitlines() if "7.81e6" in line and "z:" in line)
    path = tmp_path / "rubber.yaml"
    path.write_text(text.replace(old, f"      z: {rubber}"), encoding="utf-8")
    assert main(["procedure", "voigt-limits", "--vehicle", str(path), "--tuned-hz", "4.5"]) == 0
    errors = [float(line.split()[-1]) for line in capsys.readouterr().out.splitlines()[2:]]
    assert abs(errors[1]) < 1.0 < abs(errors[2])  # percent: right at the tuned resonance, wrong at the next


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("time_s,displacement_mm,force_n\n", "at least one row"),
        ("time_s,displacement_mm,force_n\n0,1,x\n", "'x' is not a number"),
        ("time_s,displacement_mm,force_n\n0,1\n", "row 2 has 2 cells"),
        ("time_s,displacement_mm,force_n\n0,1,nan\n", "not finite"),
        ("time_s,stroke_mm,force_n\n0,1,1\n0.1,1,2\n0.2,1,1\n", "no column 'displacement'"),
    ],
)
def test_bad_tables_end_with_code_2_and_one_clear_message(tmp_path, capsys, content, message):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    assert main(["procedure", "loop", str(path), "--frequency", "1"]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(("weight", "message"), [("nan", "--weight-n nan"), ("-5", "weight -5 N must be positive")])
def test_impossible_weights_are_named(weight, message, capsys):
    assert main(["procedure", "axle-loads", "--weight-n", weight, "--cg-from-rear-m", "1", "--wheelbase-m", "2"]) == 2
    assert message in capsys.readouterr().err


def test_an_arm_of_zero_and_a_negative_mode_are_named(tmp_path, capsys):
    t = np.arange(0, 8, 0.002)
    file = write(tmp_path / "drop.csv", "time_s,motion_mm", t, np.exp(-0.6 * t) * np.cos(10.0 * t))
    options = ["--stiffness-n-per-m", "8e5", "--pivot-inertia-kg-m2", "9000", "--arm-m", "0"]
    assert main(["procedure", "drop-test", file, *options]) == 2
    assert "arm 0 m; allowed: both greater than zero" in capsys.readouterr().err
    assert main(["procedure", "modes", "--vehicle", VEHICLE, "--measured", "bounce=-2"]) == 2
    assert "bounce -2 Hz; allowed" in capsys.readouterr().err


def test_a_missing_file_ends_with_code_2(tmp_path, capsys):
    assert main(["procedure", "tyre-lift", str(tmp_path / "none.csv")]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_modes_of_front_and_rear_and_the_closed_form(capsys):
    import dataclasses

    from ride_estimation.identification.modal_stiffness import labelled_frequencies
    from ride_estimation.io.vehicle_file import load_vehicle

    vehicle = load_vehicle("truck_cab")
    stiffer = {
        (m.name, "z"): m.elements["z"].scaled("stiffness", 1.3 if m.position[0] > 0 else 0.8) for m in vehicle.mounts.values()
    }
    truth = labelled_frequencies(dataclasses.replace(vehicle).replace_elements(stiffer))
    measured = [f"{name}={value:.8g}" for name, value in truth.items()]
    assert main(["procedure", "modes", "--vehicle", "truck_cab", "--front-rear", "--closed-form", "--measured", *measured]) == 0
    text = capsys.readouterr().out
    assert "along z front: 1.3 times" in text and "along z rear: 0.8 times" in text
    assert "all measured modes (6) are met" in text
    assert "the closed form does not hold: mounts lie up to 0.45 m off the CG plane" in text
    assert "closed form, bounce at" in text


def test_damping_against_frequency_prints_the_fit_with_intervals(tmp_path, capsys):
    rate, n, rng = 100.0, 30_000, np.random.default_rng(4)
    mass, k, c = 300.0, 47_000.0, 900.0
    base = rng.standard_normal(n)
    w = 2 * np.pi * np.fft.rfftfreq(n, 1 / rate)
    ratio = (k + 1j * w * c) / (k + 1j * w * c - mass * w**2)
    body = np.fft.irfft(ratio * np.fft.rfft(base), n) + 0.02 * rng.standard_normal(n)
    table = write(tmp_path / "run.csv", "time_s,chassis_m_per_s2,cab_m_per_s2", np.arange(n) / rate, base, body)
    options = ["--body", "cab", "--base", "chassis", "--mass-kg", "300", "--stiffness-n-per-m", "47000", "--block", "1000"]
    assert main(["procedure", "damping", table, *options, "--out", str(tmp_path / "c.csv")]) == 0
    text = capsys.readouterr().out
    found = np.genfromtxt(tmp_path / "c.csv", delimiter=",", names=True)
    inside = (found["frequency_hz"] > 1) & (found["frequency_hz"] < 5)
    assert np.median(found["damping_n_s_per_m"][inside]) == pytest.approx(c, rel=0.02)
    assert "stiffness" in text and "+-" in text
    assert "explain as much: the filter is not identifiable" in text
    assert main(["procedure", "damping", table, *options, "--range-hz", "3", "3.05"]) == 2


def test_operating_range_and_what_a_programme_leaves_unseen(tmp_path, capsys):
    t = np.arange(4000) / 1000.0
    files = []
    for name, size in (("road", np.where(t < 2, 20.0, 40.0)), ("drive", 30.0)):
        files.append(write(tmp_path / f"{name}.csv", "time_s,travel_mm", t, size * np.sin(2 * np.pi * t)))
    out = tmp_path / "hull.csv"
    assert main(["procedure", "operating-range", files[0], "--programme", files[1], "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "travel to 40 mm, with the margin 44 mm; speed -0.251 to 0.251 m/s" in text
    share = float(re.search(r"covers ([\d.]+) %", text).group(1))
    assert share == pytest.approx(50.0, abs=1.0) and "the rest is unseen" in text  # the second half goes beyond
    assert np.loadtxt(out, delimiter=",", skiprows=1)[:, 0].max() == pytest.approx(0.044, rel=1e-3)


def test_class_of_a_measured_road(tmp_path, capsys):
    rng = np.random.default_rng(2)
    spacing, n = 0.1, 20_000
    wave = np.fft.rfftfreq(n, spacing)
    density = 64e-6 * (np.maximum(wave, 1e-3) / 0.1) ** -2.0  # class B
    spectrum = np.sqrt(density * n / spacing / 2) * np.exp(2j * np.pi * rng.random(wave.size))
    spectrum[0] = 0
    table = write(tmp_path / "road.csv", "distance_m,height_mm", np.arange(n) * spacing, 1e3 * np.fft.irfft(spectrum, n))
    assert main(["procedure", "road", table, "--frequency-hz", "2"]) == 0
    text = capsys.readouterr().out
    assert "ISO 8608 class B" in text and "they excite 2 Hz at" in text
    assert float(re.search(r"waviness ([\d.]+)", text).group(1)) == pytest.approx(2.0, abs=0.1)


def test_an_element_is_stepped_over_a_recorded_deflection(tmp_path, capsys):
    t = np.arange(2000) / 1000.0
    x = 3e-3 * np.sin(2 * np.pi * 2 * t)
    force = 1e5 * x + 400 * np.gradient(x, t)
    table = write(tmp_path / "run.csv", "time_s,displacement_mm,force_n", t, 1e3 * x, force)
    element = tmp_path / "element.yaml"
    element.write_text("kind: kelvin_voigt\nstiffness_n_per_mm: 100\ndamping_n_s_per_m: 400\n")
    assert main(["procedure", "force", table, "--element", str(element), "--out", str(tmp_path / "f.csv")]) == 0
    assert np.loadtxt(tmp_path / "f.csv", delimiter=",", skiprows=1)[:, 1] == pytest.approx(force, rel=1e-6, abs=1e-6)
    assert "measured force of the file: NRMSE" in capsys.readouterr().out
    element.write_text("kind: kelvin_voigt\nstiffness_n_per_mm: 100\n")
    assert main(["procedure", "force", table, "--element", str(element), "--out", str(tmp_path / "f.csv")]) == 2
    assert "damping_n_s_per_m: missing" in capsys.readouterr().err


def test_a_lifting_force_and_its_arms_give_the_tyre_stiffness(tmp_path, capsys):
    rise = np.linspace(0.0, 40.0, 9)
    lift = 2 * 4e5 * rise * 1e-3 * 2.2 / 3.0  # moments about the other axle
    table = write(tmp_path / "lift.csv", "rise_mm,lift_n", rise, lift)
    assert main(["procedure", "tyre-lift", table, "--lift-arm-m", "3.0", "--axle-arm-m", "2.2"]) == 0
    assert "tyre stiffness 4e+05" in capsys.readouterr().out
    assert main(["procedure", "tyre-lift", table, "--lift-arm-m", "3.0"]) == 2
    assert "belong together" in capsys.readouterr().err


def test_loop_prints_the_stiffness_by_every_definition(tmp_path, capsys):
    """x + x^3 of a sine: the first harmonic sees 3/4 of the cubic part, the secant all of it."""
    phase = 2 * np.pi * np.linspace(0, 3, 3001)
    x, a = 2e-3 * np.sin(phase), 2e-3
    file = write(tmp_path / "loop.csv", "time_s,displacement_m,force_n", phase / (4 * np.pi), x, 1e5 * x + 1e10 * x**3)
    assert main(["procedure", "loop", file, "--frequency", "2"]) == 0
    line = next(s for s in capsys.readouterr().out.splitlines() if "by definition" in s)
    found = {name: float(value) for name, value in re.findall(r"(first harmonic|secant at max|peak to peak) ([0-9.e+]+)", line)}
    assert found["first harmonic"] == pytest.approx(1e5 + 0.75 * 1e10 * a**2, rel=1e-4)
    assert found["secant at max"] == found["peak to peak"] == pytest.approx(1e5 + 1e10 * a**2, rel=1e-4)


def test_velocity_of_a_displacement(tmp_path, capsys):
    t = np.arange(2000) / 500.0
    file = write(tmp_path / "travel.csv", "time_s,travel_mm", t, 10 * np.sin(2 * np.pi * 3 * t))
    out = tmp_path / "v.csv"
    assert main(["procedure", "velocity", file, "--column", "travel", "--of-displacement", "--out", str(out)]) == 0
    assert "halves 37.5 Hz" in capsys.readouterr().out
    found = np.loadtxt(out, delimiter=",", skiprows=1)[50:-50]
    gain = np.exp(-((2 * np.pi * 3 * 0.005) ** 2) / 2)
    assert found[:, 1] == pytest.approx(gain * 0.06 * np.pi * np.cos(2 * np.pi * 3 * found[:, 0]), abs=1e-5)
    command = ["procedure", "velocity", file, "--column", "travel", "--out", str(out)]
    assert main(command) == 2, "no acceleration"
    assert main([*command, "--of-displacement", "--kernel-ms", "0"]) == 2


def test_modes_writes_matrices_whose_states_and_inputs_are_named(tmp_path, capsys):
    out = tmp_path / "ab.json"
    assert main(["procedure", "modes", "--vehicle", "planar_cab_seat_set_b", "--matrices", str(out)]) == 0
    printed = capsys.readouterr().out
    assert [float(row.split()[-2]) for row in printed.splitlines()[2:]] == pytest.approx([1.0, 4.5, 21.7], abs=0.01)
    document = json.loads(out.read_text())
    a, b = np.array(document["A"]), np.array(document["B"])
    assert a.shape == (6, 6) == (len(document["states"]),) * 2
    assert b.shape == (6, len(document["inputs"]))
    # bases that all rise by one: after that the body rests, risen by one
    rise = np.array([name.endswith(".z.displacement") for name in document["inputs"]], dtype=float)
    risen = np.array([name.endswith(".z.displacement") for name in document["states"]], dtype=float)
    assert a @ risen + b @ rise == pytest.approx(np.zeros(6), abs=1e-9 * np.abs(a).max())
    assert np.abs(np.linalg.eigvals(a)).min() / (2 * np.pi) == pytest.approx(1.0, abs=0.01)


def test_force_says_which_step_an_explicit_solver_may_take(tmp_path, capsys):
    element = tmp_path / "element.yaml"
    element.write_text("kind: maxwell\nstiffness_n_per_m: 1.0e5\ndamping_n_s_per_m: 20\n")
    t = np.arange(200) / 1000.0
    file = write(tmp_path / "x.csv", "time_s,displacement_mm", t, np.sin(20 * t))
    command = ["procedure", "force", file, "--element", str(element), "--out", str(tmp_path / "f.csv")]
    assert main(command) == 0
    assert "euler below 0.4 ms, rk4 below 0.557 ms" in capsys.readouterr().out
    assert main([*command, "--explicit-step-s", "0.0003"]) == 0
    assert main([*command, "--explicit-step-s", "0.0005"]) == 2
    assert "below 0.0004 s" in capsys.readouterr().err


def test_force_beyond_what_the_element_was_identified_from_is_called_extrapolated(tmp_path, capsys):
    element = tmp_path / "element.yaml"
    seen = "seen_in_data: {largest_deflection_m: 0.02, lowest_frequency_hz: 0.1, highest_frequency_hz: 20.0}"
    element.write_text(f"kind: bump_stop\ncompression_gap_m: 0.01\nstiffness_n_per_m: 1.0e5\n{seen}\n")
    t = np.arange(2000) / 1000.0
    wave = np.sin(20 * t)
    # compression is negative: a rebound of 60 mm is out of contact and no extrapolation
    for low, high, said in ((-19.0, 60.0, False), (-40.0, 5.0, True)):
        file = write(tmp_path / "x.csv", "time_s,displacement_mm", t, np.where(wave < 0.0, -low, high) * wave)
        assert main(["procedure", "force", file, "--element", str(element), "--out", str(tmp_path / "f.csv")]) == 0
        assert ("extrapolated" in capsys.readouterr().out) == said
    # the travel of a bumper counts from where contact begins, also in a record that never leaves it
    file = write(tmp_path / "x.csv", "time_s,displacement_mm", t, 4.0 * wave - 34.0)
    assert main(["procedure", "force", file, "--element", str(element), "--out", str(tmp_path / "f.csv")]) == 0
    assert "goes 38 mm far" in capsys.readouterr().out
