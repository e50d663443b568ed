# Copyright 2026 ride_estimation contributors
"""Which added sensor or known mass would help most: the tool an engineer runs before instrumenting a truck."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from ride_estimation.errors import ConfigurationError
from ride_estimation.identification.fisher import Identifiability, judge
from ride_estimation.identification.sensitivities import AddedMass, Excitation, Sensitivities, parameter_names, sensitivities
from ride_estimation.sensors.layout import check_layout
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import linearise, undamped_modes, unheld_motions
from ride_estimation.vehicles.prior import INERTIA_STD
from ride_estimation.vehicles.vehicle import Body, ForceReference, Vehicle

_TRANSDUCER_NOISE = 2e-5  # m, a potentiometric or draw-wire transducer of 100 mm range
_LOAD_CELL_NOISE = 20.0  # N, 0.1 % of a 20 kN load cell
_ACCELEROMETER_NOISE = 0.02  # m/s^2
_GYRO_NOISE = 0.002  # rad/s
_WEIGHED = 0.01  # relative standard deviation of a mass on a truck scale
_ADDED_SHARE = 0.1  # added mass of the proposed second run over the mass of the body
#: relative standard deviation of a reference that states none; air springs carry their share of the weight within 3 %
_REFERENCE_STD = {"known_stiffness": 0.02, "load_cell": 0.01, "air_spring_pressure": 0.042}
#: a vehicle whose lowest mode is above this is not suspended [Hz]; earth-moving machines on tyres have 1 to 4 Hz
_STIFFEST_RIDE = 25.0
_MOST_SENSITIVITIES = 10_000  # channels times parameters; each takes about 0.1 MB
_RUN_SENSORS = ("accelerometer", "imu", "displacement")


@dataclasses.dataclass(frozen=True)
class Option:
    """One possible addition and what it brings.

    Attributes
    ----------
    name
        What is added.
    identifiable
        Parameters with a finite bound afterwards, those known by the addition included.
    median_relative_std
        Median bound over the parameters that are finite afterwards.
    gained
        Parameters that become identifiable by it.
    rank
        Rank of the information afterwards plus the parameters known by the addition: more of it than before means that more
        ratios or combinations are told.
    """

    name: str
    identifiable: int
    median_relative_std: float
    gained: tuple[str, ...]
    rank: int


@dataclasses.dataclass(frozen=True)
class SensorPlan:
    """What a vehicle file's sensors can tell.

    Attributes
    ----------
    present
        Judgement of the sensor set as it is.
    known
        Known beforehand -> relative standard deviation.
    ratio_to
        Mass whose ratios to everything else are told where the common scale is not, else empty.
    ratios
        Bounds on the ratios to ``ratio_to`` by parameter name; empty where the scale is told.
    layouts
        What the sensors on each body tell of its motion, in words.
    warnings
        What is wrong with the vehicle file for this purpose, in words.
    modes_hz
        (words, frequency) of the undamped modes.
    options
        Best first.
    """

    present: Identifiability
    known: Mapping[str, float]
    ratio_to: str
    ratios: Mapping[str, float]
    layouts: tuple[str, ...]
    warnings: tuple[str, ...]
    modes_hz: tuple[tuple[str, float], ...]
    options: tuple[Option, ...]


@dataclasses.dataclass(frozen=True)
class _Candidate:
    """An addition: sensors, parameters known by it, a run with a weight on it."""

    name: str
    sensors: tuple[Sensor, ...] = ()
    known: Mapping[str, float] = dataclasses.field(default_factory=dict)
    added: AddedMass | None = None


def known_parameters(vehicle: Vehicle) -> dict[str, float]:
    """Return the parameters the vehicle file anchors -> relative standard deviation (a known mass carries the inertia)."""
    names = parameter_names(vehicle)
    found: dict[str, float] = {}
    for r in vehicle.force_references:
        own = float(r.details.get("relative_std", _REFERENCE_STD.get(r.kind, 0.0)))
        if r.kind == "known_mass":
            found |= _weighed(vehicle.bodies[r.body], own)
        elif r.kind == "known_stiffness":
            found[f"{r.mount}.{r.axis}.stiffness"] = own
        elif r.kind == "air_spring_pressure":
            found.setdefault(f"{vehicle.mounts[r.mount].body}.mass", own)
    return {n: std for n, std in found.items() if n in names}


def _weighed(body: Body, stated: float = 0.0) -> dict[str, float]:
    own = stated or (body.mass.std or 0.0) / body.mass.value or _WEIGHED
    return {f"{body.name}.mass": own, f"{body.name}.inertia": body.inertia_relative_std or INERTIA_STD}


def plan(vehicle: Vehicle, excitation: Excitation, known: Mapping[str, float] | Sequence[str] | None = None) -> SensorPlan:
    """Judge the sensor set of a vehicle file and rank what could be added to it.

    Parameters
    ----------
    known
        Parameters known beforehand, exact or with their relative standard deviation; where None those the vehicle file
        declares, with its load cells and added masses.

    Raises
    ------
    ConfigurationError
        So many sensors and mounts that the answer would take minutes and gigabytes.
    """
    declared = known_parameters(vehicle) if known is None else _as_mapping(known)
    references = vehicle.force_references if known is None else ()
    cell_std = _REFERENCE_STD["load_cell"]
    cells = {r.sensor: float(r.details.get("relative_std", cell_std)) for r in references if r.kind == "load_cell"}
    sensors = [s for s in vehicle.sensors.values() if s.kind in _RUN_SENSORS or s.name in cells]
    candidates = _candidates(vehicle, sensors, declared)
    everything = [*sensors, *(s for c in candidates for s in c.sensors)]
    _check_size(vehicle, everything)
    runs = _declared_runs(vehicle, everything, excitation, references)
    gains = {f"{s.name}.gain": cells.get(s.name, cell_std) for s in everything if s.kind == "force"}
    names = [s.name for s in sensors]
    present = judge(runs, names, {**declared, **gains})
    loaded = {c.added.body: sensitivities(vehicle, everything, excitation, c.added) for c in candidates if c.added is not None}
    finite = set(_finite(present))
    options = []
    for c in candidates:
        more = [] if c.added is None else [loaded[c.added.body]]
        result = judge([*runs, *more], [*names, *(s.name for s in c.sensors)], {**declared, **gains, **c.known})
        now = _finite(result)
        values = [s for s in result.relative_std if math.isfinite(s)]
        median = float(np.median(values)) if values else math.inf
        gained = tuple(n for n in now if n not in finite)
        options.append(Option(c.name, len(now) + len(c.known), median, gained, result.rank + len(c.known)))
    ratio_to, ratios = _ratios(vehicle, runs, names, {**declared, **gains}, present)
    return SensorPlan(
        present, declared, ratio_to, ratios, _layouts(vehicle), _warnings(vehicle, cells),
        tuple((m.words, m.frequency_hz) for m in undamped_modes(linearise(assemble(vehicle)))),
        tuple(sorted(options, key=lambda o: (-o.identifiable, -o.rank, o.median_relative_std))),
    )  # fmt: skip


def additions(vehicle: Vehicle) -> dict[str, tuple[Sensor, ...]]:
    """Return the motion sensors that a plan proposes, by the words of its options."""
    sensors = [s for s in vehicle.sensors.values() if s.kind in _RUN_SENSORS]
    found = {c.name: c.sensors for c in _candidates(vehicle, sensors, known_parameters(vehicle))}
    return {name: new for name, new in found.items() if new and all(s.kind in _RUN_SENSORS for s in new)}


def _check_size(vehicle: Vehicle, everything: Sequence[Sensor]) -> None:
    """Refuse what would need more memory than a laptop has: every channel is differentiated by every parameter."""
    channels, parameters = sum(s.channels for s in everything), len(parameter_names(vehicle))
    if channels * parameters > _MOST_SENSITIVITIES:
        raise ConfigurationError(
            f"{len(vehicle.sensors)} sensors and what could be added have {channels} channels, {len(vehicle.mounts)} mounts with "
            f"their bodies {parameters} parameters: {channels * parameters} sensitivities; at most {_MOST_SENSITIVITIES} are "
            "computed. Leave out sensors that stand side by side, or plan with the mounts of one group as one"
        )


def _as_mapping(known: Mapping[str, float] | Sequence[str]) -> dict[str, float]:
    return dict(known) if isinstance(known, Mapping) else {n: 0.0 for n in known}


def _declared_runs(
    vehicle: Vehicle, sensors: Sequence[Sensor], excitation: Excitation, references: Sequence[ForceReference]
) -> list[Sensitivities]:
    """Return the run, split where the vehicle file adds a known mass during it."""
    if not sensors:
        return [sensitivities(vehicle, [_nowhere(vehicle)], excitation)]
    for r in references:
        begin = float(r.details.get("from_s", 0.0))
        if r.kind == "known_added_mass" and 0.0 < begin < excitation.duration_s:
            weight = AddedMass(r.body, float(r.details["mass"]), r.details.get("position"))
            end = min(float(r.details.get("to_s", excitation.duration_s)), excitation.duration_s)
            bare = dataclasses.replace(excitation, duration_s=excitation.duration_s - (end - begin))
            with_it = dataclasses.replace(excitation, duration_s=end - begin)
            return [sensitivities(vehicle, sensors, bare), sensitivities(vehicle, sensors, with_it, weight)]
    return [sensitivities(vehicle, sensors, excitation)]


def _nowhere(vehicle: Vehicle) -> Sensor:
    """Return a sensor nobody selects, for a vehicle to which nothing at all can be added."""
    return Sensor("none", "accelerometer", "", next(iter(vehicle.bodies)))


def _ratios(
    vehicle: Vehicle, runs: Sequence[Sensitivities], sensors: Sequence[str], known: Mapping[str, float], present: Identifiability
) -> tuple[str, dict[str, float]]:
    """Return the mass that everything else is told against, with the bounds of the ratios, where only the scale is lost."""
    for body in sorted(vehicle.bodies.values(), key=lambda b: -b.mass.value):
        name = f"{body.name}.mass"
        if name in known or math.isfinite(dict(zip(present.names, present.relative_std))[name]):
            continue
        result = judge(runs, sensors, {**known, name: 0.0})
        bounds = {n: float(s) for n, s in zip(result.names, result.relative_std) if math.isfinite(s)}
        lost = {n for n, s in zip(present.names, present.relative_std) if not math.isfinite(s)}
        if lost & set(bounds):
            return name, bounds
    return "", {}


def _layouts(vehicle: Vehicle) -> tuple[str, ...]:
    words = []
    for body in vehicle.bodies.values():
        on_it = [s for s in vehicle.sensors.values() if s.body == body.name]
        check = check_layout(on_it, body.cg, body.coordinates)
        words.append(check.sentence(body.name))
    bases = [m for m in vehicle.mounts.values() if m.base not in vehicle.bodies]
    heard = {s.mount for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu") and s.body not in vehicle.bodies}
    silent = [m.name for m in bases if m.name not in heard]
    if bases:
        text = f"{len(bases) - len(silent)} of {len(bases)} mount bases have an accelerometer"
        words.append(text + (f"; none at {', '.join(silent)}" if silent else ""))
    return tuple(words)


def _warnings(vehicle: Vehicle, cells: Mapping[str, float]) -> tuple[str, ...]:
    words = [f"the vehicle as described does not stand: {motion}" for motion in unheld_motions(assemble(vehicle))]
    lowest = min(m.frequency_hz for m in undamped_modes(linearise(assemble(vehicle))))
    if lowest > _STIFFEST_RIDE:
        words.append(
            f"no mode lies below {_STIFFEST_RIDE:g} Hz, the lowest is at {lowest:.3g} Hz: nothing is suspended like this; "
            "check the units of stiffness and mass"
        )
    words += _refused(vehicle)
    mounts = list(vehicle.mounts.values())
    for i, first in enumerate(mounts):
        same = [
            m.name for m in mounts[i + 1 :]
            if (m.body, m.base) == (first.body, first.base) and np.linalg.norm(m.position - first.position) < 1e-3
            and set(m.elements) & set(first.elements)
        ]  # fmt: skip
        if same:
            words.append(f"{first.name} and {', '.join(same)} sit at one place: only the sum of their forces is observable")
            break
    words += [
        f"{s.name} is no force reference of the vehicle file: it is left out here (add load_cell to force_references to use it)"
        for s in vehicle.sensors.values() if s.kind == "force" and s.name not in cells
    ]  # fmt: skip
    return tuple(words)


def _refused(vehicle: Vehicle) -> list[str]:
    """Say where the estimator cannot work although the parameters could be told in principle."""
    places = [s.body for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu")]
    counts = {b: places.count(b) for b in vehicle.bodies}
    if not any(counts.values()):
        return ["no accelerometer sits on a body: replay and the live node have nothing to estimate from"]
    name = "cab" if counts.get("cab") else max(counts, key=lambda b: counts[b])
    body = vehicle.bodies[name]
    check = check_layout([s for s in vehicle.sensors.values() if s.body == name], body.cg, body.coordinates)
    return [] if check.complete else [f"replay and the live node refuse this layout of {name}"]


def _finite(result: Identifiability) -> list[str]:
    return [n for n, s in zip(result.names, result.relative_std) if math.isfinite(s)]


def _candidates(vehicle: Vehicle, sensors: Sequence[Sensor], known: Mapping[str, float]) -> list[_Candidate]:
    on_bodies = _body_accelerometers(vehicle)
    at_bases = _base_accelerometers(vehicle)
    found = []
    if on_bodies:
        bodies = list(dict.fromkeys(s.body for s in on_bodies))
        found.append(_Candidate(f"accelerometers with gyro on {', '.join(bodies)}", on_bodies))
    if at_bases:
        found.append(_Candidate(f"accelerometers at the bases of {_listed([s.mount for s in at_bases])}", at_bases))
    if on_bodies and at_bases:
        found.append(_Candidate("both: accelerometers on the bodies and at the mount bases", _renamed(on_bodies + at_bases)))
    found += _force_and_travel(vehicle, sensors)
    names = parameter_names(vehicle)
    for body in vehicle.bodies.values():
        if f"{body.name}.mass" in known:
            continue
        told = {n: std for n, std in _weighed(body).items() if n in names and n not in known}
        what = " and ".join(n.rpartition(".")[2] for n in told)
        found.append(_Candidate(f"{what} of {body.name} known (weigh it)", known=told))
        weight = float(f"{_ADDED_SHARE * body.mass.value:.1g}")
        found.append(_Candidate(f"a second run with {weight:g} kg fastened to {body.name}", added=AddedMass(body.name, weight)))
    return found


def _body_accelerometers(vehicle: Vehicle) -> tuple[Sensor, ...]:
    """Return one IMU at the CG of every body whose motion the sensors do not determine."""
    found = []
    for body in vehicle.bodies.values():
        on_it = [s for s in vehicle.sensors.values() if s.body == body.name]
        if not check_layout(on_it, body.cg, body.coordinates).complete:
            found.append(Sensor(
                f"new_{body.name}", "imu", "", body.name, position=body.cg, noise_std=_ACCELEROMETER_NOISE,
                gyro_noise_std=_GYRO_NOISE,
            ))  # fmt: skip
    return tuple(found)


def _base_accelerometers(vehicle: Vehicle) -> tuple[Sensor, ...]:
    have = {s.mount for s in vehicle.sensors.values() if s.mount and s.kind in ("accelerometer", "imu")}
    return tuple(
        Sensor(f"new_base_{m.name}", "accelerometer", "", m.base, m.name, position=m.position, noise_std=_ACCELEROMETER_NOISE)
        for m in vehicle.mounts.values() if m.base not in vehicle.bodies and m.name not in have
    )  # fmt: skip


def _renamed(sensors: Sequence[Sensor]) -> tuple[Sensor, ...]:
    return tuple(dataclasses.replace(s, name=f"{s.name}_too") for s in sensors)


def _force_and_travel(vehicle: Vehicle, sensors: Sequence[Sensor]) -> list[_Candidate]:
    """Return displacement transducers per axis and a load cell per mount, as far as they are not there."""
    travelled = {(s.mount, s.axis) for s in sensors if s.kind == "displacement"}
    weighed = {s.mount for s in sensors if s.kind == "force"}
    found = []
    for axis in ("x", "y", "z"):
        new = tuple(
            Sensor(f"new_{m.name}_{axis}", "displacement", "", m.body, m.name, axis, noise_std=_TRANSDUCER_NOISE)
            for m in vehicle.mounts.values() if axis in m.elements and (m.name, axis) not in travelled
        )  # fmt: skip
        if new:
            found.append(_Candidate(f"displacement transducers along {axis} at {_listed([s.mount for s in new])}", new))
    for m in vehicle.mounts.values():
        if m.name not in weighed:
            cell = Sensor(f"new_force_{m.name}", "force", "", m.body, m.name, noise_std=_LOAD_CELL_NOISE)
            found.append(_Candidate(f"load cell at {m.name}", (cell,)))
    return found


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) < 4 else f"{len(names)} mounts"
