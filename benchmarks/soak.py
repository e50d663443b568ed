# Copyright 2026 ride_estimation contributors
"""A long time in a short one: memory, latency, covariance and time stamps of an estimator that is never switched off.

Accelerated: samples are handed over as fast as they are taken, in one process, to decoder and estimator of the live node (no
middleware, no publishing), one health report per second of data. Two ways to run it:

    python benchmarks/soak.py --days 7 --drive 10      # of every hour 10 s of driving, 0.3 % of the week: the stamps of the rest
                                                       # are jumped over, so the estimator begins a new time base every hour
    python benchmarks/soak.py --hours 2                # every second of it, 8 accelerometers at 100 Hz

Not covered: what real time does (a clock that drifts, a publisher that leaks, a machine that swaps). The first line of the
output says how much was really fed.

The drive is a simulated one of 20 s (test/worlds) whose end is blended into its beginning. Latency is the time from handing over
a message to having the forces of the block it completes, publishing not included, in processor time so that other load of the
machine does not count. Prints per tenth of the run: resident memory after a collection, latency percentiles, smallest eigenvalue
of the covariance of the motion, stated standard deviation of a force (median), restarts; at the end growth of the memory after
the first tenth (target: at most 5 %), the largest 99th percentile over that of the first tenth (target: at most 1.5), and the
largest standard deviation over that of the first tenth (at most 1.2: an estimator that drives on does not come to know less).
"""

from __future__ import annotations

import argparse
import gc
import os
import pathlib
import struct
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from fuzz.live import imu_payload  # noqa: E402
from worlds.adapters import believed_vehicle  # noqa: E402
from worlds.cab import drive, measure, random_sensors, random_vehicle  # noqa: E402
from worlds.roads import Road  # noqa: E402

from ride_estimation.estimation.common.settings import PipelineSettings  # noqa: E402
from ride_estimation.nodes.session import Session  # noqa: E402
from ride_estimation.vehicles.vehicle import Vehicle  # noqa: E402

RATE, LOOP_S, BLEND_S = 100, 20, 1
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 1_000_000_000 // RATE
IMU = "sensor_msgs/msg/Imu"


