"""Package metadata; tools are configured in pyproject.toml."""

from setuptools import find_packages, setup

setup(
    name="ride_estimation",
    version="0.1.0",
    packages=find_packages(include=["ride_estimation", "ride_estimation.*"]),
    install_requires=["setuptools", "numpy>=1.26", "scipy>=1.11", "filterpy>=2.0", "rosbags>=0.11", "pyyaml", "numba"],
    entry_points={"console_scripts": ["ride-estimation = ride_estimation.cli.main:main"]},
)
