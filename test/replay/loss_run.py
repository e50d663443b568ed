# Copyright 2026 ride_estimation contributors
"""Random losses, stalls, late bursts, returns and clock jumps, one after the other, on drives with known truth.

A sequence is a disturbance of up to some seconds followed by a calm of :data:`CALM` seconds. Sequences are chained in one run of
one estimator that is never reset from outside; where the drive is over it begins again, as after a jump of all clocks.
Nothing here knows how the estimator handles missing samples: recordings go in, forces and their standard deviations come out.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator

import numpy as np
from replay.fault_run import with_one_rear_mount
from worlds.adapters import START_NS, believed_vehicle, plane_inputs
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.plane_scenario import machine_case, quarter_car_case
from worlds.roads import Road

from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: time after a disturbance in which the estimator has to be as good as without it [s], and the last part of it that judges [s]
CALM, JUDGED = 10.0, 2.0
#: longest gap of a sensor and longest time a disturbance lasts [s]
LONGEST, LASTS = 5.0, 5.5
#: smallest jump of a clock [s]: longer than a sequence, so that a stamp tells whether it is of before or of after
JUMP = 60.0
#: rows of the drive at its beginning that are left out [s]: the vehicle stands
STANDING = 2.0
KINDS = ("loss", "together", "flicker", "singles", "late", "burst", "clock of some", "all clocks")


@dataclasses.dataclass(frozen=True)
class Layout:
    """What a drive is made with: mounts ``air`` or ``rubber``, rate [Hz], sensors.

    ``plane``: ``machine`` (a cab that bounces and pitches on two mounts) or ``quarter`` (a body on one) instead of a cab.
    """

    mounts: str
    rate_hz: float
    cab_sensors: int = 4
    chassis: bool = True
    travel: bool = False
    turned: bool = False
    imu: bool = False
    three: bool = False
    plane: str = ""


LAYOUTS = {
    "air, 4 + 4 accelerometers, 100 Hz": Layout("air", 100.0),
    "rubber, 5 + 4 turned accelerometers, 125 Hz": Layout("rubber", 125.0, cab_sensors=5, turned=True),
    "air, 4 + 4 and travel of the mounts, 100 Hz": Layout("air", 100.0, travel=True),
    "air, 4 accelerometers and travel of the mounts, 100 Hz": Layout("air", 100.0, chassis=False, travel=True),
    "rubber, accelerometers on the cab alone, 100 Hz": Layout("rubber", 100.0, chassis=False),
    "air, 3 and an IMU on the cab + 4, 200 Hz": Layout("air", 200.0, imu=True),
    "air, three mounts, 4 + 3 accelerometers, 100 Hz": Layout("air", 100.0, three=True),
    "cab in the plane, 3 + 2 accelerometers, 100 Hz": Layout("rubber", 100.0, plane="machine"),
    "body on one suspension, 1 + 1 accelerometers, 100 Hz": Layout("rubber", 100.0, plane="quarter"),
}


@dataclasses.dataclass(frozen=True)
class Course:
    """A drive: what the vehicle file says, the samples of every sensor and the true forces (N, M, 3) at the same rows.

    ``flat``: vertical forces alone have a truth.
    """

    vehicle: Vehicle
    samples: dict[str, np.ndarray]
    force: np.ndarray
    rate_hz: float
    flat: bool = False

    @property
    def rows(self) -> int:
        return len(self.force)

    @property
    def size(self) -> np.ndarray:
        """Return the standard deviation of the true forces, shape (2,): horizontal, vertical."""
        return np.maximum(self.by_direction(self.force - self.force.mean(axis=0)), 1e-9)

    def by_direction(self, error: np.ndarray) -> np.ndarray:
        """Return the root mean square of (N, M, 3) over horizontal and over vertical axes, shape (2,)."""
        horizontal = 0.0 if self.flat else np.sqrt(np.mean(error[..., :2] ** 2))
        return np.array([horizontal, np.sqrt(np.mean(error[..., 2] ** 2))])


@functools.cache
def course(name: str, seed: int, seconds: float) -> Course:
    """Return a drive of a layout: a random cab on a random road, noise 1 % of the signal."""
    layout, rng = LAYOUTS[name], np.random.default_rng(seed)
    if layout.plane:
        return _plane_course(layout, seed, seconds)
    cab = random_vehicle(rng, layout.mounts)
    if layout.three:
        cab = with_one_rear_mount(cab)
    run = drive(cab, Road.random(rng), STANDING + seconds, seed, step=1e-3)
    travel = tuple((mount, "z") for mount in cab.mount_names) if layout.travel else ()
    sensors = random_sensors(
        cab, rng, cab_sensors=layout.cab_sensors, chassis=layout.chassis, displacement=travel, turned=layout.turned
    )
    if layout.imu:
        sensors = (dataclasses.replace(sensors[0], kind="imu"), *sensors[1:])
    data = measure(run, sensors, layout.rate_hz, seed, noise_share=0.01)
    first = round(STANDING * layout.rate_hz)
    samples = {key: np.ascontiguousarray(values[first:]) for key, values in data.data.items()}
    return Course(believed_vehicle(data, seed=seed), samples, data.truth["mount_force"][first:], layout.rate_hz)


def _plane_course(layout: Layout, seed: int, seconds: float) -> Course:
    duration, rate = STANDING + seconds, layout.rate_hz
    if layout.plane == "machine":
        case = machine_case(None, seed, duration=duration, rate_hz=rate)
    else:
        case = quarter_car_case("none", seed, duration=duration, rate_hz=rate, validations=0)
    vehicle, run, _ = plane_inputs(case)
    first = round(STANDING * rate)
    force = np.zeros((len(case.forces[0]) - first, case.forces[0].shape[1], 3))
    force[:, :, 2] = case.forces[0][first:]
    return Course(vehicle, {key: np.ascontiguousarray(v[first:]) for key, v in run.data.items()}, force, rate, flat=True)


@dataclasses.dataclass(frozen=True)
class Disturbance:
    """What becomes of the samples of a sequence of N rows, per sensor (S, N).

    ``there`` whether the sample arrives at all, ``wait`` how much later than usual [s], ``ahead`` by how much its stamp is off
    [s]; ``jump`` of all clocks before the first of them [s]; ``until`` when the last disturbed row is over [s].
    """

    kind: str
    there: np.ndarray
    wait: np.ndarray
    ahead: np.ndarray
    jump: float
    until: float


def disturbance(rng: np.random.Generator, sensors: int, rate_hz: float) -> Disturbance:
    """Draw a disturbance, followed by :data:`CALM`."""
    kind = str(rng.choice(KINDS))
    rows = round((LASTS + CALM) * rate_hz)
    time = np.arange(rows) / rate_hz
    hit = np.zeros((sensors, rows), dtype=bool)
    chosen = rng.permutation(sensors)[: rng.integers(1, sensors + 1)]
    length = float(np.exp(rng.uniform(np.log(0.05), np.log(LONGEST))))
    for s in chosen:
        if kind in ("together", "burst"):
            hit[s] = time < length
        elif kind == "flicker":
            begin = rng.uniform(0.0, 1.0)
            while begin < LASTS:
                end = begin + rng.uniform(0.05, 3.0)
                hit[s] |= (time >= begin) & (time < min(end, LASTS))
                begin = end + rng.uniform(0.1, 1.0)
        elif kind == "singles":
            hit[s] = (rng.random(rows) < rng.uniform(0.01, 0.5)) & (time < length)
        else:
            begin = rng.uniform(0.0, 0.5)
            hit[s] = (time >= begin) & (time < begin + float(np.exp(rng.uniform(np.log(0.05), np.log(LONGEST)))))
    wait, ahead, jump = np.zeros((sensors, rows)), np.zeros((sensors, rows)), 0.0
    there = ~hit
    if kind in ("late", "burst"):
        # held back, then all at once, sensor by sensor
        ends = np.array([time[h].max() if h.any() else 0.0 for h in hit])
        wait = np.where(hit, ends[:, None] - time + 1e-6 * np.arange(sensors)[:, None], 0.0)
        there = np.ones_like(hit)
    elif kind == "clock of some":
        ahead, there = np.where(hit, rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 1000.0), 0.0), np.ones_like(hit)
    elif kind == "all clocks":
        jump = float(rng.choice([-1.0, 1.0]) * rng.uniform(JUMP, 1000.0))
    until = float(time[hit.any(axis=0)].max()) if hit.any() else 0.0
    rows = round((until + CALM) * rate_hz)
    return Disturbance(kind, there[:, :rows], wait[:, :rows], ahead[:, :rows], jump, until)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came out of a sequence: rows of the drive, forces and standard deviations (N, M, 3), whether they may be published."""

    rows: np.ndarray
    force: np.ndarray
    std: np.ndarray
    deflection: np.ndarray
    valid: np.ndarray


