# Copyright 2026 ride_estimation contributors
"""Keep complete cases on disk: making one takes seconds, reading it milliseconds."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import tempfile

import numpy as np

from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle
from worlds.adapters import uniform_run, vehicle_of_text
from worlds.scenario import Scenario
from worlds.vehicle_text import vehicle_yaml


@dataclasses.dataclass(frozen=True)
class StoredCase:
    """What a diagnosis gets (``vehicle``, ``run``, ``validation``) and what it is judged by.

    ``facts``: ``planted`` (list of mappings), ``road``, ``stiffness`` and ``damping`` (M, 3) of the true cab, ``laws`` as
    (mount, axis) indices with a hidden law, ``drifts``: whether parameters drift.
    """

    vehicle: Vehicle
    run: UniformRun
    validation: tuple[UniformRun, ...]
    facts: dict[str, object]


def save_case(path: pathlib.Path, scenario: Scenario) -> None:
    """Write a case as one .npz file (values as float32: resolution 1e-6 m/s^2, far below the noise)."""
    cab = scenario.fit.run.vehicle
    facts = {
        "planted": [dataclasses.asdict(p) for p in scenario.planted],
        "road": scenario.road_kind,
        "rate_hz": scenario.fit.rate_hz,
        "stiffness": cab.stiffness.tolist(),
        "damping": cab.damping.tolist(),
        "laws": sorted({(int(m), int(a)) for m, a, _, _ in cab.hidden.laws}),
        "drifts": cab.hidden.drift is not None,
    }
    text = vehicle_yaml(scenario.believed, scenario.fit.sensors, scenario.belief, scenario.seed)
    arrays = {}
    for i, measurement in enumerate((scenario.fit, *scenario.validation)):
        for name, values in uniform_run(measurement).data.items():
            arrays[f"{i}|{name}"] = values.astype(np.float32)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
        np.savez(file, text=np.array(text), facts=np.array(json.dumps(facts)), **arrays)
    pathlib.Path(file.name).replace(path)


def load_case(path: pathlib.Path) -> StoredCase:
    """Read a case."""
    with np.load(path) as stored:
        facts = json.loads(str(stored["facts"]))
        text = str(stored["text"])
        runs: dict[int, dict[str, np.ndarray]] = {}
        for key in stored.files:
            if "|" in key:
                number, name = key.split("|")
                runs.setdefault(int(number), {})[name] = stored[key].astype(float)
    vehicle = vehicle_of_text(text)
    uniform = [
        UniformRun(
            "fit" if i == 0 else f"validation_{i - 1}",
            facts["rate_hz"],
            0,
            data,
            {n: np.ones(len(v), bool) for n, v in data.items()},
        )
        for i, data in sorted(runs.items())
    ]
    return StoredCase(vehicle, uniform[0], tuple(uniform[1:]), facts)
