# Copyright 2026 ride_estimation contributors
"""The table of faults: what is done to a clean run, what must be said about it and how soon, and what may not happen meanwhile.

Printed with measured figures by ``benchmarks/fault_table.py``, enforced by ``test_fault_table.py``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from replay.fault_run import (
    BEGIN,
    END,
    IMU,
    LENGTH,
    MOVING,
    RATE,
    STANDING,
    Behaviour,
    Message,
    Outcome,
    Plant,
    World,
    as_messages,
    beginning,
    behaviour,
    judged,
    world,
)
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation
from worlds.cab import measure

#: victims: an accelerometer on the cab and one at a mount base
CAB, BASE = "cab_front_right", "chassis_rear_left"
_SECOND = 1_000_000_000
_PERIOD_NS = 10_000_000


def _same(time: np.ndarray) -> np.ndarray:
    return time


@dataclasses.dataclass(frozen=True)
class Fault:
    """One row.

    Attributes
    ----------
    name
        Short name.
    plant
        What is done to the messages.
    expected
        Regular expression of the sentence that must be said; empty where the fault is harmless and nothing need be said.
    constant
        Whether the fault is there from the start; then it must be named within 10 s of motion, otherwise within 0.5 s.
    begin, end
        When it is there [s]; negative: from the start of the motion and to the end where it is constant, else the usual time.
    kind
        Of the world, see :data:`replay.fault_run.Key`.
    within_s
        Longest time to the sentence [s] where it is not the usual one.
    true_time
        Seconds since the start from stamps, where stamps change.
    """

    name: str
    plant: Plant
    expected: str
    constant: bool = False
    begin: float = -1.0
    end: float = -1.0
    true_time: Callable[[np.ndarray], np.ndarray] = _same
    kind: str = ""
    within_s: float = 0.0

    @property
    def time(self) -> tuple[float, float]:
        """Return when it is there [s]."""
        usual = (MOVING, LENGTH) if self.constant else (BEGIN, END)
        return usual[0] if self.begin < 0.0 else self.begin, usual[1] if self.end < 0.0 else self.end

    @property
    def limit_s(self) -> float:
        """Return the longest time to the sentence [s]."""
        return self.within_s or (10.0 if self.constant else 0.5)


def run_fault(fault: Fault, seed: int) -> tuple[Outcome, Behaviour]:
    """Return figures and behaviour of one fault in one world."""
    key = (seed, fault.kind)
    w, (begin, end) = world(key), fault.time
    messages = fault.plant(w, list(w.messages), np.random.default_rng([seed, 99]))
    found = behaviour(w.vehicle, messages, fault.expected, begin, fault.true_time, beginning(key))
    return judged(key, found, begin, end), found


# -- plants ---------------------------------------------------------------------------------------------------------------


def _of(sensor: str, change: Callable[[Message, np.random.Generator, int], list[Message]], begin: float, end: float) -> Plant:
    """Change the messages of a sensor (empty: of all) within a time; the third argument counts them."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        out, count = [], 0
        for m in messages:
            if sensor in ("", m.sensor) and begin <= (m.stamp_ns - w.messages[0].stamp_ns) * 1e-9 < end:
                out += change(m, rng, count)
                count += 1
            else:
                out.append(m)
        return sorted(out, key=lambda m: m.arrival_s)

    return plant


def _passing(sensor: str, change: Callable[[Message, np.random.Generator, int], list[Message]]) -> Plant:
    return _of(sensor, change, BEGIN, END)


def _values(change: Callable[[np.ndarray, int], np.ndarray]) -> Callable[[Message, np.random.Generator, int], list[Message]]:
    return lambda m, rng, n: [dataclasses.replace(m, values=tuple(change(np.array(m.values), n).tolist()))]


def _stamp(change: Callable[[int, int], int]) -> Callable[[Message, np.random.Generator, int], list[Message]]:
    return lambda m, rng, n: [dataclasses.replace(m, stamp_ns=change(m.stamp_ns, n))]


def _stuck(sensor: str, begin: float = BEGIN, end: float = END) -> Plant:
    held: list[tuple[float, ...]] = []

    def change(m: Message, rng: np.random.Generator, n: int) -> list[Message]:
        if n == 0:
            held[:] = [m.values]
        return [dataclasses.replace(m, values=held[0])]

    return _of(sensor, change, begin, end)


