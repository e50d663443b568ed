# Copyright 2026 ride_estimation contributors
"""What benchmarks/mutations.py breaks is there to be broken: its list does not go stale unnoticed."""

from __future__ import annotations

import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_line_that_is_broken_is_there_once() -> None:
    names = runpy.run_path(str(ROOT / "benchmarks" / "mutations.py"))
    for mutation in names["MUTATIONS"]:
        text = (ROOT / "ride_estimation" / "estimation" / mutation.file).read_text(encoding="utf-8")
        assert names["mutated"](text, mutation) != text
    for pattern in names["TESTS"]:
        assert list(ROOT.glob(pattern)), pattern
