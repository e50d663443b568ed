# Copyright 2026 ride_estimation contributors
"""A drive with known truth as messages in order of arrival, and what the estimator says and does about a fault planted into it.

Nothing here knows how the package detects anything: messages go through its converter and pipeline, its words are searched for
the expected ones, its numbers are compared with the truth of ``test/worlds``.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import functools
import re
from collections import Counter
from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np
from worlds.adapters import START_NS, believed_vehicle
from worlds.cab import CabSensor, CabVehicle, Measurement, drive, measure, random_sensors, random_vehicle, rotation_of_degrees
from worlds.roads import Road

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.messages import Converter, make_converter
from ride_estimation.vehicles.vehicle import Vehicle

#: rate of every sensor [Hz], length of the drive, and the time in which a passing fault is there [s]: the drive before it is long
#: enough for a clean run to know most vertical parameters to a tenth of a percent
RATE = 100.0
LENGTH, BEGIN, END = 68.0, 60.0, 62.0
#: a parameter counts as known where the clean run's own standard deviation is at most this share of it: a hundredth is then two
KNOWN = 0.005
#: time from which the truth moves [s], and where it stands for long before
MOVING, STANDING = 1.0, 25.0
#: the sensor that measures angular rates too, in worlds that have one
IMU = "cab_front_left"
#: sensors that are turned about z, in worlds that have such
TURNED = ("cab_rear_left", "chassis_front_right")
#: distance of two looks at what the estimator says [s], five times that when a second is over
LOOK = 0.05
#: window in which forces are called recovered [s]
WINDOW = 0.5


@dataclasses.dataclass(frozen=True)
class Message:
    """One message: when it arrives and what it says; ``covariance`` is the first number of the covariance."""

    arrival_s: float
    sensor: str
    stamp_ns: int
    values: tuple[float, ...]
    covariance: float = 0.0


#: a world by number, and what is different in it: nothing, ``standing`` for half of the run, an ``imu`` on the cab, or another
#: layout: ``turned`` (five sensors on the cab, one there and one at the bases turned by 90 degrees), ``transducers`` (vertical
#: ones at all mounts), ``three`` mounts, ``random`` (all of it drawn)
Key = tuple[int, str]
Plant = Callable[["World", list[Message], np.random.Generator], list[Message]]


@dataclasses.dataclass(frozen=True)
class World:
    """A cab on a road, what its sensors measure, and what the vehicle file says."""

    key: Key
    measurement: Measurement
    vehicle: Vehicle

    @functools.cached_property
    def messages(self) -> list[Message]:
        """Return the clean run in order of arrival."""
        return as_messages(self.measurement)

    def measured_with(self, sensor: str, **changes: object) -> list[Message]:
        """Return the run as measured by a sensor that is not as the vehicle file says."""
        sensors = tuple(dataclasses.replace(s, **changes) if s.name == sensor else s for s in self.measurement.sensors)  # type: ignore[arg-type]
        return as_messages(measured(self.measurement.run, sensors, self.key[0]))

    def sensor(self, name: str) -> CabSensor:
        """Return a sensor by name."""
        return next(s for s in self.measurement.sensors if s.name == name)


def measured(run: object, sensors: tuple[CabSensor, ...], seed: int) -> Measurement:
    """Return what sensors with 1 % noise deliver."""
    return measure(run, sensors, RATE, seed, noise_share=0.01)  # type: ignore[arg-type]


@functools.cache
def world(key: Key) -> World:
    """Return a world: random cab on air springs, random road, four accelerometers on the cab and one at each mount base."""
    seed, kind = key
    rng = np.random.default_rng(seed)
    drawn = kind == "random"
    cab = random_vehicle(rng, "any" if drawn else "air")
    if kind == "three" or (drawn and rng.random() < 0.25):
        cab = with_one_rear_mount(cab)
    road = Road.random(rng)
    if kind == "standing":
        road = dataclasses.replace(road, standing_s=STANDING)
    run = drive(cab, road, LENGTH, seed, step=1e-3)
    mounted = kind == "transducers" or (drawn and rng.random() < 0.3)
    travel = tuple((name, "z") for name in cab.mount_names) if mounted else ()
    count = int(rng.integers(4, 7)) if drawn else 5 if kind == "turned" else 4
    sensors = random_sensors(cab, rng, cab_sensors=count, displacement=travel, turned=drawn and rng.random() < 0.5)
    if kind == "turned":
        turn = rotation_of_degrees(np.array([0.0, 0.0, 90.0]))
        sensors = tuple(dataclasses.replace(s, rotation=turn) if s.name in TURNED else s for s in sensors)
    if kind == "imu":
        sensors = tuple(dataclasses.replace(s, kind="imu") if s.name == IMU else s for s in sensors)
    data = measured(run, sensors, seed)
    return World(key, data, believed_vehicle(data, seed=seed))


def with_one_rear_mount(cab: CabVehicle) -> CabVehicle:
    """Return the cab with its two rear mounts as one, a little off the middle; it keeps the name of the left one."""
    rear = np.array([cab.mounts[2, 0], 0.05, cab.mounts[2, 2]])
    stiffness, damping = (np.vstack([v[:2], v[2:].sum(axis=0)]) for v in (cab.stiffness, cab.damping))
    return dataclasses.replace(
        cab, mount_names=cab.mount_names[:3], mounts=np.vstack([cab.mounts[:2], rear]), stiffness=stiffness, damping=damping
    )


def as_messages(data: Measurement) -> list[Message]:
    """Return the samples as messages that arrive 2 ms after their stamp."""
    found = []
    for name, values in data.data.items():
        stamps = START_NS + np.round(data.stamps[name] * 1e9).astype(np.int64)
        found += [
            Message(float(t) + 0.002, name, int(s), tuple(v)) for t, s, v in zip(data.stamps[name], stamps, values.tolist())
        ]
    return sorted(found, key=lambda m: (m.arrival_s, m.sensor))


@dataclasses.dataclass(frozen=True)
class Behaviour:
    """What the estimator said and did.

    Attributes
    ----------
    flagged_s
        When one of its sentences first matched what is expected, seconds of arrival time; infinity: never.
    said
        That sentence.
    texts
        All sentences at the end.
    now
        Whether a sensor was still refused at the end.
    arrival_s, time_s, force, std, valid
        Ticks in time of arrival and in true time, mount forces and their standard deviation, whether they may be published.
    parameters
        Name -> (value, standard deviation, status).
    """

    flagged_s: float
    said: str
    texts: tuple[str, ...]
    now: bool
    arrival_s: np.ndarray
    time_s: np.ndarray
    force: np.ndarray
    std: np.ndarray
    valid: np.ndarray
    parameters: dict[str, tuple[float, float, Status]]


@dataclasses.dataclass(frozen=True)
class Beginning:
    """An estimator that has seen the beginning of a clean run: its messages, how many they are, its blocks and their arrival."""

    pipeline: Pipeline
    messages: Sequence[Message]
    count: int
    blocks: tuple[OutputBlock, ...]
    arrived: tuple[float, ...]


@functools.cache
def beginning(key: Key) -> Beginning:
    """Return the clean run of a world until a second before passing faults begin."""
    w = world(key)
    pipeline, blocks, arrived, count = Pipeline(w.vehicle), [], [], 0
    converters = _converters(w.vehicle)
    # the last moment before the fault at which nothing is halfway learned: that cannot be copied
    for end in (BEGIN - 1.0, *np.arange(BEGIN - 0.9, BEGIN, 0.1)):
        while w.messages[count].arrival_s < end:
            blocks += _observed(pipeline, converters, w.messages[count], Counter())
            arrived += [w.messages[count].arrival_s] * (len(blocks) - len(arrived))
            count += 1
        pipeline.parameters()
        with contextlib.suppress(TypeError):
            copy.deepcopy(pipeline)
            break
    return Beginning(pipeline, w.messages, count, tuple(blocks), tuple(arrived))


def behaviour(
    vehicle: Vehicle,
    messages: Sequence[Message],
    expected: str,
    from_s: float,
    true_time: Callable[[np.ndarray], np.ndarray],
    given: Beginning | None = None,
) -> Behaviour:
    """Feed messages to a fresh estimator.

    Parameters
    ----------
    vehicle
        What the vehicle file says.
    messages
        In order of arrival.
    expected
        Regular expression of a sentence that names the fault; empty where nothing is to be said.
    from_s
        Arrival time from which a sentence counts [s].
    true_time
        Seconds since the start of the run from stamps, where the fault changes stamps.
    given
        The same run's beginning without a fault, taken over where the messages begin like it.
    """
    pipeline, before = Pipeline(vehicle), 0
    if given is not None and all(m is own for m, own in zip(messages[: given.count], given.messages)):
        pipeline, before = copy.deepcopy(given.pipeline), given.count
    converters = _converters(vehicle)
    refused: Counter[str] = Counter()
    blocks: list[OutputBlock] = list(given.blocks) if before and given is not None else []
    arrived: list[float] = list(given.arrived) if before and given is not None else []
    flagged, said, look = np.inf, "", from_s
    pattern = re.compile(expected) if expected else None
    for m in messages[before:]:
        blocks += _observed(pipeline, converters, m, refused)
        arrived += [m.arrival_s] * (len(blocks) - len(arrived))
        if pattern is not None and not said and m.arrival_s >= look:
            look = m.arrival_s + (LOOK if m.arrival_s < from_s + 1.0 else 5.0 * LOOK)
            said = next((t for t in sentences(pipeline, refused) if pattern.search(t)), "")
            flagged = m.arrival_s if said else np.inf
    texts = sentences(pipeline, refused)
    blocks += pipeline.finish()
    arrived += [messages[-1].arrival_s] * (len(blocks) - len(arrived))
    stamps = np.concatenate([b.stamp_ns for b in blocks])
    return Behaviour(
        flagged, said, tuple(texts), any("(now)" in t for t in texts),
        np.repeat(arrived, [len(b.stamp_ns) for b in blocks]), true_time((stamps - START_NS) * 1e-9),
        np.concatenate([b.mount_force for b in blocks]), np.concatenate([b.mount_force_std for b in blocks]),
        np.concatenate([b.valid for b in blocks]), {e.name: (e.value, e.std, e.status) for e in pipeline.parameters()},
    )  # fmt: skip


def sentences(pipeline: Pipeline, refused: Counter[str]) -> list[str]:
    """Return all the node would say: health, restarts, messages its decoder refused."""
    health = pipeline.health()
    return [
        *health.messages, *(f"restart: {reason}: {count}" for reason, count in health.restarts.items()),
        *(f"{what}: {count}" for what, count in refused.items()),
    ]  # fmt: skip


def _converters(vehicle: Vehicle) -> dict[str, Converter]:
    kinds = ("accelerometer", "imu")
    return {name: make_converter("sensor_msgs/msg/Imu", (s,)) for name, s in vehicle.sensors.items() if s.kind in kinds}


def _observed(
    pipeline: Pipeline, converters: dict[str, Converter], m: Message, refused: Counter[str]
) -> list[OutputBlock]:
    """Hand one message over through its converter (a transducer has none of its own); refused samples are counted."""
    if m.sensor not in converters:
        return list(pipeline.observe(m.sensor, m.stamp_ns, m.values))
    blocks: list[OutputBlock] = []
    for sample in converters[m.sensor](_as_imu(m)):  # type: ignore[arg-type]
        if sample.rejection:
            refused[f"{sample.sensor}: {sample.rejection}"] += 1
        else:
            blocks += pipeline.observe(sample.sensor, sample.stamp_ns, sample.values, sample.variance)
    return blocks


def _as_imu(m: Message) -> SimpleNamespace:
    covariance = (m.covariance, *(0.0,) * 8)
    stamp = SimpleNamespace(sec=m.stamp_ns // 10**9, nanosec=m.stamp_ns % 10**9)
    force, rate = (SimpleNamespace(**dict(zip("xyz", part))) for part in (m.values[:3], m.values[3:] or (0.0,) * 3))
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), linear_acceleration=force, linear_acceleration_covariance=covariance,
        angular_velocity=rate, angular_velocity_covariance=(0.0,) * 9,
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Figures of one fault in one world.

    Attributes
    ----------
    to_flag_s
        From the beginning of the fault (of the motion for constant ones) to the sentence; NaN where none is expected.
    said
        The sentence.
    not_finite
        Published numbers that are none.
    force_ratio
        Largest error of a force over what is allowed: three times the largest error of the clean run plus five stated standard
        deviations.
    to_recover_s
        From the end of the fault until the rms error of every half second is at most 1.5 times the largest of the clean run.
    parameter
        Largest relative change of a parameter that claims to be valid, against the clean run, of those the clean run knows (see
        :data:`KNOWN`; what the mass leaves uncertain is common to both runs and does not count).
    parameter_words
        Its name, and how many parameters were compared.
    parameter_stds
        Largest change of the other parameters that claim to be valid, in standard deviations of the clean run.
    wrong_stds
        Largest error of a parameter that claims to be valid against the truth, in standard deviations it states.
    inside
        Share of the force errors within two stated standard deviations from the beginning of the fault on.
    """

    to_flag_s: float
    said: str
    not_finite: int
    force_ratio: float
    to_recover_s: float
    parameter: float
    parameter_words: str
    parameter_stds: float
    wrong_stds: float
    inside: float


