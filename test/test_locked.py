# Copyright 2026 ride_estimation contributors
"""The locked versions cover what setup.py asks for and what is installed, each with its hash."""

from __future__ import annotations

import re
import runpy
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import setuptools

pytest.importorskip("pip._vendor.packaging.requirements", reason="pip is not part of this environment")
from pip._vendor.packaging.requirements import Requirement
from pip._vendor.packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]


def setup_py() -> dict[str, Any]:
    """Return the names of setup.py, and as ``given`` what it gives to setuptools."""
    given: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(setuptools, "setup", given.update)
        return {**runpy.run_path(str(ROOT / "setup.py")), "given": given}


LOCKED: dict[str, Any] = runpy.run_path(str(ROOT / "requirements" / "locked.py"))
SETUP = setup_py()
FILES = sorted((ROOT / "requirements").glob("python*.txt"))
LINE = re.compile(r"([a-z0-9-]+)==(\S+) --hash=sha256:[0-9a-f]{64}  # ([a-z ]+)")


def pinned(file: Path) -> dict[str, tuple[str, set[str]]]:
    """Return version and extras by package."""
    found = {}
    for line in file.read_text(encoding="utf-8").splitlines()[1:]:
        match = LINE.fullmatch(line)
        assert match, line
        found[match[1]] = (match[2], set(match[3].split()))
    return found


def required(extra: str) -> list[Requirement]:
    """Return what setup.py asks for by one extra, ``base`` for the package itself."""
    return [Requirement(text) for text in (SETUP["RUNTIME"] if extra == "base" else SETUP["given"]["extras_require"][extra])]


def test_every_python_that_is_promised_has_a_file() -> None:
    assert [file.stem for file in FILES] == [f"python3.{minor}" for minor in (11, 12, 13, 14)]


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_the_versions_are_those_setup_py_allows(file: Path) -> None:
    found = pinned(file)
    for extra in ("base", *LOCKED["EXTRAS"]):
        assert required(extra), extra
        for need in required(extra):
            version, extras = found[canonicalize_name(need.name)]
            assert need.specifier.contains(version, prereleases=True), need
            assert extra in extras, need


def test_everything_that_what_is_installed_needs_is_locked() -> None:
    """Walk from the package through the metadata of what is installed here in the locked version."""
    file = LOCKED["lock_file"](LOCKED["own_version"]())
    if not file.is_file():
        pytest.skip("no versions are locked for this Python")
    found, seen = pinned(file), set()
    open_ends = [(need, extra) for extra in ("base", *LOCKED["EXTRAS"]) for need in required(extra)]
    while open_ends:
        need, extra = open_ends.pop()
        name = canonicalize_name(need.name)
        try:
            texts = metadata.requires(need.name) or ()
        except metadata.PackageNotFoundError:
            continue
        assert name in found and extra in found[name][1], f"{need} of {extra}: requirements/locked.py write"
        if metadata.version(need.name) != found[name][0]:
            continue  # another version needs other things
        for more in ("", *need.extras):
            if (name, more, extra) not in seen:
                seen.add((name, more, extra))
                parsed = [Requirement(text) for text in texts]
                open_ends += [(r, extra) for r in parsed if r.marker is None or r.marker.evaluate({"extra": more})]
    assert seen


def test_an_extra_selects_its_own_packages_and_the_base() -> None:
    lines = ["# head", "a==1 --hash=sha256:0  # base ros", "b==1 --hash=sha256:0  # ros", "c==1 --hash=sha256:0  # lint"]
    assert LOCKED["selected"](lines, ["ros"]) == lines[1:3]
    assert LOCKED["selected"](lines, []) == lines[1:2]
