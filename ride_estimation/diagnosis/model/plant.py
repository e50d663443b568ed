# Copyright 2026 ride_estimation contributors
"""The part of a vehicle that a run can test: measured base motion in, measured body motion out, force ports between.

Small rotations about the static position; what the small rotations leave out is in :mod:`kinematics`.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from ride_estimation.diagnosis.common.extension import linear_part
from ride_estimation.diagnosis.model.bracket_tilts import BracketTilt, bracket_tilts
from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix, skew
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.assembly import gravity_terms
from ride_estimation.vehicles.guided import Coordinates, body_rows, mass_matrix, point_rows
from ride_estimation.vehicles.prior import DAMPING_LOG_STD, STIFFNESS_LOG_STD, log_std
from ride_estimation.vehicles.vehicle import Mount, Vehicle

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_ACCELERATION_KINDS = ("accelerometer", "imu")
#: axes of the readings of an IMU, in the order of its columns; an accelerometer has the first three
CHANNELS = (*AXES, "rate_x", "rate_y", "rate_z")
_REACHED = 1e-8  # share of the largest output of a motion below which it is rounding
_NEAR = 0.1  # distance over which the slope of a base does not matter to its motion [m]


@dataclasses.dataclass(frozen=True)
class Port:
    """One force element between a body and its base: axis of a mount."""

    mount: str
    axis: str
    stiffness: float
    damping: float
    stiffness_log_std: float
    damping_log_std: float

    @property
    def name(self) -> str:
        """Return ``<mount>.<axis>``."""
        return f"{self.mount}.{self.axis}"


@dataclasses.dataclass(frozen=True)
class Signal:
    """One measured component of one sensor.

    Attributes
    ----------
    component
        Column of the readings, see :data:`CHANNELS`; axis of the mount for a transducer.
    kind
        ``acceleration`` [m/s^2], ``rate`` [rad/s] or ``displacement`` [m].
    noise_std, full_scale
        In the unit of the kind.
    """

    sensor: str
    component: int
    kind: str
    noise_std: float
    full_scale: float = float("inf")
    dc: bool = True
    noise_slope: int = 0

    @property
    def name(self) -> str:
        """Return ``<sensor>.<axis>``, the sensor alone for a transducer."""
        return self.sensor if self.kind == "displacement" else f"{self.sensor}.{CHANNELS[self.component]}"


@dataclasses.dataclass(frozen=True)
class Plant:
    """Matrices of the testable part; nb base accelerations, nu measured inputs, ny measured outputs, P ports.

    Attributes
    ----------
    mass, gravity_stiffness
        Shape (n, n).
    port_map, port_base
        Deflection ``= port_map q - port_base w``, shapes (P, n) and (P, nb).
    base_direct
        Acceleration where each base is measured, gravity still in it, ``= base_direct u``, shape (nb, nu).
    base_lever
        From there to the mount, shape (M, 3).
    base_yaw
        Yaw of the brackets from twice integrated readings, shape (nb, nu).
    tilts, tilt_share
        Ways in which brackets tilt, and how much of each they follow (1: all of it); calibrated.
    dc_base
        Which mounts take their base motion from an accelerometer that shows gravity, shape (M,).
    out_acceleration, out_rate, out_displacement, out_base
        Output ``= (-omega^2 out_acceleration + i omega out_rate + out_displacement) q + out_base w``, shapes (ny, n), and
        (ny, nb) of the last. A gyro reads ``R^T theta'`` of its body, what the body shares with its carrier included.
    static_force
        Static vertical force of each mount [N], order of ``mounts``.
    reading_errors
        What calibration found wrong with base readings, (kind, sensor, axis) -> gain error [-] or rotation [rad].
    body_errors
        What calibration added to the bodies of the file, (kind, body, entry) -> CG position [m] or, for entry ``ixy``,
        moment of inertia over the root of the two diagonal ones [-]; already in ``vehicle`` and the matrices.
    named_cg
        How far a CG that is named as a cause lies off its place in the file, (body, axis) -> [m]; already in ``vehicle`` and
        the matrices.
    """

    vehicle: Vehicle
    coordinates: tuple[tuple[str, str], ...]
    mounts: tuple[str, ...]
    ports: tuple[Port, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    mass: Array
    gravity_stiffness: Array
    port_map: Array
    port_base: Array
    base_direct: Array
    base_lever: Array
    base_yaw: Array
    tilts: tuple[BracketTilt, ...]
    tilt_share: Array
    dc_base: BoolArray
    out_acceleration: Array
    out_rate: Array
    out_displacement: Array
    out_base: Array
    static_force: Array
    warnings: tuple[str, ...] = ()
    reading_errors: Mapping[tuple[str, str, str], float] = dataclasses.field(default_factory=dict)
    body_errors: Mapping[tuple[str, str, str], float] = dataclasses.field(default_factory=dict)
    named_cg: Mapping[tuple[str, str], float] = dataclasses.field(default_factory=dict)

    def put_right(self, inputs: Array) -> Array:
        """Return base readings without the errors that calibration found, shape (N, nu).

        ``reading = (1 + diag(gain errors) - [rotation]x) true`` in sensor axes.
        """
        out = inputs.copy()
        for sensor in dict.fromkeys(name for _, name, _ in self.reading_errors):
            rows = [i for i, s in enumerate(self.inputs) if s.sensor == sensor]
            gain, turn = (
                np.array([self.reading_errors.get((kind, sensor, a), 0.0) for a in AXES]) for kind in ("gain", "misalignment")
            )
            out[:, rows] = np.linalg.solve(np.eye(3) + np.diag(gain) - skew(turn), inputs[:, rows].T).T
        return out

    @property
    def sensors(self) -> tuple[str, ...]:
        """Return the sensors of inputs and outputs in order."""
        return tuple(dict.fromkeys(s.sensor for s in (*self.outputs, *self.inputs)))

    @property
    def columns(self) -> dict[str, int]:
        """Return how many columns of the readings of every sensor are used: six of an IMU with angular rates, else three."""
        rated = {s.sensor for s in self.outputs if s.kind == "rate"}
        return {s: len(CHANNELS) if s in rated else len(AXES) for s in self.sensors}

    @property
    def shown_motion(self) -> Array:
        """Return which motions the outputs of accelerometers and gyros show, shape (ny, n), for its rank."""
        return self.out_acceleration + self.out_rate

    @functools.cached_property
    def output_basis(self) -> tuple[Array, int]:
        """Return a basis of the outputs and how many of its first rows no motion of the bodies reaches, (ny, ny) and a number.

        In standard deviations of the sensor noise. Three sensors on a rigid body show nine accelerations and six coordinates.
        """
        noise = np.maximum([s.noise_std for s in self.outputs], 1e-12)
        axes, sizes, _ = np.linalg.svd(self.motion_outputs / noise[:, None])
        reached = int(np.count_nonzero(sizes > _REACHED * sizes.max(initial=0.0)))
        return np.concatenate([axes[:, reached:], axes[:, :reached]], axis=1).T / noise, len(noise) - reached

    @property
    def motion_outputs(self) -> Array:
        """Return what accelerations, rates and displacements of the coordinates make of the outputs, shape (ny, 3 n)."""
        return np.hstack([self.out_acceleration, self.out_rate, self.out_displacement])

    @property
    def shared_base(self) -> Array:
        """Return the map from readings to the specific force that the bases share, those that show gravity, shape (3, nu)."""
        direct = self.base_direct.reshape(len(self.mounts), len(AXES), -1)
        return np.asarray(direct[self.dc_base].sum(axis=0) / max(np.count_nonzero(self.dc_base), 1))

    def at_rest(self, stiffness: Array, wrench: Array, duration_s: float) -> Array:
        """Return the coordinates at rest under a wrench, both of shape (n, ...); stiffness of the ports, shape (P,).

        ``q = sum_i phi_i phi_i^T f / w_i^2`` over the modes that come to rest within the run, ``w_i > 2 pi / T``: a body that
        nothing holds, and the head of a bench that is too heavy to move, stay where they are.
        """
        square, shape = self.modes(stiffness)
        settles = square > (2.0 * np.pi / duration_s) ** 2
        return np.asarray((shape[:, settles] / square[settles]) @ shape[:, settles].T @ wrench)

    def modes(self, stiffness: Array) -> tuple[Array, Array]:
        """Return squared angular frequencies, shape (n,), and shapes of unit modal mass, (n, n), of the body on its ports."""
        spring = self.port_map.T @ (stiffness[:, None] * self.port_map) + self.gravity_stiffness
        square, shape = eigh(spring, self.mass)
        return np.asarray(square), np.asarray(shape)

    @property
    def slope(self) -> Array:
        """Return the base slope (roll, pitch, yaw of the brackets) ``= slope u / (-omega^2)``, shape (nb, nu)."""
        out = self.base_yaw.copy()
        for share, tilt in zip(self.tilt_share, self.tilts):
            out += share * tilt.slope
        return out

    def lever_motion(self, slope: Array) -> Array:
        """Return what brackets that turn by a slope (nb, nu) add to the base acceleration at their mounts, shape (nb, nu)."""
        return np.concatenate([-skew(r) @ slope[3 * j : 3 * j + 3] for j, r in enumerate(self.base_lever)])

    def gravity_tilt(self, slope: Array) -> Array:
        """Return the gravity that a slope (nb, nu) shows DC accelerometers, times -omega^2, to be removed, shape (nb, nu)."""
        out = np.zeros_like(slope)
        for j in range(len(self.mounts)):
            if self.dc_base[j]:
                out[3 * j] = self.vehicle.gravity * slope[3 * j + 1]
                out[3 * j + 1] = -self.vehicle.gravity * slope[3 * j]
        return out

    def static_tilt(self, slope: Array | None = None) -> Array:
        """Return the wrench of the static mount loads that turn with their bases, from slope integrals, shape (n, nu).

        ``wrench = static_tilt u / (-omega^2)``: force ``F0 theta x e_z`` at every mount on a measured base.

        Parameters
        ----------
        slope
            Shape (nb, nu); that of the plant where None.
        """
        slope = self.slope if slope is None else slope
        out = np.zeros((len(self.coordinates), slope.shape[1]))
        bodies = {b for b, _ in self.coordinates}
        for j, name in enumerate(self.mounts):
            mount = self.vehicle.mounts[name]
            if mount.base in bodies:
                continue
            turn_x, turn_y, _ = slope[3 * j : 3 * j + 3]
            force = self.static_force[j] * np.stack([turn_y, -turn_x, np.zeros_like(turn_x)])
            six = point_motion_matrix(mount.position - self.vehicle.bodies[mount.body].cg).T @ force
            out += self.body_map(mount.body).T @ six
        return out

    def body_map(self, body: str) -> Array:
        """Return the map from q to the motion of a body, what it shares with its carrier included, shape (6, n)."""
        return body_rows(self.vehicle, self.coordinates, body)

    def coordinate_rows(self, body: str) -> list[tuple[int, int]]:
        """Return (row of q, column of the six body coordinates) of one body."""
        return [(i, COORDINATES.index(c)) for i, (b, c) in enumerate(self.coordinates) if b == body]


def free_bodies(vehicle: Vehicle, sensors: Collection[str]) -> tuple[str, ...]:
    """Return the bodies whose motion the model predicts.

    A body on a base whose motion nobody measured cannot be predicted; if it carries an accelerometer it becomes the
    prescribed base of what stands on it.
    """
    measured = {vehicle.sensors[s].body for s in sensors if vehicle.sensors[s].kind in _ACCELERATION_KINDS}
    free = [b for b in vehicle.bodies if any(m.body == b for m in vehicle.mounts.values())]
    while True:
        drop = [
            b for b in free
            if any(m.body == b and m.base not in free and m.base not in measured for m in vehicle.mounts.values())
        ]
        if not drop:
            return tuple(free)
        free = [b for b in free if b not in drop]


def _port(mount: Mount, axis: str, default_k: float, default_c: float) -> Port:
    stiffness, damping = linear_part(mount.elements[axis])

    return Port(
        mount.name, axis, stiffness, damping,
        log_std(mount.priors.get((axis, "stiffness")), stiffness, default_k),
        log_std(mount.priors.get((axis, "damping")), damping, default_c),
    )


def _slope_operator(positions: Array) -> tuple[Array, Array, Array, Array]:
    """Return (d z/d x, d z/d y) at every point from z at the points, each (S, S), and the part of each that is twist.

    Zero where the layout cannot tell.
    """
    if len(positions) == 1:
        nothing = np.zeros((1, 1))
        return nothing, nothing, nothing, nothing
    centre = positions.mean(axis=0)
    x, y = (positions - centre)[:, 0], (positions - centre)[:, 1]
    terms: list[tuple[int, int]] = [(0, 0)]
    for term in ((1, 0), (0, 1), (1, 1)):
        trial = np.stack([x**i * y**j for i, j in (*terms, term)], axis=1)
        scale = np.maximum(np.abs(trial).max(axis=0), 1e-9)
        if np.linalg.matrix_rank(trial / scale, tol=1e-3) == trial.shape[1] and np.all(np.abs(trial).max(axis=0) > 1e-3):
            terms.append(term)
    basis = np.stack([x**i * y**j for i, j in terms], axis=1)
    inverse = np.linalg.pinv(basis)
    by_x = np.stack([i * x ** max(i - 1, 0) * y**j for i, j in terms], axis=1)
    by_y = np.stack([j * y ** max(j - 1, 0) * x**i for i, j in terms], axis=1)
    twist = np.array([float(term == (1, 1)) for term in terms])
    return by_x @ inverse, by_y @ inverse, (by_x * twist) @ inverse, (by_y * twist) @ inverse


def _base_maps(
    vehicle: Vehicle, mounts: tuple[str, ...], bodies: tuple[str, ...], sensors: list[Sensor]
) -> tuple[Array, Array, Array, tuple[BracketTilt, ...], BoolArray, list[str]]:
    """Return base_direct, base_lever, base_yaw, tilts and dc_base of :class:`Plant` and the mounts without base motion."""
    shape = (3 * len(mounts), 3 * len(sensors))
    direct, yaw, rigid, twist = (np.zeros(shape) for _ in range(4))
    lever, dc = np.zeros((len(mounts), 3)), np.zeros(len(mounts), dtype=bool)
    missing: list[str] = []
    for base in dict.fromkeys(vehicle.mounts[m].base for m in mounts if vehicle.mounts[m].base not in bodies):
        own = [i for i, s in enumerate(sensors) if s.body == base]
        if not own:
            missing += [m for m in mounts if vehicle.mounts[m].base == base]
            continue
        positions = np.array([sensors[i].position for i in own])
        along_x, along_y, twist_x, twist_y = _slope_operator(positions)
        rotation = np.zeros((3 * len(own), shape[1]))
        for row, i in enumerate(own):
            rotation[3 * row : 3 * row + 3, 3 * i : 3 * i + 3] = sensors[i].rotation
        for m in (m for m in mounts if vehicle.mounts[m].base == base):
            j = mounts.index(m)
            place = vehicle.mounts[m].position
            nearest = [k for k, i in enumerate(own) if sensors[i].mount == m]
            k = nearest[0] if nearest else int(np.argmin(np.linalg.norm(positions - place, axis=1)))
            lever[j] = place - positions[k]
            _check_slope(vehicle.mounts[m], [sensors[i].name for i in own], lever[j], along_x[k], along_y[k])
            dzdx, dzdy = along_x[k] @ rotation[2::3], along_y[k] @ rotation[2::3]
            dxdy, dydx = along_y[k] @ rotation[0::3], along_x[k] @ rotation[1::3]
            rows = slice(3 * j, 3 * j + 3)
            angular = np.stack([dzdy, -dzdx, 0.5 * (dydx - dxdy)])
            direct[rows] = rotation[3 * k : 3 * k + 3]
            yaw[3 * j + 2] = angular[2]
            twist[3 * j], twist[3 * j + 1] = twist_y[k] @ rotation[2::3], -twist_x[k] @ rotation[2::3]
            rigid[3 * j : 3 * j + 2] = angular[:2] - twist[3 * j : 3 * j + 2]
            dc[j] = sensors[own[k]].coupling == "dc"
    return direct, lever, yaw, bracket_tilts(mounts, rigid, twist), dc, missing


def _check_slope(mount: Mount, sensors: list[str], offset: Array, along_x: Array, along_y: Array) -> None:
    """Refuse a mount whose vertical base motion follows from no accelerometer: far from all, on a slope nobody measured."""
    for length, slope, name in ((offset[0], along_x, "pitch"), (offset[1], along_y, "roll")):
        if "z" in mount.elements and abs(length) > _NEAR and not np.any(slope):
            raise InputDataError(
                f"the base motion at mount {mount.name} is not measured: the nearest accelerometer of {mount.base} is "
                f"{abs(length):.2f} m away and {', '.join(sensors)} cannot show the {name} between them; an accelerometer on "
                f"{mount.base} at or beyond {mount.name} is needed"
            )


def vertical_row(vehicle: Vehicle, coordinates: Coordinates, mount: Mount) -> Array:
    """Return how far the coordinates lift the body side of a mount above its base, shape (n,)."""
    row = np.zeros(len(coordinates))
    for body, sign in ((mount.body, 1.0), (mount.base, -1.0)):
        if any(b == body for b, _ in coordinates):
            row += sign * point_rows(vehicle, coordinates, body, mount.position)[2]
    return row


def static_forces(vehicle: Vehicle, mounts: tuple[str, ...], bodies: tuple[str, ...]) -> Array:
    """Return static vertical mount forces: equilibrium of every body, least norm weighted by vertical stiffness.

    The weight of a body acts at its CG on what it can move along, its own coordinates or those of the body that carries it.
    """
    coordinates = tuple((b, c) for b in bodies for c in COORDINATES if c in vehicle.bodies[b].coordinates)
    lift = np.stack([vertical_row(vehicle, coordinates, vehicle.mounts[m]) for m in mounts], axis=1)
    weight = sum(
        (vehicle.bodies[b].mass.value * vehicle.gravity * body_rows(vehicle, coordinates, b)[2] for b in bodies),
        np.zeros(len(coordinates)),
    )
    used = [i for i, (_, c) in enumerate(coordinates) if c in ("z", "roll", "pitch")]
    size = np.array([
        np.sqrt(max(_port(vehicle.mounts[m], "z", 1.0, 1.0).stiffness, 1.0)) if "z" in vehicle.mounts[m].elements else 1e-3
        for m in mounts
    ])
    return np.asarray(size * np.linalg.lstsq(lift[used] * size, weight[used], rcond=None)[0])


def gravity_stiffness_of(
    vehicle: Vehicle, mounts: tuple[str, ...], static: Array, coordinates: Coordinates
) -> Array:
    """Return the stiffness of static mount loads (M,) whose points of attack turn with the bodies, shape (n, n)."""
    force = np.zeros((len(vehicle.mounts), 3))
    force[[list(vehicle.mounts).index(m) for m in mounts], 2] = static
    return gravity_terms(vehicle, coordinates, force)[0]


def build_plant(
    vehicle: Vehicle, channels: Mapping[str, int], default_k_std: float = STIFFNESS_LOG_STD,
    default_c_std: float = DAMPING_LOG_STD,
) -> Plant:  # fmt: skip
    """Build the testable plant from a vehicle and the sensors that spoke.

    Parameters
    ----------
    vehicle
        Model.
    channels
        Sensor name -> number of measured components, of the run; an IMU on a body with all six has its angular rates used.
    default_k_std, default_c_std
        Prior standard deviation of ln k and ln c where the file states none.

    Raises
    ------
    InputDataError
        No body is both carried by measured bases and measured itself.
    """
    present = [s for s in vehicle.sensors if s in channels]
    bodies = free_bodies(vehicle, present)
    sensors = {s: vehicle.sensors[s] for s in present}
    out_sensors = [s for s in sensors.values() if s.kind in _ACCELERATION_KINDS and s.body in bodies]
    mounts = tuple(m for m in vehicle.mounts if vehicle.mounts[m].body in bodies)
    bases = {vehicle.mounts[m].base for m in mounts} - set(bodies)
    in_sensors = [s for s in sensors.values() if s.kind in _ACCELERATION_KINDS and s.body in bases]
    single = [s.name for s in in_sensors if not s.triaxial]
    if single:
        raise InputDataError(
            f"{', '.join(single)} {'does' if len(single) == 1 else 'do'} not measure all three axes of the base motion, which is "
            "the input of the model: triaxial accelerometers at the mount bases are needed"
        )
    if not bodies or not in_sensors:
        raise InputDataError(
            "no base motion was measured: accelerometers on the chassis side of the mounts, or a vertical displacement "
            "transducer at every mount of a body with accelerometers, are needed to test the model"
        )
    transducers = [s for s in sensors.values() if s.kind == "displacement" and s.mount in mounts]
    if not out_sensors and not transducers:
        raise InputDataError(
            "neither an accelerometer on a sprung body nor a displacement transducer at its mounts has data in this run: "
            "there is nothing to compare the model with"
        )
    coordinates = tuple((b, c) for b in bodies for c in COORDINATES if c in vehicle.bodies[b].coordinates)
    direct, lever, yaw, tilts, dc_base, missing = _base_maps(vehicle, mounts, bodies, in_sensors)
    size = 3 * len(mounts)
    static = static_forces(vehicle, mounts, bodies)
    mass, gravity_k = mass_matrix(vehicle, coordinates), gravity_stiffness_of(vehicle, mounts, static, coordinates)
    ports, port_map, port_base = _ports(vehicle, mounts, coordinates, (default_k_std, default_c_std))
    gyros = {s.name for s in out_sensors if s.kind == "imu" and channels[s.name] == len(CHANNELS)}
    outputs, out_a, out_r, out_d, out_b = _outputs(vehicle, out_sensors, gyros, sensors, mounts, coordinates, size)
    inputs = tuple(
        Signal(s.name, i, "acceleration", s.noise_std, s.full_scale, s.coupling == "dc", s.noise_slope)
        for s in in_sensors for i in range(3)
    )
    warnings = tuple(f"mount {m}: base motion not measured, taken as zero" for m in missing)
    return Plant(
        vehicle, coordinates, mounts, ports, inputs, outputs, mass, gravity_k, port_map, port_base, direct, lever, yaw,
        tilts, np.array([t.usual for t in tilts]), dc_base, out_a, out_r, out_d, out_b, static, warnings,
    )


def _ports(
    vehicle: Vehicle, mounts: tuple[str, ...], coordinates: Coordinates, defaults: tuple[float, float]
) -> tuple[tuple[Port, ...], Array, Array]:
    """Return the ports with their deflection maps onto coordinates and base displacements."""
    ports: list[Port] = []
    maps: list[Array] = []
    base_rows: list[Array] = []
    bodies = {b for b, _ in coordinates}
    for j, name in enumerate(mounts):
        mount = vehicle.mounts[name]
        for axis in mount.elements:
            six = np.zeros(len(coordinates))
            base = np.zeros(3 * len(mounts))
            for b, sign in ((mount.body, 1.0), (mount.base, -1.0)):
                if b in bodies:
                    six += sign * point_rows(vehicle, coordinates, b, mount.position)[COORDINATES.index(axis)]
                elif sign < 0 and axis in AXES:
                    base[3 * j + AXES.index(axis)] = 1.0
            if not np.any(six):
                continue
            ports.append(_port(mount, axis, *defaults))
            maps.append(six)
            base_rows.append(base)
    return tuple(ports), np.array(maps), np.array(base_rows)


def _outputs(
    vehicle: Vehicle, accelerometers: list[Sensor], gyros: Collection[str], sensors: Mapping[str, Sensor],
    mounts: tuple[str, ...], coordinates: Coordinates, size: int,
) -> tuple[tuple[Signal, ...], Array, Array, Array, Array]:
    """Return the output channels and their maps onto acceleration, velocity, displacement and base displacement.

    A body that has no coordinate along a channel is not known to move with its carrier there as stiffly as the model has it (a
    cushion): the channel is left out.
    """
    n = len(coordinates)
    signals: list[Signal] = []
    acc, rate, dis, base = [], [], [], []
    tilt = np.zeros((3, 6))
    tilt[0, 4], tilt[1, 3] = -vehicle.gravity, vehicle.gravity
    for s in accelerometers:
        a_map = s.rotation.T @ point_rows(vehicle, coordinates, s.body, s.position)[:3]
        six = body_rows(vehicle, coordinates, s.body)
        t_map = s.rotation.T @ tilt @ six if s.coupling == "dc" else np.zeros((3, n))
        own = np.array([b == s.body for b, _ in coordinates])
        for i in range(3):
            if not s.measured[i] or not np.any(np.abs(a_map[i, own]) > 1e-9):
                continue
            signals.append(Signal(s.name, i, "acceleration", s.noise_std, s.full_scale, s.coupling == "dc"))
            acc.append(a_map[i])
            rate.append(np.zeros(n))
            dis.append(t_map[i])
            base.append(np.zeros(size))
        r_map = s.rotation.T @ six[3:]
        for i in range(3):
            if s.name not in gyros or not np.any(np.abs(r_map[i, own]) > 1e-9):
                continue
            signals.append(Signal(s.name, 3 + i, "rate", s.gyro_noise_std, dc=False))
            acc.append(np.zeros(n))
            rate.append(r_map[i])
            dis.append(np.zeros(n))
            base.append(np.zeros(size))
    for s in sensors.values():
        if s.kind != "displacement" or s.mount not in mounts or s.axis not in vehicle.mounts[s.mount].elements:
            continue
        ports, port_map, port_base = _ports(vehicle, (s.mount,), coordinates, (1.0, 1.0))
        k = [p.axis for p in ports].index(s.axis) if s.axis in [p.axis for p in ports] else -1
        if k < 0:
            continue
        row_b = np.zeros(size)
        j = mounts.index(s.mount)
        row_b[3 * j : 3 * j + 3] = -port_base[k]
        signals.append(Signal(s.name, AXES.index(s.axis), "displacement", s.noise_std, s.full_scale))
        acc.append(np.zeros(n))
        rate.append(np.zeros(n))
        dis.append(port_map[k])
        base.append(row_b)
    return tuple(signals), np.array(acc), np.array(rate), np.array(dis), np.array(base)