def _clipping(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Blows as on the end of the travel drive the sensor beyond its full scale for 24 ms twice a second."""
    scale = w.sensor(CAB).full_scale

    def change(m: Message, rng: np.random.Generator, n: int) -> list[Message]:
        if n % 50 >= 3:
            return [m]
        return [dataclasses.replace(m, values=(m.values[0], m.values[1], scale))]

    return _passing(CAB, change)(w, messages, rng)


def _bursts(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Hand a sensor's messages over every 200 ms; the stamps are right."""

    def change(m: Message, rng: np.random.Generator, n: int) -> list[Message]:
        return [dataclasses.replace(m, arrival_s=np.ceil(m.arrival_s / 0.2) * 0.2 + 1e-6 * n)]

    return _passing(CAB, change)(w, messages, rng)


def _exchanged(first: str, second: str) -> Plant:
    """Exchange two topics for the whole run."""
    names = {first: second, second: first}
    return lambda w, messages, rng: [dataclasses.replace(m, sensor=names.get(m.sensor, m.sensor)) for m in messages]


def _mounted(sensor: str, **changes: object) -> Plant:
    return lambda w, messages, rng: w.measured_with(sensor, **changes)


def _turned(sensor: str, degrees: float) -> Plant:
    """Mount a sensor turned about its x axis."""
    turn = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    return lambda w, messages, rng: w.measured_with(sensor, true_rotation=w.sensor(sensor).rotation @ turn)


def _always(sensor: str, change: Callable[[np.ndarray, int], np.ndarray]) -> Plant:
    """Change the values of a sensor during the whole run."""
    return _of(sensor, _values(change), 0.0, LENGTH)


def _both(*plants: Plant) -> Plant:
    """Take the messages of each sensor from the plant that changes it; plants change different sensors."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        own = {id(m) for m in messages}
        clean = {(m.sensor, m.stamp_ns, m.values): m for m in messages}
        changed: dict[str, list[Message]] = {}
        for one in plants:
            found = [clean.get((m.sensor, m.stamp_ns, m.values), m) for m in one(w, messages, rng)]
            for name in {m.sensor for m in found if id(m) not in own}:
                changed[name] = [m for m in found if m.sensor == name]
        kept = [m for m in messages if m.sensor not in changed]
        return sorted([*kept, *(m for part in changed.values() for m in part)], key=lambda m: (m.arrival_s, m.sensor))

    return plant


def _turned_while_standing(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Somebody steps on the bracket of a sensor before the vehicle drives off."""
    turned = {m.stamp_ns: m for m in _turned(CAB, 5.0)(w, messages, rng) if m.sensor == CAB}
    return _of(CAB, lambda m, r, n: [turned[m.stamp_ns]], 10.0, LENGTH)(w, messages, rng)


def _drift(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Let the gain rise by 15 % between 20 s and 40 s, as a sensor gets warm, and fall again until 60 s."""
    share = np.maximum(1.0 - np.abs(np.arange(LENGTH * RATE) / RATE - 40.0) / 20.0, 0.0)
    return _always(CAB, lambda v, n: v * (1.0 + 0.15 * share[min(n, len(share) - 1)]))(w, messages, rng)


def _rounded(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Give a sensor that samples when it likes stamps of a clock that only knows hundredths of a second."""
    data = measure(w.measurement.run, w.measurement.sensors, RATE, w.key[0], noise_share=0.01, jitter_s=0.002, phases_s=0.01)
    own = [m for m in as_messages(data) if m.sensor == CAB]
    own = [dataclasses.replace(m, stamp_ns=m.stamp_ns // _PERIOD_NS * _PERIOD_NS) for m in own]
    return sorted([m for m in messages if m.sensor != CAB] + own, key=lambda m: m.arrival_s)


def _misplaced(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    return w.measured_with(CAB, true_position=w.sensor(CAB).position + np.array([0.05, 0.0, 0.0]))


def _looped(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Play the run until faults begin, then from its beginning once more for a while."""
    first = [m for m in messages if m.arrival_s < BEGIN]
    return first + [dataclasses.replace(m, arrival_s=m.arrival_s + BEGIN) for m in messages if m.arrival_s < 18.0]


def _slower(w: World, messages: list[Message], sensor: str, every: int) -> list[Message]:
    """Let a sensor sample at a fraction of its rate, without aliasing and without delay."""
    if every == 1:
        return messages
    b, a = butter(4, 0.8 / every)
    own = [m for m in messages if m.sensor == sensor]
    smooth = filtfilt(b, a, np.array([m.values for m in own]), axis=0)
    slow = [dataclasses.replace(m, values=tuple(v)) for m, v in zip(own, smooth.tolist())][::every]
    return sorted([m for m in messages if m.sensor != sensor] + slow, key=lambda m: m.arrival_s)


def _late_for_a_while(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Delay the values of a base sensor by 20 ms for three seconds."""
    late = {m.stamp_ns: m for m in w.measured_with(BASE, delay_s=0.02) if m.sensor == BASE}
    return _of(BASE, lambda m, r, n: [late[m.stamp_ns]], BEGIN, BEGIN + 3.0)(w, messages, rng)


def _half_rate(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    return _slower(w, messages, CAB, 2)


def _mixed(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
    """Every second sensor at half the rate."""
    for i, name in enumerate(w.vehicle.sensors):
        messages = _slower(w, messages, name, 1 + i % 2)
    return messages


def _dropped(m: Message, rng: np.random.Generator, n: int) -> list[Message]:
    return [] if rng.random() < 0.1 else [m]


def _swap_order(m: Message, rng: np.random.Generator, n: int) -> list[Message]:
    return [dataclasses.replace(m, arrival_s=m.arrival_s + (0.015 if n % 2 == 0 else 0.0))]


def _spike(at: tuple[int, ...], size: float) -> Callable[[Message, np.random.Generator, int], list[Message]]:
    return _values(lambda v, n: v + np.array([0.0, 0.0, size if n in at else 0.0]))


def _not_used(sensor: str, why: str) -> str:
    return rf"^{sensor} was not used.*{why}"


_ANY_DOUBT = rf"{CAB}.*(rigid body|mean|explains|gain|position|rotation|delay|jumps)|one of .*{CAB}"
_LATE = rf"{CAB}.*(explains|delay|rigid body)|one of .*{CAB}|no single sensor"

_AHEAD = "stamps jumped ahead|samples rejected: .*clock_ahead"
_BACK = "stamps jumped back|samples rejected: .*clock_behind"

#: faults that are there from the start, at the base and on the cab, and such as hardly anybody thinks of
_MORE: tuple[Fault, ...] = (
    Fault("inverted axis z", _always(CAB, lambda v, n: v * [1, 1, -1]), _ANY_DOUBT, True),
    Fault("inverted axis x", _always(CAB, lambda v, n: v * [-1, 1, 1]), _ANY_DOUBT, True),
    Fault("30 deg tilt", _turned(CAB, 30.0), _ANY_DOUBT, True),
    Fault("dead, reads nothing", _always(CAB, lambda v, n: 0.0 * v), rf"{CAB}.*(stuck|mean|rigid)", True),
    Fault("dead, holds a value", _always(CAB, lambda v, n: np.array([0.1, -0.1, 9.8])), rf"{CAB}.*(stuck|rigid)", True),
    Fault("base: gain 10 % high", _mounted(BASE, gain=1.1), BASE, True),
    Fault("base: gain x 9.81", _mounted(BASE, gain=9.81), f"{BASE}.*(mean|full)", True),
    Fault("base: inverted axis z", _always(BASE, lambda v, n: v * [1, 1, -1]), f"{BASE}.*mean", True),
    Fault("base: inverted axis x", _always(BASE, lambda v, n: v * [-1, 1, 1]), BASE, True),
    Fault("base: swapped axes x and y", _always(BASE, lambda v, n: v[[1, 0, 2]]), BASE, True),
    Fault("base: swapped axes y and z", _always(BASE, lambda v, n: v[[0, 2, 1]]), f"{BASE}.*mean", True),
    Fault("base: 2 deg tilt", _turned(BASE, 2.0), BASE, True),
    Fault("base: 30 deg tilt", _turned(BASE, 30.0), f"{BASE}.*mean", True),
    Fault("base: 20 ms late", _mounted(BASE, delay_s=0.02), BASE, True),
    Fault("base: dead, reads nothing", _always(BASE, lambda v, n: 0.0 * v), f"{BASE}.*(stuck|mean)", True),
    Fault("base: dead, holds a value", _always(BASE, lambda v, n: np.array([0.1, -0.1, 9.8])), f"{BASE}.*stuck", True),
    Fault("two at once: gain 10 % high, another 20 ms late",
          _both(_mounted(CAB, gain=1.1), _mounted("cab_rear_left", delay_s=0.02)), rf"{CAB}|cab_rear_left|no single", True),
    Fault("two at once: stuck on cab and base", _both(_stuck(CAB), _stuck(BASE)), _not_used(CAB, "stuck")),
    Fault("stuck while standing", _stuck(CAB, 10.0, 20.0), "", begin=10.0, end=20.0, kind="standing"),
    Fault("gain x 9.81 while standing", _of(CAB, _values(lambda v, n: 9.81 * v), 10.0, 20.0),
          _not_used(CAB, "(jumps|rigid body|mean|full)"), begin=10.0, end=20.0, kind="standing"),
    Fault("turned by 5 deg while standing", _turned_while_standing, _ANY_DOUBT, True, begin=STANDING, kind="standing"),
    Fault("gain drifts by 15 % and back", _drift, _ANY_DOUBT, True, begin=30.0),
    Fault("silent for 2 s", _passing(CAB, lambda m, r, n: []), f"{CAB} has stopped"),
    Fault("stamps rounded to 10 ms", _rounded, rf"{_LATE}|{CAB}: samples rejected: .*duplicate", True),
    Fault("resumed after 10 minutes", _of("", _stamp(lambda s, n: s + 600 * _SECOND), BEGIN, LENGTH), _AHEAD,
          end=BEGIN + 0.5, true_time=lambda t: np.where(t > BEGIN + 300.0, t - 600.0, t)),
    Fault("gyro in deg/s", _of(IMU, _values(lambda v, n: v * [1, 1, 1, *3 * [180.0 / np.pi]]), 0.0, LENGTH),
          f"{IMU}.*angular rate", True, kind="imu"),
    Fault("gyro with inverted pitch", _of(IMU, _values(lambda v, n: v * [1, 1, 1, 1, -1, 1]), 0.0, LENGTH),
          f"{IMU}.*angular rate", True, kind="imu"),
)  # fmt: skip

TABLE: tuple[Fault, ...] = (
    Fault("sensor off from the start", _of(CAB, lambda m, r, n: [], 0.0, LENGTH), f"{CAB} is configured but contrib", True),
    Fault("sensor off midway", _of(CAB, lambda m, r, n: [], BEGIN, LENGTH), f"{CAB} has stopped", end=LENGTH),
    Fault("base sensor off midway", _of(BASE, lambda m, r, n: [], BEGIN, LENGTH), f"{BASE} has stopped", end=LENGTH),
    Fault("intermittent, 0.2 s of 0.5 s", _passing(CAB, lambda m, r, n: [m] if n % 50 >= 20 else []), rf"{CAB}: \d+ gaps"),
    Fault("single spike, 30 m/s^2", _passing(CAB, _spike((0,), 30.0)), _not_used(CAB, "jumps"), end=BEGIN),
    Fault("burst of 12 spikes", _passing(CAB, _spike(tuple(range(0, 192, 16)), 30.0)), _not_used(CAB, "jumps")),
    Fault("base: burst of spikes", _passing(BASE, _spike(tuple(range(0, 192, 16)), 60.0)), _not_used(BASE, "jumps")),
    Fault("stuck value", _stuck(CAB), _not_used(CAB, "stuck")),
    Fault("base: stuck value", _stuck(BASE), _not_used(BASE, "stuck")),
    Fault("clipping", _clipping, rf"{CAB} was (not used.*|)at full scale"),
    Fault("gain x 9.81 midway", _passing(CAB, _values(lambda v, n: 9.81 * v)), _not_used(CAB, "(jumps|rigid body|mean|full)")),
    Fault("gain x 9.81", _mounted(CAB, gain=9.81), _ANY_DOUBT, True),
    Fault("wrong unit: g", _mounted(CAB, gain=1.0 / 9.81), _ANY_DOUBT, True),
    Fault("base: wrong unit, g", _mounted(BASE, gain=1.0 / 9.81), f"{BASE}.*mean", True),
    Fault("swapped axes y and z midway", _passing(CAB, _values(lambda v, n: v[[0, 2, 1]])), _not_used(CAB, "(jumps|rigid|mean)")),
    Fault("swapped axes y and z", _of(CAB, _values(lambda v, n: v[[0, 2, 1]]), 0.0, LENGTH), _ANY_DOUBT, True),
    Fault("swapped axes x and y", _of(CAB, _values(lambda v, n: v[[1, 0, 2]]), 0.0, LENGTH), _ANY_DOUBT, True),
    Fault("inverted axis z midway", _passing(CAB, _values(lambda v, n: v * [1, 1, -1])), _not_used(CAB, "(jumps|rigid|mean)")),
    Fault("swapped topics, cab and base", _exchanged(CAB, "chassis_front_right"), rf"{CAB}|chassis_front_right", True),
    Fault("swapped topics, both on the cab", _exchanged(CAB, "cab_rear_left"), rf"{CAB}|cab_rear_left|no single sensor", True),
    Fault("2 deg tilt", _turned(CAB, 2.0), _ANY_DOUBT, True),
    Fault("50 mm wrong position", _misplaced, _ANY_DOUBT, True),
    Fault("gain 10 % high", _mounted(CAB, gain=1.1), _ANY_DOUBT, True),
    Fault("5 ms late", _mounted(CAB, delay_s=0.005), _LATE, True),
    Fault("20 ms late", _mounted(CAB, delay_s=0.02), _LATE, True),
    Fault("40 ms late", _mounted(CAB, delay_s=0.04), _LATE, True),
    Fault("base: 20 ms late for 3 s", _late_for_a_while, f"{BASE}|sensors at the mount bases", end=BEGIN + 3.0),
    Fault("200 ms late bursts, stamps right", _bursts, ""),
    Fault("duplicates", _passing(CAB, lambda m, r, n: [m, m]), f"{CAB}: samples rejected: .*duplicate"),
    Fault("out of order by one", _passing(CAB, _swap_order), ""),
    Fault("10 % dropped", _passing(CAB, _dropped), ""),
    Fault("clock skew 3 s", _passing(CAB, _stamp(lambda s, n: s + 3 * _SECOND)), f"{CAB}: samples rejected: .*clock_ahead"),
    Fault("clock 3 s behind", _passing(CAB, _stamp(lambda s, n: s - 3 * _SECOND)), f"{CAB}: samples rejected: .*clock_behind"),
    Fault("all clocks step back 1 h", _of("", _stamp(lambda s, n: s - 3600 * _SECOND), BEGIN, LENGTH), _BACK,
          end=BEGIN + 0.5, true_time=lambda t: np.where(t < -1800.0, t + 3600.0, t)),
    Fault("looped replay", _looped, _BACK, end=BEGIN + 0.5),
    Fault("stamp 0", _passing(CAB, _stamp(lambda s, n: 0)), f"{CAB}: samples rejected: .*stamp_not_positive"),
    Fault("stamp repeats", _passing(CAB, _stamp(lambda s, n: s - n * _PERIOD_NS)), f"{CAB}: samples rejected: .*duplicate"),
    Fault("NaN in every tenth", _passing(CAB, _values(lambda v, n: v * (np.nan if n % 10 == 0 else 1))), "rejected.*not_finite"),
    Fault("infinite", _passing(CAB, _values(lambda v, n: np.full(3, np.inf))), f"{CAB}: samples rejected: .*not_finite"),
    Fault("zero covariance", _passing(CAB, lambda m, r, n: [dataclasses.replace(m, covariance=0.0)]), ""),
    Fault("covariance -1 with data", _passing(CAB, lambda m, r, n: [dataclasses.replace(m, covariance=-1.0)]),
          f"{CAB}: covariance_says_not_provided"),
    *_MORE,
    Fault("half rate", _half_rate, f"{CAB} samples at 50 Hz where others do at 100 Hz", True),
    Fault("mixed rates", _mixed, "samples at 50 Hz where others do at 100 Hz", True),
)  # fmt: skip
