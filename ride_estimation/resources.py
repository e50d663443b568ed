# Copyright 2026 ride_estimation contributors
"""Find the files that come with the package (config, bags, launch) however it was installed."""

from __future__ import annotations

from pathlib import Path

from ride_estimation.errors import InputDataError


def shared_path(*parts: str) -> Path:
    """Return the path of a file or folder that comes with the package.

    Looks beside the package (source tree, editable install, ``colcon build --symlink-install``), then for
    ``share/ride_estimation`` in the folders above it (pip install, colcon install). Needs neither ament nor ROS.

    Parameters
    ----------
    parts
        Path below the repository root, for example ``"config", "vehicles", "truck_cab.yaml"``.

    Raises
    ------
    InputDataError
        The file does not exist in this installation.
    """
    package = Path(__file__).resolve().parent
    candidates = [package.parent.joinpath(*parts)]
    candidates += [above.joinpath("share", "ride_estimation", *parts) for above in package.parents]
    for candidate in candidates:
        if candidate.exists():
            return candidate
    raise InputDataError(f"{'/'.join(parts)} did not come with this installation (looked below {package.parent})")
