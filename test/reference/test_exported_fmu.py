# Copyright 2026 ride_estimation contributors
"""Exported models run by FMPy, an independent importer, against this package's own simulation."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.modified_berg import ModifiedBerg
from ride_estimation.elements.registry import kinds
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.elements.terms import continued, initial_states, pack_terms
from ride_estimation.export.elements import exported
from ride_estimation.export.fmu import VERSIONS, fmu_texts, parameter_document
from ride_estimation.export.model import ExportModel, element_model, vehicle_model
from ride_estimation.io.fmu_file import find_compiler, write_fmu
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import Assembly, assemble

fmpy = pytest.importorskip("fmpy")
COMPILER = find_compiler()
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler for 64-bit Linux")

RATE = 1000.0
#: steps of the integrator per sample: the stops are stiff
SUBSTEPS = 8
SAMPLES = 1500
TIME = np.arange(SAMPLES) / RATE
#: equal to the simulation within this share of the largest force
AGREEMENT = 1e-9
ELEMENTS = {kind: element.example() for kind, element in kinds().items()}


def written(model: ExportModel, version: str, folder: Path) -> str:
    path = folder / f"{model.name}_{version}.fmu"
    write_fmu(path, model.name, version, fmu_texts(model, version), parameter_document(model, {}), COMPILER)
    return str(path)


@pytest.fixture(scope="module", params=VERSIONS)
def all_elements(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Every kind of force element side by side in one unit."""
    parts = [exported(kind, "z", element, {}, None, prefix=f"{kind}.") for kind, element in ELEMENTS.items()]
    model = element_model("all kinds", parts, "every kind of force element")
    return written(model, request.param, tmp_path_factory.mktemp("fmu"))


def random_motion() -> np.ndarray:
    steps = np.random.default_rng(5).normal(size=SAMPLES)
    return 0.008 * np.convolve(steps, np.hanning(25), "same") / 3.0


def pulses() -> np.ndarray:
    return 0.02 * (np.sin(2 * np.pi * 2.0 * TIME) > 0.9) - 0.015 * (np.sin(2 * np.pi * 1.3 * TIME) < -0.95)


def into_the_stops() -> np.ndarray:
    """Far past both ends of the travel of every stop of the examples, and back."""
    return 0.12 * np.sin(2 * np.pi * 1.5 * TIME) * np.minimum(TIME / 0.5, 1.0)


MOTIONS = {f.__name__: f for f in (random_motion, pulses, into_the_stops)}


