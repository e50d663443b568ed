# Copyright 2026 ride_estimation contributors
"""A run with displacement transducers at the mounts and no accelerometer on their bases, as a run that can be tested.

A transducer shows the deflection of its mount, and a law says which force that asks for: no base motion is needed. What the
vertical forces do to the body follows from its accelerometers once the sideways forces are known. Those are not measured, but in
body axes their sums are: ``sum F_x = m f_x``, ``sum F_y = m f_y`` and the moment about z (f: specific force, dc accelerometers,
so that no tilt has to be known). What they do to heave, roll and pitch is taken away, and

    ``m f_z = -sum F_i``,  ``I (roll, pitch) = -sum r_i x F_i e_z``,  ``F_i = law_i(measured deflection of mount i)``

remains, exact for mounts at one height; at several heights the sums are shared by the stiffness of the vehicle file.

The chain that tests a vehicle takes this as a body so heavy that its motion changes no deflection, on bases that move by minus
the deflections: mass and inertia are ``HEAVY`` times those of the body, accelerations and gravity that much smaller. Forces,
strokes and parameters of laws keep their size; masses are divided by it in the answer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.adapters.travel_kinematics import BodyMaps, without_second_order
from ride_estimation.diagnosis.answer.result import Diagnosis, Evidence, NamedCause
from ride_estimation.diagnosis.answer.verdict import describe
from ride_estimation.diagnosis.common.extension import linear_part
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import FrequencyGrid, edge_taper, make_grid
from ride_estimation.diagnosis.diagnose import diagnose, insufficient
from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.noise import smoothed_power
from ride_estimation.errors import InputDataError
from ride_estimation.frames import COORDINATES, point_motion_matrix
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

HEAVY = 1.0e6  # body over its real mass: deflections change by less than 1e-4 of themselves from 0.4 Hz on

#: what vertical deflections and vertical accelerations can tell
CAUSES = (
    "coulomb_friction", "viscoelasticity", "stiffness_nonlinearity", "damping_nonlinearity", "bump_stop", "backlash",
    "parameter_drift", "mass_change", "one_soft_mount", "sensor_delay", "harmonic_disturbance",
)  # fmt: skip
REMARK = (
    "judged on heave, roll and pitch against the measured vertical deflections: lateral forces are taken from the lateral "
    "motion of the body; lateral mounts, a wrong gain, place or angle of a sensor, the CG and the body itself are not tested; "
    "the gain of a transducer is in the stiffness of its mount, and a CG that is off along x or y in how the mounts share it, by "
    "about the share of the error in their distance. Accelerometers at the mount bases would show all of that"
)

_ACCELERATION_KINDS = ("accelerometer", "imu")
_VERTICAL = ("z", "roll", "pitch")
_SIDEWAYS = ("x", "y", "yaw")
#: relative error of a right model here: how far a bracket tilts with the frame is not seen, and a third of the vertical force
#: sideways, turned by three hundredths of a radian that nobody measured, is a hundredth of it
_ADEQUACY = 0.01
_FADE_S = 1.0  # fading of both ends, and rest beyond them [s]: see diagnosis.bench
_SAME_HEIGHT = 0.02  # m, of mounts whose sideways forces need no sharing out
_MISSED = 0.1  # share of the wrench that springs and dampers may miss while the height of the CG is looked for
_SMOOTHED_HZ = 0.5  # width over which the spectrum of a deflection is averaged for its filter [Hz]
_BENT = 0.3  # share of the force of a mount that such laws may have
_WEAK = 1e-6  # of the largest singular value: a motion that the accelerometers do not show


@dataclasses.dataclass(frozen=True)
class _Balance:
    """Maps of one body: C coordinates, V of them vertical, channels are all components of its accelerometers.

    Attributes
    ----------
    sensors, transducers
        Accelerometers of the body; transducers in the order of ``mounts``.
    vertical
        Readings (3 per accelerometer) -> vertical acceleration at each accelerometer without what sideways forces do, (S, 3 S).
    wrench
        Readings -> vertical force and roll and pitch moment that the vertical mount forces must have, (V, 3 S).
    lever
        Tension of the vertical mounts -> minus these, (V, M).
    inertia
        Mass matrix of the vertical coordinates, the others free, (V, V).
    heights
        Difference of height among the mounts that carry sideways forces [m].
    maps
        What terms of second order need.
    """

    body: Body
    coordinates: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    mounts: tuple[Mount, ...]
    transducers: tuple[Sensor, ...]
    vertical: Array
    wrench: Array
    lever: Array
    inertia: Array
    heights: float
    maps: BodyMaps


def needs_travel(vehicle: Vehicle, run: UniformRun) -> bool:
    """Return whether deflections must stand in for base motion: no base accelerometer spoke, or too few for all mounts."""
    spoke = _spoke(vehicle, run)
    if not any(s.kind == "displacement" for s in spoke):
        return False
    if not any(s.kind in _ACCELERATION_KINDS and s.body not in vehicle.bodies for s in spoke):
        return True
    try:
        build_plant(vehicle, {s.name: 3 for s in spoke})
    except InputDataError:
        try:
            _balance(vehicle, run)
        except InputDataError:
            return False
        return True
    return False


def require_travel(vehicle: Vehicle, run: UniformRun) -> None:
    """Refuse a vehicle or a run in which deflections cannot stand in for base motion.

    Raises
    ------
    InputDataError
        What is missing, and what to add.
    """
    _balance(vehicle, run)


def diagnose_travel(
    vehicle: Vehicle,
    run: UniformRun,
    validation: Sequence[UniformRun] = (),
    settings: Settings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Diagnosis:
    """Diagnose a run whose deflections were measured instead of the motion of the mount bases.

    Parameters
    ----------
    vehicle, run, validation, settings, progress
        As in :func:`diagnose.diagnose`.

    Returns
    -------
    Diagnosis
        ``insufficient_data`` with what is missing where the deflections do not determine the vertical forces.
    """
    settings = settings or Settings()
    settings = dataclasses.replace(settings, adequacy=max(settings.adequacy, _ADEQUACY))
    duration = run.samples / run.rate_hz
    try:
        if duration < settings.minimum_duration_s:  # the rest at both ends that is added below is not in the run
            raise InputDataError(
                f"the run {run.name} lasts {duration:.1f} s; at least {settings.minimum_duration_s:g} s are needed"
            )
        balance = _balance(vehicle, run)
    except InputDataError as error:
        return insufficient(vehicle, str(error))
    shift = _cg_height(balance, vehicle, run, settings)
    balance = _balance(vehicle, run, shift)
    noise = _transducer_noise(vehicle, balance, run, settings)
    stand_in = _stand_in(vehicle, balance, noise)
    others, skipped = [], []
    for other in validation:
        missing = [s.name for s in (*balance.sensors, *balance.transducers) if s.name not in other.data]
        if missing:
            skipped.append(f"validation run {other.name}: sensor {', '.join(missing)} is missing; not used")
        else:
            others.append(_as_base_motion(vehicle, balance, noise, other, settings))
    fitted = _as_base_motion(vehicle, balance, noise, run, settings)
    answer = diagnose(stand_in, fitted, others, settings, progress, CAUSES)
    return _in_real_units(vehicle, stand_in, balance, answer, tuple(skipped), shift)


def _spoke(vehicle: Vehicle, run: UniformRun) -> list[Sensor]:
    return [s for n, s in vehicle.sensors.items() if n in run.data and np.mean(run.valid[n]) > 0.5]


def _balance(vehicle: Vehicle, run: UniformRun, raised: float = 0.0) -> _Balance:
    """Return the maps of the one body that deflections and accelerations determine.

    Parameters
    ----------
    raised
        How much higher its CG lies than the file says [m].

    Raises
    ------
    InputDataError
        What is missing, and what to add.
    """
    spoke = _spoke(vehicle, run)
    instead = "or accelerometers at the mount bases"
    carrying = {vehicle.mounts[s.mount].body for s in spoke if s.kind == "displacement" and s.mount in vehicle.mounts}
    candidates = [b for b in carrying if any(s.kind in _ACCELERATION_KINDS and s.body == b for s in spoke)]
    if len(candidates) != 1:
        raise InputDataError(
            "no base motion was measured, and the vertical deflections of the mounts stand in for it only where one body has "
            f"both accelerometers and transducers at its mounts; {', '.join(candidates) or 'no body'} has: add them, {instead}"
        )
    body = vehicle.bodies[candidates[0]]
    body = dataclasses.replace(body, cg=np.asarray(body.cg) + np.array([0.0, 0.0, raised]))
    mounts = tuple(m for m in vehicle.mounts.values() if m.body == body.name)
    on_it = sorted({m.body for m in vehicle.mounts.values() if m.base == body.name})
    if on_it:
        raise InputDataError(
            f"no base motion was measured, and {', '.join(on_it)} on {body.name} reacts on it with a force that no transducer "
            f"shows: the balance of {body.name} cannot be closed; accelerometers at the mount bases are needed"
        )
    upright = tuple(m for m in mounts if "z" in m.elements)
    by_mount = {s.mount: s for s in spoke if s.kind == "displacement" and s.axis == "z"}
    bare = [m.name for m in upright if m.name not in by_mount]
    if bare or not upright:
        raise InputDataError(
            f"no base motion was measured, and the vertical force of {', '.join(bare) or 'the mounts'} follows from no measured "
            f"deflection: the frame twists, the others do not show it; add a vertical displacement transducer there, {instead}"
        )
    sensors = tuple(s for s in spoke if s.kind in _ACCELERATION_KINDS and s.body == body.name)
    single = [s.name for s in sensors if not s.triaxial]
    if single:
        raise InputDataError(
            f"no base motion was measured, and without it the accelerometers of {body.name} must measure all three axes; "
            f"{', '.join(single)} {'does' if len(single) == 1 else 'do'} not"
        )
    return _maps(body, mounts, upright, tuple(by_mount[m.name] for m in upright), sensors, instead)


def _maps(
    body: Body, mounts: tuple[Mount, ...], upright: tuple[Mount, ...], transducers: tuple[Sensor, ...],
    sensors: tuple[Sensor, ...], instead: str,
) -> _Balance:
    """Return the maps between readings, wrenches and mount forces."""
    free = [COORDINATES.index(c) for c in COORDINATES if c in body.coordinates]
    rows = np.vstack([s.rotation.T @ point_motion_matrix(s.position - body.cg) for s in sensors])[:, free]
    noise = np.repeat([s.noise_std for s in sensors], 3)
    scaled = rows / noise[:, None]
    values, directions = np.linalg.svd(scaled / np.maximum(np.linalg.norm(scaled, axis=0), 1e-300))[1:]
    if len(values) < len(free) or values[-1] < _WEAK * values[0]:
        lost = COORDINATES[free[int(np.argmax(np.abs(directions[-1])))]]
        raise InputDataError(
            f"no base motion was measured, and the accelerometers of {body.name} do not show its {lost}: lateral and vertical "
            f"forces of the mounts cannot be distinguished; add an accelerometer away from the line of the others, {instead}"
        )
    motion = np.linalg.pinv(scaled) / noise[None, :]
    full = np.zeros((6, 6))
    full[:3, :3], full[3:, 3:] = body.mass.value * np.eye(3), body.inertia
    mass = full[np.ix_(free, free)]
    flat = [i for i, c in enumerate(free) if COORDINATES[c] in _SIDEWAYS]
    vertical = [i for i, c in enumerate(free) if COORDINATES[c] in _VERTICAL]
    sideways, share, along, lift = _sideways_maps(body, mounts, free, flat)
    # wrench of the sideways forces from the wrench the motion asks for, and what it does to the body
    taken = sideways @ share @ mass[flat] @ motion
    change = np.linalg.solve(mass, taken)
    at = np.vstack([point_motion_matrix(s.position - body.cg)[2] for s in sensors])[:, free]
    upward = np.zeros((len(sensors), 3 * len(sensors)))
    for i, s in enumerate(sensors):
        upward[i, 3 * i : 3 * i + 3] = s.rotation[2]
    lever = np.stack([point_motion_matrix(m.position - body.cg)[2] for m in upright], axis=1)[free][vertical]
    heights = [m.position[2] for m in mounts if {"x", "y"} & set(m.elements)]
    maps = BodyMaps(
        tuple(free), rows, motion, mass, np.asarray(body.inertia), np.array([s.rotation for s in sensors]),
        np.array([s.position - body.cg for s in sensors]), share @ mass[flat] @ motion, along, lift,
        np.array([m.position[:2] - body.cg[:2] for m in upright]),
    )
    return _Balance(
        body, tuple(COORDINATES[free[i]] for i in vertical), sensors, upright, transducers, upward - at @ change,
        (mass @ motion - taken)[vertical], lever,
        np.linalg.inv(np.linalg.inv(mass)[np.ix_(vertical, vertical)]), float(np.ptp(heights)) if heights else 0.0,
        maps,
    )  # fmt: skip


def _sideways_maps(
    body: Body, mounts: tuple[Mount, ...], free: list[int], flat: list[int]
) -> tuple[Array, Array, NDArray[np.int64], Array]:
    """Return how the U sideways mount forces act on the coordinates (C, U), their share in the sideways wrench (U, C'), their
    axes (U,) and how vertical forces at the same mounts act (C, U).
    """
    found = [(m, axis) for m in mounts for axis in ("x", "y") if axis in m.elements]
    if not found or not flat:
        return np.zeros((len(free), 1)), np.zeros((1, len(flat))), np.zeros(1, dtype=np.int64), np.zeros((len(free), 1))
    along = np.array([COORDINATES.index(axis) for _, axis in found])
    points = np.array([point_motion_matrix(m.position - body.cg)[:, free] for m, _ in found])
    forces = points[np.arange(len(found)), along].T
    weights = np.array([max(linear_part(m.elements[axis])[0], 1e-9) for m, axis in found])
    stiff = weights[:, None] * forces[flat].T
    return forces, stiff @ np.linalg.pinv(forces[flat] @ stiff), along, points[:, 2].T


def _readings(
    vehicle: Vehicle, balance: _Balance, run: UniformRun, settings: Settings
) -> tuple[Array, Array, BoolArray]:
    """Return accelerations without terms of second order (N, 3 S), deflections (N, M), and where all are valid.

    Corrections are applied and gaps bridged.
    """
    used = (*balance.sensors, *balance.transducers)
    run = corrected_run(run, {s.name: vehicle.sensors[s.name].correction for s in used})
    valid = np.ones(run.samples, dtype=bool)
    columns: dict[str, Array] = {}
    for s in used:
        data = np.asarray(run.data[s.name], dtype=float)[:, : 1 if s.kind == "displacement" else 3]
        good = run.valid[s.name] & np.isfinite(data).all(axis=1)
        index = np.arange(len(data))
        columns[s.name] = np.stack([np.interp(index, index[good], c[good]) for c in data.T], axis=1)
        valid &= good
    readings, deflection = (np.hstack([columns[s.name] for s in group]) for group in (balance.sensors, balance.transducers))
    return without_second_order(balance.maps, readings, deflection, run.rate_hz, settings.band_hz), deflection, valid


def _in_band(values: Array, rate_hz: float, settings: Settings) -> tuple[Array, FrequencyGrid]:
    """Return signals without their means, their ends faded into a margin of rest, (N + margin, q), and their frequency grid."""
    fade, rest = edge_taper(len(values), rate_hz, _FADE_S), round(_FADE_S * rate_hz)
    padded = np.pad((values - values.mean(axis=0)) * fade[:, None], ((rest, rest), (0, 0)))
    return padded, make_grid(len(padded), rate_hz, settings.band_hz)


def _cg_height(balance: _Balance, vehicle: Vehicle, run: UniformRun, settings: Settings) -> float:
    """Return how much higher the CG lies than the file says, as far as the run tells [m].

    Sideways forces act on roll and pitch by the height of the CG over the mounts, which is rarely known to a centimetre: least
    squares of the balance on it and on stiffness and damping of every mount, each with the tolerance of the file, and on forces
    that a hidden law may have, which would be taken for a lever otherwise.
    """
    tolerance = settings.tolerances.of_cg(balance.body)[2]
    readings, deflection, valid = _readings(vehicle, balance, run, settings)
    step = 0.1 * tolerance
    by_height = (_balance(vehicle, run, step).wrench - _balance(vehicle, run, -step).wrench) / (2.0 * step)
    if not np.any(by_height) or np.count_nonzero(valid) < 2:
        return 0.0
    signals, grid = _in_band(np.hstack([readings, deflection]) * valid[:, None], run.rate_hz, settings)
    spectrum = grid.spectrum(signals) * grid.band_weight[:, None]
    y, d = spectrum[:, : readings.shape[1]], spectrum[:, readings.shape[1] :]
    iw = 1j * grid.omega
    columns = [y @ by_height.T]
    scale = [tolerance]
    measured = y @ balance.wrench.T
    for j, mount in enumerate(balance.mounts):
        k, c = linear_part(mount.elements["z"])
        x, v = grid.signal(d[:, j]), grid.signal(iw * d[:, j])
        for motion, spread in (
            (k * d[:, j], settings.tolerances.stiffness), (c * iw * d[:, j], settings.tolerances.damping)
        ):
            columns.append(np.outer(motion, balance.lever[:, j]))
            scale.append(spread)
            measured = measured + columns[-1]
        force = float(np.hypot(k * np.std(x), c * np.std(v)))
        for shape in _bent(x, v):
            columns.append(np.outer(grid.spectrum(force * shape) * grid.band_weight, balance.lever[:, j]))
            scale.append(_BENT)
    size = np.sqrt(np.mean(np.abs(y @ balance.wrench.T) ** 2, axis=0)) + 1e-300
    flat = [np.concatenate([np.real(c / size).ravel(), np.imag(c / size).ravel()]) for c in (*columns, measured)]
    a, b = np.stack(flat[:-1], axis=1) * np.array(scale), flat[-1]
    prior = _MISSED * np.eye(len(scale))
    found = np.linalg.lstsq(np.vstack([a, prior]), -np.concatenate([b, np.zeros(len(scale))]), rcond=None)[0]
    return float(np.clip(found[0], -3.0, 3.0) * tolerance)


def _bent(deflection: Array, rate: Array) -> tuple[Array, ...]:
    """Return what forces of laws look like that are no spring and no dashpot, of unit size: friction, curved springs, damper."""
    x, v = deflection / max(float(np.std(deflection)), 1e-300), rate / max(float(np.std(rate)), 1e-300)
    return np.tanh(10.0 * v), x * np.abs(x), x**3, v * np.abs(v)


def _transducer_noise(vehicle: Vehicle, balance: _Balance, run: UniformRun, settings: Settings) -> Array:
    """Return the noise of every transducer [m]: as stated, or what the upper third of the band holds, the larger one."""
    _, deflection, valid = _readings(vehicle, balance, run, settings)
    travel, grid = _in_band(deflection * valid[:, None], run.rate_hz, settings)
    power = smoothed_power(grid.spectrum(travel), len(travel), 1)
    upper = (grid.frequency > 0.67 * grid.upper_hz) & (grid.frequency < grid.upper_hz)
    # the power of a complex Gaussian bin is exponential: median = ln 2 x mean
    measured = np.median(power[upper], axis=0) / np.log(2.0)
    return np.asarray(np.maximum(np.sqrt(measured), [s.noise_std for s in balance.transducers]))


def _stand_in(vehicle: Vehicle, balance: _Balance, travel_noise: Array) -> Vehicle:
    """Return the heavy body on bases that move by minus the deflections."""
    body = balance.body
    six = np.eye(3)
    for i, a in enumerate(balance.coordinates):
        for j, b in enumerate(balance.coordinates):
            if a != "z" and b != "z":
                six[COORDINATES.index(a) - 3, COORDINATES.index(b) - 3] = balance.inertia[i, j]
    heavy = dataclasses.replace(
        body, mass=Prior(HEAVY * body.mass.value), inertia=HEAVY * six, coordinates=balance.coordinates
    )

    def level(position: Array) -> Array:
        return np.array([position[0], position[1], body.cg[2]])

    noise = np.sqrt(np.sum((balance.vertical * np.repeat([s.noise_std for s in balance.sensors], 3)) ** 2, axis=1))
    sensors = {
        s.name: Sensor(s.name, "accelerometer", "", body.name, position=level(s.position), noise_std=n / HEAVY, coupling="ac")
        for s, n in zip(balance.sensors, noise.tolist())
    }
    mounts = {}
    for m, s, std in zip(balance.mounts, balance.transducers, travel_noise.tolist()):
        base = f"base of {m.name}"
        sensors[s.name] = Sensor(
            s.name, "accelerometer", "", base, mount=m.name, position=level(m.position), noise_std=std, coupling="ac",
            noise_slope=2,
        )
        priors = {key: prior for key, prior in m.priors.items() if key[0] == "z"}
        mounts[m.name] = dataclasses.replace(
            m, position=level(m.position), base=base, elements={"z": m.elements["z"]}, priors=priors
        )
    return Vehicle(vehicle.name, {body.name: heavy}, mounts, sensors, gravity=vehicle.gravity / HEAVY)


def _as_base_motion(
    vehicle: Vehicle, balance: _Balance, travel_noise: Array, run: UniformRun, settings: Settings
) -> UniformRun:
    """Return the run of the heavy body: vertical accelerations over ``HEAVY``, base accelerations minus the deflections'.

    Deflections pass a Wiener filter (gain signal over signal and noise): what it leaves of the noise is not correlated with what
    it passes, so that noise in the regressors bends no stiffness, damping or delay.
    """
    readings, deflection, valid = _readings(vehicle, balance, run, settings)
    upward, _ = _in_band(readings @ balance.vertical.T / HEAVY, run.rate_hz, settings)
    travel, grid = _in_band(deflection, run.rate_hz, settings)
    spectrum = grid.spectrum(travel)
    width = max(3, round(_SMOOTHED_HZ * grid.padded / grid.rate_hz))
    power = np.maximum(smoothed_power(spectrum, len(travel), width), 1e-300)
    gain = np.clip(1.0 - travel_noise**2 / power, 0.0, 1.0)
    base = grid.signal((grid.omega**2)[:, None] * gain * spectrum)
    rest = round(_FADE_S * run.rate_hz)
    everywhere = np.pad(valid, rest, constant_values=True)
    data: dict[str, Array] = {}
    for names, values in ((balance.sensors, upward), (balance.transducers, base)):
        for s, column in zip(names, values.T):
            data[s.name] = np.stack([np.zeros_like(column), np.zeros_like(column), column], axis=1)
    return UniformRun(run.name, run.rate_hz, run.start_ns, data, {name: everywhere for name in data})


def _in_real_units(
    vehicle: Vehicle, stand_in: Vehicle, balance: _Balance, answer: Diagnosis, skipped: tuple[str, ...], shift: float
) -> Diagnosis:
    """Return the answer for the vehicle itself."""
    causes = tuple(_light(c) for c in answer.causes)
    sentence = answer.sentence
    if causes != answer.causes:
        remaining = float(answer.residual.get("remaining_share", 0.0))
        old, new = (describe(answer.verdict, c, answer.gain, remaining) for c in (answer.causes, causes))
        sentence = sentence.replace(old, new)
    remarks, warnings = [*answer.remarks, REMARK], [*answer.warnings, *skipped]
    if abs(shift) > 1e-3:
        remarks.append(
            f"the CG of {balance.body.name} is taken {1000 * shift:+.0f} mm above its place, where roll and pitch fit best: an "
            "allowance for its tolerance, no finding"
        )
    if balance.heights > _SAME_HEIGHT:
        warnings.append(
            f"the mounts are not at one height ({1000 * balance.heights:.0f} mm apart): the effect of lateral forces on roll and "
            "pitch relies on the lateral stiffnesses of the vehicle file"
        )
    blind = [s.name for s in balance.sensors if s.coupling != "dc"]
    if blind:
        warnings.append(f"{', '.join(blind)}: ac-coupled; lateral forces exclude the gravity component of tilt")
    evidence = None if answer.evidence is None else _light_evidence(answer.evidence)
    return dataclasses.replace(
        answer, sentence=sentence, causes=causes, remarks=tuple(remarks), warnings=tuple(warnings), evidence=evidence,
        extended=_extended(vehicle, stand_in, balance, answer.extended),
    )  # fmt: skip


def _light(cause: NamedCause) -> NamedCause:
    """Return a cause with masses of the real body and instants of the real run."""
    scale, shift = {"kg": HEAVY}, {"instant": _FADE_S}
    parameters = tuple(
        Reported(p.name, (p.value - shift.get(p.name, 0.0)) / scale.get(p.unit, 1.0), p.std / scale.get(p.unit, 1.0), p.unit)
        for p in cause.parameters
    )
    return cause if parameters == cause.parameters else dataclasses.replace(cause, parameters=parameters)


def _light_evidence(evidence: Evidence) -> Evidence:
    """Return the evidence with accelerations of the real body and times of the real run."""
    power = (evidence.residual_power, evidence.extended_power, evidence.noise_power)
    residual, extended, noise = (HEAVY**2 * p for p in power)
    stretch = {name: (t - _FADE_S, HEAVY * a, HEAVY * b, HEAVY * c) for name, (t, a, b, c) in evidence.stretch.items()}
    return dataclasses.replace(
        evidence, residual_power=residual, extended_power=extended, noise_power=noise, stretch=stretch,
        block_time_s=evidence.block_time_s - _FADE_S,
    )  # fmt: skip


def _extended(vehicle: Vehicle, stand_in: Vehicle, balance: _Balance, found: Vehicle) -> Vehicle:
    """Return the vehicle with the vertical laws, the delays and the mass that were found."""
    out = vehicle.replace_elements({(m, "z"): mount.elements["z"] for m, mount in found.mounts.items()})
    before, after = stand_in.bodies[balance.body.name], found.bodies[balance.body.name]
    body = vehicle.bodies[balance.body.name]
    added, moved = (after.mass.value - before.mass.value) / HEAVY, np.asarray(after.cg) - np.asarray(before.cg)
    if added or np.any(moved):
        mass = dataclasses.replace(body.mass, value=body.mass.value + added)
        out = dataclasses.replace(
            out, bodies={**out.bodies, body.name: dataclasses.replace(body, mass=mass, cg=np.asarray(body.cg) + moved)}
        )
    sensors = dict(out.sensors)
    for name, sensor in found.sensors.items():
        delay = sensor.correction.delay - stand_in.sensors[name].correction.delay
        if delay:
            old = sensors[name].correction
            sensors[name] = dataclasses.replace(sensors[name], correction=dataclasses.replace(old, delay=old.delay + delay))
    return dataclasses.replace(out, sensors=sensors)
