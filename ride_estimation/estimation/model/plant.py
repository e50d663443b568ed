# Copyright 2026 ride_estimation contributors
"""What does not change during a run: geometry of body, mounts, base and sensors, prior of the constants."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.geometry import USUAL_SHARES, Geometry, geometry_of, plate_fit, relative_tilt_maps
from ride_estimation.estimation.forces.mount_forces import share_by_stiffness, static_share, static_split
from ride_estimation.estimation.model.carried import Carried, CarriedParts
from ride_estimation.estimation.model.load import Load, static_with_load
from ride_estimation.estimation.model.states import FastStates, SlowStates, reading_width, slow_states
from ride_estimation.frames import AXES, point_motion_matrix
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.prior import DAMPING_LOG_STD, INERTIA_STD, STIFFNESS_LOG_STD, TWIST_SHARE_STD, cg_std_of, log_std
from ride_estimation.vehicles.tangent import tangent
from ride_estimation.vehicles.vehicle import Mount, Vehicle

Array = NDArray[np.float64]

#: standard deviation of shares and shifts of bracket tilt [-, m]
_SHARES_STD = np.array([TWIST_SHARE_STD, 0.15, TWIST_SHARE_STD, 0.15])
#: triaxial accelerometers that rigid motion needs
_LEAST_SENSORS = 3
#: length of a projected unit vector below which it depends on those before
_DEPENDENT = 1e-6
#: rows and columns of the products of inertia
_PRODUCTS = np.triu_indices(3, 1)
#: standard deviation of the mean specific force beyond gravity [m/s^2]: a slope of two degrees; upright what rolling and pitching
#: take from gravity, g theta^2 / 2
_MEAN_STD = np.array([0.3, 0.3, 0.01])
#: smallest singular value of the wrenches of forces beside their laws, above which motion tells them apart: of four vertical ones
#: at a rectangle of mounts it is 0
_TOLD_APART = 0.2


@dataclasses.dataclass(frozen=True)
class Constants:
    """The slow states of body, mounts and base in physical units.

    Attributes
    ----------
    stiffness, damping
        Per mount and axis, shape (3 M,) [N/m, N s/m].
    tilt
        T, shape (3 M, 3 M): from the stacked deflections to the rotation of the body against each bracket.
    mass, cg, inertia
        Of the body alone: [kg], [m] shape (3,), [kg m^2] shape (3, 3).
    carried
        What it carries.
    points
        P, shape (3 M, 6): from rigid motion at the CG to the motion of the mounts.
    static, static_left
        Force of the mounts on the body at rest, shape (M, 3) [N], and what equilibrium leaves of the covariance of loads that the
        file states or that springs share, (3 M, 3 M).
    mean
        Mean specific force of base and body beyond gravity, shape (3,) [m/s^2].
    deflected
        Mean deflection of the mounts by that mean, shape (3 M,) [m].
    """

    stiffness: Array
    damping: Array
    tilt: Array
    mass: float
    cg: Array
    inertia: Array
    carried: CarriedParts
    points: Array
    static: Array
    static_left: Array
    mean: Array
    deflected: Array

    @property
    def mobility(self) -> Array:
        """Return the inverse of the mass matrix of body and carried bodies, shape (6 + Q, 6 + Q)."""
        own = np.zeros_like(self.carried.inertia)
        own[:6, :6] = sl.block_diag(self.mass * np.eye(3), self.inertia)
        return np.asarray(np.linalg.inv(own + self.carried.inertia))


class Plant:
    """Body, mounts, base and sensors of one vehicle.

    Parameters
    ----------
    vehicle
        One body free in six coordinates on three or more mounts, each with an accelerometer on its base; three or more
        accelerometers on the body that are not on one line. Bodies that it carries take part by the vehicle file.

    Attributes
    ----------
    patterns
        U, shape (3 M, n): orthonormal deformations of the base that leave its rigid motion zero.
    twist
        From the deformations to the twist of the base, shape (n,) [1/m]; zero where the mounts do not show it.
    untwisted
        ``Constants.tilt`` of brackets that do not follow the twist.
    sensors
        Accelerometers of the body, of the bases, displacement transducers: the order of the readings.
    base_of
        Name of a base sensor -> index of its mount.
    load
        What the body carries that its file does not contain. Slow states are those for the mass of the file: with a load of share
        s all of mass, stiffness, damping, inertia and force are ``1 + s`` times as large.
    freed, freed_std
        Places of the mounts' axes whose force is not its law's alone, among the 3 M, and standard deviation of ln k there.
    noise, travels, delay_of
        Per reading, shape (C,): standard deviation of the noise, infinite along axes that are not measured, whether it is a
        displacement, place of its delay in theta.

    Raises
    ------
    ConfigurationError
        The vehicle is none of that kind.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        a = geometry_of(vehicle)
        _check(a)
        self.geometry, self.mounts, self.gravity = a, a.mounts, vehicle.gravity
        self.base_sensors = tuple(s for s in a.base_sensors if s is not None)
        self.base_of = {s.name: i for i, s in enumerate(self.base_sensors)}
        self.transducers = tuple(s for s in a.transducers if s.axis in AXES)
        self.sensors: tuple[Sensor, ...] = (*a.body_sensors, *self.base_sensors, *self.transducers)
        count = len(a.mounts)
        maps = [relative_tilt_maps(a.mounts, e).reshape(3 * count, 3 * count) for e in np.eye(5)[:, :4]]
        self.untwisted, self._tilt_slopes = maps[4], [m - maps[4] for m in maps[:4]]
        points = self.points(a.body.cg)
        self.patterns = _patterns(np.eye(3 * count) - points @ np.linalg.pinv(points))
        _, fit = plate_fit(a.mounts)
        twist = fit[3] if len(fit) == 4 else np.zeros(count)
        self.twist = twist @ self.patterns[2::3]
        #: relative standard deviation of the mass: all forces have it in common, also where the mass is held
        self.mass_std = (a.body.mass.std or 0.0) / a.body.mass.value
        self.carried = Carried(a)
        self.load = Load()
        self.freed: tuple[int, ...] = ()
        self.freed_std: tuple[float, ...] = ()
        self.states = FastStates.of(self.patterns.shape[1], self.carried.count)
        self.slow = self._slow()
        widths = [reading_width(s) for s in self.sensors]
        measured = np.concatenate([s.measured[:width] for s, width in zip(self.sensors, widths)])
        self.noise = np.where(measured, np.repeat([s.noise_std for s in self.sensors], widths), np.inf)
        self.travels = np.repeat([s.kind == "displacement" for s in self.sensors], widths)
        self.delay_of = np.repeat([self.slow.sensors[s.name]["delay"].start for s in self.sensors], widths)

    def _slow(self) -> SlowStates:
        a, body = self.geometry, self.geometry.body
        pairs = {"stiffness": [], "damping": []}  # type: dict[str, list[tuple[float, float]]]
        for mount in self.mounts:
            for axis in AXES:
                for part, found in zip(pairs, _law(mount, axis)):
                    pairs[part].append(found)
        k, c = (np.array(p).T for p in pairs.values())
        known = any(r.kind == "known_mass" and r.body == body.name for r in a.vehicle.force_references)
        mass_std = 0.0 if known else self.mass_std
        cg_std = cg_std_of(body)
        spread = INERTIA_STD if body.inertia_relative_std is None else body.inertia_relative_std
        return slow_states(
            [
                (np.log(k[0]), k[1]), (np.log(c[0]), c[1]), (USUAL_SHARES, _SHARES_STD),
                (np.array([np.log(body.mass.value)]), np.array([mass_std])), (np.asarray(body.cg, dtype=float), cg_std),
                (np.zeros(3), np.full(3, spread)), (np.zeros(3), np.full(3, spread)),
                (np.zeros(len(self.carried.std)), self.carried.std),
                (np.zeros(3), _MEAN_STD),
            ],
            self.sensors,
        )  # fmt: skip

    def _static(self, points: Array, k: Array, weight: Array, cg: Array, own: float) -> tuple[Array, Array]:
        """Return forces at rest (M, 3) and their covariance (3 M, 3 M); ``own``: weight of the body without what it carries."""
        static, left = static_split(self.mounts, points.T, static_share(points.T, k, weight), weight)
        if not self.load.leaning:
            return static, left
        offset = cg - np.asarray(self.geometry.body.cg)
        before = weight - np.append(np.zeros(3), np.cross(offset, [0.0, 0.0, own]))
        level, _ = static_split(self.mounts, points.T, static_share(points.T, k, before), before)
        # a finite rotation moves its arms too: those of half of it give its deflections to second order
        upright = motion_of_points([m.position for m in self.geometry.mounts], self.load.own(cg))
        return static_with_load(0.5 * (points + upright), k, offset, own, level, self.load.share), left

    def _products(self, shares: Array) -> Array:
        """Return elements xy, xz and yz of an inertia, shape (3, 3) [kg m^2], from their shares of the moments of the file."""
        found, size = np.zeros((3, 3)), np.sqrt(np.diag(self.geometry.body.inertia))
        found[_PRODUCTS] = shares
        return np.asarray((found + found.T) * np.outer(size, size))

    @property
    def centre(self) -> Array:
        """Return the point between the mounts, shape (3,) [m]."""
        return np.asarray(np.mean([m.position for m in self.mounts], axis=0))

    def points(self, cg: Array) -> Array:
        """Return the map from rigid motion at a CG to the motion of the mounts, shape (3 M, 6)."""
        return motion_of_points([m.position for m in self.mounts], cg)

    def constants(self, theta: Array) -> Constants:
        """Return the constants of a vector of slow states in physical units.

        Every mount carries its share of the weight as vertical springs share it, or what the vehicle file states, in equilibrium.
        """
        s, body = self.slow, self.geometry.body
        k, mass, cg = np.exp(theta[s.log_stiffness]), float(np.exp(theta[s.log_mass][0])), theta[s.cg]
        root = np.exp(0.5 * theta[s.log_inertia])
        inertia = np.outer(root, root) * (body.inertia + self._products(theta[s.inertia_products])) * mass / body.mass.value
        points, carried = self.points(cg), self.carried.parts(theta[s.log_carried], cg)
        weight = np.array([0.0, 0.0, mass * self.gravity, 0.0, 0.0, 0.0]) + carried.weight
        static, left = self._static(points, k, weight, cg, mass * self.gravity)
        pull = np.append(mass * theta[s.mean_accel], np.zeros(3))
        deflected = -points @ np.linalg.solve(points.T @ (k[:, None] * points), pull)
        tilt = self.untwisted + sum(share * slope for share, slope in zip(theta[s.tilt_shares], self._tilt_slopes))
        c = np.exp(theta[s.log_damping])
        return Constants(k, c, tilt, mass, cg, inertia, carried, points, static, left, theta[s.mean_accel], deflected)

    def with_free_force(self, place: int) -> Plant:
        """Return the plant with a force beside its law at one axis of a mount.

        The law is held: what it is wrong by moves that force, and only what the force carries at rest hangs on it.
        """
        found, slow = copy.copy(self), self.slow
        std = slow.std.copy()
        found.freed, found.freed_std = (*self.freed, place), (*self.freed_std, float(std[slow.log_stiffness][place]))
        std[[slow.log_stiffness.start + place, slow.log_damping.start + place]] = 0.0
        found.slow = dataclasses.replace(slow, std=std)
        found.states = FastStates.of(self.patterns.shape[1], self.carried.count, len(found.freed))
        return found

    def with_load(self, load: Load, offset: Array) -> Plant:
        """Return the plant with a load that moves the CG by (3,) [m]: what the file states is for another mass."""
        found, slow = copy.copy(self), self.slow
        mean, std = slow.mean.copy(), slow.std.copy()
        for part in (slow.log_stiffness, slow.log_damping, slow.log_carried, slow.log_inertia):
            mean[part] -= np.log1p(load.share)
            std[part] = np.where(std[part] > 0.0, np.hypot(std[part], load.std), 0.0)
        for part in (slow.log_inertia, slow.inertia_products):
            std[part] = np.hypot(std[part], load.share)
        std[slow.cg] = np.linalg.norm(offset)
        found.load, found.slow = load, dataclasses.replace(slow, mean=mean, std=std)
        found.freed_std = tuple(float(np.hypot(known, load.std)) for known in self.freed_std)
        own = {s.name for s in self.geometry.body_sensors}
        found.sensors = tuple(load.moved_sensor(s) if s.name in own else s for s in self.sensors)
        found.mounts = tuple(dataclasses.replace(m, position=load.moved(m.position)) for m in self.mounts)
        return found

    def carrying(self, load: Load) -> Plant:
        """Return the plant with other numbers of its load, which moves the body as before."""
        found = copy.copy(self)
        found.load = load
        return found

    @property
    def mass_factor(self) -> tuple[float, float]:
        """Return by what everything known over the mass of the file is multiplied, and its relative standard deviation.

        Where the mass is a slow state its own standard deviation is in their covariance.
        """
        factor = 1.0 + self.load.share
        held = self.mass_std if self.slow.std[self.slow.log_mass][0] == 0.0 else 0.0
        return factor, float(np.hypot(held, self.load.std / factor))

    def with_laws_known_to(self, freed_std: tuple[float, ...]) -> Plant:
        """Return the plant with other standard deviations of ln k where there are forces beside laws."""
        found = copy.copy(self)
        found.freed_std = freed_std
        return found

    def may_free(self, place: int) -> bool:
        """Return whether the motion of the body tells one more force beside its law from those there are."""
        arms = self.points(self.centre)[[*self.freed, place]]
        size = np.sqrt(np.mean(np.sum(arms[:, 3:] ** 2, axis=1)))
        arms[:, 3:] /= size
        return bool(np.linalg.svd(arms, compute_uv=False)[-1] > _TOLD_APART)

    @property
    def of_bases(self) -> NDArray[np.int64]:
        """Return which of the readings are of sensors of the base."""
        return np.arange(3 * len(self.base_sensors)) + 3 * len(self.geometry.body_sensors)

    def enough_without(self, sensor: str) -> bool:
        """Return whether the motion of the body and the rigid one of the base are measured without one of the sensors."""
        places: Sequence[Sensor] = self.base_sensors if sensor in self.base_of else self.geometry.body_sensors
        return sum(s.triaxial and s.name != sensor for s in places) >= _LEAST_SENSORS

    @property
    def findings(self) -> tuple[str, ...]:
        """In words how the vehicle differs from its file."""
        places = [f"{self.mounts[i // 3].name} {AXES[i % 3]}" for i in sorted(self.freed)]
        return (f"the force is not that of a linear law at {', '.join(places)}",) if places else ()

    def static_covariance(self, m: Constants) -> Array:
        """Return the covariance of the static forces that equilibrium leaves, (3 M, 3 M).

        Horizontal ones are there because brackets lean at rest as their sensors do.
        """
        lean = [s.stated_installation.misalignment for s in self.base_sensors]
        sideways = np.zeros(m.static.shape)
        sideways[:, :2] = np.outer(lean * m.static[:, 2], np.ones(2)) ** 2
        left = unbalanced(m.points, m.stiffness)
        return np.asarray(m.static_left + (left * sideways.ravel()) @ left.T)


