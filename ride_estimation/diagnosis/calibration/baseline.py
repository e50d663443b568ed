# Copyright 2026 ride_estimation contributors
"""Sensitivities of everything a calibration may adjust: stiffness, damping, CG, inertia, installation tolerances.

Each is a column of the whitened regression with a prior standard deviation. A cause must explain what these cannot.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.initial_state import initial_motions
from ride_estimation.diagnosis.common.effect import Where
from ride_estimation.diagnosis.model.plant import CHANNELS, Plant, Signal
from ride_estimation.diagnosis.runs.frame import tilt_spectrum
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix, skew
from ride_estimation.vehicles.weighed_loads import Balance, absurd, balance_of, balances, contradicted

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SingleArray = NDArray[np.float32]


#: errors of single sensors
OF_SENSORS = ("gain", "misalignment", "position", "delay", "bandwidth")
_BATCH = 32  # columns whitened at once: transforms of all of them together take half a gigabyte for a minute


@dataclasses.dataclass(frozen=True)
class Adjustable:
    """One adjustable number of the calibrated model.

    Attributes
    ----------
    kind
        ``stiffness``, ``damping`` (natural logarithm), ``cg``, ``inertia``, ``mount_axes``, ``gain``, ``misalignment``,
        ``position``, ``delay``, ``bandwidth``, ``attitude``, ``tilt``, ``twist``, ``initial_state``.
    place, axis
        Port, body, sensor or mode it belongs to; of the gain of an angular rate ``rate_x``, ``rate_y`` or ``rate_z``.
    prior_std
        In the unit of the number.
    offset
        Prior value minus current value.
    """

    kind: str
    place: str
    axis: str
    prior_std: float
    offset: float = 0.0

    @property
    def name(self) -> str:
        """Return ``<place>.<axis>.<kind>``."""
        return ".".join(part for part in (self.place, self.axis, self.kind) if part)


@dataclasses.dataclass(frozen=True)
class MeanTable:
    """Mean readings of accelerometers that see gravity and of transducers, and weighed loads: the zero-frequency evidence.

    Attributes
    ----------
    signals
        One per row, of the first rows.
    weighed
        Body and coordinate of every equilibrium of weighed loads, of the others.
    residual
        Measured mean minus gravity along the sensor axis, or minus the zero of a transducer, or weighed loads less the weight, in
        units of ``std``, shape (K,).
    std
        Offset tolerance of every row [m/s^2], [m], [N], [N m], shape (K,).
    gravity
        Gravity reaction in sensor axes by sensor name, shape (3,).
    """

    signals: tuple[Signal, ...]
    weighed: tuple[tuple[str, int], ...]
    residual: Array
    std: Array
    gravity: dict[str, Array]

    def row(self, sensor: str, component: int) -> int | None:
        """Return the row of a channel, None where the channel is not in the table."""
        for i, s in enumerate(self.signals):
            if s.sensor == sensor and s.component == component:
                return i
        return None


def mean_table(view: RunView) -> MeanTable:
    """Return the mean readings of a run against gravity, those of transducers and weighed loads against static equilibrium."""
    plant, tolerances = view.plant, view.settings.tolerances
    gravity = {s: plant.vehicle.sensors[s].rotation.T @ np.array([0.0, 0.0, plant.vehicle.gravity]) for s in plant.sensors}
    rows: list[Signal] = []
    readings: list[float] = []
    for signals, mean, shift in (
        (plant.outputs, view.data.output_mean, view.model.output_rectified),
        (plant.inputs, view.data.input_mean, np.zeros(len(plant.inputs))),
    ):
        for s, m, d in zip(signals, mean, shift):
            if s.kind == "displacement" or s.dc:
                rows.append(s)
                readings.append(float(m - d - (gravity[s.sensor][s.component] if s.kind == "acceleration" else 0.0)))
    installed = [tolerances.of(plant.vehicle.sensors[s.sensor]) for s in rows]
    std = np.array([i.bias if s.kind == "acceleration" else i.travel_zero for s, i in zip(rows, installed)])
    balanced = _contradicted_balances(plant)
    values, std = np.array([*readings, *(b.left for b in balanced)]), np.array([*std, *(b.std for b in balanced)])
    return MeanTable(tuple(rows), tuple((b.body, b.coordinate) for b in balanced), values / std, std, gravity)


def _contradicted_balances(plant: Plant) -> list[Balance]:
    """Return the equilibria that weighed loads contradict by the vehicle file, at the CGs of a plant without named offsets."""
    vehicle, out = plant.vehicle, list[Balance]()
    without = {
        body: known.cg - np.array([plant.named_cg.get((body, a), 0.0) for a in AXES]) for body, known in vehicle.bodies.items()
    }
    of_file = {
        body: cg - np.array([plant.body_errors.get(("cg", body, a), 0.0) for a in AXES]) for body, cg in without.items()
    }
    for name in dict.fromkeys(b for b, _ in plant.coordinates):
        stated = balances(vehicle, name, of_file)
        if contradicted(vehicle, stated) and not absurd(vehicle, stated):
            out += balances(vehicle, name, without)
    return out


def weight_means(view: RunView, table: MeanTable, body: str, weight: Array) -> dict[int, float]:
    """Return what a further weight on a body, its wrench about the CG (6,), adds to weighed loads, row -> [N], [N m]."""
    first = len(table.signals)
    return {first + i: value for i, value in balance_of(table.weighed, view.plant.vehicle, body, weight).items()}


def unit_weights(view: RunView) -> Array:
    """Return the wrenches of the weights of a kilogram and of first moments of a kilogram metre along x, y, z, shape (4, 6)."""
    down = np.array([0.0, 0.0, -view.plant.vehicle.gravity])
    return np.vstack([np.append(down, np.zeros(3)), np.hstack([np.zeros((3, 3)), np.cross(np.eye(3), down)])])


def cg_means(view: RunView, table: MeanTable, body: str, axis: int) -> dict[int, float]:
    """Return what a CG that lies one metre off along an axis adds to weighed loads, row -> [N], [N m]."""
    return weight_means(view, table, body, view.plant.vehicle.bodies[body].mass.value * unit_weights(view)[1 + axis])


def static_shift(view: RunView, wrench: Array) -> Array:
    """Return the coordinates at rest under a constant wrench, both of shape (n,)."""
    return view.plant.at_rest(view.state.stiffness, wrench, view.grid.duration_s)


def static_means(view: RunView, table: MeanTable, shift: Array) -> dict[int, float]:
    """Return what a shift of the coordinates at rest (n,) adds to the mean readings of transducers, row -> [m]."""
    plant = view.plant
    travel = plant.out_displacement @ shift
    return {
        row: float(travel[i])
        for i, s in enumerate(plant.outputs)
        if s.kind == "displacement" and (row := table.row(s.sensor, s.component)) is not None and travel[i] != 0.0
    }


#: an adjustable, its output spectrum (F, ny), and what it adds to mean readings, row -> value
_Column = tuple[Adjustable, ComplexArray, dict[int, float]]


def baseline_columns(
    view: RunView, table: MeanTable, prior: tuple[Array, Array]
) -> tuple[tuple[Adjustable, ...], SingleArray, Array]:
    """Return the adjustables of a view with their whitened rows (B, R, p) and mean rows (K, p).

    Parameters
    ----------
    view
        Run and model state.
    table
        Mean readings.
    prior
        Stiffness and damping of the vehicle file, shape (P,) each.
    """
    adjustables: list[Adjustable] = []
    parts, means = [], []
    columns = itertools.chain(baseline_spectra(view, table, prior), _initial_columns(view))
    # spectra of all columns at once take a hundred megabytes
    while batch := [*itertools.islice(columns, _BATCH)]:
        adjustables += [item for item, _, _ in batch]
        parts.append(view.rows(np.stack([spectrum for _, spectrum, _ in batch], axis=2), single=True))
        means.append(np.zeros((len(table.std), len(batch))))
        for number, (_, _, own) in enumerate(batch):
            means[-1][[*own], number] = np.array([*own.values()]) / table.std[[*own]]
    return tuple(adjustables), np.concatenate(parts, axis=2), np.concatenate(means, axis=1)


def baseline_spectra(view: RunView, table: MeanTable, prior: tuple[Array, Array]) -> Iterator[_Column]:
    """Yield the adjustables that hold on other runs, too, their output spectra (F, ny) and means they add to, row -> value."""
    moving = {name: body_spectra(view, name)[1] for name in dict.fromkeys(b for b, _ in view.plant.coordinates)}
    from_port = view.response.output_from_port
    for item, p, force in _port_adjustables(view, prior):
        yield item, from_port[:, :, p] * force[:, None], {}
    for item, spectrum in (*body_adjustables(view, moving), *_axes_columns(view), *_tilt_columns(view)):
        yield item, spectrum, cg_means(view, table, item.place, AXES.index(item.axis)) if item.kind == "cg" else {}
    yield from _sensor_columns(view, table)
    yield from _attitude_columns(view, table)


def _initial_columns(view: RunView) -> Iterator[_Column]:
    """Yield the initial state of the run, which belongs to no other."""
    names, std, spectra = initial_motions(view)
    for number, (mode, name) in enumerate(names):
        yield Adjustable("initial_state", mode, name, float(std[number])), spectra[:, :, number], {}


def _port_adjustables(view: RunView, prior: tuple[Array, Array]) -> list[tuple[Adjustable, int, ComplexArray]]:
    """Return the logarithms of stiffness and damping of every port, the port and its force spectrum (F,)."""
    out = []
    for p, port in enumerate(view.plant.ports):
        x = view.deflection_spectrum[:, p]
        for kind, value, reference, std, signal in (
            ("stiffness", view.state.stiffness[p], prior[0][p], port.stiffness_log_std, x),
            ("damping", view.state.damping[p], prior[1][p], port.damping_log_std, 1j * view.grid.omega * x),
        ):
            if value > 0.0:
                item = Adjustable(kind, port.mount, port.axis, std, float(np.log(reference / value)))
                out.append((item, p, value * signal))
    return out


def port_columns(view: RunView, prior: tuple[Array, Array]) -> tuple[tuple[Adjustable, ...], Array]:
    """Return the port adjustables of a view and their whitened rows (B, R, p)."""
    adjustables, ports, forces = zip(*_port_adjustables(view, prior))
    return adjustables, view.port_rows(ports, np.stack(forces, axis=1))


def body_spectra(view: RunView, body: str) -> tuple[ComplexArray, ComplexArray]:
    """Return displacement and acceleration spectra of the six coordinates of a body, (F, 6) each."""
    q: ComplexArray = view.coordinate_spectrum @ view.plant.body_map(body).T
    return q, np.asarray(-(view.grid.omega**2)[:, None] * q)


def balanced_acceleration(view: RunView, body: str) -> ComplexArray:
    """Return the spectrum of the acceleration that the forces along the estimated deflections give a body, (F, 6).

    ``M q'' = -D^T ((k + i w c) x + law forces) - K_g q + T theta_base + wrenches``. Deflections are cleared of the noise of the
    base sensors: what mass, CG and inertia do is compared with what stiffness and damping do along the same deflections, else
    the difference of two estimates of one motion would tell a mass that no run can tell.
    """
    plant, grid = view.plant, view.grid
    stiffness, damping = view.state.linear
    force = (stiffness + 1j * grid.omega[:, None] * damping) * view.deflection_spectrum
    wrench = -force @ plant.port_map - view.coordinate_spectrum @ plant.gravity_stiffness
    wrench += (view.data.input_spectrum / (-grid.omega**2)[:, None]) @ plant.static_tilt().T
    for e in view.state.effects:
        if e.where is Where.PORT:
            wrench -= np.outer(grid.spectrum(e.signal), plant.port_map[e.index])
        elif e.where is Where.WRENCH:
            wrench[:, e.index] += grid.spectrum(e.signal)
    return np.asarray(wrench @ np.linalg.inv(plant.mass) @ plant.body_map(body).T, dtype=complex)


def cg_shift_wrench(
    view: RunView, body: str, shift: Array, acceleration: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return force and moment spectra of a CG that lies ``shift`` from where the model has it, (F, 3) each.

    About the model's CG: ``force = -m alpha x d``, ``moment = -m d x a - m g (theta x d) x e_z``, with the acceleration of the
    six coordinates of the body, shape (F, 6).
    """
    mass, gravity = view.plant.vehicle.bodies[body].mass.value, view.plant.vehicle.gravity
    q, a = body_spectra(view, body)[0], acceleration
    force = -mass * np.cross(a[:, 3:], shift)
    moment = -mass * np.cross(shift, a[:, :3]) - mass * gravity * np.cross(np.cross(q[:, 3:], shift), [0.0, 0.0, 1.0])
    return np.asarray(force, dtype=complex), np.asarray(moment, dtype=complex)


