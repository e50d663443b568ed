# Copyright 2026 ride_estimation contributors
"""``ride-estimation export-model``: an identified element, a mount or a vehicle for another simulation program (FMI)."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
from pathlib import Path
from typing import Any

from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.export.fmu import fmu_texts, parameter_document
from ride_estimation.export.model import ExportModel, element_model, vehicle_model
from ride_estimation.io.document import read_yaml, suggestion
from ride_estimation.io.fmu_file import find_compiler, write_fmu
from ride_estimation.io.json_file import read_json
from ride_estimation.io.vehicle_file import find_vehicle_file, load_vehicle
from ride_estimation.io.vehicle_mechanics import read_element
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Prior


def run(options: argparse.Namespace) -> int:
    """Read, translate, write."""
    require_finite(options)
    if options.out.suffix.lower() != ".fmu":
        raise InputDataError(f"{options.out}: cannot be written; allowed ending: .fmu")
    if options.rate <= 0.0:
        raise InputDataError(f"--rate {options.rate:g}: allowed: more than 0 Hz")
    model, origin = _read(options)
    compiler = None if options.source_only else find_compiler()
    texts = fmu_texts(model, options.fmi)
    write_fmu(options.out, model.name, options.fmi, texts, parameter_document(model, origin), compiler)
    inputs = sum(v.role == "input" for v in model.variables)
    outputs = sum(v.role in ("state", "output") for v in model.variables)
    holds = "C source only" if compiler is None else "C source and binary for 64-bit Linux"
    print(f"{options.out}: FMI {options.fmi}.0, model {model.name}, {inputs} inputs, {outputs} outputs, {holds}")
    known = sum(c.std is not None for c in model.constants)
    print(f"{len(model.constants)} parameters, {known} with a standard deviation")
    return 0


def _read(options: argparse.Namespace) -> tuple[ExportModel, dict[str, Any]]:
    """Return the model and where its numbers come from."""
    path = find_vehicle_file(options.model)
    document = read_yaml(path)
    origin: dict[str, Any] = {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    if "kind" in document or "element" in document:
        if options.mount:
            raise ConfigurationError(f"--mount {options.mount}: {path} is one force element, not a vehicle")
        return _read_element(path, document, origin)
    vehicle = load_vehicle(path)
    if not options.mount:
        return vehicle_model(assemble(vehicle), options.rate), origin
    if options.mount not in vehicle.mounts:
        raise ConfigurationError(
            f"--mount {options.mount}: no such mount; allowed: {', '.join(vehicle.mounts)}"
            f"{suggestion(options.mount, vehicle.mounts)}"
        )
    mount = vehicle.mounts[options.mount]
    description = f"mount {mount.name} of {vehicle.name}, deflection from static equilibrium"
    return element_model(mount.name, mount.elements, mount.priors, description), origin


def _read_element(path: Path, document: Any, origin: dict[str, Any]) -> tuple[ExportModel, dict[str, Any]]:
    """Return an element with the standard deviations of the identification it came from, where that stands beside it."""
    problems: list[str] = []
    priors: dict[str, Prior] = {}
    element = read_element(document, "element", problems, priors)
    if element is None or problems:
        raise ConfigurationError(problems, where=str(path))
    beside = path.with_name("identification.json")
    if beside.is_file():
        found = read_json(beside)
        if found.get("element") == element.to_mapping():
            origin["identification"] = {
                key: found[key] for key in ("method", "model", "parameters", "validation", "warnings") if key in found
            }
            for known in found.get("parameters", []):
                # a quantity of the identification that is a number of the element under the same name
                prior = priors.get(str(known.get("name")))
                if prior is not None and prior.std is None and known.get("value") == prior.value:
                    priors[str(known["name"])] = dataclasses.replace(prior, std=known.get("std"))
    description = f"force element {element.KIND}"
    name = path.parent.name if path.stem == "element" else path.stem
    return element_model(name or element.KIND, {"z": element}, {("z", n): p for n, p in priors.items()}, description), origin