def own_force(kind: str, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Force of an element at rest at zero that is put to the first sample without time passing, then stepped."""
    codes, params = pack_terms(ELEMENTS[kind].terms())
    states = initial_states(codes, params)
    first = continued(codes, params, states, x[:1], v[:1], 0.0)
    return np.concatenate([first, continued(codes, params, states, x[1:], v[1:], 1 / RATE)])


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_every_kind_of_element_gives_the_force_of_the_simulation(all_elements: str, interface: str, motion: str) -> None:
    x = MOTIONS[motion]()
    v = np.gradient(x, 1 / RATE)
    columns = {f"{k}.{w}": values for k in ELEMENTS for w, values in (("deflection", x), ("rate", v))}
    names = list(ELEMENTS)
    found = stepped(all_elements, interface, columns, [f"{k}.force" for k in names])
    for i, kind in enumerate(names):
        expected = own_force(kind, x, v)
        scale = max(np.abs(expected).max(), 1.0)
        assert np.abs(found[:, i] - expected).max() < AGREEMENT * scale, kind


def shaken_cab(motion: str) -> tuple[Assembly, BaseMotion]:
    """Return a cab on hysteretic mounts with stops and the motion of its tilting base; the last motion hits the stops."""
    vehicle = load_vehicle("truck_cab")
    law = SumOfElements((ModifiedBerg.example(), BumpStop.example()))
    vehicle = vehicle.replace_elements({(m, "z"): law for m in vehicle.mount_names})
    mounts = len(vehicle.mounts)
    if motion == "pulses":
        share = np.random.default_rng(4).normal(size=(mounts, 3))
        # what a bench can do: a pulse rises within a few milliseconds
        smooth = 0.1 * share * np.convolve(pulses(), np.hanning(9) / np.hanning(9).sum(), "same")[:, None, None]
    else:
        shapes = np.random.default_rng(3).normal(size=(SAMPLES, mounts, 3))
        smooth = np.apply_along_axis(lambda s: np.convolve(s, np.hanning(60), "same"), 0, shapes)
        smooth *= (0.0018 if motion == "random_motion" else 0.006) * np.minimum(TIME, 0.2)[:, None, None]
    return assemble(vehicle), BaseMotion.from_displacement(smooth, RATE, angle=smooth[:, ::-1] / 12.0)


def base_columns(model: ExportModel, assembly: Assembly, base: BaseMotion) -> dict[str, np.ndarray]:
    motion = np.concatenate([base.displacement, base.angle], axis=2)
    velocity = np.concatenate([base.velocity, base.angular_rate], axis=2)
    columns = {}
    for variable in model.variables:
        mount, _, rest = variable.name.partition(".")
        axis, _, what = rest.partition(".")
        if what.startswith("base_"):
            source = motion if what == "base_displacement" else velocity
            number = ("x", "y", "z", "roll", "pitch", "yaw").index(axis)
            columns[variable.name] = source[:, assembly.mount_names.index(mount), number]
    return columns


@pytest.fixture(scope="module")
def cab_unit(tmp_path_factory: pytest.TempPathFactory) -> Callable[[ExportModel, str], str]:
    """Return what writes the cab as a unit, once per version and rate: it is the same one whatever moves it."""
    folder, done = tmp_path_factory.mktemp("cab"), {}

    def unit(model: ExportModel, version: str) -> str:
        key = (version, *fmu_texts(model, version).values())
        if key not in done:
            (folder / str(len(done))).mkdir()
            done[key] = written(model, version, folder / str(len(done)))
        return done[key]

    return unit


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("version", VERSIONS)
def test_a_cab_moves_as_in_the_simulation(
    version: str, motion: str, cab_unit: Callable[[ExportModel, str], str]
) -> None:
    assembly, base = shaken_cab(motion)
    own = simulate(assembly, base, substeps=SUBSTEPS)
    hit = np.abs(own.deflection).max() > BumpStop.example().compression_gap
    assert hit == (motion == "into_the_stops")
    model = vehicle_model(assembly, SUBSTEPS * RATE)
    columns = base_columns(model, assembly, base)
    outputs = [v.name for v in model.variables if v.role in ("state", "output")]
    unit = cab_unit(model, version)
    found = stepped(unit, "CoSimulation", columns, outputs)
    size, components = len(assembly.coordinates), len(assembly.components)
    expected = np.hstack([own.coordinates, own.rates, own.accelerations, own.deflection])
    for i in range(3 * size + components):
        scale = max(np.abs(expected[:, i]).max(), 1e-3)
        assert np.abs(found[:, i] - expected[:, i]).max() < AGREEMENT * scale, outputs[i]
    force = own.mount_force()
    for i, (mount, axis) in enumerate(assembly.components):
        given = found[:, 3 * size + components + i]
        want = force[:, assembly.mount_names.index(mount), "xyz".index(axis)]
        assert np.abs(given - want).max() < AGREEMENT * np.abs(want).max(), (mount, axis)


class Unit:
    """An initialised unit under FMPy, the same words for both versions."""

    def __init__(self, path: str, interface: str, first: dict[str, float]) -> None:
        description = fmpy.read_model_description(path)
        self.fmu = fmpy.instantiate_fmu(fmpy.extract(path), description, interface)
        self.number = {v.name: v.valueReference for v in description.modelVariables}
        old = description.fmiVersion == "2.0"
        self.set = self.fmu.setReal if old else self.fmu.setFloat64
        self.get = self.fmu.getReal if old else self.fmu.getFloat64
        self.keep, self.put = (
            (self.fmu.getFMUstate, self.fmu.setFMUstate) if old else (self.fmu.getFMUState, self.fmu.setFMUState)
        )
        if old:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.set([self.number[n] for n in first], [float(v) for v in first.values()])
        self.fmu.exitInitializationMode()
        if interface == "ModelExchange":
            self.slopes = self.fmu.getDerivatives if old else self.fmu.getContinuousStateDerivatives
            self.fmu.enterContinuousTimeMode()

    def free(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def stepped(path: str, interface: str, columns: dict[str, np.ndarray], outputs: list[str]) -> np.ndarray:
    """Return outputs at every sample, shape (N, outputs).

    Inputs of sample k are given for the step that ends there (co-simulation) or at its time (model exchange).
    """
    unit = Unit(path, interface, {name: values[0] for name, values in columns.items()})
    inputs, wanted = [unit.number[n] for n in columns], [unit.number[n] for n in outputs]
    rows = [unit.get(wanted)]
    table = np.column_stack(list(columns.values()))
    for k in range(1, SAMPLES):
        if interface == "ModelExchange":
            unit.fmu.setTime(k / RATE)
            unit.set(inputs, table[k])
            unit.fmu.completedIntegratorStep()
        else:
            unit.set(inputs, table[k])
            unit.fmu.doStep(currentCommunicationPoint=(k - 1) / RATE, communicationStepSize=1 / RATE)
        rows.append(unit.get(wanted))
    unit.free()
    return np.array(rows)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_description_obeys_the_standard_and_the_source_fits_its_headers(version: str, tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    model = vehicle_model(assemble(load_vehicle("truck_cab")), RATE)
    assert validate_fmu(written(model, version, tmp_path)) == []
    for inside, text in fmu_texts(model, version).items():
        (tmp_path / Path(inside).name).write_text(text)
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        [str(COMPILER), "-std=c99", "-Wall", "-Werror", f"-DFMI{version}_STANDARD_HEADERS", f"-I{headers}", "-c",
         f"fmi{version}.c", "-o", "checked.o"],
        cwd=tmp_path, check=True,
    )  # fmt: skip


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_that_was_kept_gives_the_same_steps_again(version: str, tmp_path: Path) -> None:
    alone = exported("mount", "z", ModifiedBerg.example(), {}, None)
    path = written(element_model("mount", [alone], "one mount"), version, tmp_path)
    unit = Unit(path, "CoSimulation", {})

    def steps(first: int) -> list[float]:
        forces = []
        for k in range(first, first + 20):
            unit.set([unit.number["deflection"]], [0.003 * np.sin(0.3 * k)])
            unit.fmu.doStep(currentCommunicationPoint=k / RATE, communicationStepSize=1 / RATE)
            forces += unit.get([unit.number["force"]])
        return forces

    steps(0)
    kept = unit.keep()
    once = steps(20)
    unit.put(kept)
    assert steps(20) == once
    # through bytes into a state of its own, as a program does that stores it
    stored = unit.fmu.serializeFMUState(kept)
    unit.put(unit.fmu.deserializeFMUState(stored))
    assert steps(20) == once
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.fmu.deserializeFMUState(stored[:-1])
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.set([unit.number["deflection"]], [float("nan")])
    unit.free()


def pointer(numbers: np.ndarray) -> object:
    return numbers.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("version", VERSIONS)
def test_a_solver_of_another_program_moves_the_cab_as_the_simulation(
    version: str, motion: str, cab_unit: Callable[[ExportModel, str], str]
) -> None:
    """Model exchange under Runge-Kutta steps of this test; the base between samples on the splines of the simulation."""
    assembly, base = shaken_cab(motion)
    # without tilt: between samples the simulation lets what a tilted base does run straight, which no solver can know
    base = BaseMotion.from_displacement(base.displacement[:800], RATE)
    own = simulate(assembly, base, substeps=1)
    assert (np.abs(own.deflection).max() > BumpStop.example().compression_gap) == (motion == "into_the_stops")
    model = vehicle_model(assembly, RATE)
    columns = base_columns(model, assembly, base)
    unit = Unit(cab_unit(model, version), "ModelExchange", {n: c[0] for n, c in columns.items()})
    inputs, size, h = [unit.number[n] for n in columns], len(assembly.coordinates), 1 / RATE
    table = np.column_stack(list(columns.values()))
    u, v = table[:, 0::2], table[:, 1::2]
    middle = np.empty_like(table[1:])
    middle[:, 0::2] = 0.5 * (u[1:] + u[:-1]) + h / 8.0 * (v[:-1] - v[1:])
    middle[:, 1::2] = 1.5 / h * (u[1:] - u[:-1]) - 0.25 * (v[1:] + v[:-1])
    state, slope = np.zeros(2 * size), np.zeros(2 * size)

    def slopes(at: float, given: np.ndarray, states: np.ndarray) -> np.ndarray:
        unit.fmu.setTime(at)
        unit.set(inputs, given)
        unit.fmu.setContinuousStates(pointer(states), 2 * size)
        unit.slopes(pointer(slope), 2 * size)
        return slope.copy()

    path = [state]
    for k in range(len(table) - 1):
        begin = k * h
        k1 = slopes(begin, table[k], state)
        k2 = slopes(begin + 0.5 * h, middle[k], state + 0.5 * h * k1)
        k3 = slopes(begin + 0.5 * h, middle[k], state + 0.5 * h * k2)
        k4 = slopes(begin + h, table[k + 1], state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        slopes(begin + h, table[k + 1], state)
        unit.fmu.completedIntegratorStep()
        path.append(state)
    unit.free()
    expected = np.hstack([own.coordinates, own.rates])
    assert np.abs(np.array(path) - expected).max() < AGREEMENT * np.abs(expected).max()