def body_adjustables(view: RunView, accelerations: Mapping[str, ComplexArray]) -> list[tuple[Adjustable, ComplexArray]]:
    """Return CG and inertia of bodies that move with some accelerations (F, 6), with their output spectra (F, ny)."""
    tolerances, known = view.settings.tolerances, view.plant.body_errors
    out: list[tuple[Adjustable, ComplexArray]] = []

    def add(kind: str, name: str, label: str, std: float, force: ComplexArray, moment: ComplexArray) -> None:
        wrench = np.concatenate([force, moment], axis=1) @ view.plant.body_map(name)
        output = np.einsum("fij,fj->fi", view.response.output_from_wrench, wrench)
        out.append((Adjustable(kind, name, label, std, -known.get((kind, name, label), 0.0)), output))

    for name, a in accelerations.items():
        body = view.plant.vehicle.bodies[name]
        for i, (axis, std) in enumerate(zip(AXES, tolerances.of_cg(body))):
            add("cg", name, axis, std, *cg_shift_wrench(view, name, np.eye(3)[i], a))
        relative = tolerances.inertia if body.inertia_relative_std is None else body.inertia_relative_std
        diagonal = np.sqrt(np.abs(np.diag(body.inertia)))
        for i in range(3):
            for j in range(i, 3):
                if COORDINATES[3 + i] not in body.coordinates and COORDINATES[3 + j] not in body.coordinates:
                    continue
                change = np.zeros((3, 3))
                change[i, j] = change[j, i] = diagonal[i] * diagonal[j]
                moment = -a[:, 3:] @ change
                add("inertia", name, f"i{AXES[i]}{AXES[j]}", relative, np.zeros_like(moment), moment)
    return out