def motion_of_points(positions: Sequence[Array], cg: Array) -> Array:
    """Return the map from rigid motion at a CG to the motion of points, shape (3 M, 6)."""
    return np.vstack([point_motion_matrix(position - cg) for position in positions])


def unbalanced(points: Array, stiffness: Array) -> Array:
    """Return what takes from forces of the mounts the part that equilibrium gives them by their stiffness, shape (3 M, 3 M).

    Parameters
    ----------
    points
        From rigid motion to that of the mounts, shape (3 M, 6).
    stiffness
        Of the mounts' axes, shape (3 M,) [N/m].
    """
    return np.asarray(np.eye(len(points)) - share_by_stiffness(points.T, stiffness) @ points.T)


def _patterns(projector: Array) -> Array:
    """Return an orthonormal basis of what a projector leaves, shape (3 M, n).

    Vertical motion of the mounts one after the other, then x, then y, each made orthogonal to those before: eigenvectors of equal
    eigenvalues would be another basis on every processor, and spectra are per pattern.
    """
    count = len(projector)
    found = np.zeros((count, 0))
    for place in [*range(2, count, 3), *range(0, count, 3), *range(1, count, 3)]:
        column = projector[place]
        for _ in range(2):  # once more against rounding
            column = column - found @ (found.T @ column)
        size = float(np.linalg.norm(column))
        if size > _DEPENDENT:
            found = np.column_stack([found, column / size])
    return found


