# Copyright 2026 ride_estimation contributors
"""The worked example of the documents, command by command in one folder; what the page says is what comes out."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "worked_example.md"
#: runs the example names; the fleet replays those that are there
RUNS = ("standing", "hidden_friction", "hidden_friction_validation")


def commands() -> list[str]:
    blocks = re.findall(r"```bash\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.strip()]


@pytest.mark.slow
def test_the_worked_example(tmp_path: Path) -> None:
    (tmp_path / "config").symlink_to(ROOT / "config")
    (tmp_path / "bags").mkdir()
    for name in RUNS:
        (tmp_path / "bags" / name).symlink_to(ROOT / "bags" / name)
    assert len(commands()) == 8
    for command in commands():
        words = shlex.split(command)[1:]
        done = subprocess.run(
            [sys.executable, "-m", "ride_estimation.cli.main", *words], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    diagnosis = json.loads((tmp_path / "out" / "diagnosis" / "diagnosis.json").read_text())
    assert [(c["id"], c["location"], c["axis"]) for c in diagnosis["causes"]] == [("coulomb_friction", "front_left", "z")]
    judged = diagnosis["gain"]["validation"][0]
    assert judged["extended"] < 0.5 * judged["baseline"]
    second = (tmp_path / "out" / "second" / "report.html").read_text()
    assert "coulomb friction at front_left z" in second and "another recording" not in second
    assert (tmp_path / "out" / "second" / "report.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "out" / "fleet" / "fleet.csv").read_text().count("\n") == 1 + len(RUNS)


def test_the_pages_for_a_first_day_are_linked() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "docs/worked_example.md" in readme and "docs/what_it_can_know.md" in readme
