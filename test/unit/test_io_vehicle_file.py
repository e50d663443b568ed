# Copyright 2026 ride_estimation contributors
"""Vehicle files: what they can say, every mistake with its field, and that saving and loading is the identity."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from ride_estimation.elements.registry import kinds
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.vehicle_file import body_layout, load_vehicle, save_vehicle, vehicle_from_mapping, vehicle_to_mapping
from ride_estimation.vehicles.data_range import DataRange

ROOT = Path(__file__).parents[2]
TRUCK = ROOT / "config" / "vehicles" / "truck_cab.yaml"


@functools.cache
def parsed() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(TRUCK.read_text())
    return document


def truck() -> dict[str, Any]:
    return copy.deepcopy(parsed())


def problems_of(change: Callable[[dict[str, Any]], Any]) -> tuple[str, ...]:
    document = truck()
    change(document)
    with pytest.raises(ConfigurationError) as caught:
        vehicle_from_mapping(document)
    return caught.value.problems


def test_truck_file_says_what_it_says() -> None:
    vehicle = load_vehicle(TRUCK)
    assert vehicle.mount_names == ("front_left", "front_right", "rear_left", "rear_right")
    assert vehicle.bodies["cab"].mass.value == 1200.0 and vehicle.bodies["cab"].mass.std == pytest.approx(12.0)
    prior = vehicle.mounts["rear_left"].priors["z", "stiffness"]
    assert (prior.value, prior.std) == (4.2e4, pytest.approx(1.26e4))
    assert vehicle.sensors["cab_rear_right"].position.tolist() == [-0.80, -0.60, 0.90]
    assert vehicle.force_references[0].kind == "known_mass"
    assert len(vehicle.checksum) == 64


@pytest.mark.parametrize("path", sorted((ROOT / "config" / "vehicles").glob("*.yaml")), ids=lambda p: p.name)
def test_bundled_files_load_and_survive_saving(path: Path, tmp_path: Path) -> None:
    vehicle = load_vehicle(path)
    save_vehicle(vehicle, tmp_path / "again.yaml")
    again = load_vehicle(tmp_path / "again.yaml")
    assert vehicle_to_mapping(again) == vehicle_to_mapping(vehicle)
    assert again.mounts[vehicle.mount_names[0]].priors == vehicle.mounts[vehicle.mount_names[0]].priors


@pytest.mark.parametrize("kind", sorted(kinds()))
def test_every_kind_of_element_loads_and_survives_saving(kind: str) -> None:
    element = kinds()[kind].example()
    document = truck()
    document["mounts"]["front_left"]["axes"]["x"] = element.to_mapping()
    vehicle = vehicle_from_mapping(document)
    assert vehicle.mounts["front_left"].elements["x"] == element
    again = vehicle_from_mapping(vehicle_to_mapping(vehicle))
    assert again.mounts["front_left"].elements == vehicle.mounts["front_left"].elements
    assert again.mounts["front_left"].priors == vehicle.mounts["front_left"].priors


def test_units_of_keys_are_converted() -> None:
    document = truck()
    document["bodies"]["cab"]["cg_mm"] = [100.0, 0.0, -50.0]
    del document["bodies"]["cab"]["cg_m"]
    z = {"kind": "kelvin_voigt", "stiffness_n_per_mm": {"value": 52.0, "std": 5.0, "range": [20, 90]}, "damping_n_s_per_m": 1500}
    document["mounts"]["front_left"]["axes"]["z"] = z
    sensor = document["sensors"]["cab_front_left"]
    sensor["rotation_deg"] = [0.0, 0.0, 90.0]
    sensor["full_scale_g"] = 10.0
    del sensor["full_scale_m_per_s2"]
    vehicle = vehicle_from_mapping(document)
    assert vehicle.bodies["cab"].cg.tolist() == pytest.approx([0.1, 0.0, -0.05])
    prior = vehicle.mounts["front_left"].priors["z", "stiffness"]
    assert (prior.value, prior.std, prior.lower, prior.upper) == (5.2e4, 5.0e3, 2.0e4, 9.0e4)
    assert vehicle.sensors["cab_front_left"].full_scale == pytest.approx(98.0665)
    # sensor x points along body y after a quarter turn about z
    assert vehicle.sensors["cab_front_left"].rotation @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_an_axis_of_rotation_takes_and_gives_the_units_of_moments_and_angles(tmp_path: Path) -> None:
    document = truck()
    document["mounts"]["front_left"]["axes"]["roll"] = {
        "kind": "sum",
        "elements": [
            {"kind": "kelvin_voigt", "stiffness_n_m_per_rad": {"value": 4600, "relative_std": 0.1}, "damping_n_m_s_per_rad": 3},
            {"kind": "dahl", "friction_n_m": 5.0, "slope_n_m_per_rad": 900.0},
        ],
    }
    vehicle = vehicle_from_mapping(document)
    addressed = vehicle.mounts["front_left"].elements["roll"].addressed()
    assert addressed["elements[0].stiffness"][1] == 4600.0
    assert vehicle.mounts["front_left"].priors["roll", "elements[0].stiffness"].std == pytest.approx(460.0)
    save_vehicle(vehicle, tmp_path / "v.yaml")
    text = (tmp_path / "v.yaml").read_text()
    assert text.count("stiffness_n_m_per_rad") == text.count("slope_n_m_per_rad") == 1
    assert load_vehicle(tmp_path / "v.yaml").mounts["front_left"].elements == vehicle.mounts["front_left"].elements


def test_what_the_data_showed_of_an_element_is_kept_in_the_units_of_its_axis(tmp_path: Path) -> None:
    document = truck()
    axes = document["mounts"]["front_left"]["axes"]
    axes["z"]["seen_in_data"] = {"largest_deflection_mm": 12, "lowest_frequency_hz": 0.5, "highest_frequency_hz": 18}
    axes["roll"] = {
        "kind": "kelvin_voigt", "stiffness_n_m_per_rad": 4600, "damping_n_m_s_per_rad": 3,
        "seen_in_data": {
            "largest_deflection_rad": 0.01, "lowest_frequency_hz": 1, "highest_frequency_hz": 2, "lowest_preload_n_m": -5,
            "highest_preload_n_m": 7,
        },
    }  # fmt: skip
    vehicle = vehicle_from_mapping(document)
    save_vehicle(vehicle, tmp_path / "v.yaml")
    again = load_vehicle(tmp_path / "v.yaml").mounts["front_left"].seen
    assert again == vehicle.mounts["front_left"].seen
    assert again["z"] == DataRange(0.012, (0.5, 18.0))
    assert again["roll"] == DataRange(0.01, (1.0, 2.0), (-5.0, 7.0))
    axes["z"]["seen_in_data"]["lowest_frequency_hz"] = 20
    axes["roll"]["seen_in_data"]["amplitude"] = 3
    with pytest.raises(ConfigurationError) as caught:
        vehicle_from_mapping(document)
    assert "20 is above the highest, 18" in str(caught.value) and "unknown key" in str(caught.value)


def test_units_of_a_rotation_are_refused_along_an_axis_and_named_about_one() -> None:
    document = truck()
    axes = document["mounts"]["front_left"]["axes"]
    axes["z"] = {"kind": "kelvin_voigt", "stiffness_n_m_per_rad": 1.0, "damping_n_s_per_m": 1.0}
    axes["roll"] = {"kind": "kelvin_voigt", "damping_n_m_s_per_rad": 1.0}
    with pytest.raises(ConfigurationError) as error:
        vehicle_from_mapping(document)
    said = "\n".join(error.value.problems)
    assert "axes.z.unknown key 'stiffness_n_m_per_rad'" in said
    assert "axes.roll.stiffness_n_m_per_rad: missing" in said and "[N m/rad]" in said


def test_numbers_written_without_a_dot_are_numbers() -> None:
    document = yaml.safe_load(TRUCK.read_text().replace("5.2e4", "5e4"))
    assert document["mounts"]["front_left"]["axes"]["z"]["stiffness_n_per_m"]["value"] == "5e4"  # what YAML 1.1 makes of it
    assert vehicle_from_mapping(document).mounts["front_left"].elements["z"].addressed()["stiffness"][1] == 5e4


def test_numbers_inside_a_sum_carry_priors_under_their_address(tmp_path: Path) -> None:
    document = truck()
    part = {"kind": "kelvin_voigt", "stiffness_n_per_mm": {"value": 52.0, "relative_std": 0.1}, "damping_n_s_per_m": 1500.0}
    document["mounts"]["front_left"]["axes"]["z"] = {"kind": "sum", "elements": [part, part]}
    vehicle = vehicle_from_mapping(document)
    assert vehicle.mounts["front_left"].priors["z", "elements[1].stiffness"].std == pytest.approx(5200.0)
    save_vehicle(vehicle, tmp_path / "v.yaml")
    assert load_vehicle(tmp_path / "v.yaml").mounts["front_left"].priors == vehicle.mounts["front_left"].priors


def test_one_element_may_stand_for_all_axes() -> None:
    document = truck()
    element = {"kind": "kelvin_voigt", "stiffness_n_per_m": 1e5, "damping_n_s_per_m": 1e3}
    document["mounts"]["front_left"] = {"position_m": [0.8, 0.5, -0.45], "body": "cab", "base": "chassis", "element": element}
    assert set(vehicle_from_mapping(document).mounts["front_left"].elements) == {"x", "y", "z"}


def test_displacement_speed_and_force_sensors_have_defaults() -> None:
    document = truck()
    document["sensors"]["d"] = {"kind": "displacement", "mount": "front_left", "axis": "z", "noise_mm": 0.2}
    document["sensors"]["v"] = {"kind": "speed"}
    document["sensors"]["f"] = {"kind": "force", "mount": "rear_left", "noise_n": 20.0}
    document["force_references"] = [
        {"kind": "load_cell", "mount": "rear_left", "sensor": "f"},
        {"kind": "air_spring_pressure", "mount": "rear_left", "pressure_bar": 2.5, "area_m2": 0.012, "relative_std": 0.05},
        {"kind": "known_stiffness", "mount": "rear_left", "axis": "z", "relative_std": 0.02},
        {"kind": "known_added_mass", "body": "cab", "mass_kg": 80.0, "position_m": [0.0, 0.3, 0.2], "from_s": 30.0},
    ]
    vehicle = vehicle_from_mapping(document)
    d = vehicle.sensors["d"]
    assert (d.topic, d.element, d.body, d.channels) == ("/mounts/displacement", "front_left_z", "cab", 1)
    assert d.noise_std == pytest.approx(2e-4)
    assert vehicle.sensors["v"].topic == "/vehicle/speed"
    assert vehicle.sensors["f"].topic == "/mounts/rear_left/force_measured"
    pressure = next(r for r in vehicle.force_references if r.kind == "air_spring_pressure")
    assert pressure.details["pressure"] * pressure.details["area"] == pytest.approx(3000.0) and pressure.axis == "z"
    again = vehicle_from_mapping(vehicle_to_mapping(vehicle))
    assert vehicle_to_mapping(again) == vehicle_to_mapping(vehicle)


def test_all_mistakes_are_reported_at_once() -> None:
    def break_it(d: dict[str, Any]) -> None:
        d["bodies"]["cab"]["mass_kg"] = {"value": -5.0}
        d["mounts"]["front_left"]["position_m"] = [800, 500, -450]
        d["mounts"]["front_right"]["axes"]["z"]["kind"] = "kelvin_voigd"
        d["sensors"]["cab_front_left"]["position_m"] = [0.0, float("nan"), 0.0]
        d["sensors"]["cab_front_right"]["colour"] = "red"
        d["sensors"]["cab_rear_left"]["mount"] = "middle"
        d["gravity"] = 9.81

    found = problems_of(break_it)
    expected = [
        ("bodies.cab.mass_kg", "-5 kg"), ("mounts.front_left.position_m", "800 m"), ("front_right.axes.z.kind", "kelvin_voigt"),
        ("cab_front_left.position_m", "finite"), ("cab_front_right.colour", "unknown key"), ("cab_rear_left.mount", "'middle'"),
        ("gravity", "no unit"),
    ]
    for field, words in expected:
        assert any(field in p and words in p for p in found), (field, found)
    assert len(found) == len(expected)


def inertia(d: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = d["bodies"]["cab"]["inertia_kg_m2"]
    return found


def vertical(d: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = d["mounts"]["front_left"]["axes"]["z"]
    return found


def sensor(d: dict[str, Any], name: str = "cab_front_right") -> dict[str, Any]:
    found: dict[str, Any] = d["sensors"][name]
    return found


MISTAKES: list[tuple[str, Callable[[dict[str, Any]], Any], str]] = [
    ("no schema", lambda d: d.pop("schema"), "schema"),
    ("wrong schema", lambda d: d.update(schema="x"), "schema"),
    ("no bodies", lambda d: d.pop("bodies"), "bodies"),
    ("no mounts", lambda d: d.pop("mounts"), "mounts"),
    ("no mass", lambda d: d["bodies"]["cab"].pop("mass_kg"), "bodies.cab.mass_kg"),
    ("mass as text", lambda d: d["bodies"]["cab"].update(mass_kg="heavy"), "'heavy'"),
    ("inertia in kg mm2", lambda d: inertia(d).update(ixx=7.3e8, iyy=5.4e8, izz=8.1e8), "radius of gyration"),
    ("triangle inequality", lambda d: inertia(d).update(ixx=100.0, iyy=100.0, izz=900.0), "no body can have it"),
    ("not positive definite", lambda d: inertia(d).update(ixy=900.0), "not positive definite"),
    ("negative moment", lambda d: inertia(d).update(iyy=-540.0), "must be positive"),
    ("missing moment", lambda d: inertia(d).pop("iyy"), "iyy: missing"),
    ("unknown coordinate", lambda d: d["bodies"]["cab"].update(degrees_of_freedom=["z", "heave"]), "degrees_of_freedom"),
    ("unknown body", lambda d: d["mounts"]["front_left"].update(body="cabin"), "did you mean 'cab'"),
    ("mount on itself", lambda d: d["mounts"]["front_left"].update(base="cab"), "two different bodies"),
    ("unknown axis", lambda d: d["mounts"]["front_left"]["axes"].update(u={}), "axes.u"),
    ("element without kind", lambda d: d["mounts"]["front_left"]["axes"].update(z={}), "axes.z.kind"),
    ("stiffness out of bounds", lambda d: vertical(d).update(stiffness_n_per_m=-1.0), "outside"),
    ("both std", lambda d: vertical(d)["stiffness_n_per_m"].update(std=1.0), "one is allowed"),
    ("outside own range", lambda d: vertical(d)["stiffness_n_per_m"].update(range=[1, 2]), "own range"),
    ("wrong dimension", lambda d: d["bodies"]["cab"].update(mass_m=3.0), "allowed: mass_kg"),
    ("twice in two units", lambda d: d["bodies"]["cab"].update(cg_mm=[0, 0, 0]), "more than once"),
    ("two topics", lambda d: d["sensors"]["cab_front_left"].update(topic="/cab/rear_left/accel"), "already used"),
    ("no topic", lambda d: d["sensors"]["cab_front_left"].pop("topic"), "topic"),
    ("empty topic", lambda d: d["sensors"]["cab_front_left"].update(topic="/"), "not a topic"),
    ("unknown kind", lambda d: d["sensors"]["cab_front_left"].update(kind="acc"), "accelerometer, imu"),
    ("wrong side", lambda d: d["sensors"]["chassis_front_left"].update(body="trailer"), "trailer"),
    ("left-handed", lambda d: sensor(d).update(rotation_matrix=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), "left-handed"),
    ("not a rotation", lambda d: sensor(d).update(rotation_matrix=[[2, 0, 0], [0, 1, 0], [0, 0, 1]]), "orthogonal"),
    ("degrees as radians", lambda d: sensor(d).update(rotation_rad=[0, 0, 90]), "impossible"),
    ("negative noise", lambda d: d["sensors"]["cab_front_left"].update(noise_m_per_s2=-0.1), "outside"),
    ("coupling", lambda d: d["sensors"]["cab_front_left"].update(coupling="DC"), "dc, ac"),
    ("reference of nothing", lambda d: d.update(force_references=[{"kind": "known_mass", "body": "seat"}]), "'seat'"),
    ("load cell that is none", lambda d: d.update(
        force_references=[{"kind": "load_cell", "mount": "front_left", "sensor": "cab_front_left"}]
    ), "none is declared"),
    ("unknown top key", lambda d: d.update(sensor={}), "did you mean 'sensors'"),
    ("stiffness in N/mm under N/m", lambda d: [
        m["axes"]["z"].update(stiffness_n_per_m=1e-3) for m in d["mounts"].values()
    ], "N/mm given as N/m"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES])
def test_each_mistake_is_named_and_it_alone(change: Callable[[dict[str, Any]], Any], words: str) -> None:
    found = problems_of(change)
    assert len(found) == 1, found
    assert words in found[0]


def test_a_body_with_few_coordinates_needs_few_moments() -> None:
    document = truck()
    cab = document["bodies"]["cab"]
    cab["degrees_of_freedom"] = ["z", "pitch"]
    cab["inertia_kg_m2"] = {"iyy": 540.0}
    body = vehicle_from_mapping(document).bodies["cab"]
    assert body.coordinates == ("z", "pitch") and body.inertia[1, 1] == 540.0
    assert np.linalg.eigvalsh(body.inertia)[0] > 0.0
    cab["degrees_of_freedom"] = ["z"]
    del cab["inertia_kg_m2"]
    assert vehicle_from_mapping(document).bodies["cab"].coordinates == ("z",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"), ("- a\n- b\n", "mapping"), ("a: [1, 2", "not valid YAML"),
        ("a: 1\nb: 2\na: 3\n", "given twice, the second time in line 3"), ("\x00\x01", "not valid YAML"),
    ],
)  # fmt: skip
def test_broken_files_are_refused_with_their_name(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=words) as caught:
        load_vehicle(path)
    assert "broken.yaml" in str(caught.value)


def test_missing_file_and_binary_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="does not exist"):
        load_vehicle(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_vehicle(tmp_path / "binary.yaml")


def test_layout_of_the_truck_is_complete_and_of_a_single_imu_flagged() -> None:
    check = body_layout(load_vehicle(TRUCK), "cab")
    assert check.accelerometers_suffice and check.rank == 6 and check.condition < 5.0
    single = body_layout(load_vehicle(ROOT / "config" / "vehicles" / "single_imu.yaml"), "cab")
    assert single.complete and not single.accelerometers_suffice and single.rank == 3
    assert "nothing checks one channel against another" in single.sentence("cab")


def test_the_home_of_nobody_is_a_file_name() -> None:
    with pytest.raises(ConfigurationError, match="~nobody-of-that-name"):
        load_vehicle("~nobody-of-that-name")
