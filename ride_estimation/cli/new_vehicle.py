# Copyright 2026 ride_estimation contributors
"""``ride-estimation new-vehicle``: a vehicle file to start from."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.tables import read_table
from ride_estimation.io.vehicle_template import Template, vehicle_template
from ride_estimation.vehicles.inertia import combined, inertia_to_si, shifted

Array = NDArray[np.float64]
Answer = TypeVar("Answer", int, float, str)

_DEFAULT = Template()
#: products of inertia a table of parts may leave out where they are zero
_PRODUCTS = ("xy", "xz", "yz")


def run(options: argparse.Namespace) -> int:
    """Write the file."""
    require_finite(options)
    path = Path(options.out)
    if path.exists():
        raise ConfigurationError("exists already and is not replaced; give another name or remove it", where=str(path))
    if not path.parent.is_dir():
        raise ConfigurationError("the folder does not exist", where=str(path.parent))
    if options.about is not None and options.parts is None:
        raise ConfigurationError("--about is the point of the inertia of --parts; give both")
    if options.parts is not None and options.mass_kg is not None:
        raise ConfigurationError("--mass-kg and --parts both give the mass; use one")
    whole = None if options.parts is None else _assembled(options.parts, options.about)
    template = Template(
        name=_given_or_asked(options.name, "name of the vehicle", _DEFAULT.name, str),
        body=options.body,
        mass=whole[0] if whole else _given_or_asked(options.mass_kg, "mass of the body [kg]", _DEFAULT.mass, float),
        mounts=_given_or_asked(options.mounts, "number of mounts", _DEFAULT.mounts, int),
        sensors=_given_or_asked(options.sensors, "number of accelerometers on the body", _DEFAULT.sensors, int),
        base_sensors=not options.no_base_sensors,
        cg=None if whole is None else tuple(whole[1].tolist()),
        inertia=None if whole is None else tuple(map(tuple, whole[2].tolist())),
    )
    write_atomically(path, vehicle_template(template))
    print(f"written: {path}; replace the numbers marked 'replace', then: ride-estimation plan --vehicle {path}")
    return 0


def _assembled(path: Path, about: Sequence[float] | None) -> tuple[float, Array, Array]:
    """Return mass [kg], CG [m] and tensor about it [kg m^2] of the parts of a table; print them."""
    table = read_table(path)
    count = len(table.column("mass", "kg"))
    entries = {name: table.column(f"i{name}", "kg m^2") if f"i{name}" in table.columns else np.zeros(count) for name in _PRODUCTS}
    entries |= {name: table.column(f"i{name}", "kg m^2") for name in ("xx", "yy", "zz")}
    parts = []
    for row in range(count):
        part, place = float(table.column("mass")[row]), [float(table.column(axis, "m")[row]) for axis in "xyz"]
        tensor = [[float(entries["".join(sorted(a + b))][row]) for b in "xyz"] for a in "xyz"]
        if not part > 0.0:
            raise ConfigurationError(f"row {row + 2}: mass {part:g} kg; allowed: above 0", where=str(path))
        try:
            parts.append((part, place, inertia_to_si(tensor, "kg m^2", part)))
        except ConfigurationError as error:
            raise ConfigurationError(f"row {row + 2}: {error}", where=str(path)) from error
    mass, cg, tensor_about_cg = combined(parts)
    centre = ", ".join(f"{v + 0.0:.4g}" for v in cg)
    print(f"{len(parts)} parts: {mass:.6g} kg, CG at ({centre}) m, about it {_moments(tensor_about_cg)}")
    if about is not None:
        there = shifted(tensor_about_cg, mass, np.asarray(about) - cg)
        print(f"about ({', '.join(f'{v:g}' for v in about)}) m (parallel axes): {_moments(there)}")
    return mass, cg, tensor_about_cg


def _moments(tensor: Array) -> str:
    return ", ".join(f"I{axis}{axis} {value:.5g}" for axis, value in zip("xyz", np.diag(tensor))) + " kg m^2"


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
