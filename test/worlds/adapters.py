# Copyright 2026 ride_estimation contributors
"""The only file of the worlds that knows the product: hands measurements over as its data classes."""

from __future__ import annotations

import dataclasses
import pathlib
import tempfile

import numpy as np

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import Channel, Recording, UniformRun
from ride_estimation.vehicles.vehicle import Vehicle
from worlds.cab import Measurement
from worlds.plane_scenario import PlaneCase
from worlds.scenario import Scenario
from worlds.vehicle_text import Belief, vehicle_yaml

START_NS = 1_700_000_000_000_000_000


def uniform_run(measurement: Measurement, name: str = "world", *, from_s: float = 0.0, to_s: float | None = None) -> UniformRun:
    """Return the run on its own time base (measured without jitter and phases)."""
    first = round(from_s * measurement.rate_hz)
    last = len(measurement.time) if to_s is None else round(to_s * measurement.rate_hz)
    data = {key: np.ascontiguousarray(values[first:last]) for key, values in measurement.data.items()}
    valid = {key: np.ones(len(values), bool) for key, values in data.items()}
    start = START_NS + round(first / measurement.rate_hz * 1e9)
    return UniformRun(name, measurement.rate_hz, start, data, valid)


def stretch(run: UniformRun, first: int, last: int | None = None, name: str = "") -> UniformRun:
    """Return the samples of a run from ``first`` to before ``last``."""
    data, valid = ({s: v[first:last] for s, v in part.items()} for part in (run.data, run.valid))
    return dataclasses.replace(run, name=name or run.name, data=data, valid=valid)


def with_gaps(run: UniformRun, *gaps_s: tuple[float, float]) -> UniformRun:
    """Return a run whose sensors were silent from and to some times [s]."""
    data, valid = ({s: v.copy() for s, v in part.items()} for part in (run.data, run.valid))
    for begin, end in gaps_s:
        part = slice(round(begin * run.rate_hz), round(end * run.rate_hz))
        for sensor in data:
            data[sensor][part], valid[sensor][part] = np.nan, False
    return dataclasses.replace(run, data=data, valid=valid)


def recording(measurement: Measurement, name: str = "world", *, latency_s: float = 0.002) -> Recording:
    """Return the run as messages: header stamps as sampled, arrival a little later."""
    channels = {}
    for key, values in measurement.data.items():
        stamp = START_NS + np.round(measurement.stamps[key] * 1e9).astype(np.int64)
        arrival = stamp + round(latency_s * 1e9)
        channels[key] = Channel(key, stamp, values, arrival)
    return Recording(name, channels)


def arrivals(measurement: Measurement) -> list[tuple[int, str, np.ndarray]]:
    """Return (stamp_ns, sensor, values) of every sample in the order of the stamps."""
    out = []
    for key, values in measurement.data.items():
        stamp = START_NS + np.round(measurement.stamps[key] * 1e9).astype(np.int64)
        out += [(int(s), key, v) for s, v in zip(stamp, values)]
    out.sort(key=lambda item: (item[0], item[1]))
    return out


def believed_vehicle(measurement: Measurement, belief: Belief | None = None, seed: int = 0, true: object = None) -> Vehicle:
    """Return the product's vehicle as a test engineer would have written it down (through a vehicle file)."""
    cab = measurement.run.vehicle if true is None else true
    text = vehicle_yaml(cab, measurement.sensors, belief, seed)  # type: ignore[arg-type]
    return vehicle_of_text(text)


def vehicle_of_text(text: str) -> Vehicle:
    """Return the vehicle of a vehicle file given as text."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "vehicle.yaml"
        path.write_text(text, encoding="utf-8")
        return load_vehicle(path)


def plane_inputs(case: PlaneCase) -> tuple[Vehicle, UniformRun, list[UniformRun]]:
    """Return vehicle, fit run and validation runs of a plane case."""
    runs = [
        UniformRun(f"run_{i}", case.rate_hz, START_NS, data, {n: np.ones(len(v), bool) for n, v in data.items()})
        for i, data in enumerate(case.runs)
    ]
    return vehicle_of_text(case.vehicle_text), runs[0], runs[1:]


def product_inputs(scenario: Scenario) -> tuple[Vehicle, UniformRun, list[UniformRun]]:
    """Return vehicle, fit run and validation runs of a scenario as the product takes them."""
    vehicle = believed_vehicle(scenario.fit, scenario.belief, scenario.seed, scenario.believed)
    runs = [uniform_run(m, f"validation_{i}") for i, m in enumerate(scenario.validation)]
    return vehicle, uniform_run(scenario.fit, "fit"), runs
