# Copyright 2026 ride_estimation contributors
"""Discovery: completion that a shell takes, help that teaches, verbs that load only themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ride_estimation.cli.main import EPILOG, TOPICS, arguments_of, build_parser, main, verb_helps
from ride_estimation.identification.bench.choices import MODELS
from ride_estimation.identification.bench.models import LADDER


def test_the_shell_completes_verbs_and_options(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("shtab")
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    ask = script + (
        "\nCOMP_WORDS=(ride-estimation repl); COMP_CWORD=1; _shtab_ride_estimation 2>/dev/null; echo \"${COMPREPLY[@]}\""
        "\nCOMP_WORDS=(ride-estimation replay --dai); COMP_CWORD=2; _shtab_ride_estimation 2>/dev/null; echo \"${COMPREPLY[@]}\""
    )
    done = subprocess.run([bash, "-c", ask], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["replay", "--daily-hours"]


def test_a_missing_library_names_its_extra(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "zsh"]) == 2
    assert "ride_estimation[completion]" in capsys.readouterr().err


def test_help_lists_every_verb_once_with_what_it_is_for() -> None:
    text = build_parser([]).format_help()
    for verb, words in verb_helps().items():
        assert sum(line.split()[:1] == [verb] for line in text.splitlines()) == 1, verb
        assert words in text
    assert {verb for _, group in TOPICS for verb in group} <= set(verb_helps())


def test_examples_of_help_are_commands_that_parse() -> None:
    parser = build_parser()
    texts = [EPILOG, *(getattr(arguments_of(verb), "EXAMPLES", "") for verb in verb_helps())]
    joined = [re.sub(r"\\\n\s*", "", text) for text in texts]
    lines = [line.strip() for text in joined for line in text.splitlines() if line.strip().startswith("ride-estimation ")]
    assert len(lines) > 12
    for line in lines:
        # what stands behind two blanks is an explanation
        words = line.split("  ")[0].partition(">")[0].split()[1:]
        if words[0] != "COMMAND":
            parser.parse_args(words)


def imported_by(statement: str, *names: str) -> list[str]:
    """Return which of some modules a fresh Python has imported after a statement."""
    code = f"{statement}\nimport sys\nprint('imported:', *(name for name in {names!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.rpartition("imported:")[2].split()


def test_arguments_of_all_verbs_import_nothing_of_the_work() -> None:
    statement = "from ride_estimation.cli.main import build_parser; build_parser()"
    assert imported_by(statement, "argparse", "numpy", "scipy", "numba", "matplotlib", "yaml", "rosbags") == ["argparse"]


def test_a_wrong_file_is_answered_before_the_work_is_imported(tmp_path: Path) -> None:
    statement = "from ride_estimation.cli.main import main\n" + "\n".join(
        f"assert main([{verb!r}, 'absent.mcap', '--vehicle', 'truck_cab', '--out', {str(tmp_path)!r}]) == 2"
        for verb in ("replay", "diagnose")
    )
    heavy = ("scipy.signal", "scipy.stats", "matplotlib", "ride_estimation.estimation.pipeline", "ride_estimation.api.diagnosing")
    assert imported_by(statement, "rosbags", *heavy) == ["rosbags"]


def test_models_to_choose_from_are_those_there_are() -> None:
    assert tuple(model.name for model in LADDER) == MODELS
