# Copyright 2026 ride_estimation contributors
"""The same estimates, bit by bit, whether a bag is read in bulk or played message by message into the pipeline."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from worlds.adapters import recording as as_recording
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.estimation.offline import EstimateDigest, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import iterate_messages, read_recording
from ride_estimation.io.messages import make_converter, sensors_by_topic
from ride_estimation.io.vehicle_file import load_vehicle


def played(bag: Path, vehicle_path: Path) -> str:
    """Digest of a run whose messages are converted one by one, as a node does it."""
    vehicle = load_vehicle(vehicle_path)
    pipeline, digest = Pipeline(vehicle), EstimateDigest()
    sensors = sensors_by_topic(vehicle.sensors.values())
    converters = {}
    for topic, kind, _, message in iterate_messages(bag, sensors):
        if topic not in converters:
            converters[topic] = make_converter(kind, sensors[topic])
        for sample in converters[topic](message):
            assert not sample.rejection
            for block in pipeline.observe(sample.sensor, sample.stamp_ns, sample.values, sample.variance):
                digest.update(block)
    for block in pipeline.finish():
        digest.update(block)
    digest.parameters(pipeline.parameters())
    return digest.hexdigest()


@pytest.mark.parametrize("displacement", [False, True], ids=["accelerometers", "with displacement transducer"])
def test_bulk_and_message_by_message_agree_bit_by_bit(displacement: bool, tmp_path: Path) -> None:
    rng = np.random.default_rng(21)
    cab = random_vehicle(rng, "air")
    transducers = (("front_left", "z"), ("rear_right", "z")) if displacement else ()
    sensors = random_sensors(cab, rng, displacement=transducers)
    data = measure(drive(cab, Road.random(rng), 5.0, 21), sensors, 250.0, 21, noise_share=0.01, jitter_s=1e-4)
    (tmp_path / "v.yaml").write_text(vehicle_yaml(cab, data.sensors, None, 21))
    vehicle = load_vehicle(tmp_path / "v.yaml")
    write_bag(tmp_path / "run", as_recording(data), vehicle.sensors)
    bulk = run_offline(read_recording(tmp_path / "run", vehicle), Pipeline(vehicle))
    assert bulk.valid.sum() > 1000
    assert played(tmp_path / "run", tmp_path / "v.yaml") == bulk.digest
