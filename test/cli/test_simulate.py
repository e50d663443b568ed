# Copyright 2026 ride_estimation contributors
"""``ride-estimation simulate`` end to end: bag and truth fit together, runs repeat, mistakes are named."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.api.simulating import find_vehicle
from ride_estimation.cli.main import main
from ride_estimation.frames import point_motion_matrix
from ride_estimation.io.bags import read_recording
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.measurement import SensorErrors
from ride_estimation.simulation.scenario import Scenario

ROOT = Path(__file__).parents[2]
TRUCK_CAB = ROOT / "config" / "vehicles" / "truck_cab.yaml"
SHORT = f"""schema: ride_estimation/scenario/1
name: short
vehicle: {TRUCK_CAB}
seed: 5
duration_s: 3.0
speed_km_per_h: 40.0
road: {{iso_class: C}}
obstacles:
  - {{kind: block, at_m: 12.0, length_m: 0.1, height_m: 0.03, side: left}}
engine:
  speed_rpm: 1200.0
  orders_m_per_s2: {{3: 0.2}}
lane_changes:
  - {{from_s: 0.5, duration_s: 2.0, peak_m_per_s2: 0.5}}
payloads:
  - {{body: cab, mass_kg: 60.0, position_m: [0.2, 0.1, 0.0], from_s: 1.0}}
disturbances:
  - {{body: cab, position_m: [0.6, 0.2, 0.0], axis: z, frequency_hz: 6.3, amplitude_n: 50.0}}
true_mounts:
  front_left: {{z: {{factors: {{stiffness: 1.2}}}}}}
  rear_left: {{z: {{element: {{kind: sum, elements: [
    {{kind: kelvin_voigt, stiffness_n_per_m: 4.2e4, damping_n_s_per_m: 1400.0}},
    {{kind: berg_friction, friction_n: 80.0, half_stroke_m: 0.001}}]}}}}}}
sensors: {{rate_hz: 200.0, quantisation_m_per_s2: 0.002, jitter_std_ms: 0.1}}
faults:
  - {{sensor: cab_front_right, kind: gap, from_s: 1.0, to_s: 1.5}}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("simulate")
    recipe = folder / "short.yaml"
    recipe.write_text(SHORT, encoding="utf-8")
    assert main(["simulate", str(recipe), "--out", str(folder / "one")]) == 0
    return folder


def test_bag_and_truth_describe_the_same_motion(run):
    vehicle = load_vehicle(TRUCK_CAB)
    recording = read_recording(run / "one" / "bag", vehicle)
    truth = np.load(run / "one" / "truth.npz")
    about = json.loads((run / "one" / "truth.json").read_text(encoding="utf-8"))
    start = about["start_stamp_ns"]
    readings, rows = [], []
    for name in ("cab_front_left", "cab_rear_left", "cab_rear_right"):
        channel = recording.channels[name]
        t = (channel.stamp_ns - start) * 1e-9
        readings.append(np.stack([np.interp(truth["time_s"], t, channel.values[:, i]) for i in range(3)], axis=1))
        rows.append(point_motion_matrix(vehicle.sensors[name].position))
    motion = np.hstack(readings) @ np.linalg.pinv(np.vstack(rows)).T
    inner = truth["time_s"] < 0.98  # before the payload moves the CG
    felt = truth["mount_force"].sum(axis=1)
    # specific force at the CG times mass is the sum of the mount forces: sensors, truth and physics agree; the disturbance
    # force is the only other one
    push = 50.0 * np.sin(2 * np.pi * 6.3 * truth["time_s"][inner])
    rest = 1200.0 * motion[inner, :3] - felt[inner] - push[:, None] * np.array([0.0, 0.0, 1.0])
    assert np.sqrt(np.mean(rest**2, axis=0)).max() < 40.0  # N of about 11 800: noise 0.02 m/s^2, 200 Hz straight lines
    assert truth["mass"][0] == pytest.approx(1200.0) and truth["mass"][-1] == pytest.approx(1260.0)
    np.testing.assert_allclose(truth["cg_offset"][-1], np.array([0.2, 0.1, 0.0]) * 60.0 / 1260.0, atol=1e-6)


def test_truth_states_parameters_seed_versions_and_checksums(run):
    about = json.loads((run / "one" / "truth.json").read_text(encoding="utf-8"))
    assert about["schema"] == "ride_estimation/truth/1" and about["seed"] == 5
    assert about["vehicle"]["checksum"] and len(about["recipe_sha256"]) == 64
    assert about["parameters"]["mounts"]["front_left"]["z"]["stiffness_n_per_m"] == pytest.approx(1.2 * 5.2e4)
    assert about["parameters"]["mounts"]["rear_left"]["z"]["kind"] == "sum"
    planted = {"sensor": "cab_front_right", "kind": "gap", "from_s": 1.0, "to_s": 1.5, "size": 0.0, "axis": "z"}
    assert about["faults"] == [planted]
    assert set(about["software"]) >= {"ride_estimation", "numpy", "scipy"}


def test_the_planted_gap_is_in_the_bag(run):
    recording = read_recording(run / "one" / "bag", load_vehicle(TRUCK_CAB))
    lengths = {name: len(c.stamp_ns) for name, c in recording.channels.items()}
    assert lengths["cab_front_left"] == 600
    assert lengths["cab_front_right"] == pytest.approx(500, abs=1)