def balanced_columns(view: RunView, bodies: Collection[str]) -> tuple[tuple[Adjustable, ...], Array]:
    """Return CG and inertia of some bodies and their whitened rows (B, R, p) along :func:`balanced_acceleration`."""
    pairs = body_adjustables(view, {name: balanced_acceleration(view, name) for name in bodies})
    return tuple(a for a, _ in pairs), view.rows(np.stack([s for _, s in pairs], axis=2), single=True)


def _axes_columns(view: RunView) -> Iterator[tuple[Adjustable, ComplexArray]]:
    """Yield what changes when the mount axes turn with the body, or with nothing, instead of with the base."""
    base = view.rotation_wrench("base")
    for axes in ("body", "world"):
        change = view.grid.spectrum(view.data.tapered(view.rotation_wrench(axes) - base))
        output = np.einsum("fij,fj->fi", view.response.output_from_wrench, change)
        yield Adjustable("mount_axes", axes, "", 0.5), output


def _tilt_columns(view: RunView) -> Iterator[tuple[Adjustable, ComplexArray]]:
    """Yield how much of every possible tilt the brackets really follow."""
    plant = view.plant
    for tilt, share in zip(plant.tilts, plant.tilt_share):
        item = Adjustable(tilt.kind, tilt.place, tilt.axis, tilt.usual_std, tilt.usual - float(share))
        yield item, tilt_spectrum(plant, view.response, tilt.slope, view.data.input_spectrum)


