# Copyright 2026 ride_estimation contributors
"""What pip and colcon install: metadata that agree, complete dependencies, files that are found."""

from __future__ import annotations

import ast
import functools
import importlib
import re
import runpy
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import setuptools

import ride_estimation
from ride_estimation.errors import InputDataError
from ride_estimation.resources import shared_path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "ride_estimation"
BAG_LIMIT_BYTES = 6_000_000
#: module -> rosdep key of package.xml
ROSDEP_KEYS = {
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "matplotlib": "python3-matplotlib",
    "yaml": "python3-yaml",
    "filterpy": "python3-filterpy-pip",
    "rosbags": "python3-rosbags-pip",
}
#: module -> name on the package index, where it differs
INDEX_NAMES = {"yaml": "pyyaml"}
#: imported only where installed, with a message or a fallback; each is an extra or has a stand-in
OPTIONAL = {"numba"}


@pytest.fixture(scope="module")
def metadata() -> dict[str, Any]:
    """Return the arguments setup.py gives to setuptools."""
    given: dict[str, Any] = {}
    original, folder = setuptools.setup, Path.cwd()
    patch = pytest.MonkeyPatch()
    try:
        patch.chdir(ROOT)
        patch.setattr(setuptools, "setup", given.update)
        runpy.run_path(str(ROOT / "setup.py"))
    finally:
        patch.undo()
    assert setuptools.setup is original
    assert Path.cwd() == folder
    return given


@pytest.fixture(scope="module")
def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


@functools.cache
def top_level_imports(folder: Path) -> set[str]:
    """Return the third-party packages imported anywhere below a folder."""
    names: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - {"ride_estimation", "__future__"}


def is_ros(name: str) -> bool:
    return name in {"rclpy", "builtin_interfaces", "rcl_interfaces", "std_srvs"} or name.endswith("_msgs")


def test_versions_agree(metadata: dict[str, Any], manifest: ElementTree.Element) -> None:
    version = ride_estimation.__version__
    assert metadata["version"] == version
    assert manifest.findtext("version") == version
    assert re.search(rf"^{re.escape(version)} \(", (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8"), re.MULTILINE)


def test_manifest_is_an_ament_python_package(manifest: ElementTree.Element) -> None:
    assert manifest.get("format") == "3"
    assert manifest.findtext("name") == "ride_estimation"
    assert manifest.findtext("export/build_type") == "ament_python"
    maintainer = manifest.find("maintainer")
    assert maintainer is not None
    assert re.fullmatch(r"[^@\s]+@[^@\s]+\.[a-z]{2,}", maintainer.get("email", ""))
    assert "python3-pytest" in {d.text for d in manifest.findall("test_depend")}


def test_manifest_names_everything_that_is_imported(manifest: ElementTree.Element) -> None:
    declared = {d.text for d in manifest.findall("exec_depend")}
    used = top_level_imports(PACKAGE)
    needed = {name for name in used if is_ros(name)} | {ROSDEP_KEYS[n] for n in used if n in ROSDEP_KEYS}
    assert {"rclpy", "python3-numpy"} <= needed
    assert needed <= declared


def test_pip_metadata_name_everything_that_is_imported(metadata: dict[str, Any]) -> None:
    every = [*metadata["install_requires"], *(r for extra in metadata["extras_require"].values() for r in extra)]
    offered = {re.split(r"[<>=!~\[; ]", r, maxsplit=1)[0].lower() for r in every}
    required = {re.split(r"[<>=!~\[; ]", r, maxsplit=1)[0].lower() for r in metadata["install_requires"]}
    used = {INDEX_NAMES.get(n, n) for n in top_level_imports(PACKAGE) if not is_ros(n)}
    unknown = used - offered
    assert not unknown, f"imported but in no list of setup.py: {sorted(unknown)}"
    assert {"numpy", "scipy", "filterpy", "rosbags", "pyyaml", "numba"} <= required


def test_colcon_finds_pytest(metadata: dict[str, Any]) -> None:
    # Without pytest in the extra "test", colcon test runs no test at all and reports success.
    assert any(r.startswith("pytest>") or r == "pytest" for r in metadata["extras_require"]["test"])


def test_ros_wheels_are_pinned(metadata: dict[str, Any]) -> None:
    assert any("ros-rclpy[fastrtps]==7.1.6" in r for r in metadata["extras_require"]["ros"])


def test_data_files_exist_and_include_what_the_nodes_need(metadata: dict[str, Any]) -> None:
    files = [Path(name) for _, names in metadata["data_files"] for name in names]
    assert all((ROOT / name).is_file() for name in files)
    names = {name.as_posix() for name in files}
    assert {
        "package.xml",
        "resource/ride_estimation",
        "launch/estimation.launch.py",
        "launch/replay.launch.py",
        "config/nodes/estimator.yaml",
        "config/vehicles/truck_cab.yaml",
    } <= names


def test_console_scripts_lead_somewhere(metadata: dict[str, Any]) -> None:
    for entry in metadata["entry_points"]["console_scripts"]:
        name, target = (part.strip() for part in entry.split("="))
        module, _, function = target.partition(":")
        if module.startswith("ride_estimation.nodes"):
            pytest.importorskip("rclpy", reason="ROS is not installed")
        assert callable(getattr(importlib.import_module(module), function)), name


def test_bundled_runs_are_small() -> None:
    runs = [folder for folder in (ROOT / "bags").iterdir() if folder.is_dir()]
    assert runs
    for folder in runs:
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        assert size < BAG_LIMIT_BYTES, f"{folder.name}: {size} bytes, allowed {BAG_LIMIT_BYTES}"


def test_a_wheel_carries_recipes_and_no_recordings(metadata: dict[str, Any]) -> None:
    shared = [ROOT / name for folder, names in metadata["data_files"] for name in names]
    assert {path.name for path in shared if "bags" in path.parts} == {"recipe.yaml"}
    assert sum(path.stat().st_size for path in shared) < 1_000_000


def test_every_source_file_carries_its_copyright_line() -> None:
    folders = ("ride_estimation", "test", "benchmarks", "launch")
    sources = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(sources) > 50
    missing = [
        path.relative_to(ROOT).as_posix()
        for path in sources
        if not path.read_text(encoding="utf-8").startswith(("# Copyright 2026 ride_estimation contributors", "#!/"))
    ]
    assert not missing


def test_shared_files_are_found_and_a_missing_one_is_named() -> None:
    assert shared_path("config", "vehicles", "truck_cab.yaml").is_file()
    with pytest.raises(InputDataError, match=r"config/vehicles/no_such\.yaml"):
        shared_path("config", "vehicles", "no_such.yaml")