def looped_drive(seed: int) -> tuple[Vehicle, list[tuple[str, list[bytes]]]]:
    """Return the vehicle and, per topic, the payloads of one loop (stamps are put in later)."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    run = drive(cab, Road.random(rng), LOOP_S + BLEND_S + 2.0, seed, step=1e-3)
    data = measure(run, random_sensors(cab, rng), float(RATE), seed, noise_share=0.01)
    vehicle = believed_vehicle(data, seed=seed)
    weight = np.linspace(0.0, 1.0, BLEND_S * RATE)[:, None]
    found = []
    for name, sensor in vehicle.sensors.items():
        values = data.data[name][2 * RATE :]
        loop = values[: LOOP_S * RATE].copy()
        loop[: len(weight)] = weight * loop[: len(weight)] + (1.0 - weight) * values[LOOP_S * RATE : LOOP_S * RATE + len(weight)]
        found.append((sensor.topic, [imu_payload(0, row) for row in loop]))
    return vehicle, found


def stamped(payload: bytes, stamp_ns: int) -> bytes:
    return payload[:4] + struct.pack("<iI", stamp_ns // 10**9, stamp_ns % 10**9) + payload[12:]


def resident_mib() -> float:
    gc.collect()
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


class Soak:
    """One estimator and what was seen of it."""

    def __init__(self, seed: int) -> None:
        vehicle, self.topics = looped_drive(seed)
        self.session = Session(vehicle, PipelineSettings())
        self.session.warm_up()
        self.latency: list[float] = []
        self.doubt: list[float] = []
        self.smallest, self.messages, self.ticks = np.inf, 0, 0

    def second(self, number: int, stamp_ns: int) -> None:
        """Feed one second of the loop, then report as the node does."""
        clock, receive = time.thread_time, self.session.receive
        for k in range(RATE):
            row, stamp = (number * RATE + k) % (LOOP_S * RATE), stamp_ns + k * PERIOD_NS
            for topic, payloads in self.topics:
                payload = stamped(payloads[row], stamp)
                began = clock()
                blocks = receive(topic, IMU, payload)
                if blocks:
                    self.latency.append(clock() - began)
                    for block in blocks:
                        self.look(block.cg_accel_covariance, block.mount_force, block.stamp_ns, stamp)
                        self.doubt.append(float(np.mean(block.mount_force_std)))
            self.messages += len(self.topics)
        for status in self.session.statuses():
            assert status.name
        for p in self.session.pipeline.parameters():
            assert np.isfinite(p.value) and np.isfinite(p.std), p

    def look(self, covariance: np.ndarray, force: np.ndarray, stamps: np.ndarray, now_ns: int) -> None:
        self.ticks += len(stamps)
        assert np.isfinite(force).all()
        # at most what waits for its neighbours, or what was left when the stamps jumped over the rest of an hour
        assert stamps.dtype == np.int64 and 0 <= now_ns - int(stamps[-1]) < 3602 * 10**9
        matrix = covariance[-1] if covariance.ndim == 3 else covariance
        self.smallest = min(self.smallest, float(np.linalg.eigvalsh(matrix)[0]))


def plan(given: argparse.Namespace) -> list[tuple[int, int]]:
    """Return (number of the second in the loop, stamp) of every second to be fed."""
    if given.hours:
        return [(s, START_NS + s * 10**9) for s in range(round(given.hours * 3600))]
    hours = range(round(given.days * 24))
    return [(s, START_NS + (h * 3600 + s) * 10**9) for h in hours for s in range(given.drive)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=float, default=7.0, help="simulated days (default 7)")
    parser.add_argument("--drive", type=int, default=10, help="seconds of driving per hour of them (default 10)")
    parser.add_argument("--hours", type=float, default=0.0, help="instead: simulated hours without a gap")
    parser.add_argument("--seed", type=int, default=21)
    given = parser.parse_args()
    seconds, soak = plan(given), Soak(given.seed)
    span = (seconds[-1][1] - START_NS) / 1e9 + 1.0
    print(
        f"simulated span {span / 3600.0:.1f} h, of which {len(seconds)} s ({100.0 * len(seconds) / span:.1f} %) are fed, "
        f"{len(soak.topics)} sensors at {RATE} Hz"
    )
    parts = np.array_split(np.arange(len(seconds)), 10)
    began, rows = time.perf_counter(), []
    print("| part | to [h] | memory [MiB] | p50 [ms] | p99 [ms] | max [ms] | least eigenvalue | force std [N] | restarts |")
    print("|---|---|---|---|---|---|---|---|---|")
    for n, part in enumerate(parts):
        soak.latency.clear()
        soak.doubt.clear()
        for i in part:
            soak.second(*seconds[i])
        p50, p99, largest = (1e3 * float(v) for v in np.percentile(soak.latency, (50, 99, 100)))
        rows.append((resident_mib(), p99, float(np.median(soak.doubt))))
        restarts = sum(soak.session.pipeline.health().restarts.values())
        simulated = (seconds[part[-1]][1] - START_NS) / 3.6e12
        memory, _, std = rows[-1]
        figures = f"{memory:.1f} | {p50:.2f} | {p99:.2f} | {largest:.1f} | {soak.smallest:.2e} | {std:.1f} | {restarts}"
        print(f"| {n + 1} | {simulated:.1f} | {figures} |", flush=True)
    growth = 100.0 * (rows[-1][0] / rows[0][0] - 1.0)
    ratio, doubt = (max(row[k] for row in rows) / rows[0][k] for k in (1, 2))
    faults = sum(soak.session.faults.values())
    print(
        f"{soak.messages} messages, {soak.ticks} ticks, {time.perf_counter() - began:.0f} s: memory {growth:+.1f} % after the "
        f"first tenth, p99 at most {ratio:.2f} times that of the first tenth, standard deviation of a force at most {doubt:.2f} "
        f"times, {faults} numerical faults"
    )
    return 0 if growth <= 5.0 and ratio <= 1.5 and doubt <= 1.2 and not faults and soak.smallest > 0.0 else 1


if __name__ == "__main__":
    sys.exit(main())
