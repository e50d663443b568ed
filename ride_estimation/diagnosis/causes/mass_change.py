# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not know, there from the start or taken on during the run."""

from __future__ import annotations

import dataclasses
import weakref
from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import (
    balanced_acceleration,
    mean_table,
    sensor_error_spectra,
    static_means,
    static_shift,
    unit_weights,
    weight_means,
)
from ride_estimation.diagnosis.common.effect import Column, Effect, Shape, Where
from ride_estimation.diagnosis.hypotheses.body_wrench import six_of, wrench_column
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.operators import step_window
from ride_estimation.diagnosis.model.plant import gravity_stiffness_of, static_forces
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.vehicles.prior import MASS_STD, std_of
from ride_estimation.vehicles.vehicle import Vehicle
from ride_estimation.vehicles.weighed_loads import LARGEST_LOAD

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_UP = np.array([0.0, 0.0, 1.0])
#: instants on the grid, and distance of two of them over which more are tried around the best
_INSTANTS, _NEIGHBOURS = 20, 1.5
#: how long a load takes to come on [s]: first trial, and from what is dropped to what is filled. What comes on slower than a
#: body bounces hardly makes it bounce
_TAKES, _TAKES_WITHIN = 0.5, (0.05, 10.0)
#: a load: standard deviations that one from the start is beyond, and its largest distance from the CG as a multiple of that of
#: the farthest mount or sensor: what a moment needs farther out is a CG that lies elsewhere
_BEYOND, _REACH = 3.0, 1.5
_CONSTANT = "from the start"


