# Copyright 2026 ride_estimation contributors
"""Documents are run: every command in a bash block is checked here, and those of the package are executed."""

from __future__ import annotations

import ast
import importlib.util
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ride_estimation.cli.main import arguments_of, build_parser, main, verb_helps
from ride_estimation.diagnosis.causes import library

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "bags").glob("*.md")])
#: longer than a few seconds: run by the slow suite
SLOW_VERBS = {"demo", "diagnose", "plan", "replay", "simulate"}
#: commands build on each other there: test_worked_example.py runs them
SEQUENCES = {"docs/worked_example.md"}
#: commands of the shell and of other programs that need no check here
OTHER_PROGRAMS = {"cd", "source", ".", "git", "touch", "mkdir", "pip", "colcon", "deactivate", "export"}


def commands() -> list[tuple[str, str]]:
    """Return (document, command) for every line of every bash block, continued lines joined."""
    found = []
    for path in DOCUMENTS:
        for block in re.findall(r"```(?:bash|sh)\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                for part in re.split(r"&&|;", re.sub(r"(^|\s)#.*", "", line)):
                    if part.strip():
                        found.append((path.relative_to(ROOT).as_posix(), " ".join(part.split())))
    return found


COMMANDS = commands()
VERB_COMMANDS = sorted({(d, c) for d, c in COMMANDS if Path(shlex.split(c)[0]).name == "ride-estimation"})


def words_of(command: str) -> list[str]:
    """Return the words of a command without variable assignments before it."""
    words = shlex.split(command)
    while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
        words.pop(0)
    return words


def entry_points() -> set[str]:
    return set(re.findall(r'"([\w-]+) = ride_estimation', (ROOT / "setup.py").read_text(encoding="utf-8")))


def launch_arguments(name: str) -> set[str]:
    """Return the arguments a launch file declares, read from its source."""
    tree = ast.parse((ROOT / "launch" / name).read_text(encoding="utf-8"))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "DeclareLaunchArgument"]
    return {call.args[0].value for call in calls if isinstance(call.args[0], ast.Constant)}


def check_ros2(words: list[str]) -> None:
    """Check a ros2 command as far as this repository defines it."""
    if words[1] == "launch":
        package, launch_file, *arguments = words[2:]
        assert package == "ride_estimation"
        assert {a.partition(":=")[0] for a in arguments} <= launch_arguments(launch_file)
    elif words[1] == "run":
        assert words[2] == "ride_estimation"
        assert words[3] in entry_points()
    else:
        assert words[1] in {"service", "topic", "param", "lifecycle", "bag"}


@pytest.mark.parametrize(("document", "command"), sorted(set(COMMANDS)), ids=lambda text: text.replace("/", "_"))
def test_command_exists_as_written(document: str, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    words = words_of(command)
    if not words:
        return  # only sets a variable
    program = Path(words[0]).name
    if program == "ride-estimation":
        build_parser().parse_args([w for w in words[1:]]) if "--help" not in words else None
    elif program == "make":
        done = subprocess.run(["make", "-n", *words[1:]], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    elif program.startswith("python") and words[1:2] == ["-m"]:
        assert words[2] in {"venv", "pytest", "pip", "colcon"} or importlib.util.find_spec(words[2]) is not None
    elif program.startswith("python"):
        assert words[-1] == "--help", "a script in a document is shown with --help; what it measures takes long"
        # in this process, which has imported most of what a script does
        monkeypatch.setattr(sys, "path", [str((ROOT / words[1]).parent), *sys.path])
        monkeypatch.setattr(sys, "argv", words[1:])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(ROOT / words[1]), run_name="__main__")
        assert ended.value.code == 0
    elif program == "ros2":
        check_ros2(words)
    elif program in entry_points() or (ROOT / words[0]).is_file():
        return
    else:
        assert program in OTHER_PROGRAMS, f"{document}: no check for {program!r}"


@pytest.fixture
def in_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], int]:
    """Return what runs a ride-estimation command in a folder that has the bundled files of the repository: its exit code.

    In this process: an interpreter of its own imports for longer than most of these commands run.
    """
    for name in ("bags", "config"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)

    def run(command: str) -> int:
        try:
            return main(shlex.split(command)[1:])
        except SystemExit as ended:  # --help
            return int(ended.code or 0)

    return run


