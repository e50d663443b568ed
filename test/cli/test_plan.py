# Copyright 2026 ride_estimation contributors
"""End to end: ``ride-estimation plan``."""

import dataclasses
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ride_estimation.api import predicted
from ride_estimation.api.diagnosing import diagnose as re_diagnose
from ride_estimation.api.planning import plan
from ride_estimation.api.predicted import PredictedReplay
from ride_estimation.api.runs import Run
from ride_estimation.cli.main import main
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.identification.sensitivities import Excitation
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.field_run import run_scenario
from ride_estimation.simulation.scenario import RoadSpec, Scenario

VEHICLES = Path(__file__).parents[2] / "config" / "vehicles"
VEHICLE = str(VEHICLES / "truck_cab.yaml")
TEXT = Path(VEHICLE).read_text(encoding="utf-8")


def planned(path, capsys, *options):
    assert main(["plan", "--vehicle", str(path), "--bounds-only", *options]) == 0
    text = capsys.readouterr().out
    assert "nan" not in text.lower().split()
    return text


def written(tmp_path, text):
    path = tmp_path / "vehicle.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_plan_prints_bounds_no_better_than_their_scale_reference(capsys):
    """The cab was weighed to 1 %, its inertia is known to 3 %: no stiffness is told to 0.01 %."""
    text = planned(VEHICLE, capsys)
    assert "rank 24 of 24" in text
    assert "cab.mass (1 %), cab.inertia (3 %)" in text
    bounds = [float(v) for v in re.findall(r"\.z\.stiffness +([\d.]+) %", text)]
    assert len(bounds) == 4
    assert all(0.9 < v < 1.0 for v in bounds)
    assert "load cell at front_left: median bound 0.69 % instead of 0.95 %" in text


def test_plan_without_a_scale_reference_says_what_scales_together(capsys):
    assert "scale together" in planned(VEHICLE, capsys, "--unknown-mass", "--rigid-frame")


def test_accelerometers_identify_only_ratios_and_a_weight_or_scale_would_identify_the_rest(tmp_path, capsys):
    text = planned(written(tmp_path, TEXT[: TEXT.index("force_references:")]), capsys)
    assert "ratios to cab.mass have the standard deviation" in text
    assert re.search(r"front_left\.z\.stiffness +not identifiable +0\.0\d+ %", text)
    for cure in ("a second run with 100 kg fastened to cab", "inertia of cab known (weigh it)", "load cell at rear_left"):
        assert f"{cure}: 26 of 26 known or identifiable instead of 0" in text
    assert re.search(r"no lower bound by itself: displacement transducers along x", text)


@pytest.mark.parametrize("path", sorted(VEHICLES.glob("*.yaml")), ids=lambda p: p.stem)
def test_every_shipped_vehicle_can_be_planned(path, capsys):
    text = planned(path, capsys)
    assert "does not stand" not in text
    if "sensors:" not in path.read_text(encoding="utf-8"):
        assert "no accelerometer sits on a body" in text
        assert "accelerometers on the bodies and at the mount bases: identifies ratios" in text


def test_degenerate_layouts_are_named(tmp_path, capsys):
    on_a_line = TEXT.replace("[0.75, 0.60, -0.35]", "[0.75, 0, 0]").replace("[0.75, -0.60, -0.35]", "[0.1, 0, 0]")
    on_a_line = on_a_line.replace("[-0.80, 0.60, -0.35]", "[-0.8, 0, 0]").replace("[-0.80, -0.60, 0.90]", "[-0.4, 0, 0]")
    text = planned(written(tmp_path, on_a_line), capsys)
    assert "replay and the live node refuse this layout" in text
    assert "not determined: roll acceleration" in text
    at_one_place = re.sub(r"position_m: \[\S+ \S+ -0.45\]\n", "position_m: [0.0, 0.0, -0.45]\n", TEXT)
    text = planned(written(tmp_path, at_one_place), capsys)
    assert "front_left and front_right, rear_left, rear_right sit at one place" in text
    assert "does not stand: pitch topples" in text
    assert "does not stand: yaw is free" in text
    assert "rank 6 of 24" in text


def test_stiffness_in_an_implausible_unit_is_questioned(tmp_path, capsys):
    text = planned(written(tmp_path, TEXT.replace("stiffness_n_per_m", "stiffness_kgf_per_mm")), capsys)
    assert "the lowest is at 114 Hz: nothing is suspended like this; check the units" in text


def test_a_declared_added_mass_and_a_load_cell_are_scale_references_of_the_plan(tmp_path, capsys):
    start = TEXT[: TEXT.index("force_references:")]
    added = "force_references:\n  - {kind: known_added_mass, body: cab, mass_kg: 100.0, from_s: 30.0}\n"
    assert "rank 26 of 26" in planned(written(tmp_path, start + added), capsys)
    transducers = (VEHICLES / "truck_cab_transducers.yaml").read_text(encoding="utf-8")
    assert "load_cell_front_left is no force reference" in planned(written(tmp_path, transducers), capsys)
    cell = "force_references:\n  - {kind: load_cell, mount: front_left, sensor: load_cell_front_left}\n"
    text = planned(written(tmp_path, transducers[: transducers.index("force_references:")] + cell), capsys)
    assert "rank 26 of 26" in text
    assert re.search(r"cab\.mass +1 %", text)  # the gain of the cell


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_numbers_that_are_not_finite_are_named(value, capsys):
    assert main(["plan", "--vehicle", VEHICLE, "--duration", value]) == 2
    assert f"--duration {value}: allowed are finite numbers" in capsys.readouterr().err


