# Copyright 2026 ride_estimation contributors
"""The registry of force elements: every module of this folder that defines a concrete element is in it."""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from typing import Any

import ride_estimation.elements as package
from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError

#: key that may stand beside the parameters: what was in the data the element was identified from; no part of the law
SEEN = "seen_in_data"


@functools.cache
def kinds() -> dict[str, type[ForceElement]]:
    """Return all element classes by their KIND, in alphabetical order."""
    found: dict[str, type[ForceElement]] = {}
    for module_info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{module_info.name}")
        for _, cls in inspect.getmembers(module, inspect.isclass):
            if issubclass(cls, ForceElement) and not inspect.isabstract(cls) and cls.__module__ == module.__name__:
                found[cls.KIND] = cls
    return dict(sorted(found.items()))


def element_from_mapping(mapping: Mapping[str, Any]) -> ForceElement:
    """Build an element from its YAML form ``{kind: ..., <parameter>: ...}``.

    Raises
    ------
    ConfigurationError
        Unknown kind, or the mistakes :meth:`ForceElement.from_mapping` reports.
    """
    kind = mapping.get("kind")
    if not isinstance(kind, str) or kind not in kinds():
        raise ConfigurationError(f"kind: {kind!r} is not a force element; allowed: {', '.join(kinds())}")
    return kinds()[kind].from_mapping({key: value for key, value in mapping.items() if key != SEEN})