def sensor_error_spectra(
    view: RunView, sensor: str, kind: str, component: int, fault: Array | None = None
) -> tuple[dict[int, ComplexArray], bool]:
    """Return what one unit of a sensor error adds to the reading, channel -> spectrum, and whether it is an input.

    Parameters
    ----------
    kind
        ``gain``, ``misalignment``, ``position``, ``delay`` or ``bandwidth``.
    component
        Axis of gain (:data:`plant.CHANNELS`), rotation or shift; ignored by ``delay`` and ``bandwidth``, which touch all axes.
    fault
        What the sensor reads over what it would read without a large fault of its own, shape (6, 6), of a sensor without
        angular rates (3, 3) or more: that distorts what its small errors add as well. What an input would read is wanted
        instead of the reading.

    Notes
    -----
    Accelerometer and gyro of an IMU share housing and clock: its rotation, its delay and its low-pass are one error of all six
    channels. The gain of every channel is its own; a position does not act on rates.
    """
    is_input = any(s.sensor == sensor for s in view.plant.inputs)
    rows = {s.component: i for i, s in enumerate(view.plant.inputs if is_input else view.plant.outputs) if s.sensor == sensor}
    spectrum = view.data.input_spectrum if is_input else view.model.ideal_spectrum
    if fault is None:
        return _plain_error(view, sensor, kind, component, spectrum, rows), is_input
    places = [*rows.values()]
    own = fault[np.ix_([*rows], [*rows])]
    if is_input:
        spectrum = spectrum.copy()
        spectrum[:, places] = spectrum[:, places] @ np.linalg.inv(own).T
        return _plain_error(view, sensor, kind, component, spectrum, rows), is_input
    plain = _plain_error(view, sensor, kind, component, spectrum, rows)
    zero = np.zeros(len(spectrum), dtype=complex)
    read = np.stack([plain.get(i, zero) for i in places], axis=1) @ own.T
    return ({i: read[:, n] for n, i in enumerate(places)} if plain else {}), is_input