def test_bad_numbers_end_with_code_2(capsys):
    assert main(["plan", "--vehicle", VEHICLE, "--speed", "-3"]) == 2
    assert "allowed: 0.5 to 60 m/s" in capsys.readouterr().err


def test_a_vehicle_of_hundreds_of_sensors_is_refused_before_the_memory_is_full(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = "".join(
        f"  more{i}: {{kind: accelerometer, topic: /more{i}, body: cab, position_m: [0.1, 0, {i / 500}], noise_m_per_s2: 0.02}}\n"
        for i in range(400)
    )
    path = written(tmp_path, TEXT.replace("\nsensors:\n", f"\nsensors:\n{more}"))
    assert main(["plan", "--vehicle", str(path)]) == 2
    said = capsys.readouterr().err
    assert "sensitivities; at most 10000" in said and "Leave out sensors" in said


@pytest.mark.slow
def test_what_replay_will_state_stands_beside_the_bounds(capsys):
    assert main(["plan", "--vehicle", "single_imu", "--duration", "8"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"replay will identify \d+ of 25 parameters within 8 s", text)
    added = r"(accelerometers at the bases of|displacement transducers along z at)"
    assert re.search(rf"with {added} 4 mounts: \d+ parameters valid", text)
    # the bounds say nothing about motion sensors that the drives judge
    assert not re.search(r"by itself: .*(displacement|accelerometers)", text)
    *_, refused, _, last = [line for line in text.splitlines() if not line.startswith("  with")] + [text.splitlines()[-1]]
    assert refused.startswith("diagnose will refuse: no base motion was measured")
    assert re.fullmatch(r"the one sensor that helps most: .* at \w+: \d+ parameters valid, standard .* times smaller", last)


def test_what_replay_will_refuse_is_said(capsys):
    assert main(["plan", "--vehicle", "quarter_car", "--duration", "5"]) == 0
    assert "replay will refuse: " in (text := capsys.readouterr().out) and "Without one nothing can be estimated" in text
    assert "diagnose will refuse: " in text


@pytest.mark.slow
@pytest.mark.parametrize("kept", [("front_left", "front_right", "rear_left", "rear_right"), ("front_left", "rear_right"), ()])
def test_what_diagnose_will_refuse_is_what_it_refuses(kept):
    """The sentence of the plan is that of a diagnosis of another drive with the same sensors."""
    whole = load_vehicle(VEHICLE)
    sensors = {n: s for n, s in whole.sensors.items() if not s.mount or s.mount in kept}
    vehicle = dataclasses.replace(whole, sensors=sensors)
    said = predicted.predicted_replay(vehicle, Excitation(duration_s=24.0), (20,)).diagnosis
    drive = Scenario("other", 5, "", 24.0, speed=((0.0, 12.0),), road=RoadSpec(64e-6))
    answer = re_diagnose(Run(run_scenario(drive, vehicle).recording, vehicle), settings=Settings()).answer
    assert (answer.verdict == "insufficient_data") == bool(said) == (len(kept) < 4)
    assert said in answer.sentence


def test_progress_counts_every_simulated_drive(monkeypatch):
    for name in ("run_scenario", "run_offline", "Pipeline"):
        monkeypatch.setattr(predicted, name, lambda *given, **named: SimpleNamespace(recording=None, parameters=()))
    monkeypatch.setattr(predicted, "refusal", lambda run: "")
    shares: list[float] = []
    found = plan("single_imu", report=shares.append)
    assert np.diff(shares) == pytest.approx(shares[0]) and shares[-1] < 1.0  # no addition helps: no single sensor is looked for
    assert len(shares) == predicted.DRIVES + len(found.helpful) > predicted.DRIVES


@pytest.mark.slow
def test_plan_and_replay_agree_on_random_layouts():
    """Layouts and drives no plan has seen; ``benchmarks/plan_agreement.py`` prints the shares over many."""
    module = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "plan_agreement.py"))
    found = module["agreement"](layouts=4, seed=71)
    assert found.refusals_agree
    assert len(found.std_ratio) >= 50
    assert module["within"](found.std_ratio, 1.5) >= 0.85
    assert found.status_agrees >= 0.85


def test_a_status_that_depends_on_the_installation_says_in_how_many_drives() -> None:
    def drive(status: Status) -> tuple[Estimate, ...]:
        stiffness = Estimate("a.x.stiffness", 2.0, 0.4, "N/m", 2.0, status, "", 0)
        return (stiffness, Estimate("m", 1.0, 0.01, "kg", 1.0, Status.VALID, "", 0))

    states = (Status.ESTIMATING, Status.NOT_IDENTIFIABLE, Status.ESTIMATING, Status.ESTIMATING)
    seen = PredictedReplay(30.0, tuple(map(drive, states)))
    stiffness, mass = seen.parameters
    assert (stiffness.status, stiffness.share, stiffness.words) == ("estimating", 0.75, "estimating (75 % of the drives)")
    assert (mass.status, mass.words) == ("valid", "valid")
    assert seen.of_status("estimating") == ("a.x.stiffness",)


def test_a_notebook_shows_the_prediction_only_where_drives_were_simulated() -> None:
    bounds = plan("single_imu", unknown_mass=True, drives=False)
    assert "<th>bound</th>" in bounds._repr_html_() and "status" not in bounds._repr_html_()
    estimate = Estimate(bounds.result.present.names[0], 2.0, 0.4, "N/m", 2.0, Status.ESTIMATING, "", 0)
    text = dataclasses.replace(bounds, replay=PredictedReplay(30.0, ((estimate,),)))._repr_html_()
    assert "<th>status</th>" in text and "<td>20 %</td>" in text and "<td>estimating</td>" in text