class Chain:
    """An estimator through which sequences go, one after the other."""

    def __init__(self, given: Course) -> None:
        self.course, self.pipeline = given, Pipeline(given.vehicle)
        self._row, self._start = 0, START_NS

    def feed(self, given: Disturbance) -> Outcome:
        """Feed the next rows of the drive, disturbed."""
        rows, rate, jump = given.there.shape[1], self.course.rate_hz, given.jump
        if self._row + rows > self.course.rows:
            self._row, jump = 0, max(abs(jump), JUMP)
        # the clocks go on by the rows fed before, and jump
        first, self._row = self._row, self._row + rows
        begin = self._start + round(jump * 1e9)
        self._start = begin + round(rows * 1e9 / rate)
        channels, step = {}, np.round(np.arange(rows) * 1e9 / rate).astype(np.int64)
        for s, (name, values) in enumerate(self.course.samples.items()):
            keep = given.there[s]
            stamp = begin + step + np.round(given.ahead[s] * 1e9).astype(np.int64)
            arrival = begin + step + np.round(given.wait[s] * 1e9).astype(np.int64)
            order = np.argsort(arrival[keep], kind="stable")
            channels[name] = Channel(
                name, stamp[keep][order], values[first : first + rows][keep][order], arrival[keep][order]
            )  # fmt: skip
        blocks = [b for found, _ in self.pipeline.replay(Recording("chain", channels)) for b in found]
        if not blocks:
            count = self.course.force.shape[1]
            nothing = np.zeros((0, count, 3))
            return Outcome(np.zeros(0, dtype=int), nothing, nothing, nothing, np.zeros(0, dtype=bool))
        at = np.concatenate([(b.stamp_ns - begin) * 1e-9 * rate for b in blocks])
        # ticks of before a jump, and of sensors that were followed onto a clock of their own, have no truth
        row = np.round(at).astype(np.int64)
        known = (row >= -rows) & (row < rows) & (first + row >= 0)
        row = np.where(known, first + row, -1)
        force, std, deflection, valid = (
            np.concatenate([getattr(b, name) for b in blocks])
            for name in ("mount_force", "mount_force_std", "mount_deflection", "valid")
        )
        return Outcome(row, force, std, deflection, valid)