def _plain_error(
    view: RunView, sensor: str, kind: str, component: int, spectrum: ComplexArray, rows: Mapping[int, int]
) -> dict[int, ComplexArray]:
    plant, grid = view.plant, view.grid
    is_input = any(s.sensor == sensor for s in plant.inputs)
    if kind == "delay":
        return {i: -1j * grid.omega * spectrum[:, i] for i in rows.values()}
    if kind == "bandwidth":
        factor = -(grid.omega**2) / view.grid.rate_hz**2
        return {i: factor * spectrum[:, i] for i in rows.values()}
    if kind == "gain":
        return {i: spectrum[:, i] for c, i in rows.items() if c == component}
    if kind == "misalignment":
        return turned_reading(spectrum, rows, -skew(np.eye(3)[component]))
    description = plant.vehicle.sensors[sensor]
    shift = point_motion_matrix(np.eye(3)[component])[:, 3:]
    if is_input:
        return {}
    _, a = body_spectra(view, description.body)
    motion = a[:, 3:] @ shift.T @ description.rotation
    return {i: motion[:, c] for c, i in rows.items() if c < len(AXES)}


def turned_reading(spectrum: ComplexArray, rows: Mapping[int, int], turn: Array) -> dict[int, ComplexArray]:
    """Return a matrix (3, 3) times what a sensor measures, channel -> spectrum (F,): accelerations, and rates likewise.

    Parameters
    ----------
    spectrum
        Of all channels, shape (F, q).
    rows
        Component of the sensor -> channel.
    """
    out: dict[int, ComplexArray] = {}
    for first in range(0, len(CHANNELS), len(AXES)):
        own = {c - first: i for c, i in rows.items() if first <= c < first + len(AXES)}
        for c, i in own.items():
            if np.any(turn[c]):
                out[i] = sum((turn[c, d] * spectrum[:, k] for d, k in own.items()), np.zeros(len(spectrum), dtype=complex))
    return out


