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
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "IncludeLaunchDescription"],
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


@pytest.mark.parametrize("name", ["estimation.launch.py", "replay.launch.py"])
def test_launch_file_is_built_by_ros_launch(name: str) -> None:
    found = importlib.util.find_spec("launch")
    if found is None or importlib.util.find_spec("launch_ros") is None:
        pytest.skip("ROS launch has no wheel; this runs in a sourced ROS workspace")
    import launch

    if not hasattr(launch, "LaunchDescription"):
        pytest.skip("the installed 'launch' is another project")
    description = runpy.run_path(str(LAUNCH / name))["generate_launch_description"]()
    assert isinstance(description, launch.LaunchDescription)
