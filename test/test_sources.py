# Copyright 2026 ride_estimation contributors
"""docs/sources.md is complete and true: every row is there, every test and every file it names exists."""

from __future__ import annotations

import argparse
import ast
import re
from pathlib import Path

import pytest

from ride_estimation.cli.main import arguments_of, verb_helps

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "docs" / "sources.md").read_text(encoding="utf-8")
ROWS = [
    *(f"0-{i}" for i in range(1, 22)), *(f"1-{i}" for i in range(1, 25)), *(f"2-{i}" for i in range(1, 12)),
    *(f"B{i}" for i in range(1, 19)), *(f"J{i}" for i in range(1, 16)), *(f"E{i}" for i in range(1, 31)),
]


def functions(path: Path) -> set[str]:
    """Return the names of all test functions of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and n.name.startswith("test_")}


@pytest.mark.parametrize("row", ROWS)
def test_row_is_listed(row: str) -> None:
    cells = [line.split("|")[2] for line in TEXT.splitlines() if line.startswith("|") and line.count("|") > 6]
    assert any(row in re.split(r"[ ,]+", cell.strip()) for cell in cells), f"{row} has no line in docs/sources.md"


@pytest.mark.parametrize("name", sorted(set(re.findall(r"(test_\w+\.py)::test_", TEXT))))
def test_named_tests_exist(name: str) -> None:
    found = list((ROOT / "test").rglob(name))
    assert len(found) == 1, f"{name} is there {len(found)} times"
    missing = set(re.findall(rf"{name}::(test_\w+)", TEXT)) - functions(found[0])
    assert not missing, f"{name} has no {', '.join(sorted(missing))}"


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:ride_estimation|config|benchmarks)/[\w/.]+)`", TEXT))))
def test_named_files_exist(path: str) -> None:
    assert (ROOT / path).is_file()


def test_each_correction_has_a_test_or_says_reading() -> None:
    """A line with an E number proves its correction by a test; what the text shows by itself says "reading"."""
    for line in TEXT.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) > 7 and re.search(r"\bE\d", cells[2]):
            assert "::test_" in cells[6] or "reading" in cells[4] or "reading" in cells[5], line


def commands() -> set[str]:
    """Return the commands of the last column: verbs, and procedures with their name."""
    found = set()
    for line in TEXT.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 9 and cells[2] != "row":
            of_commands = re.sub(r"`[^`]*`(?:, `[^`]*`)* \(\[Python", "", cells[7])
            found |= set(re.findall(r"`([a-z][\w-]+(?: (?!-)[a-z][\w-]*)?)(?:[ `])", of_commands))
    return {c for c in found if not c.startswith(("python", "kind", "inertial_load"))}


def test_named_commands_exist() -> None:
    helps = verb_helps()
    parser = argparse.ArgumentParser()
    arguments_of("procedure").add_arguments(parser)
    (kinds,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    named = commands()
    assert {"identify", "replay", "design-test", "procedure damping", "procedure road"} <= named
    for command in named:
        verb, _, procedure = command.partition(" ")
        assert verb in helps, command
        assert verb != "procedure" or procedure in kinds.choices, command
