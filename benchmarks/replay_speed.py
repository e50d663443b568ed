# Copyright 2026 ride_estimation contributors
"""Speed of a replay on one core: eight triaxial accelerometers at 500 Hz, target 20 times real time.

Prints processor time of reading, of estimating with and without the second pass, and of the whole command per second of data.
``--seconds`` sets the length of the run.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "test"))

import numpy as np
from worlds.adapters import recording as as_recording
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.cli.main import main as command
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.alignment import StampAligner, StreamSpec


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    cab = random_vehicle(rng, "air")
    run = drive(cab, Road.random(rng), options.seconds, options.seed)
    data = measure(run, random_sensors(cab, rng), 500.0, options.seed, noise_share=0.01, jitter_s=5e-5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "vehicle.yaml").write_text(vehicle_yaml(cab, data.sensors, None, options.seed))
        vehicle = load_vehicle(path / "vehicle.yaml")
        write_bag(path / "run", as_recording(data), vehicle.sensors)
        places = [str(path / "run"), "--vehicle", str(path / "vehicle.yaml"), "--out", str(path / "out")]
        arguments = ["replay", *places, "--no-report"]
        command(arguments)  # compiles kernels on the first run on a machine
        stages = {}
        start = time.process_time()
        recording = read_recording(path / "run", vehicle)
        stages["read and decode"] = time.process_time() - start
        samples = list(recording.in_order())
        aligner = StampAligner([StreamSpec(n, c.values.shape[1]) for n, c in recording.channels.items()])
        start = time.process_time()
        for index, stamp, values, variance in samples:
            aligner.push(index, stamp, values, variance)
        stages["of estimation: alignment alone"] = time.process_time() - start
        start = time.process_time()
        run_offline(recording, Pipeline(vehicle), smoothing=False)
        stages["estimation as live"] = time.process_time() - start
        start = time.process_time()
        run_offline(recording, Pipeline(vehicle))
        stages["estimation with smoothing"] = time.process_time() - start
        start = time.process_time()
        command(arguments)
        stages["whole command without report"] = time.process_time() - start
    print(f"\n{len(samples)} samples of {len(recording.channels)} sensors over {options.seconds:g} s")
    for name, seconds in stages.items():
        print(f"{name:<34}{1e3 * seconds / options.seconds:8.1f} ms per s of data {options.seconds / seconds:8.1f} x real time")


if __name__ == "__main__":
    main()
