# Copyright 2026 ride_estimation contributors
"""The folder of compiled code removes old code of its own and nothing else."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from ride_estimation.jit import cache_folder


def test_only_compiled_code_of_this_package_is_ever_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIDE_ESTIMATION_CACHE", str(tmp_path))
    old, young, foreign = tmp_path / "0123456789abcdef", tmp_path / "fedcba9876543210", tmp_path / "photos"
    for folder in (old, young, foreign):
        folder.mkdir()
    month = time.time() - 30 * 86400.0
    for folder in (old, foreign):
        os.utime(folder, (month, month))
    made = cache_folder.__wrapped__("signals")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([young.name, "photos", made.name])