@functools.cache
def clean(key: Key) -> Behaviour:
    """Return the behaviour on the clean run of a world."""
    w = world(key)
    return behaviour(w.vehicle, w.messages, "", BEGIN, lambda t: t, beginning(key))


def judged(key: Key, found: Behaviour, begin: float, end: float) -> Outcome:
    """Compare a behaviour with truth and clean run of the same world; times are of arrival, forces count from 5 s on."""
    usual = clean(key)
    error, std, time = _errors(key, found)
    base, _, base_time = _errors(key, usual)
    allowed = 3.0 * np.abs(base[base_time > 5.0]).max(axis=0) + 5.0 * std
    after = time >= max(begin, 5.0)
    ratios = np.abs(error[after]) / allowed[after]
    known, others = _changes(found, usual)
    worst = max(known, default=(0.0, "none"))
    usual_rms = max(_rms(base_time, base, edge) for edge in np.arange(5.0, base_time[-1] - WINDOW, WINDOW))
    edges = np.arange(end, time[-1] - WINDOW, WINDOW)
    recovered = max((edge + WINDOW for edge in edges if not _rms(time, error, edge) <= 1.5 * usual_rms), default=end)
    return Outcome(
        to_flag_s=found.flagged_s - begin,
        said=found.said,
        not_finite=int(np.sum(~np.isfinite(found.force[found.valid]))),
        force_ratio=float(ratios.max()) if ratios.size else 0.0,
        to_recover_s=recovered - end,
        parameter=worst[0],
        parameter_words=f"{worst[1]}, {len(known)} compared",
        parameter_stds=max(others, default=0.0),
        wrong_stds=max(_wrong(key, found), default=0.0),
        inside=float(np.mean(np.abs(error[after]) < 2.0 * std[after])) if after.any() else np.nan,
    )


