# Copyright 2026 ride_estimation contributors
"""The files of a Functional Mock-up Unit (FMI 2.0 and 3.0): model description, C source, parameters; no binaries."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

import ride_estimation
from ride_estimation.errors import ConfigurationError
from ride_estimation.export.elements import Constant
from ride_estimation.export.kernel_translation import kernel_source
from ride_estimation.export.model import ExportModel, Variable
from ride_estimation.vehicles.data_range import DataRange

#: FMI versions that can be written
VERSIONS = ("3", "2")
#: step the model is offered to be run with [s]: 1 kHz resolves everything up to the band edge of ride measurements
_DEFAULT_STEP = "0.001"
#: exponents of the base units of SI by unit of the interface
_BASE_UNITS = {
    "m": 'm="1"', "m/s": 'm="1" s="-1"', "m/s2": 'm="1" s="-2"', "N": 'kg="1" m="1" s="-2"',
    "rad": 'rad="1"', "rad/s": 'rad="1" s="-1"', "rad/s2": 'rad="1" s="-2"', "N.m": 'kg="1" m="2" s="-2"',
}  # fmt: skip


def fmu_texts(model: ExportModel, version: str) -> dict[str, str]:
    """Return path in the unit -> text of a source FMU, model exchange and co-simulation.

    Parameters
    ----------
    model
        What is exported.
    version
        ``2`` or ``3``.

    Raises
    ------
    ConfigurationError
        Another version.
    """
    if version not in VERSIONS:
        raise ConfigurationError(f"FMI version {version!r}; allowed: {', '.join(VERSIONS)}")
    data = _data_header(model)
    kernels = kernel_source()
    interface = _template(f"fmi{version}.c")
    shared = {name: _template(name) for name in ("model.h", "both.h")}
    variables = "".join(v.name + v.unit + v.role for v in model.variables)
    token = _token(data + kernels + interface + "".join(shared.values()) + variables)
    texts = {
        "modelDescription.xml": _description_2(model, token) if version == "2" else _description_3(model, token),
        f"sources/fmi{version}.c": interface,
        **{f"sources/{name}": text for name, text in shared.items()},
        "sources/kernels.h": _KERNELS_HEAD + kernels + "\n#endif\n",
        "sources/data.h": data.replace("@TOKEN@", token),
    }
    if version == "3":
        texts["sources/buildDescription.xml"] = _build_description(model)
    return texts


def parameter_document(model: ExportModel, origin: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``resources/parameters.json``: every parameter with standard deviation, range and source.

    Parameters
    ----------
    model
        What is exported.
    origin
        What is known of where the numbers come from: file, checksum, identification.
    """
    return {
        "schema": "ride_estimation/parameters/1",
        "software": f"ride_estimation {ride_estimation.__version__}",
        "model": model.name,
        "description": model.description,
        "origin": dict(origin),
        "parameters": [
            {
                "name": c.name, "value": c.value, "std": c.std, "unit": c.unit, "lower": c.lower, "upper": c.upper,
                "meaning": c.meaning, "source": c.source, "seen_in_data": None if c.seen is None else _seen(c.seen),
            }
            for c in model.constants
        ],
    }  # fmt: skip


_KERNELS_HEAD = """\
/* Copyright 2026 ride_estimation contributors
 *
 * Force laws, translated from the kernels of ride_estimation. Deflection x and tension F positive in extension; row i of
 * the memory s belongs to term i.
 */
#ifndef RIDE_KERNELS_H
#define RIDE_KERNELS_H

"""


def _template(name: str) -> str:
    return (files("ride_estimation.export") / "c" / name).read_text(encoding="utf-8")


