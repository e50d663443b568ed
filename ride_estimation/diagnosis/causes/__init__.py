# Copyright 2026 ride_estimation contributors
"""Candidate causes of a misfit, one file each; :func:`library` walks the folder."""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil

from ride_estimation.diagnosis.hypotheses.hypothesis import Cause


@functools.cache
def library() -> dict[str, Cause]:
    """Return one instance of every cause of this folder by its id, in alphabetical order."""
    found: dict[str, Cause] = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for _, cls in inspect.getmembers(module, inspect.isclass):
            if issubclass(cls, Cause) and not inspect.isabstract(cls) and cls.__module__ == module.__name__:
                found[cls.ID] = cls()
    return dict(sorted(found.items()))
