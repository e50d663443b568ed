# Copyright 2026 ride_estimation contributors
"""``ride-estimation export-model``: an identified element, a mount or a vehicle for another simulation program."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import ride_estimation
from ride_estimation.cli.arguments.export_model import FORMATS
from ride_estimation.cli.finite import require_finite
from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.export.adams import bushing_text
from ride_estimation.export.elements import ExportedElement, exported, of_assembly, of_mount
from ride_estimation.export.fmu import fmu_texts, parameter_document
from ride_estimation.export.model import element_model, vehicle_model
from ride_estimation.export.modelica_package import package_text
from ride_estimation.export.simscape import script_text
from ride_estimation.export.tables import table_text
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.document import read_yaml, suggestion
from ride_estimation.io.fmu_file import find_compiler, write_fmu
from ride_estimation.io.json_file import read_json
from ride_estimation.io.vehicle_file import find_vehicle_file, load_vehicle
from ride_estimation.io.vehicle_mechanics import read_element, read_seen
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.vehicle import Prior


@dataclasses.dataclass(frozen=True)
class _Subject:
    """What is exported: elements alone, or those of an assembly; the name, one sentence, and where its numbers come from."""

    name: str
    description: str
    elements: tuple[ExportedElement, ...]
    origin: dict[str, Any]
    assembly: Assembly | None = None

    def head(self) -> list[str]:
        """Return the first lines of a text file."""
        lines = [
            self.description,
            f"ride_estimation {ride_estimation.__version__} from {self.origin['file']}, sha256 {self.origin['sha256']}",
        ]
        found = self.origin.get("identification", {})
        lines += [f"held-out data: {_score(entry)}" for entry in found.get("validation", [])]
        return lines


def _score(entry: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value:.4g}" if isinstance(value, float) else str(value) for key, value in entry.items())


def run(options: argparse.Namespace) -> int:
    """Read, translate, write."""
    require_finite(options)
    ending = FORMATS[options.format]
    if options.out.suffix.lower() != ending:
        raise InputDataError(f"{options.out}: cannot be written as {options.format}; allowed ending: {ending}")
    if options.rate <= 0.0:
        raise InputDataError(f"--rate {options.rate:g}: allowed: more than 0 Hz")
    for name in ("frequencies", "amplitudes"):
        given = getattr(options, name)
        if given and options.format not in ("table", "simscape"):
            raise ConfigurationError(f"--{name}: only tables have them; allowed with --format table or simscape")
        if any(value <= 0.0 for value in given):
            raise ConfigurationError(f"--{name} {min(given):g}: allowed: more than 0")
    subject = _read(options)
    if ending == ".fmu":
        _write_unit(options, subject)
    else:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(options.out, _text(options, subject))
        names = ", ".join(e.name for e in subject.elements)
        print(f"{options.out}: {options.format}, {len(subject.elements)} elements: {names}")
    parameters = sum(len(e.constants) for e in subject.elements)
    known = sum(e.known for e in subject.elements)
    seen = sum(e.seen is not None for e in subject.elements)
    print(
        f"{parameters} parameters, {known} with a standard deviation; what the data showed is known of {seen} of "
        f"{len(subject.elements)} elements"
    )
    return 0


def _write_unit(options: argparse.Namespace, subject: _Subject) -> None:
    model = (
        element_model(subject.name, subject.elements, subject.description)
        if subject.assembly is None
        else vehicle_model(subject.assembly, options.rate)
    )
    version = options.format[-1]
    compiler = None if options.source_only else find_compiler()
    write_fmu(options.out, model.name, version, fmu_texts(model, version), parameter_document(model, subject.origin), compiler)
    inputs = sum(v.role == "input" for v in model.variables)
    outputs = sum(v.role in ("state", "output") for v in model.variables)
    holds = "C source only" if compiler is None else "C source and binary for 64-bit Linux"
    print(f"{options.out}: FMI {version}.0, model {model.name}, {inputs} inputs, {outputs} outputs, {holds}")


def _text(options: argparse.Namespace, subject: _Subject) -> str:
    elements, head = subject.elements, subject.head()
    if options.format == "modelica":
        return package_text(subject.name, elements, head)
    if options.format == "adams":
        if subject.assembly is not None:
            mounts = ", ".join(subject.assembly.mount_names)
            raise ConfigurationError(f"a bushing property file holds one mount: choose it with --mount; there are {mounts}")
        return bushing_text(elements, head)
    write = table_text if options.format == "table" else script_text
    return write(elements, head, sorted(options.frequencies), sorted(options.amplitudes))


def _read(options: argparse.Namespace) -> _Subject:
    """Return what is exported and where its numbers come from."""
    path = find_vehicle_file(options.model)
    document = read_yaml(path)
    origin: dict[str, Any] = {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    if "kind" in document or "element" in document:
        if options.mount:
            raise ConfigurationError(f"--mount {options.mount}: {path} is one force element, not a vehicle")
        return _read_element(path, document, origin)
    vehicle = load_vehicle(path)
    if not options.mount:
        assembly = assemble(vehicle)
        return _Subject(
            vehicle.name, f"force elements of {vehicle.name}, deflection from static equilibrium", of_assembly(assembly), origin,
            assembly,
        )  # fmt: skip
    if options.mount not in vehicle.mounts:
        raise ConfigurationError(
            f"--mount {options.mount}: no such mount; allowed: {', '.join(vehicle.mounts)}"
            f"{suggestion(options.mount, vehicle.mounts)}"
        )
    mount = vehicle.mounts[options.mount]
    description = f"mount {mount.name} of {vehicle.name}, deflection from static equilibrium"
    return _Subject(mount.name, description, of_mount(mount), origin)


def _read_element(path: Path, document: Any, origin: dict[str, Any]) -> _Subject:
    """Return an element with the standard deviations of the identification it came from, where that stands beside it."""
    problems: list[str] = []
    priors: dict[str, Prior] = {}
    element = read_element(document, "element", problems, priors)
    seen = read_seen(document.get("element", document), "element", problems)
    if element is None or problems:
        raise ConfigurationError(problems, where=str(path))
    correlation = np.eye(len(element.addressed()))
    beside = path.with_name("identification.json")
    if beside.is_file():
        found = read_json(beside)
        if found.get("element") == element.to_mapping():
            origin["identification"] = {
                key: found[key] for key in ("method", "model", "parameters", "validation", "warnings") if key in found
            }
            matched = _matched(element, found.get("parameters", []))
            for address, number in matched.items():
                prior = priors[address]
                if prior.std is None:
                    priors[address] = dataclasses.replace(prior, std=found["parameters"][number].get("std"))
            if "correlation" in found:
                places = [i for i, address in enumerate(element.addressed()) if address in matched]
                numbers = list(matched.values())
                correlation[np.ix_(places, places)] = np.asarray(found["correlation"], dtype=float)[np.ix_(numbers, numbers)]
    description = f"force element {element.KIND}"
    name = path.parent.name if path.stem == "element" else path.stem
    name = name or element.KIND
    return _Subject(name, description, (exported(name, "z", element, priors, seen, correlation=correlation),), origin)


def _matched(element: ForceElement, parameters: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Return address -> number of the identified parameter that it is: the only one of that value and unit on both sides."""
    addressed = element.addressed()
    values = [value for _, value in addressed.values()]
    found: dict[str, int] = {}
    for address, (declared, value) in addressed.items():
        same = [i for i, p in enumerate(parameters) if p.get("value") == value and p.get("unit", declared.unit) == declared.unit]
        if len(same) == 1 and values.count(value) == 1:
            found[address] = same[0]
    return found
