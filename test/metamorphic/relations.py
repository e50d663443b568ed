# Copyright 2026 ride_estimation contributors
"""Changes of a recorded run whose effect on every estimate is known beforehand: metamorphic relations.

A relation says how vehicle and recording change and how the estimates of the changed run are taken back to the original one.
Nothing here knows the truth: the relations hold on any recording, foreign ones too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ride_estimation.frames import COORDINATES
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import ForceReference, Mount, Prior, Vehicle

AXES = ("x", "y", "z")
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.diag([1.0, -1.0, 1.0])
#: turns the axes of a sensor in a mirror into a right-handed frame again
_HANDED = np.diag([1.0, -1.0, 1.0])
MICROSECOND, YEAR = 1_000, 365 * 86_400 * 1_000_000_000  # ns
MASS_FACTOR = 3.0


@dataclasses.dataclass(frozen=True)
class Relation:
    """One change and the way back.

    ``exact``: nothing but rounding may differ. ``turn`` takes vectors of the original vehicle to those of the changed one,
    ``scale`` multiplies forces and masses, ``mounts`` gives the new name of a mount, ``shift_ns`` is added to stamps.
    """

    name: str
    exact: bool
    vehicle: Callable[[Vehicle], Vehicle] = lambda vehicle: vehicle
    recording: Callable[[Vehicle, Recording], Recording] = lambda vehicle, run: run
    turn: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(3))
    scale: float = 1.0
    mounts: Callable[[str], str] = lambda name: name
    shift_ns: int = 0

    def axis(self, axis: str) -> str:
        """Return the axis of the changed vehicle along which an axis of the original one lies; other words stay."""
        return axes_of(self.turn).get(axis, axis)

    def parameter(self, name: str) -> str:
        """Return the name that a parameter of the original vehicle has in the changed one."""
        mount, _, rest = name.partition(".")
        axis, dot, quantity = rest.partition(".")
        return f"{self.mounts(mount)}.{self.axis(axis)}.{quantity}" if dot else name

    def vectors_back(self, values: np.ndarray, axial: bool = False) -> np.ndarray:
        """Return vectors (..., 3) in axes of the original vehicle; ``axial``: rates and moments, which a mirror reverses."""
        sign = np.linalg.det(self.turn) if axial else 1.0
        return sign * values @ self.turn

    def spreads_back(self, values: np.ndarray) -> np.ndarray:
        """Return standard deviations (..., 3) in axes of the original vehicle."""
        return values @ np.abs(self.turn)


def axes_of(turn: np.ndarray) -> dict[str, str]:
    """Return for every coordinate the one it becomes; a rotation goes with the axis it turns about."""
    to = [int(np.argmax(np.abs(turn[:, i]))) for i in range(3)]
    return {words[i]: words[to[i]] for words in (AXES, ("roll", "pitch", "yaw")) for i in range(3)}


# -- vehicles ------------------------------------------------------------------------------------------------------------------


def turned(vehicle: Vehicle, turn: np.ndarray) -> Vehicle:
    """Return the same vehicle in axes turned (or mirrored) by an orthogonal matrix that takes axes to axes."""
    to, mirror = axes_of(turn), np.linalg.det(turn) < 0.0

    def sensor(s: Sensor) -> Sensor:
        rotation = turn @ s.rotation @ (_HANDED if mirror else np.eye(3))
        return dataclasses.replace(s, position=turn @ s.position, rotation=rotation, axis=to.get(s.axis, s.axis))

    def mount(m: Mount) -> Mount:
        return dataclasses.replace(
            m,
            position=turn @ m.position,
            elements={to.get(a, a): e for a, e in sorted(m.elements.items(), key=lambda item: to.get(item[0], item[0]))},
            priors={(to.get(a, a), p): prior for (a, p), prior in m.priors.items()},
        )

    bodies = {
        name: dataclasses.replace(
            b,
            cg=turn @ b.cg,
            inertia=turn @ b.inertia @ turn.T,
            cg_std=None if b.cg_std is None else np.abs(turn) @ b.cg_std,
            coordinates=tuple(c for c in COORDINATES if c in {to[own] for own in b.coordinates}),
        )
        for name, b in vehicle.bodies.items()
    }
    return dataclasses.replace(
        vehicle,
        bodies=bodies,
        mounts={name: mount(m) for name, m in vehicle.mounts.items()},
        sensors={name: sensor(s) for name, s in vehicle.sensors.items()},
        force_references=tuple(dataclasses.replace(r, axis=to.get(r.axis, r.axis)) for r in vehicle.force_references),
    )


def turned_readings(vehicle: Vehicle, run: Recording, turn: np.ndarray) -> Recording:
    """Return what the sensors of the turned vehicle read: in a turn the same, in a mirror its image."""
    mirror = np.linalg.det(turn) < 0.0

    def values(s: Sensor, readings: np.ndarray) -> np.ndarray:
        if s.kind == "displacement":
            return readings * turn[:, AXES.index(s.axis)].sum()
        if not mirror or s.kind == "speed":
            return readings
        return np.hstack([readings[:, :3] @ _HANDED, -readings[:, 3:] @ _HANDED]) if s.channels == 6 else readings @ _HANDED

    return changed_channels(run, lambda c: dataclasses.replace(c, values=values(vehicle.sensors[c.name], c.values)))


def renamed_mounts(vehicle: Vehicle, new: Callable[[str], str]) -> Vehicle:
    """Return the vehicle with other names of its mounts, listed the other way round."""

    def reference(r: ForceReference) -> ForceReference:
        return dataclasses.replace(r, mount=new(r.mount) if r.mount else "")

    return dataclasses.replace(
        vehicle,
        mounts={new(n): dataclasses.replace(m, name=new(n)) for n, m in reversed(vehicle.mounts.items())},
        sensors={n: dataclasses.replace(s, mount=new(s.mount) if s.mount else "") for n, s in vehicle.sensors.items()},
        force_references=tuple(map(reference, vehicle.force_references)),
    )


def permuted_sensors(vehicle: Vehicle, seed: int) -> Vehicle:
    """Return the vehicle with its sensors in another order in the file."""
    names = np.random.default_rng(seed).permutation(list(vehicle.sensors))
    return dataclasses.replace(vehicle, sensors={str(n): vehicle.sensors[str(n)] for n in names})


def heavier(vehicle: Vehicle, factor: float) -> Vehicle:
    """Return the vehicle with mass, inertia, stiffness and damping times a factor: accelerations stay, forces grow by it."""

    def prior(p: Prior) -> Prior:
        std = None if p.std is None else factor * p.std
        return dataclasses.replace(p, value=factor * p.value, std=std, lower=factor * p.lower, upper=factor * p.upper)

    def mount(m: Mount) -> Mount:
        elements = {a: e.replace(stiffness=factor * e.stiffness, damping=factor * e.damping) for a, e in m.elements.items()}
        return dataclasses.replace(m, elements=elements, priors={key: prior(p) for key, p in m.priors.items()})

    return dataclasses.replace(
        vehicle,
        bodies={n: dataclasses.replace(b, mass=prior(b.mass), inertia=factor * b.inertia) for n, b in vehicle.bodies.items()},
        mounts={n: mount(m) for n, m in vehicle.mounts.items()},
    )


# -- recordings ----------------------------------------------------------------------------------------------------------------


def changed_channels(run: Recording, change: Callable[[Channel], Channel]) -> Recording:
    """Return the run with every channel changed."""
    return dataclasses.replace(run, channels={name: change(c) for name, c in run.channels.items()})


def shifted(run: Recording, by_ns: int) -> Recording:
    """Return the run at another time."""
    return changed_channels(run, lambda c: dataclasses.replace(c, stamp_ns=c.stamp_ns + by_ns, arrival_ns=c.arrival_ns + by_ns))


def half_a_tick_later(run: Recording) -> Recording:
    """Return the run whose every first sample comes half a period later, and the ticks of the time base with it."""

    def later(c: Channel) -> Channel:
        stamp, values = c.stamp_ns.copy(), c.values.copy()
        stamp[0] += (stamp[1] - stamp[0]) // 2
        values[0] = 0.5 * (values[0] + values[1])
        return dataclasses.replace(c, stamp_ns=stamp, values=values)

    return changed_channels(run, later)


def noisier(vehicle: Vehicle, run: Recording, share: float, seed: int = 0) -> Recording:
    """Return the run with noise whose standard deviation is larger by a share of what the vehicle file states."""
    rng = np.random.default_rng(seed)
    added = np.sqrt((1.0 + share) ** 2 - 1.0)

    def loud(c: Channel) -> Channel:
        s = vehicle.sensors[c.name]
        std = np.r_[np.full(min(3, s.channels), s.noise_std), np.full(max(0, s.channels - 3), s.gyro_noise_std)]
        return dataclasses.replace(c, values=c.values + added * std * rng.standard_normal(c.values.shape))

    return changed_channels(run, loud)


def between(run: Recording, from_ns: int, to_ns: int) -> Recording:
    """Return the samples with stamps in an interval."""

    return changed_channels(run, lambda c: c.picked((c.stamp_ns >= from_ns) & (c.stamp_ns < to_ns)))


# -- the relations ---------------------------------------------------------------------------------------------------------------


def _new_name(mount: str) -> str:
    """Return another name, which sorts in another order and says nothing about the place."""
    return f"point_{mount[::-1]}"


def shorter(run: Recording, share: float) -> Recording:
    """Return the run without the last share of its time."""
    first = min(int(c.stamp_ns[0]) for c in run.channels.values())
    last = max(int(c.stamp_ns[-1]) for c in run.channels.values())
    return between(run, first, last - round(share * (last - first)))


def resampled(run: Recording, rate_hz: float) -> Recording:
    """Return the run on another time base, as a logger that samples at another rate would have it."""
    found = align(run, rate_hz)
    stamps = found.start_ns + np.round(found.time_s * 1e9).astype(np.int64)
    channels = {
        name: Channel(name, stamps[found.valid[name]], values[found.valid[name]], stamps[found.valid[name]])
        for name, values in found.data.items()
    }
    return dataclasses.replace(run, channels=channels)


def perturbations(spare: str, seed: int = 0) -> tuple[Relation, ...]:
    """Return the changes after which an engineer would call a run the same run; ``spare`` is a sensor to do without, if any."""

    def without(vehicle: Vehicle) -> Vehicle:
        return dataclasses.replace(vehicle, sensors={name: s for name, s in vehicle.sensors.items() if name != spare})

    fewer = (Relation(f"without {spare}", False, without),) if spare else ()
    return (
        Relation("1 % more noise", False, recording=lambda v, r: noisier(v, r, 0.01, seed)),
        Relation("10 % shorter", False, recording=lambda v, r: shorter(r, 0.1)),
        *fewer,
        Relation("time base of 180 Hz", False, recording=lambda v, r: resampled(r, 180.0)),
    )


def relations(seed: int = 0) -> tuple[Relation, ...]:
    """Return all relations; ``seed`` draws the order of the sensors and the added noise."""
    return (
        Relation("stamps + 1 microsecond", True, recording=lambda v, r: shifted(r, MICROSECOND), shift_ns=MICROSECOND),
        Relation("stamps + 1 year", True, recording=lambda v, r: shifted(r, YEAR), shift_ns=YEAR),
        Relation("sensors permuted", True, lambda v: permuted_sensors(v, seed)),
        Relation("mounts renamed and permuted", True, lambda v: renamed_mounts(v, _new_name), mounts=_new_name),
        Relation(
            "left and right mirrored",
            True,
            lambda v: turned(v, MIRROR),
            lambda v, r: turned_readings(v, r, MIRROR),
            turn=MIRROR,
        ),
        Relation(
            "turned by 90 degrees",
            True,
            lambda v: turned(v, QUARTER_TURN),
            lambda v, r: turned_readings(v, r, QUARTER_TURN),
            turn=QUARTER_TURN,
        ),
        Relation("mass and mounts scaled", True, lambda v: heavier(v, MASS_FACTOR), scale=MASS_FACTOR),
        Relation("time base + half a tick", False, recording=lambda v, r: half_a_tick_later(r)),
        Relation("1 % more noise", False, recording=lambda v, r: noisier(v, r, 0.01, seed)),
    )