def faulty_rows(view: RunView, adjustables: Sequence[Adjustable], faults: Mapping[str, Array]) -> tuple[list[int], Array]:
    """Return the places of the errors of some faulty sensors and their whitened rows (B, R, p), sensor -> fault, shape (6, 6)."""
    places, spectra = [], []
    for i, a in enumerate(adjustables):
        if a.kind in OF_SENSORS and a.place in faults:
            component = CHANNELS.index(a.axis) if a.axis else 0
            errors, is_input = sensor_error_spectra(view, a.place, a.kind, component, faults[a.place])
            places.append(i)
            spectra.append(error_outputs(view, errors, is_input))
    return places, view.rows(np.stack(spectra, axis=2), single=True) if spectra else np.zeros((*view.residual.shape, 0))


def error_outputs(view: RunView, errors: dict[int, ComplexArray], is_input: bool) -> ComplexArray:
    """Return the output spectrum of reading errors: direct for outputs, minus the transfer for inputs, (F, ny)."""
    out = np.zeros((len(view.grid.omega), len(view.plant.outputs)), dtype=complex)
    for index, spectrum in errors.items():
        if is_input:
            out -= view.response.output_from_input[:, :, index] * spectrum[:, None]
        else:
            out[:, index] += spectrum
    return out


def sensor_error_means(table: MeanTable, sensor: str, kind: str, component: int) -> dict[int, float]:
    """Return what one unit of a sensor error adds to the mean readings, row -> value."""
    change = np.zeros(3)
    gravity = table.gravity[sensor]
    if kind == "gain":
        change[component : component + 1] = gravity[component : component + 1]
    elif kind == "misalignment":
        change = -skew(np.eye(3)[component]) @ gravity
    rows = {c: table.row(sensor, c) for c in range(3)}
    return {row: float(change[c]) for c, row in rows.items() if row is not None and change[c] != 0.0}


def _sensor_columns(view: RunView, table: MeanTable) -> Iterator[_Column]:
    tolerances = view.settings.tolerances
    for sensor in view.plant.sensors:
        installed = tolerances.of(view.plant.vehicle.sensors[sensor])
        kinds: tuple[tuple[str, float], ...] = (
            ("gain", installed.gain), ("misalignment", installed.misalignment), ("position", installed.position),
            ("delay", installed.delay), ("bandwidth", tolerances.bandwidth),
        )
        axes = [s.component for s in (*view.plant.outputs, *view.plant.inputs) if s.sensor == sensor]
        displacement = view.plant.vehicle.sensors[sensor].kind == "displacement"
        for kind, std in kinds:
            if displacement and kind in ("misalignment", "position"):
                continue
            for component in (range(3) if kind in ("misalignment", "position") else axes if kind == "gain" else (0,)):
                errors, is_input = sensor_error_spectra(view, sensor, kind, component)
                if not errors:
                    continue
                axis = "" if kind in ("delay", "bandwidth") else CHANNELS[component]
                means = {} if displacement else sensor_error_means(table, sensor, kind, component)
                known = view.plant.reading_errors.get((kind, sensor, axis), 0.0) if is_input else 0.0
                own = tolerances.gyro_gain if component >= len(AXES) else std
                yield Adjustable(kind, sensor, axis, own, -known), error_outputs(view, errors, is_input), means


def _attitude_columns(view: RunView, table: MeanTable) -> Iterator[_Column]:
    """Yield the unknown mean attitude of every body that carries accelerometers."""
    plant = view.plant
    bodies = dict.fromkeys(plant.vehicle.sensors[s.sensor].body for s in table.signals)
    for body in bodies:
        for axis in (0, 1):
            means = {}
            for i, s in enumerate(table.signals):
                sensor = plant.vehicle.sensors[s.sensor]
                if sensor.body == body:
                    turned = sensor.rotation.T @ (-skew(np.eye(3)[axis]) @ np.array([0.0, 0.0, plant.vehicle.gravity]))
                    means[i] = float(turned[s.component])
            yield Adjustable("attitude", body, COORDINATES[3 + axis], 0.3), error_outputs(view, {}, False), means
