# Copyright 2026 ride_estimation contributors
"""A Modelica package: the force laws as equations, and one model per element with its numbers and what is known of them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import NamedTuple

from ride_estimation.elements import terms
from ride_estimation.elements.terms import Term
from ride_estimation.errors import ConfigurationError
from ride_estimation.export.elements import Constant, ExportedElement, identifier


class _Law(NamedTuple):
    """A model of ``laws.mo`` and its parameters by column of the term; the curve of a table follows after ``table`` columns."""

    name: str
    parameters: tuple[str, ...]
    table: int = 0


_LAWS = {
    terms.ELASTIC: _Law("Elastic", ("k", "k3", "c")),
    terms.MAXWELL: _Law("Maxwell", ("k", "corner")),
    terms.BERG_FRICTION: _Law("Berg", ("friction", "half_stroke")),
    terms.DAHL: _Law("Dahl", ("friction", "slope", "exponent")),
    terms.BOUC_WEN: _Law("BoucWen", ("friction", "slope", "exponent", "share")),
    terms.CONTACT: _Law("Stop", ("side", "gap", "half_width", "k", "k3", "c")),
    terms.CONTACT_MAXWELL: _Law("ContactMaxwell", ("side", "gap", "half_width", "k", "corner")),
    terms.POWER_SPRING: _Law("PowerSpring", ("k", "reference", "exponent", "rounding")),
    terms.POWER_DAMPER: _Law("PowerDamper", ("c", "reference", "exponent", "rounding")),
    terms.ASYMMETRIC_DAMPER: _Law("AsymmetricDamper", ("extension", "compression")),
    terms.STRIBECK: _Law("Stribeck", ("kinetic", "static", "stribeck_speed", "rounding_speed")),
    terms.CURVE_SPRING: _Law("CurveSpring", ("side", "offset"), 3),
    terms.CURVE_DAMPER: _Law("CurveDamper", (), 1),
    terms.WEIGHTED_DAHL: _Law(
        "WeightedDahl", ("side", "offset", "reference", "lowest_slope", "highest_slope", "exponent"), 8
    ),
    terms.RATE_FILTER: _Law("RateFilter", ("a1", "a0", "c1", "c0", "d")),
}
#: library, deflection, rate, tension and their units by whether the element acts about an axis
_COMPLIANT = {
    False: ("Translational", "s_rel", "v_rel", "f", "m", "N"),
    True: ("Rotational", "phi_rel", "w_rel", "tau", "rad", "N.m"),
}


def package_text(name: str, elements: Sequence[ExportedElement], head: Sequence[str]) -> str:
    """Return a package of one file.

    Every element extends the partial compliant model of the Modelica Standard Library (translational or rotational): it goes
    between two flanges as a spring does.

    Parameters
    ----------
    name
        Any text; it becomes the name of the package.
    elements
        One or more.
    head
        Lines for its documentation.

    Raises
    ------
    ConfigurationError
        An element whose law is no ordinary differential equation.
    """
    laws = (files("ride_estimation.export") / "modelica" / "laws.mo").read_text(encoding="utf-8")
    lines = [f"package {identifier(name)} {_text(head[0])}", laws.rstrip()]
    for exported in elements:
        lines += ["", *(f"  {line}" if line else "" for line in _model(exported))]
    words = "".join(f"<p>{_html(line)}</p>" for line in head)
    lines += [f"  annotation(Documentation(info = {_text(f'<html>{words}</html>')}));", f"end {identifier(name)};", ""]
    return "\n".join(lines)


def _model(exported: ExportedElement) -> list[str]:
    library, deflection, rate, tension, length, force = _COMPLIANT[exported.turned]
    name = identifier(exported.name)
    seen = "" if exported.seen is None else f"; {exported.seen.sentence(exported.axis)}"
    listed = exported.element.terms()
    lines = [
        f"model {name} {_text(exported.element.KIND + seen)}",
        f"  extends Modelica.Mechanics.{library}.Interfaces.PartialCompliantWithRelativeStates;",
    ]
    lines += [
        f'  parameter Real rest(unit = "{length}") = 0 "{deflection} at static equilibrium";',
        f'  parameter Real preload(unit = "{force}") = 0 "tension at static equilibrium";',
    ]
    lines += [f"  constant Laws.Known {_constant(c, exported.prefix)};" for c in exported.constants]
    for i, term in enumerate(listed, start=1):
        arguments = [*_arguments(exported, term), f"x = {deflection} - rest", f"v = {rate}"]
        lines.append(f"  Laws.{_LAWS[term.code].name} term{i}({', '.join(arguments)});")
    total = " + ".join(["preload", *(f"term{i}.force" for i in range(1, len(listed) + 1))])
    return [*lines, "equation", f"  {tension} = {total};", f"end {name};"]


def _arguments(exported: ExportedElement, term: Term) -> list[str]:
    if term.code not in _LAWS:
        raise ConfigurationError(
            f"{exported.name}: {exported.element.KIND} keeps a memory that is no differential equation; "
            "allowed for it: --format fmi3 or fmi2"
        )
    law = _LAWS[term.code]
    found = [f"{name} = {value!r}" for name, value in zip(law.parameters, term.parameters)]
    if law.table:
        points = int(term.parameters[law.table - 1])
        for i, name in enumerate(("points", "values", "slopes")):
            part = term.parameters[law.table + i * points : law.table + (i + 1) * points]
            found.append(f"{name} = {{{', '.join(repr(float(v)) for v in part)}}}")
    return found


def _constant(c: Constant, prefix: str) -> str:
    pairs = [f"value = {float(c.value)!r}", f"unit_name = {_text(c.unit)}"]
    pairs += [f"{key} = {float(v)!r}" for key in ("std", "lower", "upper") if (v := getattr(c, key)) is not None]
    if c.seen is not None:
        pairs.append(f"largest_deflection = {float(c.seen.deflection)!r}")
        pairs += [f"{key}_frequency = {float(v)!r}" for key, v in zip(("lowest", "highest"), c.seen.frequency, strict=True)]
    return f"known_{identifier(c.name.removeprefix(prefix))}({', '.join(pairs)}) {_text(c.meaning)}"


def _text(words: str) -> str:
    return '"' + words.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _html(words: str) -> str:
    return words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