@final
class MassChange(Cause):
    """Payload that the vehicle file does not hold."""

    ID = "mass_change"
    QUESTION = "Does a body carry a load that the vehicle file does not know, or does its mass change at some moment of the run?"
    NEEDS = "displacement transducers, weighed corner loads, a load off the CG, or excitation before and after a change"
    RIVALS = ("parameter_drift", "cg_offset")
    WOULD_REFUTE = "the weight of the body on a scale as the vehicle file has it; a damping over stiffness ratio that changes too"
    MEASURE_NEXT = "weigh the body, or log payload or air-spring pressure; mark loading in the recording"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return two hypotheses per body: a load from the start, and one from an instant of a grid on."""
        first, last = (float(t) for t in view.blocks.time_s[[0, -1]])
        grid = tuple({"at": float(t), "over": _TAKES} for t in np.linspace(first, last, _INSTANTS))
        # how the body bounces after a sudden load tells the instant to a twentieth of a second, and only there
        apart = (last - first) / (_INSTANTS - 1)
        instant = Shape("at", 0.5 * (first + last), first, last, 0.2 * apart, _NEIGHBOURS * apart)
        bounds = (instant, Shape("over", _TAKES, *_TAKES_WITHIN))
        travels = any(s.kind == "displacement" for s in view.plant.outputs)
        table, kilogram = mean_table(view), unit_weights(view)[0]
        out: list[Hypothesis] = []
        for body in dict.fromkeys(b for b, _ in view.plant.coordinates):

            always = _AlwaysThere(body)

            def changing(view: RunView, shape: Shapes, always: _AlwaysThere = always) -> list[Column]:
                window = step_window(view.data.time_s, float(shape["at"]), float(shape["over"]))
                return [tuple(dataclasses.replace(e, signal=window * e.signal) for e in column) for column in always(view)]

            def constant(view: RunView, shape: Shapes, b: str = body) -> list[Column]:
                moving = view.grid.signal(balanced_acceleration(view, b))
                return [column for column in _at_rest(view, b, _constant_load(view, b, moving)) if column]

            def simulated(view: RunView, shape: Shapes, b: str = body) -> list[Column]:
                return [column for column in _at_rest(view, b, _constant_load(view, b, six_of(view, b)[1])) if column]

            mass = view.plant.vehicle.bodies[body].mass
            known = _BEYOND * std_of(mass, MASS_STD)
            moments, reach = len(_moment_axes(view, body)), _REACH * _extent(view.plant.vehicle, body)

            def on_the_body(coefficients: Array, shape: Shapes, count: int = moments, reach: float = reach) -> bool:
                return bool(np.all(np.abs(coefficients[1 : 1 + count]) <= reach * abs(float(coefficients[0]))))

            def plausible(
                coefficients: Array, shape: Shapes, least: float = known, near: Callable[[Array, Shapes], bool] = on_the_body
            ) -> bool:
                return abs(float(coefficients[0])) >= least and near(coefficients, shape)

            most = LARGEST_LOAD * mass.value
            sinks = travels or bool(weight_means(view, table, body, kilogram))
            out.append(Hypothesis(
                self.ID, body, "", changing, grid, bounds, largest=most, run_bound=True, plausible=on_the_body
            ))
            out.append(Hypothesis(
                self.ID, body, "", constant, variant=_CONSTANT, largest=most, plausible=plausible,
                shows_in_means=sinks, only_alone=not sinks, moves_cg=True, absorbed=True, simulated=simulated,
            ))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the added mass [kg], its place from the CG [m] and, of a change, the instant [s].

        A part of the first moments of a load from the start is what the CG of a right file is off.
        """
        added, body = float(fitted.coefficients[0]), view.plant.vehicle.bodies[fitted.hypothesis.location]
        constant = fitted.hypothesis.variant == _CONSTANT
        off = body.mass.value / (added or 1.0) * np.array(view.settings.tolerances.of_cg(body)) * constant
        out = [Reported("added mass", added, fitted.std(0), "kg")]
        for number, axis in enumerate(_moments(view, fitted), start=1):
            place = float(fitted.coefficients[number]) / (added or 1.0)
            spread = np.array([-place, 1.0]) / (added or 1.0)
            pick = np.ix_([0, number], [0, number])
            std = float(np.hypot(np.sqrt(max(float(spread @ fitted.covariance[pick] @ spread), 0.0)), off[axis]))
            out.append(Reported(f"place from the CG {AXES[axis]}", place, std, "m"))
        if not constant:
            out.insert(1, Reported("instant", float(fitted.shape["at"]), 0.02 * float(view.data.time_s[-1]), "s"))
        return tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write mass and CG with the load."""
        name = fitted.hypothesis.location
        body = vehicle.bodies[name]
        mass = body.mass.value + float(fitted.coefficients[0])
        moments = np.zeros(3)
        for number, axis in enumerate(_moments(view, fitted), start=1):
            moments[axis] = fitted.coefficients[number]
        changed = dataclasses.replace(
            body, mass=dataclasses.replace(body.mass, value=mass), cg=np.asarray(body.cg) + moments / mass
        )
        when = "with the load" if fitted.hypothesis.variant == _CONSTANT else "after the change"
        return dataclasses.replace(vehicle, bodies={**vehicle.bodies, name: changed}), (
            f"mass and CG of {name} are those {when}; the inertia is left as it was",
        )


class _AlwaysThere:
    """Columns of a load on a body with its weight, as if it were there all the time; those of the last view are kept.

    A search for the instant of a change takes them a hundred times along one motion.
    """

    def __init__(self, body: str) -> None:
        self._body = body
        self._last: tuple[weakref.ref[RunView], list[Column]] | None = None

    def __call__(self, view: RunView) -> list[Column]:
        """Return mass, first moments, moments and products of inertia as far as something tells them.

        They are those of a load from the start, with what it turns, and with its weight, whose onset shows.
        """
        last = self._last  # other threads may ask along other motions
        if last is not None and last[0]() is view:
            return last[1]
        window, gravity = np.ones(len(view.data.time_s)), view.plant.vehicle.gravity
        load = _carried(view, self._body, _load(view, self._body, window, six_of(view, self._body)[1], gravity))
        load = [tuple(e for e in column if e.where is not Where.MEAN) for column in _at_rest(view, self._body, load)]
        columns = (*load, *_inertia(view, self._body, window))
        found = [column for column in columns if column]
        self._last = weakref.ref(view), found
        return found


def _extent(vehicle: Vehicle, body: str) -> float:
    """Return the distance of the farthest mount or sensor of a body from its CG [m]."""
    ends = [m.position for m in vehicle.mounts.values() if body in (m.body, m.base)]
    ends += [s.position for s in vehicle.sensors.values() if s.body == body and s.kind in ("accelerometer", "imu")]
    return max((float(np.linalg.norm(end - vehicle.bodies[body].cg)) for end in ends), default=0.0)


def _moments(view: RunView, fitted: Fitted) -> list[int]:
    """Return the axes of the first moments among the coefficients, in order."""
    return _moment_axes(view, fitted.hypothesis.location)


def _moment_axes(view: RunView, body: str) -> list[int]:
    """Return the axes along which a run can tell the place of a load: about the two others the body turns by itself."""
    turns = view.plant.vehicle.bodies[body].coordinates
    return [i for i in range(3) if any(c in turns for c in COORDINATES[3:] if c != COORDINATES[3 + i])]


def _constant_load(view: RunView, body: str, moving: Array) -> list[Column]:
    # the weight of a load that is always there has no part in the band, and its edges must not leak into it
    return _carried(view, body, _load(view, body, np.ones(len(view.data.time_s)), moving, 0.0))


def _carried(view: RunView, body: str, columns: list[Column]) -> list[Column]:
    """Return columns of a load with what the mount forces that carry it do as they turn."""
    turned = _turned_weights(view, body)
    return [
        (*column, *(Effect(Where.WRENCH, i, signal[:, i]) for i in range(signal.shape[1]) if np.any(signal[:, i])))
        if column else () for column, signal in zip(columns, turned)
    ]


def _turned_weights(view: RunView, body: str) -> list[Array]:
    """Return the wrenches of the mount forces that carry a load, per unit of mass and first moments, as they turn, (N, n) each.

    They turn with the bases of the mounts and attack at points that turn with the body.
    """
    plant, grid = view.plant, view.grid
    known, vehicle = plant.vehicle.bodies[body], plant.vehicle
    heavier = dataclasses.replace(known.mass, value=known.mass.value + 1.0)
    changed = [dataclasses.replace(known, mass=heavier)]
    changed += [dataclasses.replace(known, cg=known.cg + np.eye(3)[i] / known.mass.value) for i in range(3)]
    out = []
    for other in changed:
        loaded = dataclasses.replace(vehicle, bodies={**vehicle.bodies, body: other})
        names = tuple(dict.fromkeys(b for b, _ in plant.coordinates))
        force = static_forces(loaded, plant.mounts, names) - static_forces(vehicle, plant.mounts, names)
        tilt = dataclasses.replace(plant, static_force=force).static_tilt()
        wrench = (view.data.input_spectrum / (-grid.omega**2)[:, None]) @ tilt.T
        stiffness = gravity_stiffness_of(vehicle, plant.mounts, force, plant.coordinates)
        out.append(grid.signal(wrench - view.coordinate_spectrum @ stiffness.T))
    return out


def _load(view: RunView, body: str, window: Array, a: Array, weight: float) -> list[Column]:
    """Return added mass and its three first moments, four columns, empty where nothing tells them.

    A body that does not turn by itself does not tell where on it a load lies.

    Parameters
    ----------
    window
        Share of the load that is there, shape (N,).
    a
        Acceleration of the six coordinates of the body, shape (N, 6).
    weight
        Gravity whose onset shows [m/s^2].
    """
    window = window[:, None]
    gravity = view.plant.vehicle.gravity
    q = six_of(view, body)[0]
    load = a[:, :3] + weight * _UP
    out = [wrench_column(view, body, -window * load, np.zeros_like(load))]
    for i in range(3):
        if i not in _moment_axes(view, body):
            out.append(())
            continue
        arm = np.eye(3)[i]
        force = -np.cross(a[:, 3:], arm)
        moment = -np.cross(arm, load) - gravity * np.cross(np.cross(q[:, 3:], arm), _UP)
        out.append(wrench_column(view, body, window * force, window * moment))
    return out


def _inertia(view: RunView, body: str, window: Array) -> list[Column]:
    """Return three added moments and three products of inertia, empty where the body does not turn."""
    _, a = six_of(view, body)
    out = []
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        moment = np.zeros_like(a[:, :3])
        moment[:, i] = -a[:, 3 + j]
        moment[:, j] = -a[:, 3 + i]
        out.append(wrench_column(view, body, np.zeros_like(moment), window[:, None] * moment))
    return out


def _at_rest(view: RunView, body: str, columns: list[Column]) -> list[Column]:
    """Return the columns of a load with what its weight does at rest: mean readings of transducers, turned bodies."""
    table, out = mean_table(view), []
    for column, six in zip(columns, unit_weights(view)):
        shift = static_shift(view, six @ view.plant.body_map(body))
        means = static_means(view, table, shift) | weight_means(view, table, body, six)
        sag = [Effect(Where.MEAN, row, np.array([value])) for row, value in means.items()]
        out.append((*column, *sag, *_turned(view, shift)) if column else ())
    return out


def _turned(view: RunView, shift: Array) -> list[Effect]:
    """Return what changes when the bodies rest turned by a shift of the coordinates (n,), to first order.

    In axes of the body its sensors, its CG and its mounts stay where they were; the readings of its bases and the axes of its
    mounts are turned back: a mount whose body is turned by phi against its base has the further tension
    ``K (phi x d) - phi x (K d)`` along a deflection d, and alike of its rate. Rotational stiffness counts as that of a sphere.
    """
    plant, vehicle = view.plant, view.plant.vehicle
    turns = {body: (plant.body_map(body) @ shift)[3:] for body in dict.fromkeys(b for b, _ in plant.coordinates)}
    modulus = np.stack(view.state.linear)
    wrench = np.zeros((len(view.data.time_s), len(plant.coordinates)))
    for mount in (vehicle.mounts[name] for name in plant.mounts):
        turn = turns[mount.body] - turns.get(mount.base, np.zeros(3))
        ports = {AXES.index(p.axis): i for i, p in enumerate(plant.ports) if p.mount == mount.name and p.axis in AXES}
        axes, rows = [*ports], [*ports.values()]
        for motion, own in zip((view.deflection, view.deflection_rate), modulus[:, rows]):
            d, force = np.zeros((2, len(motion), 3))
            d[:, axes], force[:, axes] = motion[:, rows], own * motion[:, rows]
            further = own * np.cross(turn, d)[:, axes] - np.cross(turn, force)[:, axes]
            wrench -= further @ plant.port_map[rows]
    out = [Effect(Where.WRENCH, i, wrench[:, i]) for i in range(wrench.shape[1]) if np.any(wrench[:, i])]
    total: dict[int, ComplexArray] = {}
    for name in dict.fromkeys(s.sensor for s in plant.inputs):
        sensor = vehicle.sensors[name]
        carried = [m.body for m in vehicle.mounts.values() if sensor.mount in (m.name, None) and m.base == sensor.body]
        turn = turns.get(carried[0], np.zeros(3)) if carried else np.zeros(3)
        for component, angle in enumerate(-sensor.rotation.T @ turn):
            for i, spectrum in sensor_error_spectra(view, name, "misalignment", component)[0].items():
                total[i] = total.get(i, 0.0) - angle * spectrum
    return out + [Effect(Where.INPUT, i, view.grid.signal(spectrum)) for i, spectrum in total.items()]
