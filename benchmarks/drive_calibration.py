# Copyright 2026 ride_estimation contributors
"""Measure ``calibrate --drive`` on fresh worlds (test/worlds: own equations and integrator) and on runs of other programs.

    python benchmarks/drive_calibration.py --seeds 20
    python benchmarks/drive_calibration.py --foreign FOLDER

A world is a random cab over a random road for 60 s, 200 Hz, noise 1 % of the signal; bias, gain, misalignment, position and
delay of every sensor are drawn from the usual installation. Printed per kind of error: 95th percentile, share within two
standard deviations, share of the values the drive determines (standard deviation below half the prior) and the same for those.
Drives that calibration calls unfit to use are left out of the table. Delays are compared without
what all sensors have in common: nothing can show that. Installed errors of a foreign run are those of
its ``truth.json``, its priors the tolerances of its ``vehicle.json`` (two standard deviations).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import pathlib
import sys
import time

import numpy as np
from scipy.spatial.transform import Rotation

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from estimator_targets import installed  # noqa: E402
from worlds.adapters import believed_vehicle, recording  # noqa: E402
from worlds.cab import drive, measure, random_sensors, random_vehicle  # noqa: E402
from worlds.roads import Road  # noqa: E402

from ride_estimation.errors import RideEstimationError  # noqa: E402
from ride_estimation.estimation.model.drive_calibration import DriveCalibration, calibrate_drive  # noqa: E402
from ride_estimation.io.bags import read_recording  # noqa: E402
from ride_estimation.io.vehicle_file import load_vehicle  # noqa: E402
from ride_estimation.sensors.installation import Installation  # noqa: E402

RATE = 200.0
UNITS = {"gain": (100.0, "%"), "misalignment": (np.degrees(1.0), "deg"), "position": (1e3, "mm"), "delay": (1e3, "ms")}
Errors = dict[str, dict[str, np.ndarray]]


def world(seed: int, duration: float) -> tuple[DriveCalibration, Errors]:
    """Return what calibration finds in a world and what is true."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air" if seed % 2 == 0 else "rubber")
    sensors = installed(random_sensors(cab, rng), seed)
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    run = drive(cab, dataclasses.replace(Road.random(rng), follow=follow), duration, seed)
    data = measure(run, sensors, RATE, seed, noise_share=0.01, anti_alias=0.0)
    truth = {
        s.name: {
            "bias": np.asarray(s.bias), "gain": np.asarray(s.gain) - 1.0, "delay": np.array([s.delay_s]),
            "position": s.true_position - s.position,
            "misalignment": Rotation.from_matrix(s.rotation.T @ s.true_rotation).as_rotvec(),
        }
        for s in sensors
    }  # fmt: skip
    return calibrate_drive(recording(data), believed_vehicle(data, seed=seed)), truth


def foreign(folder: pathlib.Path) -> tuple[DriveCalibration, Errors]:
    """Return what calibration finds in a foreign run and what is true."""
    vehicle = load_vehicle(folder / "vehicle.yaml")
    tolerance = json.loads((folder / "vehicle.json").read_text(encoding="utf-8"))["tolerance"]
    prior = Installation(
        bias=0.5 * tolerance["sensor_bias_m_s2"], gain=0.005 * tolerance["sensor_gain_pct"],
        misalignment=np.radians(0.5 * tolerance["sensor_angle_deg"]), position=0.5 * tolerance["sensor_position_m"],
    )  # fmt: skip
    stated = {n: dataclasses.replace(s, installation=prior) for n, s in vehicle.sensors.items()}
    vehicle = dataclasses.replace(vehicle, sensors=stated)
    truth: Errors = {}
    by_topic = {s.topic: s for s in vehicle.sensors.values()}
    for entry in json.loads((folder / "truth.json").read_text(encoding="utf-8"))["true_parameters"]["sensors"]:
        sensor = by_topic.get(entry["topic"])
        on_cab = sensor is not None and (sensor.body == "cab" or bool(sensor.mount))
        if sensor is not None and on_cab and entry["kind"] == "acc":
            truth[sensor.name] = {
                "bias": np.array(entry["bias"]), "gain": np.array(entry["gain"]) - 1.0, "delay": np.array([entry["delay"]]),
                "position": np.array(entry["true_pos"]) - sensor.position, "misalignment": np.array(entry["mis"]),
            }  # fmt: skip
    return calibrate_drive(read_recording(folder / "run", vehicle), vehicle), truth


def scores(found: DriveCalibration, truth: Errors) -> dict[str, list[tuple[float, float, bool]]]:
    """Return (error, standard deviation, determined) of every value by kind of error."""
    rows: dict[str, list[tuple[float, float, bool]]] = {}
    common = np.mean([found.sensors[n].errors["delay"] - t["delay"] for n, t in truth.items()])
    for name, true in truth.items():
        c = found.sensors[name]
        place = "body" if not c.sensor.mount else "base"
        for kind, value in true.items():
            error = c.errors[kind] - value - (common if kind == "delay" else 0.0)
            rows.setdefault(f"{place} {kind}", []).extend(zip(error, c.stds[kind], c.determined[kind]))
    return rows


def figures(error: np.ndarray, std: np.ndarray) -> str:
    return f"{np.percentile(np.abs(error), 95):9.3f}{np.mean(np.abs(error) < 2.0 * std):9.1%}"


def table(rows: dict[str, list[tuple[float, float, bool]]]) -> None:
    print(f"{'error':<20}{'unit':<7}{'p95':>9}{'inside':>9}{'determined':>12}{'p95':>9}{'inside':>9}")
    for kind in sorted({k.split()[1] for k in rows}):
        merged = {"all": [v for k in rows if k.endswith(kind) for v in rows[k]]}
        for place, values in {**{k.split()[0]: v for k, v in rows.items() if k.endswith(kind)}, **merged}.items():
            factor, unit = UNITS.get(kind, (1.0, "m/s^2"))
            error, std, known = (np.array(column) for column in zip(*values))
            cells = figures(factor * error, factor * std) + f"{known.mean():12.0%}"
            if known.any():
                cells += figures(factor * error[known], factor * std[known])
            print(f"{place + ' ' + kind:<20}{unit:<7}{cells}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--duration", type=float, default=60.0, help="[s]")
    parser.add_argument("--foreign", type=pathlib.Path, help="folder of foreign runs instead of worlds")
    given = parser.parse_args()
    total: dict[str, list[tuple[float, float, bool]]] = {}
    cases: list[object] = list(range(given.first, given.first + given.seeds))
    if given.foreign is not None:
        cases = [c for c in sorted(given.foreign.glob("cab_*")) if (c / "vehicle.yaml").exists()]
    for case in cases:
        began = time.process_time()
        try:
            found, truth = foreign(case) if isinstance(case, pathlib.Path) else world(int(str(case)), given.duration)
        except RideEstimationError as error:
            print(f"{case}: {error}", flush=True)
            continue
        rows = scores(found, truth)
        inside = np.mean([abs(e) < 2.0 * s for values in rows.values() for e, s, _ in values])
        spent = time.process_time() - began
        said = "" if found.usable else f", not usable, conflicts {len(found.conflicts)}"
        nis = f"NIS {found.nis:.2f}, worst octave {found.largest_nis:.2f}"
        print(f"{getattr(case, 'name', case)}: {nis}, inside {inside:.0%}, {spent:.0f} s{said}", flush=True)
        if not found.usable:
            continue
        for kind, values in rows.items():
            total.setdefault(kind, []).extend(values)
    table(total)


if __name__ == "__main__":
    main()
