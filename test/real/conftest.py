# Copyright 2026 ride_estimation contributors
"""Where the public recordings lie; tests skip where they are absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

DEFAULT = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data():
    """Return a function: folder name -> path, skipping the test where the folder is absent."""
    root = Path(os.environ.get("RIDE_ESTIMATION_REAL_DATA", str(DEFAULT)))

    def folder(name: str) -> Path:
        path = root / name
        if not path.is_dir():
            pytest.skip(f"{path} is absent; set RIDE_ESTIMATION_REAL_DATA")
        return path

    return folder
