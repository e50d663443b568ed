# Copyright 2026 ride_estimation contributors
"""Discovery: completion that a shell takes, help that teaches, verbs that load only themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest

from ride_estimation.cli.main import EPILOG, TOPICS, build_parser, main, verb_helps


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
    texts = [EPILOG, *(getattr(__import__(f"ride_estimation.cli.{v.replace('-', '_')}", fromlist=["x"]), "EXAMPLES", "")
                       for v in verb_helps())]  # fmt: skip
    joined = [re.sub(r"\\\n\s*", "", text) for text in texts]
    lines = [line.strip() for text in joined for line in text.splitlines() if line.strip().startswith("ride-estimation ")]
    assert len(lines) > 12
    for line in lines:
        # what stands behind two blanks is an explanation
        words = line.split("  ")[0].partition(">")[0].split()[1:]
        if words[0] != "VERB":
            parser.parse_args(words)


def test_one_verb_does_not_import_the_others() -> None:
    code = "import sys; from ride_estimation.cli.main import build_parser; build_parser(['plan']); " \
        "sys.exit('ride_estimation.cli.fleet' in sys.modules or 'matplotlib' in sys.modules)"  # fmt: skip
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
