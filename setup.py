# Copyright 2026 ride_estimation contributors
"""Package metadata for pip and for colcon (ament_python); tools are configured in pyproject.toml."""

from collections import defaultdict
from pathlib import Path

from setuptools import find_packages, setup

NAME = "ride_estimation"
#: what is installed below share/ride_estimation as it is; of the bundled runs only the recipes: `demo` simulates them from these
SHARED_FILES = ("launch/**/*", "config/**/*", "bags/*/recipe.yaml")


def data_files():
    """List what goes to ``share/``: the ament index marker, the manifest, launch files, configuration, bundled runs."""
    by_folder = defaultdict(list)
    by_folder["share/ament_index/resource_index/packages"].append(f"resource/{NAME}")
    by_folder[f"share/{NAME}"].append("package.xml")
    for pattern in SHARED_FILES:
        for path in sorted(Path().glob(pattern)):
            if path.is_file() and "__pycache__" not in path.parts:
                by_folder[f"share/{NAME}/{path.parent.as_posix()}"].append(path.as_posix())
    return sorted(by_folder.items())


RUNTIME = [
    "setuptools",
    "numpy>=1.26",
    "scipy>=1.11",
    "filterpy>=2.0",
    "rosbags>=0.11",
    "pyyaml>=6.0",
    "matplotlib>=3.6",
    "numba>=0.60",
]

# Pinned: the newest unpinned wheels are of another ROS distribution.
ROS = [
    'ros-jazzy-rclpy; platform_machine == "x86_64"',
    'ros-rclpy[fastrtps]==7.1.6; platform_machine == "x86_64"',
    'ros-jazzy-common-interfaces; platform_machine == "x86_64"',
]
# Import and export of measurement files: MDF4, TDMS, RPC III, Parquet. The newest pyarrow refuses numpy 1.26.
FILES = ["asammdf>=8.1", "npTDMS>=1.9", "rpc3-file>=1.0.0rc6", "pyarrow>=15,<26"]
FLEET = ["distributed>=2024.1"]
COMPLETION = ["shtab>=1.6"]
# What results of the Python interface become in a notebook.
NOTEBOOK = ["pandas>=2.0", "xarray>=2023.1"]
# npTDMS, rpc3-file, shtab: half a megabyte each. Tests of MDF4, Parquet, Dask (100 MB and more) are skipped without their extras.
TEST = [
    "pytest>=8.0", "pytest-timeout>=2.2", "pytest-xdist>=3.5", "hypothesis>=6.100", "mujoco>=3.2",
    "rainflow>=3.2", "mcap>=1.3", "npTDMS>=1.9", "rpc3-file>=1.0.0rc6", "fmpy>=0.3.20", *COMPLETION,
]
LINT = ["ruff>=0.6", "mypy>=1.11", "import-linter>=2.0", "types-PyYAML"]
# The documentation site; its two notebooks are executed when it is built.
DOCS = ["sphinx>=7.2", "myst-nb>=1.1", "furo>=2024.1", "numpydoc>=1.7", "fmpy>=0.3.20", *NOTEBOOK]
COLCON = ["colcon-common-extensions", "colcon-ros", "catkin_pkg", "setuptools<80"]

setup(
    name=NAME,
    version="0.1.0",
    description="Cab motion, inertial loads, mount parameters and attachment forces from accelerometers, live and from bags",
    long_description=Path("README.md").read_text(encoding="utf-8") if Path("README.md").is_file() else "",
    long_description_content_type="text/markdown",
    maintainer="ride_estimation contributors",
    maintainer_email="maintainers@example.com",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={f"{NAME}.export": ["c/*", "modelica/*"], f"{NAME}.reporting": ["web/*"]},
    data_files=data_files(),
    zip_safe=False,
    install_requires=RUNTIME,
    extras_require={
        "ros": ROS,
        "test": TEST,
        "lint": LINT,
        "colcon": COLCON,
        "files": FILES,
        "fleet": FLEET,
        "completion": COMPLETION,
        "notebook": NOTEBOOK,
        "docs": DOCS,
        "dev": TEST + LINT,
    },
    entry_points={
        "console_scripts": [
            "ride-estimation = ride_estimation.cli.main:main",
            "estimator_node = ride_estimation.nodes.estimator_node:main",
            "replay_node = ride_estimation.nodes.replay_node:main",
        ],
    },
)