def _law(mount: Mount, axis: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return (value, std of its logarithm) of stiffness and damping of one axis: the law linearised at rest."""
    found = []
    for name, value, usual in zip(("stiffness", "damping"), tangent(mount.elements[axis]), (STIFFNESS_LOG_STD, DAMPING_LOG_STD)):
        prior = mount.priors.get((axis, name))
        found.append((max(value, 1e-3), log_std(prior, value if prior is None else prior.value, usual)))
    return found[0], found[1]


def _check(a: Geometry) -> None:
    problems = []
    if not a.free.all():
        problems.append(f"body {a.body.name!r} must be free in six coordinates")
    if len(a.mounts) < 3:
        problems.append(f"body {a.body.name!r} has {len(a.mounts)} mounts on a measured base; at least 3 are needed")
    short = [m.name for m in a.mounts if any(axis not in m.elements for axis in AXES)]
    if short:
        problems.append(f"mounts without a force element along x, y and z: {', '.join(short)}")
    bare = [m.name for m, s in zip(a.mounts, a.base_sensors) if s is None or not s.triaxial]
    if bare:
        problems.append(f"mounts without a triaxial accelerometer on their base: {', '.join(bare)}")
    count = sum(s.triaxial for s in a.body_sensors)
    if count < _LEAST_SENSORS:
        problems.append(f"body {a.body.name!r} has {count} triaxial accelerometers; at least {_LEAST_SENSORS} are needed")
    if problems:
        raise ConfigurationError(problems, where=a.vehicle.name or "vehicle")