def _changes(found: Behaviour, usual: Behaviour) -> tuple[list[tuple[float, str]], list[float]]:
    """Return changes of the parameters that both runs call valid: relative ones of those the clean run knows, others in stds."""
    known, others = [], []
    mass, mass_std, _ = usual.parameters["cab.mass"]
    for name, (value, _, status) in found.parameters.items():
        before, std, was = usual.parameters[name]
        if status is not Status.VALID or was is not Status.VALID or name == "cab.mass":
            continue
        own = float(np.sqrt(max((std / before) ** 2 - (mass_std / mass) ** 2, 0.0)))
        if own <= KNOWN:
            known.append((abs(value / before - 1.0), name))
        else:
            others.append(abs(value / before - 1.0) / own)
    return known, others


def true_parameters(key: Key) -> dict[str, float]:
    """Return the true stiffness and damping by the name of the estimate."""
    cab = world(key).measurement.run.vehicle
    tables = {"stiffness": cab.stiffness, "damping": cab.damping}
    return {
        f"{mount}.{axis}.{word}": float(table[m, a])
        for word, table in tables.items() for m, mount in enumerate(cab.mount_names) for a, axis in enumerate("xyz")
    }  # fmt: skip


def _wrong(key: Key, found: Behaviour) -> list[float]:
    """Return the errors of all parameters that claim to be valid, in standard deviations they state."""
    truth = true_parameters(key)
    return [
        abs(value - truth[name]) / std
        for name, (value, std, status) in found.parameters.items()
        if status is Status.VALID and name in truth
    ]


def _errors(key: Key, found: Behaviour) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return force error, standard deviation and time of arrival of the ticks that may be published."""
    data = world(key).measurement
    row = np.round(found.time_s * RATE).astype(int)
    keep = found.valid & (row >= 0) & (row < len(data.time))
    return found.force[keep] - data.truth["mount_force"][row[keep]], found.std[keep], found.arrival_s[keep]


def _rms(time: np.ndarray, error: np.ndarray, start: float) -> float:
    """Return the rms of a window; infinite where fewer than half of its ticks are there."""
    chosen = (time >= start) & (time < start + WINDOW)
    return float(np.sqrt(np.mean(error[chosen] ** 2))) if chosen.sum() > 0.5 * WINDOW * RATE else np.inf
