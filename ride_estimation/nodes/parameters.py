# Copyright 2026 ride_estimation contributors
"""The one table of node parameters: declared, validated, documented and written to YAML from here."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import TypedDict

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.context import Context
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ride_estimation.errors import ConfigurationError

Value = bool | int | float | str


class NodeOptions(TypedDict, total=False):
    """How a node is created, as keyword arguments of its constructor.

    Attributes
    ----------
    context
        ROS context, the default one where absent.
    parameter_overrides
        Values that win over the command line and parameter files.
    use_global_arguments
        Whether the command line of the process applies; it does where absent.
    """

    context: Context | None
    parameter_overrides: list[Parameter]
    use_global_arguments: bool


_TYPES: dict[type, Parameter.Type] = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
}
_WORDS: dict[type, str] = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


@dataclasses.dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node.

    Attributes
    ----------
    name
        ROS name; dots group.
    default
        Its type is the type of the parameter.
    unit
        Printed in brackets, empty for plain words and switches.
    meaning
        One sentence.
    lower, upper
        Closed range of a number, None where unbounded.
    or_zero
        Whether 0, which stands for something else than a number, is allowed beside the range.
    allowed
        Words a string may take, empty where free.
    read_only
        Cannot change while the node runs.
    """

    name: str
    default: Value
    unit: str
    meaning: str
    lower: float | None = None
    upper: float | None = None
    or_zero: bool = False
    allowed: tuple[str, ...] = ()
    read_only: bool = False

    @property
    def range_text(self) -> str:
        """Return what is allowed, in words."""
        if self.allowed:
            return " or ".join(f"`{word}`" for word in self.allowed)
        if self.lower is None or self.upper is None:
            return "any"
        return f"{'0 or ' if self.or_zero else ''}{self.lower:g} to {self.upper:g}"

    @property
    def description(self) -> str:
        """Return meaning and unit in brackets."""
        return f"{self.meaning} [{self.unit}]" if self.unit else self.meaning

    def problem(self, value: object) -> str:
        """Return why a value is refused, empty where it is fine."""
        kind = type(self.default)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if kind is float and number:
            pass
        elif type(value) is not kind:
            return f"{self.name}: {value!r} is not {_WORDS[kind]}"
        if self.allowed and value not in self.allowed:
            return f"{self.name}: {value!r} is not allowed; allowed: {', '.join(self.allowed)}"
        if self.lower is not None and self.upper is not None:
            inside = isinstance(value, (int, float)) and self.lower <= value <= self.upper  # False for NaN
            if not (inside or (self.or_zero and value == 0)):
                return f"{self.name}: {value} is not allowed; allowed: {self.range_text} {self.unit.strip('-')}".rstrip()
        return ""

    def descriptor(self) -> ParameterDescriptor:
        """Return the ROS descriptor."""
        descriptor = ParameterDescriptor(
            name=self.name,
            type=_TYPES[type(self.default)].value,
            description=self.description,
            read_only=self.read_only,
        )
        if self.allowed:
            descriptor.additional_constraints = "one of: " + ", ".join(self.allowed)
        elif self.or_zero:  # a range of ROS is one interval
            descriptor.additional_constraints = self.range_text
        elif self.lower is not None and self.upper is not None:
            if isinstance(self.default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(self.lower), to_value=float(self.upper), step=0.0)
                ]
            else:
                descriptor.integer_range = [
                    IntegerRange(from_value=int(self.lower), to_value=int(self.upper), step=1)
                ]
        return descriptor


def declare(node: Node, table: Iterable[NodeParameter]) -> None:
    """Declare every parameter of the table on a node.

    Raises
    ------
    ConfigurationError
        Every value of the command line or a parameter file that is refused, in one message.
    """
    problems = []
    for parameter in table:
        try:
            node.declare_parameter(parameter.name, parameter.default, parameter.descriptor())
            refused = ""
        except (InvalidParameterTypeException, InvalidParameterValueException):
            # what was given can be read by declaring without type and range
            node.declare_parameter(parameter.name, parameter.default, ParameterDescriptor(dynamic_typing=True))
            refused = f"{parameter.name}: a whole number to ROS; write it with a point"
        if problem := parameter.problem(node.get_parameter(parameter.name).value) or refused:
            problems.append(problem)
    if problems:
        raise ConfigurationError("; ".join(problems), where=f"parameters of {node.get_fully_qualified_name()}")


def values(node: Node, table: Iterable[NodeParameter]) -> dict[str, Value]:
    """Return the present values by name."""
    return {parameter.name: node.get_parameter(parameter.name).value for parameter in table}


def problems(table: Iterable[NodeParameter], given: Mapping[str, object]) -> list[str]:
    """Return one sentence per value of the table that is refused."""
    return [problem for p in table if p.name in given and (problem := p.problem(given[p.name]))]


def verdict(table: Iterable[NodeParameter], proposed: Iterable[Parameter]) -> SetParametersResult:
    """Accept or reject a change of parameters, with the reason."""
    found = problems(table, {parameter.name: parameter.value for parameter in proposed})
    return SetParametersResult(successful=not found, reason="; ".join(found))


def markdown(table: Iterable[NodeParameter]) -> str:
    """Return the documentation table."""
    lines = ["| parameter | default | unit | allowed | while running | meaning |", "|---|---|---|---|---|---|"]
    for p in table:
        change = "fixed" if p.read_only else "can change"
        lines.append(f"| `{p.name}` | `{_yaml(p.default)}` | {p.unit} | {p.range_text} | {change} | {p.meaning} |")
    return "\n".join(lines) + "\n"


def parameter_file(table: Iterable[NodeParameter], title: str) -> str:
    """Return a ROS parameter file with every line commented; ``/**`` matches the node in any namespace."""
    lines = [f"# {title}", "# Written from the table in ride_estimation/nodes; numbers of type double need their point.", "/**:"]
    lines.append("  ros__parameters:")
    for p in table:
        note = f"allowed: {p.range_text.replace('`', '')}; {'fixed at start' if p.read_only else 'can change while running'}"
        lines += [f"    # {p.description}; {note}", f"    {p.name}: {_yaml(p.default)}"]
    return "\n".join(lines) + "\n"


def _yaml(value: Value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)
