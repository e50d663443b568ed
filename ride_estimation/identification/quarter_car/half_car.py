# Copyright 2026 ride_estimation contributors
"""A half car fitted to one run: body with bounce and pitch on two axles that meet the same road a wheelbase apart.

The next step document 002 names. The laws are linear; deflections count from static equilibrium, so gravity is left out.
Both sprung masses are those above their axle: ``a = L m_r / (m_f + m_r)`` from the front axle to the centre of gravity.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.uncertainty import effective_samples
from ride_estimation.identification.quarter_car.fit import relative_std
from ride_estimation.identification.quarter_car.models import PARAMETERS
from ride_estimation.metrics import nrmse
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import CompiledModel
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]

#: fitted parameter -> parameter of the quarter car with its literature value and bounds
_CORNER = {
    f"{end}_{name}": name for end in ("front", "rear") for name in ("spring_rate", "damping", "tyre_rate", "tyre_damping")
}
#: pitch inertia over m a b (the dynamic index): start, bounds
_DYNAMIC_INDEX, _INDEX_BOUNDS = 1.0, (0.2, 5.0)
#: tyre damping is searched as a logarithm from here on [N s/m]
_LEAST_TYRE_DAMPING = 10.0
#: internal steps per second and random starts, as for the quarter car
_INTERNAL_HZ = 1000.0
#: a parameter whose relative standard deviation exceeds this is not identified by the run
_IDENTIFIED = 0.5
#: channels in the order of the measured columns
CHANNELS = ("body", "axle", "rear_body", "rear_axle")


@dataclasses.dataclass(frozen=True)
class HalfCarMasses:
    """Known masses [kg], sprung ones above their axle, and the wheelbase [m]."""

    front_sprung: float
    front_unsprung: float
    rear_sprung: float
    rear_unsprung: float
    wheelbase: float

    @property
    def arms(self) -> tuple[float, float]:
        """Return the distances of front and rear axle from the centre of gravity [m]."""
        front = self.wheelbase * self.rear_sprung / (self.front_sprung + self.rear_sprung)
        return front, self.wheelbase - front

    @property
    def uncoupled_inertia(self) -> float:
        """Return ``m a b`` [kg m^2], the pitch inertia that makes two quarter cars of the half car."""
        return (self.front_sprung + self.rear_sprung) * self.arms[0] * self.arms[1]


@dataclasses.dataclass(frozen=True)
class HalfCarFit:
    """Result of the fit.

    Attributes
    ----------
    values, std
        SI; ``pitch_inertia`` [kg m^2], ``front_spring_rate`` ... as the quarter car names them.
    sum_of_squares
        Weighted as for the quarter car, over the channels given.
    nrmse
        Channel -> error over the standard deviation of the measurement.
    on_bounds, not_identified
        Names.
    """

    values: dict[str, float]
    std: dict[str, float]
    sum_of_squares: float
    nrmse: dict[str, float]
    on_bounds: tuple[str, ...]
    not_identified: tuple[str, ...]


def half_car(masses: HalfCarMasses, values: dict[str, float]) -> Vehicle:
    """Return the half car as a vehicle, x forward from the centre of gravity."""
    arms = dict(zip(("front", "rear"), (masses.arms[0], -masses.arms[1])))
    sprung = masses.front_sprung + masses.rear_sprung
    inertia = np.diag([1.0, values["pitch_inertia"], values["pitch_inertia"]])
    bodies = {"body": Body("body", Prior(sprung), np.zeros(3), inertia, coordinates=("z", "pitch"))}
    mounts = {}
    for end, mass in (("front", masses.front_unsprung), ("rear", masses.rear_unsprung)):
        place = np.array([arms[end], 0.0, 0.0])
        bodies[f"{end}_axle"] = Body(f"{end}_axle", Prior(mass), place, np.eye(3), coordinates=("z",))
        for name, body, base, law in (
            ("suspension", "body", f"{end}_axle", ("spring_rate", "damping")),
            ("tyre", f"{end}_axle", "road", ("tyre_rate", "tyre_damping")),
        ):
            element = KelvinVoigt(*(values[f"{end}_{word}"] for word in law))
            mounts[f"{end}_{name}"] = Mount(f"{end}_{name}", place, body, base, {"z": element})
    return Vehicle("half_car", bodies, mounts, {}, gravity=0.0)


def fit_half_car(
    road: ArrayLike, measured: ArrayLike, rate_hz: float, masses: HalfCarMasses, speed: float, noise_std: float,
    *, seed: int = 0, starts: int = 4,
) -> HalfCarFit:  # fmt: skip
    """Fit stiffness, damping and pitch inertia of a half car to measured accelerations by simulation error.

    Parameters
    ----------
    road
        Road displacement at the front wheel centre [m], shape (N,); the rear wheel meets it ``wheelbase / speed`` later.
    measured
        Acceleration of the body above the front axle and of the front axle, and where they were measured of the body above the
        rear axle and of the rear axle [m/s^2], shape (N, 2), (N, 3) or (N, 4) in the order of :data:`CHANNELS`.
    rate_hz, speed, noise_std
        [Hz], [m/s], [m/s^2].
    masses
        Known masses and wheelbase.
    seed, starts
        Random starts beside the literature values.

    Raises
    ------
    InputDataError
        Shapes that do not fit, values not finite, masses, speed or noise not positive, a run shorter than the way of a wheelbase.
    """
    u, y = np.asarray(road, dtype=float).ravel(), np.asarray(measured, dtype=float)
    if y.ndim != 2 or y.shape[0] != u.size or not 2 <= y.shape[1] <= 4 or u.size < 50:
        raise InputDataError(f"road of shape (N,) and 2 to 4 accelerations (N, C), N >= 50; given {u.shape} and {y.shape}")
    if not (np.all(np.isfinite(u)) and np.all(np.isfinite(y))):
        raise InputDataError("road or accelerations contain values that are not finite")
    if not (min(dataclasses.astuple(masses)) > 0.0 and speed > 0.0 and noise_std > 0.0 and rate_hz > 0.0):
        raise InputDataError("masses, wheelbase, speed, rate and noise must be positive")
    if masses.wheelbase / speed > 0.8 * u.size / rate_hz:
        raise InputDataError(
            f"the run lasts {u.size / rate_hz:.3g} s and the rear axle comes {masses.wheelbase / speed:.3g} s after the front one"
        )
    problem = _Problem(u, y, rate_hz, masses, speed, noise_std)
    rng = np.random.default_rng(seed)
    found = [problem.descend(z) for z in problem.starts(rng, starts)]
    return problem.result(*min(found, key=lambda f: float(f[1] @ f[1])))


class _Problem:
    """The least squares problem of one run, in logarithms."""

    def __init__(
        self, road: Array, measured: Array, rate_hz: float, masses: HalfCarMasses, speed: float, noise_std: float
    ) -> None:
        self._measured, self._masses, self._noise = measured, masses, noise_std
        time = np.arange(road.size) / rate_hz
        self.names = ("pitch_inertia", *_CORNER)
        index = masses.uncoupled_inertia
        corner = [PARAMETERS[name] for name in _CORNER.values()]
        self._lower = np.log([_INDEX_BOUNDS[0] * index, *(max(p.lower, _LEAST_TYRE_DAMPING) for p in corner)])
        self._upper = np.log([_INDEX_BOUNDS[1] * index, *(p.upper for p in corner)])
        self._literature = np.log([_DYNAMIC_INDEX * index, *(p.literature for p in corner)])
        vehicle = half_car(masses, self.values(self._literature))
        displacement = np.zeros((road.size, len(vehicle.mounts), 3))
        for name, delay in (("front_tyre", 0.0), ("rear_tyre", masses.wheelbase / speed)):
            displacement[:, vehicle.mount_names.index(name), 2] = np.interp(time - delay, time, road)
        self._base = BaseMotion.from_displacement(displacement, rate_hz)
        self._substeps = max(1, math.ceil(_INTERNAL_HZ / rate_hz))

    def values(self, z: Array) -> dict[str, float]:
        return {name: math.exp(v) for name, v in zip(self.names, z, strict=True)}

    def simulated(self, z: Array) -> Array:
        """Return the channels [m/s^2], shape (N, C)."""
        assembly = assemble(half_car(self._masses, self.values(z)))
        accel = np.asarray(CompiledModel(assembly, self._base, substeps=self._substeps).run_raw({}).qdd)
        column = {name: accel[:, i] for i, name in enumerate(assembly.coordinates)}
        heave, pitch = column["body", "z"], column["body", "pitch"]
        front, rear = self._masses.arms
        channels = (heave - front * pitch, column["front_axle", "z"], heave + rear * pitch, column["rear_axle", "z"])
        return np.column_stack(channels[: self._measured.shape[1]])

    def residual(self, z: Array) -> Array:
        error = (self.simulated(z) - self._measured) / self._noise
        return np.asarray(np.nan_to_num(error, nan=1e6, posinf=1e6, neginf=-1e6).ravel())

    def starts(self, rng: np.random.Generator, count: int) -> list[Array]:
        """Return the literature and random points around it."""
        drawn = self._literature + rng.uniform(-0.7, 0.7, size=(count, len(self.names)))
        return [np.clip(z, self._lower, self._upper) for z in (self._literature, *drawn)]

    def descend(self, start: Array) -> tuple[Array, Array, Array]:
        found = scipy.optimize.least_squares(
            self.residual, start, bounds=(self._lower, self._upper), method="trf", xtol=1e-8, ftol=1e-8, diff_step=1e-6,
            max_nfev=60,
        )  # fmt: skip
        return found.x, found.fun, found.jac

    def result(self, z: Array, residual: Array, jacobian: Array) -> HalfCarFit:
        # what the model leaves beyond the noise is correlated: fewer independent residuals than samples
        independent = sum(effective_samples(r) for r in residual.reshape(self._measured.shape).T)
        relative = relative_std(jacobian, max(float(residual @ residual) / max(independent - len(z), 1.0), 1.0))
        values = self.values(z)
        modelled = self.simulated(z)
        on_bounds = [n for n, v, a, b in zip(self.names, z, self._lower, self._upper) if min(v - a, b - v) < 1e-3]
        return HalfCarFit(
            values=values,
            std={name: float(s * values[name]) for name, s in zip(self.names, relative)},
            sum_of_squares=float(residual @ residual),
            nrmse={n: nrmse(m, s) for n, m, s in zip(CHANNELS, self._measured.T, modelled.T)},
            on_bounds=tuple(on_bounds),
            not_identified=tuple(n for n, s in zip(self.names, relative) if s > _IDENTIFIED),
        )