def selected(slow: bool) -> list[tuple[str, str]]:
    return [(d, c) for d, c in VERB_COMMANDS if (shlex.split(c)[1] in SLOW_VERBS) == slow and d not in SEQUENCES]


@pytest.mark.parametrize(("document", "command"), selected(slow=False), ids=lambda text: text.replace("/", "_"))
def test_command_runs(document: str, command: str, in_copy: Callable[[str], int]) -> None:
    assert in_copy(command) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("document", "command"), selected(slow=True), ids=lambda text: text.replace("/", "_"))
def test_long_command_runs(document: str, command: str, in_copy: Callable[[str], int]) -> None:
    assert in_copy(command) == 0


def examples_of_help() -> list[str]:
    """Return the examples of --help that are quick and name only files that come with the package."""
    lines = [line.strip() for verb in ("plan", "procedure", "calibrate") for line in arguments_of(verb).EXAMPLES.splitlines()]
    commands = [line.split("  ")[0] for line in lines if line.startswith("ride-estimation ")]
    inputs = {command: re.findall(r"[\w/]+\.csv|bags/[\w/]+", command) for command in commands}
    return [command for command in commands if all((ROOT / path).exists() for path in inputs[command])]


@pytest.mark.parametrize("command", examples_of_help(), ids=lambda text: text.replace("/", "_"))
def test_example_of_help_runs(command: str, in_copy: Callable[[str], int]) -> None:
    quick = f"{command} --bounds-only" if " plan " in command else command  # simulated drives take half a minute
    assert in_copy(quick) == 0


def test_there_are_examples_of_help() -> None:
    assert len(examples_of_help()) >= 6
    assert all(getattr(arguments_of(verb), "EXAMPLES", "") for verb in verb_helps() if verb not in {"demo"})


def test_readme_starts_with_the_two_commands() -> None:
    readme = [command for document, command in COMMANDS if document == "README.md"]
    assert "make demo" in readme
    assert "make test" in readme


@pytest.mark.parametrize("verb", sorted(verb_helps()))
def test_verb_has_help_and_an_end_to_end_test(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([verb, "--help"])
    assert ended.value.code == 0
    assert verb in capsys.readouterr().out
    assert (ROOT / "test" / "cli" / f"test_{verb.replace('-', '_')}.py").is_file(), "every verb has an end-to-end test"


def test_page_of_commands_names_every_verb() -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) == sorted(verb_helps())


def test_links_between_documents_lead_somewhere() -> None:
    for path in DOCUMENTS:
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_features_are_all_listed_and_what_shows_them_exists() -> None:
    text = (ROOT / "docs" / "features.md").read_text(encoding="utf-8")
    listed = [line.split("|")[1].strip() for line in text.splitlines() if re.match(r"\| F\d", line)]
    assert listed == [f"F{number}" for number in range(1, len(listed) + 1)] and len(listed) >= 25
    for path in re.findall(r"`((?:ride_estimation|config|benchmarks)/[\w/.]+)`", text):
        assert (ROOT / path).is_file(), path
    named = re.findall(r"(test_\w+\.py)::(test_\w+)", text)
    assert len(named) > 40
    for file, test in named:
        found = list((ROOT / "test").rglob(file))
        assert len(found) == 1, file
        assert f"def {test}(" in found[0].read_text(encoding="utf-8"), f"{file} has no {test}"


def test_the_gallery_has_a_page_and_a_picture_of_every_cause() -> None:
    folder = ROOT / "docs" / "gallery"
    assert {path.stem for path in folder.glob("*.md")} == {*library(), "index"}
    for cause in library():
        assert "![" in (folder / f"{cause}.md").read_text(encoding="utf-8"), cause


def test_make_is_here_to_check_its_targets() -> None:
    assert shutil.which("make"), "make is needed to check the commands of the documents"