def undisturbed_rows(sensors: int, rows: int) -> Disturbance:
    """Return a disturbance that is none."""
    nothing = np.zeros((sensors, rows))
    return Disturbance("none", nothing == 0.0, nothing, nothing, 0.0, 0.0)


def undisturbed(given: Course) -> np.ndarray:
    """Return the error of the forces at every row of a drive that is seen for the second time, shape (N, M, 3)."""
    chain = Chain(given)
    error = np.full(given.force.shape, np.nan)
    sensors, rows = len(given.samples), round(CALM * given.rate_hz)
    calm = undisturbed_rows(sensors, rows)
    for _ in range(2 * (given.rows // rows)):
        found = chain.feed(calm)
        good = (found.rows >= 0) & found.valid
        error[found.rows[good]] = found.force[good] - given.force[found.rows[good]]
    return error


@dataclasses.dataclass(frozen=True)
class Verdict:
    """One sequence: its kind, whether all numbers were finite, the largest valid force over the largest true one, error at the
    end of the calm and without disturbance over the size of the forces, ticks with a truth, and those inside two standard
    deviations (horizontal, vertical each).
    """

    kind: str
    finite: bool
    largest: float
    error: np.ndarray
    allowed: np.ndarray
    ticks: np.ndarray
    inside: np.ndarray


def sequences(given: Course, seed: int, count: int, reference: np.ndarray | None = None) -> Iterator[Verdict]:
    """Run sequences over a drive and judge them.

    Parameters
    ----------
    given
        Drive.
    seed, count
        Of the sequences.
    reference
        Of :func:`undisturbed`.
    """
    if reference is None:
        reference = undisturbed(given)
    chain, rng, rate = Chain(given), np.random.default_rng(seed), given.rate_hz
    largest_true = float(np.abs(given.force).max())
    sensors = len(given.samples)
    chain.feed(undisturbed_rows(sensors, round(2 * CALM * rate)))
    for _ in range(count):
        plan = disturbance(rng, sensors, rate)
        found = chain.feed(plan)
        last = chain._row
        good = (found.rows >= 0) & found.valid
        error = found.force[good] - given.force[found.rows[good]]
        late = found.rows[good] >= last - round(JUDGED * rate)
        own = reference[last - round(JUDGED * rate) : last]
        own = own[np.isfinite(own).all(axis=(1, 2))]
        hits = np.abs(error) <= 2.0 * found.std[good]
        finite = bool(np.isfinite(found.force).all() and np.isfinite(found.std).all() and np.isfinite(found.deflection).all())
        with np.errstate(all="ignore"):
            now = given.by_direction(error[late]) if late.sum() > rate else np.full(2, np.inf)
            largest = float(np.abs(found.force[found.valid]).max(initial=0.0)) / largest_true
        yield Verdict(
            plan.kind, finite, largest, now / given.size, given.by_direction(own) / given.size,
            np.array([0 if given.flat else len(error), len(error)]),
            np.array([0.0 if given.flat else hits[..., :2].mean(axis=(1, 2)).sum(), hits[..., 2].mean(axis=1).sum()]),
        )  # fmt: skip
