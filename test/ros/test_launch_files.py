# Copyright 2026 ride_estimation contributors
"""Launch files: what they start exists. With a real `launch` they are built by it, without by a stand-in that records."""

from __future__ import annotations

import importlib.util
import re
import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import yaml

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import estimator_parameters, replay_node
from ride_estimation.nodes.parameters import NodeParameter

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = ROOT / "launch"
TABLES: dict[str, tuple[NodeParameter, ...]] = {
    "estimator_node": estimator_parameters.TABLE,
    "replay_node": replay_node.TABLE,
}


class Recorded:
    """Stands in for a class of launch and keeps what it was made with."""

    made: list[Recorded]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.args, self.kwargs = args, kwargs
        type(self).made.append(self)


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Recorded]]:
    names = {
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "IncludeLaunchDescription", "OpaqueFunction"],
        "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["LifecycleNode", "Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
    }
    classes: dict[str, type[Recorded]] = {}
    for module_name, members in names.items():
        module = types.ModuleType(module_name)
        for member in members:
            classes[member] = type(member, (Recorded,), {"made": []})
            setattr(module, member, classes[member])
        monkeypatch.setitem(sys.modules, module_name, module)
    return classes


def build(name: str) -> None:
    runpy.run_path(str(LAUNCH / name))["generate_launch_description"]()


@pytest.mark.parametrize("name", ["estimation.launch.py", "replay.launch.py"])
def test_launch_file_starts_what_exists(stand_in: dict[str, type[Recorded]], name: str) -> None:
    build(name)
    declared = {a.args[0] for a in stand_in["DeclareLaunchArgument"].made}
    used = {c.args[0] for c in stand_in["LaunchConfiguration"].made}
    assert used <= declared, "an argument is used but not declared"
    scripts = (ROOT / "setup.py").read_text(encoding="utf-8")
    nodes = stand_in["LifecycleNode"].made + stand_in["Node"].made
    assert nodes
    for node in nodes:
        assert node.kwargs["package"] == "ride_estimation"
        assert re.search(rf'"{node.kwargs["executable"]} = ', scripts)
        known = {p.name for p in TABLES[node.kwargs["executable"]]} | {"use_sim_time"}
        for parameters in node.kwargs["parameters"]:
            if isinstance(parameters, dict):
                assert set(parameters) <= known


def test_defaults_of_the_launch_files_exist(stand_in: dict[str, type[Recorded]]) -> None:
    build("estimation.launch.py")
    defaults = {a.args[0]: a.kwargs.get("default_value") for a in stand_in["DeclareLaunchArgument"].made}
    assert Path(defaults["config"]).is_file()
    assert (ROOT / "config" / "vehicles" / f"{defaults['vehicle']}.yaml").is_file()
    assert defaults["namespace"] == "ride"


def test_replay_passes_only_arguments_the_estimation_declares(stand_in: dict[str, type[Recorded]]) -> None:
    build("estimation.launch.py")
    declared = {a.args[0] for a in stand_in["DeclareLaunchArgument"].made}
    build("replay.launch.py")
    (include,) = stand_in["IncludeLaunchDescription"].made
    assert {name for name, _ in include.kwargs["launch_arguments"]} <= declared
    (source,) = stand_in["PythonLaunchDescriptionSource"].made
    assert Path(source.args[0]) == LAUNCH / "estimation.launch.py"


def test_every_frame_an_output_names_is_published_where_the_vehicle_file_says(stand_in: dict[str, type[Recorded]]) -> None:
    build("frames.launch.py")
    defaults = {a.args[0]: a.kwargs["default_value"] for a in stand_in["DeclareLaunchArgument"].made}
    node = {p.name: p.default for p in estimator_parameters.TABLE}
    shared = ("vehicle", "vehicle_frame", "cg_frame", "mount_frame_prefix")
    assert {name: defaults[name] for name in shared} == {name: node[name] for name in shared}
    (opaque,) = stand_in["OpaqueFunction"].made
    given = {**defaults, "cg_frame": "cg", "mount_frame_prefix": "at_"}
    opaque.kwargs["function"](types.SimpleNamespace(launch_configurations=given))
    found = {}
    for node in stand_in["Node"].made:
        assert (node.kwargs["package"], node.kwargs["executable"]) == ("tf2_ros", "static_transform_publisher")
        words = node.kwargs["arguments"]
        given = dict(zip(words[::2], words[1::2], strict=True))
        assert given["--frame-id"] == "cab_link"
        found[given["--child-frame-id"]] = given
    vehicle = load_vehicle(ROOT / "config" / "vehicles" / "truck_cab.yaml")
    assert {"cg", *(f"at_{name}" for name in vehicle.mounts), *vehicle.sensors} == set(found)
    for name, mount in vehicle.mounts.items():
        assert [float(found[f"at_{name}"][f"--{c}"]) for c in "xyz"] == mount.position.tolist()
        assert float(found[f"at_{name}"]["--qw"]) == 1.0


def test_the_rviz_layout_shows_topics_and_frames_of_the_bundled_vehicle() -> None:
    layout = yaml.safe_load((ROOT / "config" / "rviz" / "ride.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    vehicle = load_vehicle(ROOT / "config" / "vehicles" / "truck_cab.yaml")
    topics = {d["Topic"]["Value"] for d in layout["Displays"] if "Topic" in d}
    assert topics == {"/ride/estimator/inertial_load", *(f"/ride/estimator/mounts/{m}/force" for m in vehicle.mounts)}
    assert layout["Global Options"]["Fixed Frame"] == "cab_link"


@pytest.mark.parametrize("name", ["estimation.launch.py", "replay.launch.py", "frames.launch.py"])
def test_launch_file_is_built_by_ros_launch(name: str) -> None:
    found = importlib.util.find_spec("launch")
    if found is None or importlib.util.find_spec("launch_ros") is None:
        pytest.skip("ROS launch has no wheel; this runs in a sourced ROS workspace")
    import launch

    if not hasattr(launch, "LaunchDescription"):
        pytest.skip("the installed 'launch' is another project")
    description = runpy.run_path(str(LAUNCH / name))["generate_launch_description"]()
    assert isinstance(description, launch.LaunchDescription)