def test_the_same_scenario_gives_the_same_samples(run):
    assert main(["simulate", str(run / "short.yaml"), "--out", str(run / "two")]) == 0
    vehicle = load_vehicle(TRUCK_CAB)
    one, two = (read_recording(run / n / "bag", vehicle) for n in ("one", "two"))
    for name, channel in one.channels.items():
        np.testing.assert_array_equal(channel.values, two.channels[name].values)
        np.testing.assert_array_equal(channel.stamp_ns, two.channels[name].stamp_ns)


def test_an_existing_run_is_not_overwritten(run, capsys):
    assert main(["simulate", str(run / "short.yaml"), "--out", str(run / "one")]) == 2
    assert "holds a bag already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("iso_class: C", "iso_class: Z", "road.iso_class: 'Z' is unknown; allowed: A, B, C"),
        ("duration_s: 3.0", "duration_s: -3.0", "duration_s: -3 s is outside 1 to 86400 s"),
        ("kind: block", "kind: blok", "obstacles[0].kind: 'blok' is unknown; allowed: cosine, block, ramp"),
        ("stiffness: 1.2", "stifness: 1.2", "true_factors.front_left.z.stifness: no such parameter; allowed: stiffness"),
        ("sensor: cab_front_right", "sensor: cab_middle", "sensor 'cab_middle': not in the vehicle file; allowed: cab"),
        ("body: cab, mass", "body: cabin, mass", "body 'cabin': not in the vehicle file; allowed: cab"),
        ("rate_hz: 200.0", "rate_hz: 2000.0", "rate_hz: 2000 Hz; allowed: at most simulation_rate_hz 1000 Hz"),
        ("speed_km_per_h: 40.0", "speed_mph: 40.0", "unknown key"),
        ("seed: 5", "seed: five", "seed: 'five' is not a whole number"),
        (str(TRUCK_CAB), "nowhere.yaml", "'nowhere.yaml' does not exist beside the scenario"),
    ],
)
def test_a_mistake_is_named_with_field_value_and_what_is_allowed(tmp_path, capsys, old, new, message):
    recipe = tmp_path / "wrong.yaml"
    recipe.write_text(SHORT.replace(old, new, 1), encoding="utf-8")
    assert main(["simulate", str(recipe), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_vehicle_that_topples_at_rest_is_refused_in_words(tmp_path, capsys):
    """Mounts 0.3 m apart under a CG 1.2 m above them: m g h = 14 kN m/rad against 4 kN m/rad of the springs."""
    text = TRUCK_CAB.read_text(encoding="utf-8")
    for old, new in (("[0.80, ", "[0.15, "), ("[-0.85, ", "[-0.15, "), ("0.50, -0.45]", "0.15, -1.2]")):
        text = text.replace(old, new).replace(old.replace("0.50", "0.55"), new)
    path, recipe = tmp_path / "tall.yaml", tmp_path / "tall_run.yaml"
    path.write_text(text, encoding="utf-8")
    recipe.write_text(SHORT.replace(str(TRUCK_CAB), str(path)), encoding="utf-8")
    assert main(["simulate", str(recipe), "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert "topples: gravity is stronger than the mounts" in message
    assert "check mount positions, height of the CG" in message


def test_all_mistakes_of_a_file_are_reported_at_once(tmp_path, capsys):
    recipe = tmp_path / "wrong.yaml"
    recipe.write_text(SHORT.replace("kind: gap", "kind: gape").replace("duration_s: 3.0", "duration_s: x"), encoding="utf-8")
    assert main(["simulate", str(recipe), "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    assert "2 mistakes" in text and "faults[0].kind" in text and "duration_s" in text


@pytest.mark.parametrize("recipe", sorted((ROOT / "bags").glob("*/recipe.yaml")), ids=lambda p: p.parent.name)
def test_bundled_recipes_load_and_their_bags_are_small(recipe):
    scenario = load_scenario(recipe)
    assert scenario.name == recipe.parent.name and scenario.description
    folder = recipe.parent
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    assert 1e5 < size < 6e6  # bytes
    recording = read_recording(folder / "bag", load_vehicle(TRUCK_CAB))
    span = [c.stamp_ns[-1] - c.stamp_ns[0] for c in recording.channels.values()]
    assert max(span) * 1e-9 == pytest.approx(scenario.duration, abs=0.1)
    assert json.loads((folder / "truth.json").read_text(encoding="utf-8"))["seed"] == scenario.seed


def test_the_example_shows_every_key_and_loads():
    example = ROOT / "config" / "scenarios" / "every_key.yaml"
    scenario = load_scenario(example)
    default = Scenario("x", 0, "x", 20.0)
    same = {"simulation_rate", "truth_rate", "start_ns"}
    for field in dataclasses.fields(Scenario):
        if field.name not in same:
            shown, unset = getattr(scenario, field.name), getattr(default, field.name)
            assert shown and (shown != unset or field.name in ("duration", "truck")), field.name
    text = example.read_text(encoding="utf-8")
    for field in dataclasses.fields(SensorErrors):
        assert f"  {field.name}" in text, field.name
    assert find_vehicle(example, scenario.vehicle_file) == TRUCK_CAB