def _token(text: str) -> str:
    """Return an identifier that changes with everything that must fit between description and binary."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def _data_header(model: ExportModel) -> str:
    """Return the header with the numbers of the model."""
    components, coordinates = model.deflection_map.shape
    bases = model.tilt_map.shape[1]
    sizes = {
        "COORDINATES": coordinates, "COMPONENTS": components, "BASES": bases, "INPUTS": 2 * bases + coordinates,
        "TERMS": len(model.terms.codes), "PARAMETERS": model.terms.parameters.shape[1],
        "MEMORY": model.terms.memory_size, "CONSTANTS": len(model.constants),
    }  # fmt: skip
    lines = ["/* The numbers of this model. */", "#ifndef RIDE_DATA_H", "#define RIDE_DATA_H", "", '#define TOKEN "@TOKEN@"']
    lines += [f"#define {name} {value}" for name, value in sizes.items()]
    lines += [f"#define BASE_SIGN {model.base_sign!r}", f"#define INTERNAL_STEP {model.internal_step_s!r}", ""]
    lines += [
        _array("int", "code_of", model.terms.codes),
        _array("int", "channel_of", model.terms.channel),
        _array("int", "base_of", model.base_of),
        _array("double", "parameters", model.terms.parameters),
        _array("double", "deflection_map", model.deflection_map),
        _array("double", "geometric_stiffness", model.geometric_stiffness),
        _array("double", "inverse_mass", model.inverse_mass),
        _array("double", "tilt_map", model.tilt_map),
        _array("double", "static_force", model.static_force),
        _array("double", "constants", np.array([c.value for c in model.constants])),
    ]
    return "\n".join([*lines, "", "#endif", ""])


def _array(kind: str, name: str, values: Any) -> str:
    flat = np.asarray(values).ravel().tolist() or [0]
    return f"static const {kind} {name}[] = {{{', '.join(repr(v) for v in flat)}}};"


def _attributes(pairs: Mapping[str, str]) -> str:
    return "".join(f" {key}={quoteattr(value)}" for key, value in pairs.items())


def _interface(variable: Variable) -> dict[str, str]:
    """Return causality, variability, initial and start of a variable: the same words in both versions."""
    start = {"start": repr(float(variable.value))}
    if variable.role == "input":
        return {"causality": "input", "variability": "continuous", **start}
    if variable.role == "state":
        return {"causality": "output", "variability": "continuous", "initial": "exact", **start}
    if variable.role == "constant":
        c = variable.constant
        bounds = {} if c is None or c.lower is None or c.upper is None else {"min": repr(c.lower), "max": repr(c.upper)}
        return {"causality": "local", "variability": "constant", "initial": "exact", **start, **bounds}
    return {"causality": "output", "variability": "continuous", "initial": "calculated"}


def _known(constant: Constant) -> str:
    """Return what is known of a parameter as an element of XML: numbers for programs, as the description has them for people."""
    pairs = {"value": repr(float(constant.value)), "unit": constant.unit}
    pairs |= {k: repr(float(v)) for k in ("std", "lower", "upper") if (v := getattr(constant, k)) is not None}
    if constant.source:
        pairs["source"] = constant.source
    if constant.seen is not None:
        pairs |= {key: repr(float(value)) for key, value in _seen(constant.seen).items()}
    return f"<Parameter{_attributes(pairs)}/>"


def _seen(seen: DataRange) -> dict[str, float]:
    found = {"largest_deflection": seen.deflection, "lowest_frequency": seen.frequency[0], "highest_frequency": seen.frequency[1]}
    if seen.preload is not None:
        found |= {"lowest_preload": seen.preload[0], "highest_preload": seen.preload[1]}
    return found


def _units(model: ExportModel) -> str:
    used = sorted({v.unit for v in model.variables if v.unit})
    lines = [f'    <Unit name="{u}"><BaseUnit {_BASE_UNITS[u]}/></Unit>' for u in used]
    return "\n".join(["  <UnitDefinitions>", *lines, "  </UnitDefinitions>"])


def _head(model: ExportModel) -> dict[str, str]:
    return {
        "modelName": model.name,
        "description": model.description,
        "version": ride_estimation.__version__,
        "generationTool": f"ride_estimation {ride_estimation.__version__}",
    }


def _references(model: ExportModel, roles: Iterable[str]) -> list[int]:
    wanted = set(roles)
    return [i for i, v in enumerate(model.variables, start=1) if v.role in wanted]


def _derivatives(model: ExportModel) -> list[int]:
    return [i for i, v in enumerate(model.variables, start=1) if v.derivative_of]


def _description_2(model: ExportModel, token: str) -> str:
    """Return modelDescription.xml of FMI 2.0; variable number n of the list is n = value reference + 1."""
    source = '<SourceFiles><File name="fmi2.c"/></SourceFiles>'
    flags = 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"'
    name = model.name
    reference = {v.name: i for i, v in enumerate(model.variables, start=1)}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" guid="{token}" variableNamingConvention="flat"{_attributes(_head(model))}'
        ' numberOfEventIndicators="0">',
        f'  <ModelExchange modelIdentifier="{name}" completedIntegratorStepNotNeeded="false" {flags}>{source}</ModelExchange>',
        f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" {flags}>{source}</CoSimulation>',
        _units(model),
        f'  <DefaultExperiment startTime="0" stepSize="{_DEFAULT_STEP}"/>',
        "  <ModelVariables>",
        '    <ScalarVariable name="time" valueReference="0" causality="independent" variability="continuous"><Real/>'
        "</ScalarVariable>",
    ]
    for i, v in enumerate(model.variables, start=1):
        words = _interface(v)
        real: dict[str, str] = {k: words.pop(k) for k in ("start", "min", "max") if k in words}
        if v.unit:
            real["unit"] = v.unit
        if v.derivative_of:
            real["derivative"] = str(reference[v.derivative_of] + 1)
        known = "" if v.constant is None else _known(v.constant)
        note = f'<Annotations><Tool name="ride_estimation">{known}</Tool></Annotations>' if known else ""
        head = _attributes({"name": v.name, "valueReference": str(i), "description": v.meaning, **words})
        lines.append(f"    <ScalarVariable{head}><Real{_attributes(real)}/>{note}</ScalarVariable>")
    lines.append("  </ModelVariables>")
    lines.append("  <ModelStructure>")
    for tag, indices in (
        ("Outputs", _references(model, ("state", "output"))),
        ("Derivatives", _derivatives(model)),
        ("InitialUnknowns", _references(model, ("output",))),
    ):
        if indices:
            unknowns = "".join(f'<Unknown index="{i + 1}"/>' for i in indices)
            lines.append(f"    <{tag}>{unknowns}</{tag}>")
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _description_3(model: ExportModel, token: str) -> str:
    """Return modelDescription.xml of FMI 3.0."""
    flags = 'canGetAndSetFMUState="true" canSerializeFMUState="true"'
    name = model.name
    reference = {v.name: i for i, v in enumerate(model.variables, start=1)}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" instantiationToken="{token}" variableNamingConvention="flat"'
        f"{_attributes(_head(model))}>",
        f'  <ModelExchange modelIdentifier="{name}" needsCompletedIntegratorStep="true" {flags}/>',
        f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" {flags}/>',
        _units(model),
        f'  <DefaultExperiment startTime="0" stepSize="{_DEFAULT_STEP}"/>',
        "  <ModelVariables>",
        '    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>',
    ]
    for i, v in enumerate(model.variables, start=1):
        pairs = {"name": v.name, "valueReference": str(i), "description": v.meaning, **_interface(v)}
        if v.unit:
            pairs["unit"] = v.unit
        if v.derivative_of:
            pairs["derivative"] = str(reference[v.derivative_of])
        if v.constant is None:
            lines.append(f"    <Float64{_attributes(pairs)}/>")
        else:
            note = f'<Annotations><Annotation type="ride_estimation">{_known(v.constant)}</Annotation></Annotations>'
            lines.append(f"    <Float64{_attributes(pairs)}>{note}</Float64>")
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    for tag, references in (
        ("Output", _references(model, ("state", "output"))),
        ("ContinuousStateDerivative", _derivatives(model)),
        ("InitialUnknown", _references(model, ("output",))),
    ):
        lines += [f'    <{tag} valueReference="{i}"/>' for i in references]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _build_description(model: ExportModel) -> str:
    return f"""\
<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{model.name}">
    <SourceFileSet language="C99">
      <SourceFile name="fmi3.c"/>
    </SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""
