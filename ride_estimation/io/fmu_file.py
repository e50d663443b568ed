# Copyright 2026 ride_estimation contributors
"""Functional Mock-up Units as files: a zip of texts and, where a C compiler is at hand, the binary for this computer."""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import replacing
from ride_estimation.io.json_file import jsonable

#: the same bytes for the same model: no time of writing in the archive
_TIMESTAMP = (1980, 1, 1, 0, 0, 0)
_COMPILERS = ("cc", "gcc", "clang")
#: seconds after which a compiler is taken for stuck; the largest model takes a few
_COMPILER_TIMEOUT_S = 120
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
#: folder of the binary of 64-bit Linux by FMI version
_FOLDERS = {"2": "linux64", "3": "x86_64-linux"}


def find_compiler() -> str | None:
    """Return the C compiler that can make the binary of this computer; None without one, or where it is no 64-bit Linux."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None
    return next((found for name in _COMPILERS if (found := shutil.which(name))), None)


def write_fmu(
    path: Path, name: str, version: str, texts: Mapping[str, str], parameters: Mapping[str, Any], compiler: str | None
) -> None:
    """Write a unit, completely or not at all.

    Parameters
    ----------
    path
        File to write.
    name
        Model identifier.
    version
        FMI version, ``2`` or ``3``.
    texts
        Path in the unit -> text.
    parameters
        Content of ``resources/parameters.json``.
    compiler
        C compiler for the binary, None: source only.

    Raises
    ------
    InputDataError
        The compiler fails; its first words are given.
    """
    content = {inside: text.encode() for inside, text in texts.items()}
    content["resources/parameters.json"] = (json.dumps(jsonable(parameters), indent=2) + "\n").encode()
    if compiler is not None:
        content[f"binaries/{_FOLDERS[version]}/{name}.so"] = _compiled(texts, version, compiler)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as place, zipfile.ZipFile(place, "w", zipfile.ZIP_DEFLATED) as archive:
        for inside, written in content.items():
            info = zipfile.ZipInfo(inside, _TIMESTAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, written)


def _compiled(texts: Mapping[str, str], version: str, compiler: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for inside, text in texts.items():
            if inside.startswith("sources/"):
                (Path(folder) / Path(inside).name).write_text(text, encoding="utf-8")
        command = [compiler, *_FLAGS, f"fmi{version}.c", "-o", "model.so", "-lm"]
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, timeout=_COMPILER_TIMEOUT_S, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputDataError(f"{compiler} cannot be run ({error}); --source-only writes the unit without binary") from error
        if done.returncode != 0:
            raise InputDataError(f"{compiler} fails: {done.stderr[:500]}; --source-only writes the unit without binary")
        return (Path(folder) / "model.so").read_bytes()
