# Copyright 2026 ride_estimation contributors
"""Installation of exact versions, each file checked against its SHA-256: ``requirements/pythonX.Y.txt``.

    python requirements/locked.py install ros,test          what `make` does: those extras and this repository, editable
    python requirements/locked.py write                     resolve anew for this Python (with every extra) and write its file
    python requirements/locked.py write --python 3.14       for another Python, with the versions resolved for this one

A line of a file is a pinned package, its hash, and after ``#`` the extras that need it (``base``: the package itself). The hashes
are of the files for Linux on x86_64. Uses nothing but pip.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pip._vendor.packaging.requirements import Requirement
from pip._vendor.packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
NAME = "ride-estimation"
#: extras of setup.py that are locked ("dev" is test and lint)
EXTRAS = ("ros", "test", "lint", "colcon", "files", "fleet", "completion", "notebook", "docs")


def lock_file(python: str) -> Path:
    """Return the file of a Python version (``3.12``)."""
    return ROOT / "requirements" / f"python{python}.txt"


def own_version() -> str:
    """Return the version of this Python as lock files are named."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def pip(*arguments: str) -> None:
    """Run pip of this environment; leave with its exit code where it fails."""
    done = subprocess.run([sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments], check=False, cwd=ROOT)
    if done.returncode:
        sys.exit(done.returncode)


def selected(lines: Iterable[str], extras: Iterable[str]) -> list[str]:
    """Return the pinned lines that the package itself or one of the extras needs."""
    wanted = {"base", *extras}
    return [line for line in lines if line[:1] != "#" and wanted & set(line.partition("#")[2].split())]


def install(extras: list[str]) -> None:
    """Install the locked files of some extras, then this repository without looking for anything else."""
    unknown = sorted(set(extras) - set(EXTRAS))
    if unknown:
        sys.exit(f"{', '.join(unknown)}: no such extra; there are {', '.join(EXTRAS)}")
    file = lock_file(own_version())
    if not file.is_file() or (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        here = f"Python {own_version()} on {platform.system()} {platform.machine()}"
        sys.exit(f"no versions are locked for {here}; 'make LOCKED=no' installs what the package index has today, unchecked")
    lines = selected(file.read_text(encoding="utf-8").splitlines(), extras)
    with tempfile.TemporaryDirectory() as folder:
        chosen = Path(folder) / "requirements.txt"
        chosen.write_text("\n".join(lines) + "\n", encoding="utf-8")
        pip("install", "--quiet", "--no-deps", "--require-hashes", "-r", str(chosen))
    pip("install", "--quiet", "--no-deps", "--no-build-isolation", "-e", ".")


def report(*arguments: str) -> dict[str, Any]:
    """Return what pip would install."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "report.json"
        pip("install", "--dry-run", "--ignore-installed", "--quiet", "--report", str(file), *arguments)
        return dict(json.loads(file.read_text(encoding="utf-8")))


def closure(packages: Mapping[str, Mapping[str, Any]], extra: str, environment: Mapping[str, str]) -> set[str]:
    """Return the names of everything that an extra needs (``base``: no extra)."""
    found: set[tuple[str, str]] = set()
    open_ends = [(NAME, extra if extra != "base" else "")]
    while open_ends:
        here = open_ends.pop()
        if here in found:
            continue
        found.add(here)
        for text in packages[here[0]].get("requires_dist", ()):
            needed = Requirement(text)
            if needed.marker is None or needed.marker.evaluate({**environment, "extra": here[1]}):
                name = canonicalize_name(needed.name)
                open_ends += [(name, more) for more in ("", *needed.extras)]
    return {name for name, _ in found} - {NAME}


def write(python: str) -> None:
    """Resolve every extra and write the file of a Python version."""
    resolved = report(f".[{','.join(EXTRAS)}]")
    packages = {canonicalize_name(item["metadata"]["name"]): item["metadata"] for item in resolved["install"]}
    environment = {**resolved["environment"], "python_version": python, "python_full_version": f"{python}.0"}
    needs: dict[str, list[str]] = {}
    for extra in ("base", *EXTRAS):
        for name in closure(packages, extra, environment):
            needs.setdefault(name, []).append(extra)
    files = {canonicalize_name(item["metadata"]["name"]): item["download_info"] for item in resolved["install"]}
    if python != own_version():
        wheels = [f"{name}=={packages[name]['version']}" for name in needs if files[name]["url"].endswith(".whl")]
        with tempfile.TemporaryDirectory() as folder:
            other = report("--python-version", python, "--only-binary=:all:", "--no-deps", "--target", folder, *wheels)
        files |= {canonicalize_name(item["metadata"]["name"]): item["download_info"] for item in other["install"]}
    lines = [f"# Python {python}, Linux, x86_64. Written by requirements/locked.py; every version with the SHA-256 of its file."]
    for name in sorted(needs):
        digest = files[name]["archive_info"]["hashes"]["sha256"]
        lines.append(f"{name}=={packages[name]['version']} --hash=sha256:{digest}  # {' '.join(needs[name])}")
    lock_file(python).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{lock_file(python).relative_to(ROOT)}: {len(needs)} packages")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    installs = commands.add_parser("install", help="install locked versions")
    installs.add_argument("extras", nargs="?", default="", help="separated by commas")
    writes = commands.add_parser("write", help="write the file of a Python version")
    writes.add_argument("--python", default=own_version(), metavar="X.Y", help="default: this one")
    options = parser.parse_args()
    if options.command == "install":
        install([extra for extra in options.extras.split(",") if extra])
    else:
        write(options.python)


if __name__ == "__main__":
    main()
