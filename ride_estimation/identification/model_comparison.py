# Copyright 2026 ride_estimation contributors
"""Voigt against the damping filter of document 000 and what else could explain a mount, on the same measured data.

The reviewer of document 000 asked for this comparison. Every model is fitted by simulation error to the vertical body
accelerations of one run, driven by the measured base accelerations, and scored on runs it has not seen.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.bouc_wen import BoucWen
from ride_estimation.elements.damping_filter import BAND, DampingFilter
from ride_estimation.elements.fractional import Fractional
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import InputDataError
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.simulation.base_motion import BaseMotion, high_passed
from ride_estimation.simulation.simulate import CompiledModel
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.tangent import equivalent
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
Shape = Mapping[str, float]

_SHORTEST_S = 10.0  # run that a model can be fitted to [s]
CORNER_HZ = 0.5  # lower end of the compared band; base and body pass the same high-pass
_SETTLING_S = 2.0  # left out at both ends: the filters start there
PAPER_CENTRE, PAPER_QUALITY = 12.6, 0.5  # rad/s and 1, document 000 Table 5
_REACH = 20.0  # a fitted stiffness or damping is within this factor of the best Voigt's
_LEAST_DAMPING = 1e3  # but damping may vanish beside a law that has its own
FRACTIONAL_REFERENCE = 12.6  # rad/s, frequency of the stiffness of the fractional element


@dataclasses.dataclass(frozen=True)
class CandidateModel:
    """A vertical mount law with shape parameters shared by all mounts.

    Attributes
    ----------
    name
        As printed.
    shape
        Parameter -> (start, lower, upper); fitted in logarithm, relative to the mount's own stiffness where it is a force.
    build
        (stiffness, damping, shape) -> element.
    damping_free
        False where the law has no viscous damper.
    """

    name: str
    shape: Mapping[str, tuple[float, float, float]]
    build: Callable[[float, float, Shape], ForceElement]
    damping_free: bool = True


def _band(k: float, shape: Shape) -> DampingFilter:
    centre, quality = shape.get("centre", PAPER_CENTRE), shape.get("quality", PAPER_QUALITY)
    return DampingFilter(gain=shape["gain_time"] * k, centre=centre, quality=quality, shape=BAND)


def _maxwell(k: float, shape: Shape) -> Maxwell:
    stiffness = shape["branch_ratio"] * k
    return Maxwell(stiffness=stiffness, damping=stiffness * shape["branch_time"])


_GAIN = {"gain_time": (0.02, 1e-4, 2.0)}  # s: K over the mount's stiffness
_FILTER = {**_GAIN, "centre": (PAPER_CENTRE, 2.0, 200.0), "quality": (PAPER_QUALITY, 0.05, 10.0)}
_BRANCH = {"branch_ratio": (0.3, 1e-3, 5.0), "branch_time": (0.03, 2e-3, 0.5)}
_FRICTION = {"friction_stroke": (1e-3, 1e-6, 2e-2), "half_stroke": (1e-3, 1e-6, 1e-2)}  # m: force over stiffness; x_2

CANDIDATES: tuple[CandidateModel, ...] = (
    CandidateModel("Voigt", {}, lambda k, c, s: KelvinVoigt(k, c)),
    CandidateModel(
        "filter alone, paper values", _GAIN, lambda k, c, s: SumOfElements((KelvinVoigt(k, 0.0), _band(k, s))), False
    ),
    CandidateModel("filter alone, free", _FILTER, lambda k, c, s: SumOfElements((KelvinVoigt(k, 0.0), _band(k, s))), False),
    CandidateModel("Voigt + filter", _FILTER, lambda k, c, s: SumOfElements((KelvinVoigt(k, c), _band(k, s)))),
    CandidateModel("Voigt + Maxwell", _BRANCH, lambda k, c, s: SumOfElements((KelvinVoigt(k, c), _maxwell(k, s)))),
    CandidateModel(
        "Voigt + Maxwell + friction",
        {**_BRANCH, **_FRICTION},
        lambda k, c, s: SumOfElements(
            (KelvinVoigt(k, c), _maxwell(k, s), BergFriction(s["friction_stroke"] * k, s["half_stroke"]))
        ),
    ),
)

#: other laws of document 001, chapter 2, to be compared on request (row 1-23)
LITERATURE: tuple[CandidateModel, ...] = (
    CandidateModel("Zener", _BRANCH, lambda k, c, s: SumOfElements((KelvinVoigt(k, 0.0), _maxwell(k, s))), False),
    CandidateModel(
        "Voigt + two Maxwell",
        {**_BRANCH, "second_ratio": (0.3, 1e-3, 5.0), "second_time": (3e-3, 5e-4, 2e-2)},
        lambda k, c, s: SumOfElements(
            (KelvinVoigt(k, c), _maxwell(k, s), Maxwell(s["second_ratio"] * k, s["second_ratio"] * k * s["second_time"]))
        ),
    ),
    CandidateModel(
        "Voigt + fractional",
        {"fractional_ratio": (0.3, 1e-3, 20.0), "order": (0.4, 0.05, 0.95)},
        lambda k, c, s: SumOfElements(
            (KelvinVoigt(k, c), Fractional(s["fractional_ratio"] * k, s["order"], FRACTIONAL_REFERENCE, 2.0, 300.0))
        ),
    ),
    CandidateModel(
        "Voigt + Bouc-Wen",
        {"friction_stroke": (1e-3, 1e-6, 2e-2), "slope_ratio": (1.0, 0.05, 50.0)},
        lambda k, c, s: SumOfElements((KelvinVoigt(k, c), BoucWen(s["friction_stroke"] * k, s["slope_ratio"] * k))),
    ),
)


@dataclasses.dataclass(frozen=True)
class FittedModel:
    """One model after the fit.

    Attributes
    ----------
    name
        As printed.
    stiffness, damping
        Per vertical mount [N/m], [N s/m].
    shape
        Shared shape parameters.
    on_bounds
        Parameters that sit on a bound; damping there means that the model needs none.
    elements
        (mount, axis) -> element, ready for :meth:`Vehicle.replace_elements`.
    """

    name: str
    stiffness: dict[str, float]
    damping: dict[str, float]
    shape: dict[str, float]
    on_bounds: tuple[str, ...]
    elements: dict[tuple[str, str], ForceElement]


class MeasuredRun:
    """A run prepared for comparison: base motion in, vertical body accelerations out.

    Parameters
    ----------
    vehicle
        Mounts with prescribed bases need an accelerometer each at their base.
    run
        Measured, sensor axes, gravity in it.

    Raises
    ------
    InputDataError
        Missing base or body accelerometers, run shorter than 10 s, no stretch of 10 s without gaps.

    Notes
    -----
    The longest stretch without a gap of any accelerometer is used, ``used_s`` says from when to when and
    ``left_out_s`` how much was left out [s].
    """

    def __init__(self, vehicle: Vehicle, run: UniformRun) -> None:
        self.name = run.name
        self.rate_hz = run.rate_hz
        if run.samples < _SHORTEST_S * run.rate_hz:
            raise InputDataError(
                f"{run.name}: {run.samples / run.rate_hz:.1f} s are too short; at least {_SHORTEST_S:g} s are needed"
            )
        whole = run.samples
        run, self.used_s = _without_gaps(vehicle, run)
        self.left_out_s = (whole - run.samples) / run.rate_hz
        names = vehicle.mount_names
        acceleration = np.zeros((run.samples, len(names), 3))
        for index, mount in enumerate(vehicle.mounts.values()):
            if mount.base not in vehicle.bodies:
                acceleration[:, index] = self._base(vehicle, run, mount.name)
        self.base = BaseMotion.from_acceleration(acceleration, run.rate_hz, corner_hz=CORNER_HZ)
        self.sensors = tuple(
            s.name for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu") and s.body in vehicle.bodies
            and s.name in run.data and _measures_vertical(s)
        )
        if not self.sensors:
            raise InputDataError(f"{run.name}: no accelerometer that measures the vertical axis on a body of the vehicle file")
        rotations = {n: vehicle.sensors[n].rotation for n in self.sensors}
        measured = np.column_stack([(run.data[n][:, :3] @ rotations[n].T)[:, 2] for n in self.sensors])
        edge = round(_SETTLING_S * run.rate_hz)
        self.kept = slice(edge, run.samples - edge)
        # what the model answers to a filtered base is compared with the measurement behind the same filter, no other
        self.measured = high_passed(measured - measured.mean(axis=0), run.rate_hz, CORNER_HZ)[self.kept]
        self._rotations = rotations

    @staticmethod
    def _base(vehicle: Vehicle, run: UniformRun, mount: str) -> Array:
        for sensor in vehicle.sensors.values():
            if sensor.mount == mount and sensor.kind in ("accelerometer", "imu") and sensor.triaxial and sensor.name in run.data:
                reading = run.data[sensor.name][:, :3] @ sensor.rotation.T
                return np.asarray(reading - reading.mean(axis=0))
        raise InputDataError(f"{run.name}: no triaxial accelerometer at the base of mount {mount}: the model has no input there")

    def modelled(self, model: CompiledModel, elements: Mapping[tuple[str, str], ForceElement]) -> Array:
        """Return the vertical accelerations of a model, compared band, shape as ``measured``."""
        response = model.run(elements)
        vertical = np.column_stack([(response.specific_force(n)[:, :3] @ self._rotations[n].T)[:, 2] for n in self.sensors])
        return np.asarray(vertical - vertical.mean(axis=0))[self.kept]


def _measures_vertical(sensor: Sensor) -> bool:
    """Return whether the axes that an accelerometer measures make up the vertical axis."""
    return bool(np.all(np.abs(sensor.rotation[2, ~sensor.measured[:3]]) < 1e-3))


def _without_gaps(vehicle: Vehicle, run: UniformRun) -> tuple[UniformRun, tuple[float, float]]:
    """Return the longest stretch of a run in which every accelerometer is valid, and when it begins and ends [s].

    Raises
    ------
    InputDataError
        It is too short.
    """
    used = [n for n, s in vehicle.sensors.items() if n in run.data and s.kind in ("accelerometer", "imu")]
    valid = np.logical_and.reduce([run.valid[n] for n in used]) if used else np.ones(run.samples, dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], valid, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins)) if len(begins) else 0
    begin, end = (int(begins[longest]), int(ends[longest])) if len(begins) else (0, 0)
    if end - begin < _SHORTEST_S * run.rate_hz:
        worst = min(used, key=lambda n: float(np.mean(run.valid[n])))
        raise InputDataError(
            f"{run.name}: at most {(end - begin) / run.rate_hz:.1f} s without gaps, {_SHORTEST_S:g} s are needed; most gaps "
            f"are those of {worst}"
        )
    part = slice(begin, end)
    cut = dataclasses.replace(
        run, start_ns=run.start_ns + round(1e9 * begin / run.rate_hz), data={n: v[part] for n, v in run.data.items()},
        valid={n: v[part] for n, v in run.valid.items()},
    )  # fmt: skip
    return cut, (begin / run.rate_hz, end / run.rate_hz)


def fit_candidates(
    vehicle: Vehicle,
    run: MeasuredRun,
    candidates: Sequence[CandidateModel] = CANDIDATES,
    advance: Callable[[float], None] = lambda share: None,
) -> tuple[FittedModel, ...]:
    """Fit every candidate to one run by simulation error; each starts from the best Voigt and from its own start.

    Parameters
    ----------
    advance
        Called with the share of the work that was done, for progress.
    """
    assembly = assemble(vehicle)
    model = CompiledModel(assembly, run.base)
    found = []
    start = _file_values(assembly)
    for candidate in candidates:
        fitted, solution = _fit(candidate, assembly, model, run, start)
        if candidate.name == "Voigt":
            start = solution
        found.append(fitted)
        advance(1.0 / len(candidates))
    return tuple(found)


def _vertical(assembly: Assembly) -> list[str]:
    return [m for m, axis in assembly.components if axis == "z"]


def _file_values(assembly: Assembly) -> Array:
    """Return log stiffness and damping of the vertical mounts in the vehicle file, shape (2 V,)."""
    pairs = [equivalent(e, 2.0, 2e-3) for e, (_, axis) in zip(assembly.elements, assembly.components) if axis == "z"]
    k, c = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    return np.concatenate([np.log(k), np.log(np.maximum(c, 1e-4 * k))])


def _fit(
    candidate: CandidateModel, assembly: Assembly, model: CompiledModel, run: MeasuredRun, start: Array
) -> tuple[FittedModel, Array]:
    mounts = _vertical(assembly)
    count = len(mounts)
    names = list(candidate.shape)
    shape_start = np.log([candidate.shape[n][0] for n in names]) if names else np.zeros(0)
    reach = np.log(np.repeat([_REACH, _LEAST_DAMPING], count))
    lower = np.concatenate([start - reach, np.log([candidate.shape[n][1] for n in names]) if names else np.zeros(0)])
    upper = np.concatenate([start + np.log(_REACH), np.log([candidate.shape[n][2] for n in names]) if names else np.zeros(0)])
    free = np.ones(lower.size, dtype=bool)
    free[count : 2 * count] = candidate.damping_free
    z0 = np.concatenate([start, shape_start])
    scale = run.measured.std(axis=0)

    def elements(z: Array) -> dict[tuple[str, str], ForceElement]:
        shape = dict(zip(names, np.exp(z[2 * count :]).tolist()))
        k, c = np.exp(z[:count]), np.exp(z[count : 2 * count])
        return {(m, "z"): candidate.build(float(k[i]), float(c[i]), shape) for i, m in enumerate(mounts)}

    def residual(z_free: Array) -> Array:
        z = z0.copy()
        z[free] = z_free
        return np.asarray(((run.modelled(model, elements(z)) - run.measured) / scale).ravel())

    result = scipy.optimize.least_squares(
        residual, z0[free], bounds=(lower[free], upper[free]), x_scale=0.2, diff_step=1e-4, xtol=1e-6, ftol=1e-7, max_nfev=25
    )
    z = z0.copy()
    z[free] = result.x
    shape = dict(zip(names, np.exp(z[2 * count :]).tolist()))
    every = [f"stiffness of {m}" for m in mounts] + [f"damping of {m}" for m in mounts] + names
    gap = np.minimum(z - lower, upper - z)
    bounds = tuple(n for n, g, used in zip(every, gap, free) if used and g < 1e-3)
    damping = np.exp(z[count : 2 * count]) if candidate.damping_free else np.zeros(count)
    fitted = FittedModel(
        candidate.name, dict(zip(mounts, np.exp(z[:count]).tolist())), dict(zip(mounts, damping.tolist())), shape, bounds,
        elements(z),
    )
    return fitted, z[: 2 * count]


def predict(vehicle: Vehicle, run: MeasuredRun, fitted: FittedModel) -> Array:
    """Return the vertical accelerations of a fitted model on any run, shape as ``run.measured``."""
    return run.modelled(CompiledModel(assemble(vehicle), run.base), fitted.elements)
