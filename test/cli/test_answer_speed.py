# Copyright 2026 ride_estimation contributors
"""A mistake on the command line is answered before anything slow is imported; benchmarks/answer_speed.py prints the times."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: what takes a quarter of a second and more to import, and no check of an input needs
SLOW = (
    "numba", "scipy.special", "scipy.stats", "scipy.signal", "scipy.linalg", "matplotlib", "ride_estimation.estimation.pipeline",
)  # fmt: skip

CODE = f"""
import importlib.util, sys, tempfile
from pathlib import Path
from ride_estimation.cli.main import main
spec = importlib.util.spec_from_file_location("answer_speed", {str(ROOT / "benchmarks" / "answer_speed.py")!r})
speed = importlib.util.module_from_spec(spec)
spec.loader.exec_module(speed)
wrong = []
with tempfile.TemporaryDirectory() as folder:
    for arguments in speed.mistakes(Path(folder)):
        try:
            code = main(arguments)
        except SystemExit as left:
            code = left.code
        slow = sorted(set({SLOW!r}) & set(sys.modules))
        if code != 2 or slow:
            sys.exit(f"{{arguments}}: exit code {{code}}, imported {{slow}}")
"""


def test_no_mistake_waits_for_a_slow_import() -> None:
    """Every mistake of the benchmark, one after the other in one process: exit code 2 and none of the slow packages loaded."""
    done = subprocess.run([sys.executable, "-c", CODE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr.splitlines()[-1]
