# Copyright 2026 ride_estimation contributors
"""Text that users read keeps to the terms of docs/conventions.md."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from ride_estimation.cli.main import build_parser

ROOT = Path(__file__).resolve().parents[1]
RETIRED = re.compile(
    r"\b(hindsight|second look|overtaken|passed over|stands? out|(?:took|takes?) no part|neither fit(?:ted)? nor select(?:ed)?|"
    r"cumulated|damage line|what was learn(?:ed|t)|is taken back|taken back|swamps?|smells?|can(?:not)? tell|could tell|"
    r"be told apart|told from|sideways|verbs?|comes? aboard|came aboard|anchors?|anchored|lets expect|of it (?:equilibrium|the)|"
    r"worth a word|leave little doubt|tells?|told|spoke|holds? no(?:thing)?|nothing (?:is|was) learned|loudest 1 %|"
    r"says what it takes|lies off its place|is no (?:unit|model|column|sensor|mount|parameter)|on its way|beside its place)\b",
    re.IGNORECASE,
)
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "gallery").glob("*.md")])


def found(text: str) -> list[str]:
    """Return the retired words of a text, each with what stands around it; code in backticks is not text."""
    plain = re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)|--[\w-]+", " ", text, flags=re.DOTALL)
    return [" ".join(plain[max(m.start() - 30, 0) : m.end() + 30].split()) for m in RETIRED.finditer(plain)]


def literals(path: Path) -> list[str]:
    """Return the texts in the code of a file that are no docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documents = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and node.body and isinstance(node.body[0], ast.Expr)
    }
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents
        and (" " in node.value or path.parent.name == "reporting")  # one word may be a key; there it is the head of a column
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_keep_to_the_terms(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not found(text.partition("## Words")[0])


def test_help_keeps_to_the_terms() -> None:
    parser = build_parser()
    helps = {"": parser.format_help()}
    assert parser._subparsers is not None  # argparse has no public way to its commands
    for action in parser._subparsers._group_actions:
        helps |= {name: command.format_help() for name, command in action.choices.items()}  # type: ignore[union-attr]
    assert len(helps) > 15
    assert not {name: found(text) for name, text in helps.items() if found(text)}


FOLDERS = sorted(path.name for path in (ROOT / "ride_estimation").iterdir() if path.is_dir() and any(path.glob("*.py")))


@pytest.mark.parametrize("folder", FOLDERS)
def test_messages_and_reports_keep_to_the_terms(folder: str) -> None:
    told = {
        f"{path.name}": words
        for path in sorted((ROOT / "ride_estimation" / folder).rglob("*.py"))
        if (words := [word for text in literals(path) for word in found(text)])
    }
    assert not told


#: retired in names, comments and docstrings too
IN_CODE = re.compile(
    r"(?<![a-z])(tells?|told|spare|hindsight|doubt\w*|stretch\w*|blame\w*|culprit|swing|arrangement|anchor\w*)(?![a-z])"
)
#: packages of the estimator whose code keeps to the terms
PACKAGES = ("common", "faults", "forces", "kinematics", "motion", "parameters", "sensor_errors")


@pytest.mark.parametrize("package", PACKAGES)
def test_names_and_docstrings_of_the_estimator_keep_to_the_terms(package: str) -> None:
    retired = {
        path.name: words
        for path in sorted((ROOT / "ride_estimation" / "estimation" / package).glob("*.py"))
        # one word in quotes may be a key of a saved state
        if (words := IN_CODE.findall(re.sub(r'"\w+"', "", path.read_text(encoding="utf-8").lower())))
    }
    assert not retired


def test_the_check_finds_what_it_is_for() -> None:
    assert IN_CODE.findall("self._spare = told") == ["spare", "told"] and not IN_CODE.findall("spared")
    assert found("Forces with hindsight; see `mount_force_hindsight`.") == ["Forces with hindsight; see ."]
    assert found("which run stands out, and what was learned") and not found("the outlier is rejected")
