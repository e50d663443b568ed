# Copyright 2026 ride_estimation contributors
"""Online and offline estimation of ride loads, mount parameters and mount forces, with diagnosis of the model."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ride_estimation.api.diagnosing import diagnose
    from ride_estimation.api.planning import plan
    from ride_estimation.api.replaying import replay
    from ride_estimation.api.runs import read_run
    from ride_estimation.api.simulating import simulate
    from ride_estimation.io.vehicle_file import load_vehicle

__version__ = "0.1.0"
__all__ = ["diagnose", "load_vehicle", "plan", "read_run", "replay", "simulate"]

#: name of the Python interface -> module it is imported from when it is first used (PEP 562)
_HOMES = {
    "diagnose": "ride_estimation.api.diagnosing",
    "load_vehicle": "ride_estimation.io.vehicle_file",
    "plan": "ride_estimation.api.planning",
    "read_run": "ride_estimation.api.runs",
    "replay": "ride_estimation.api.replaying",
    "simulate": "ride_estimation.api.simulating",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
