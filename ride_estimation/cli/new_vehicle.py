# Copyright 2026 ride_estimation contributors
"""``ride-estimation new-vehicle``: a vehicle file to start from."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.vehicle_template import Template, vehicle_template

Answer = TypeVar("Answer", int, float, str)

_DEFAULT = Template()


def run(options: argparse.Namespace) -> int:
    """Write the file."""
    require_finite(options)
    path = Path(options.out)
    if path.exists():
        raise ConfigurationError("exists already and is not replaced; give another name or remove it", where=str(path))
    if not path.parent.is_dir():
        raise ConfigurationError("the folder does not exist", where=str(path.parent))
    template = Template(
        name=_given_or_asked(options.name, "name of the vehicle", _DEFAULT.name, str),
        body=options.body,
        mass=_given_or_asked(options.mass_kg, "mass of the body [kg]", _DEFAULT.mass, float),
        mounts=_given_or_asked(options.mounts, "number of mounts", _DEFAULT.mounts, int),
        sensors=_given_or_asked(options.sensors, "number of accelerometers on the body", _DEFAULT.sensors, int),
        base_sensors=not options.no_base_sensors,
    )
    write_atomically(path, vehicle_template(template))
    print(f"written: {path}; replace the numbers marked 'replace', then: ride-estimation plan --vehicle {path}")
    return 0


def at_terminal() -> bool:
    """Return whether a person can be asked."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _given_or_asked(given: Answer | None, question: str, default: Answer, convert: Callable[[str], Answer]) -> Answer:
    """Return the option, the answer of a person at a terminal, or the default."""
    if given is not None:
        return given
    if not at_terminal():
        return default
    try:
        answer = input(f"{question} [{default}]: ").strip()
    except EOFError:
        return default
    try:
        return convert(answer) if answer else default
    except ValueError as error:
        raise ConfigurationError(f"{question}: {answer!r} is not a number") from error
