# Copyright 2026 ride_estimation contributors
"""``ride-estimation design-test``: drive files out, and what comes back from the bench goes into ``identify``."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

try:
    import asammdf
except ImportError:
    asammdf = None
try:
    import rpc3
except ImportError:
    rpc3 = None

from ride_estimation.cli.main import main
from ride_estimation.identification.bench.design import candidate_signals, design_tests
from ride_estimation.identification.bench.models import model_by_name
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.time_domain import fit_time_domain, prepare
from ride_estimation.identification.bench.uncertainty import uncertainty
from ride_estimation.io.files.formats import read_measurement_file

EXPECT = ["stiffness=2e5", "damping=900"]


def bench(path, out, noise=5.0):
    """What an independent bench answers to a drive file: a spring and a damper with noise; the ending says how it records."""
    drive = read_measurement_file(path)
    (channel,) = drive.channels
    t, x = channel.time_s, 1e-3 * channel.values
    force = 2e5 * x + 900 * np.gradient(x, t) + noise * np.random.default_rng(1).standard_normal(t.size)
    if out.suffix == ".csv":
        np.savetxt(out, np.column_stack([t, 1e3 * x, force]), delimiter=",", header="time_s,displacement_mm,force_n", comments="")
    elif out.suffix == ".rpc":
        channels = [rpc3.Channel("displacement", "mm", t[1] - t[0], 1e3 * x), rpc3.Channel("force", "N", t[1] - t[0], force)]
        rpc3.write(str(out), channels, datatype=float)
    else:
        signals = (("displacement", "mm", 1e3 * x), ("force", "N", force))
        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(samples=y, timestamps=t, name=n, unit=u) for n, u, y in signals])
            file.save(out, overwrite=True)
    return str(out)


@pytest.mark.parametrize("kind", ["csv", "rpc", "mf4"])
def test_drive_files_go_to_the_bench_and_the_record_into_identify(tmp_path, capsys, kind):
    if {"csv": csv, "rpc": rpc3, "mf4": asammdf}[kind] is None:
        pytest.skip("the library that writes such files is not installed")
    out = tmp_path / "drive"
    options = ["--stroke-mm", "4", "--highest-hz", "10", "--rate-hz", "100", "--percent", "0.5", "--format", kind]
    assert main(["design-test", "--model", "kelvin_voigt", "--expect", *EXPECT, *options, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "minutes in all" in said and "not covered by any such test" in said
    files = sorted(out.iterdir())
    assert files[0].name == f"0_preconditioning.{kind}" and [f.stem[2:] for f in files[-3:]] == ["V1", "V2", "V3"]
    fitted = [bench(f, tmp_path / f.name) for f in files[1:-3]]
    held = [bench(f, tmp_path / f.name) for f in files[-3:]]
    code = main(["identify", *fitted, "--validate", *held, "--model", "kelvin_voigt", "--out", str(tmp_path / "found")])
    assert code == 0
    found = json.loads((tmp_path / "found" / "identification.json").read_text())
    for parameter, truth in zip(found["parameters"], (2e5, 900.0), strict=True):
        assert parameter["value"] == pytest.approx(truth, rel=0.015)  # three of the standard deviations asked for
    table = capsys.readouterr().out
    # Figure 19 and Table 3 of document 003 in one table: models by validations, and their parameters
    assert f"NRMSE [%] on {', '.join(Path(f).name for f in held)}" in table
    assert any(line.startswith("linear_spring") and "stiffness 2" in line for line in table.splitlines())


def test_the_accuracy_that_is_promised_is_the_one_of_the_fit():
    model, values = model_by_name("modified_berg"), np.array([127.1e3, -0.116e9, 6.285e3, 1.555e3, 20e3, 159.0, 81.73, 0.766e-3])
    signals = candidate_signals(10e-3, 20.0, 200.0)
    design = design_tests(model, values, 0.03 * np.abs(values), signals, force_noise=10.0)
    assert design.not_identifiable == () and np.all(design.std <= 1.001 * design.wanted)
    assert design.duration_s < 600.0  # the DMA plan alone takes 1488 s
    theta, coefficients = model.searched(values)
    rng = np.random.default_rng(2)
    prepared = []
    for signal in design.signals[1:]:
        from ride_estimation.identification.bench.columns import simulate
        from ride_estimation.identification.bench.reversals import find_motion

        motion = find_motion(signal.displacement, float(signal.time_s[1]))
        force = simulate(model.layout, motion, theta, coefficients) + 10.0 * rng.standard_normal(signal.time_s.size)
        prepared.append(prepare(check_record(BenchRecord(signal.name, signal.time_s, signal.displacement, force))))
    fit = fit_time_domain(model, prepared, start=theta)
    assert uncertainty(fit, prepared).white_std == pytest.approx(design.std, rel=0.1)
    assert np.all(np.abs(fit.values - values) < 4 * design.std)


def test_what_the_machine_cannot_do_is_said(tmp_path, capsys):
    options = ["--stroke-mm", "4", "--rate-hz", "100", "--speed-m-per-s", "0.01", "--out", str(tmp_path / "drive")]
    options += ["--percent", "0.05", "--longest-s", "400", "--force-noise-n", "50"]
    assert main(["design-test", "--model", "kelvin_voigt", "--expect", *EXPECT, *options]) == 0
    said = capsys.readouterr().out
    assert "left out random:" in said and "the machine reaches 0.01 m/s" in said
    assert "cannot be identified to the wanted accuracy" in said and "damping" in said.split("cannot be identified")[1]
    for path in (tmp_path / "drive").iterdir():
        drive = read_measurement_file(path).channels[0]
        assert np.abs(np.gradient(drive.values, drive.time_s)).max() <= 10.0 * 1.001  # mm/s


@pytest.mark.parametrize("rate", ["200"])
def test_programme_of_a_jounce_bumper_scales_with_its_reference_travel(tmp_path, capsys, rate):
    travel = np.linspace(0.0, 80.0, 50)
    curve = tmp_path / "curve.csv"
    rows = np.column_stack([travel, 9000.0 * (travel / 60.0) ** 3])
    np.savetxt(curve, rows, delimiter=",", header="travel_mm,force_n", comments="")
    out = tmp_path / "drive"
    options = ["--static-curve", str(curve), "--rate-hz", rate, "--out", str(out)]
    assert main(["design-test", "--model", "jounce_bumper", *options]) == 0
    assert "reference travel 59.99 mm" in capsys.readouterr().out
    for name in ("0_static_ramps", "1_dynamic_ramps", "2_amplitude_sweep"):
        (channel,) = read_measurement_file(out / f"{name}.csv").channels
        assert channel.values.min() == pytest.approx(-60.0, rel=0.02)  # compression


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--model is needed"),
        (["--model", "kelvin_voigt", "--expect", "stiffness=2e5"], "missing: damping"),
        (["--model", "kelvin_voigt", "--expect", "stiffness=2e5", "damping=-9"], "must be positive"),
        (["--model", "kelvin_voigt", "--expect", "stiffness"], "give NAME=NUMBER"),
        (["--model", "kelvin_voigt", "--expect", *EXPECT, "--wanted", "colour=3"], "no parameter of kelvin_voigt"),
        (["--model", "kelvin_voigt", "--expect", *EXPECT, "--rate-hz", "50"], "a rate above twice the frequency"),
        (["--model", "jounce_bumper"], "--reference-mm or --static-curve"),
        (["--like", "nowhere.json"], "is not an identification.json"),
        (["--model", "kelvin_voigt", "--expect", *EXPECT, "--speed-m-per-s", "1e-6"], "no test stays below"),
    ],
)
def test_bad_input_is_refused_with_one_message(tmp_path, capsys, options, says):
    assert main(["design-test", *options, "--out", str(tmp_path / "drive")]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "drive").exists() or not list(Path(tmp_path / "drive").iterdir())
