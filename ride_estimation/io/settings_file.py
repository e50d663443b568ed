# Copyright 2026 ride_estimation contributors
"""Settings of the estimators from the parameter file of the node, so that a replay runs with what ran live."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.io.document import Section, as_number, read_yaml, shown


def load_settings(path: str | Path) -> PipelineSettings:
    """Load the estimator settings out of a ROS parameter file (``/**: ros__parameters:``).

    Parameters of the node that are no settings of the estimators are passed over.

    Parameters
    ----------
    path
        YAML file as ``config/nodes/estimator.yaml``.

    Raises
    ------
    ConfigurationError
        No parameter file, or settings of the wrong type or out of range.
    """
    path = Path(path)
    document = read_yaml(path)
    nodes = [node for node in document.values() if isinstance(node, dict) and "ros__parameters" in node]
    if len(nodes) != 1:
        raise ConfigurationError("one node with ros__parameters is needed", where=str(path))
    problems: list[str] = []
    section = Section(nodes[0]["ros__parameters"], "ros__parameters", problems)
    given: dict[str, Any] = {}
    for field in dataclasses.fields(PipelineSettings):
        if field.name in section:
            given[field.name] = _value(section, field.name, field.default)
    if problems:
        raise ConfigurationError(problems, where=str(path))
    try:
        return PipelineSettings(**given)
    except ConfigurationError as error:
        raise ConfigurationError(error.problems, where=str(path)) from None


def _value(section: Section, name: str, default: Any) -> Any:
    """Return one setting in the type of its default; a rate of zero means automatic."""
    if isinstance(default, bool):
        return section.flag(name, default)
    number = as_number(section.raw(name))
    if number is None:
        section.note(name, f"{shown(section.raw(name))} is not a finite number")
        return default
    if default is None:
        return number or None
    if isinstance(default, int):
        if not number.is_integer():
            section.note(name, f"{number:g} is not a whole number")
        return int(number)
    return number
