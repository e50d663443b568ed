# Copyright 2026 ride_estimation contributors
"""The form of a saved state of the pipeline, and whether a state has it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.sensors.sensor import Sensor


def plain(state: Any) -> Any:
    """Return a state as JSON can hold it: arrays as lists, in mappings and lists too."""
    if isinstance(state, np.ndarray):
        return state.tolist()
    if isinstance(state, Mapping):
        return {key: plain(value) for key, value in state.items()}
    return [plain(value) for value in state] if isinstance(state, (list, tuple)) else state


def fields_of(owner: object, names: Sequence[str]) -> dict[str, Any]:
    """Return attributes as JSON can hold them, by their names without a leading underscore."""
    return {name.removeprefix("_"): plain(getattr(owner, name)) for name in names}


def take_fields(owner: object, names: Sequence[str], saved: Mapping[str, Any]) -> None:
    """Set attributes from :func:`fields_of`; types, and shapes of arrays, are those of the present ones.

    Parameters
    ----------
    owner
        Whose attributes.
    names
        Of the attributes.
    saved
        Values by name without a leading underscore.

    Raises
    ------
    ValueError
        An array of another size.
    """
    for name in names:
        own, value = getattr(owner, name), saved[name.removeprefix("_")]
        if isinstance(own, np.ndarray):
            setattr(owner, name, np.array(value, dtype=own.dtype).reshape(own.shape))
        else:
            kind = bool if isinstance(own, (bool, np.bool_)) else int if isinstance(own, (int, np.integer)) else float
            setattr(owner, name, kind(value))


def all_finite(state: Any) -> bool:
    """Return whether every number in a state is finite."""
    if isinstance(state, np.ndarray):
        return bool(np.isfinite(state).all())
    if isinstance(state, Mapping):
        return all(all_finite(value) for value in state.values())
    if isinstance(state, (list, tuple)):
        return all(math.isfinite(value) if type(value) is float else all_finite(value) for value in state)
    return not isinstance(state, float) or math.isfinite(state)


_NAME = "ride_estimation/estimator_state/"
#: raised whenever a key is added or changes its meaning; 2: verdicts on the sensors are kept, 4: exchanged topics,
#: 5: lasting faults of base sensors and gyros, 6: accelerations that last, errors of base sensors,
#: 7: parameters of the beginning, 8: lean of the base sensors, 9: which axes of a sensor ever varied,
#: 10: loads by static travel and by the place of the CG, 11: parameters before a sudden change,
#: 12: moments of the tilt of brackets in a steeper band, 13: gains of base sensors, 14: names of keys,
#: 15: delays that were found, 16: where a load moved the CG
STATE_SCHEMA = f"{_NAME}17"


def check_state(state: Mapping[str, Any], sensors: Sequence[Sensor], mount_names: Sequence[str]) -> None:
    """Refuse a state of another version or of another vehicle.

    Parameters
    ----------
    state
        Of ``Pipeline.save_state``.
    sensors, mount_names
        Those the pipeline uses, in its order.

    Raises
    ------
    InputDataError
        Naming what differs.
    """
    schema = state.get("schema")
    if isinstance(schema, str) and schema.startswith(_NAME) and schema != STATE_SCHEMA:
        raise InputDataError(
            f"saved state: schema is {schema!r}, this version writes and reads {STATE_SCHEMA!r}: what was found out about the "
            "sensors is kept in another form. Delete the state to start from the vehicle file"
        )
    wanted = {"schema": STATE_SCHEMA, "sensors": [s.name for s in sensors], "mounts": list(mount_names)}
    for key, value in wanted.items():
        if state.get(key) != value:
            raise InputDataError(f"saved state: {key} is {state.get(key)!r}; this vehicle needs {value!r}")
