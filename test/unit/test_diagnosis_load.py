# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not know: what a run tells of its mass, and beside another cause."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from worlds.adapters import believed_vehicle, uniform_run
from worlds.cab import CabVehicle, measure, random_sensors, random_vehicle, simulate
from worlds.effects import Reference, plant
from worlds.roads import Road, base_motion
from worlds.vehicle_text import Belief

from ride_estimation.diagnosis.answer.result import Diagnosis
from ride_estimation.diagnosis.calibration.baseline import balanced_columns, mean_table, port_columns
from ride_estimation.diagnosis.calibration.linear_model import calibrate, file_parameters
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.effect import Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant, static_forces
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.vehicles.payload import with_payload
from ride_estimation.vehicles.vehicle import Prior, Vehicle
from ride_estimation.vehicles.weighed_loads import absurd, balance_of, balances, contradicted, contradiction

SECONDS, RATE_HZ, STEP = 30.0, 100.0, 1e-3
SITTING = np.array([0.15, 0.25, 0.0])
#: the load comes at once at the start; the run is read from where the cab has settled
SETTLED = 6.0


def loaded(vehicle: CabVehicle, share: float, place: np.ndarray) -> CabVehicle:
    """Return a vehicle that takes on a load of a share of its mass, at a place from its CG, before the run is read."""
    load = share * vehicle.mass
    mass, cg = vehicle.mass + load, vehicle.cg + load / (vehicle.mass + load) * place
    apart = vehicle.mass * load / mass * (place @ place * np.eye(3) - np.outer(place, place))
    return dataclasses.replace(
        vehicle, hidden=dataclasses.replace(vehicle.hidden, mass_after=(STEP, mass, cg, vehicle.inertia + apart))
    )


def runs_of(seed: int, share: float, place: np.ndarray, transducers: bool, fault: str | None = None):
    """Return the file's vehicle and two runs, on two roads, of the cab with the load and with a fault of one sensor."""
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, "air")
    travel = tuple((name, "z") for name in vehicle.mount_names) if transducers else ()
    sensors = random_sensors(vehicle, rng, displacement=travel)
    roads = [base_motion(Road.random(rng, "rough"), vehicle.mounts, SECONDS, STEP, seed + i) for i in range(2)]
    driven = vehicle
    if fault is not None:
        reference = Reference(vehicle, sensors, simulate(vehicle, roads[0]))
        effect = plant(fault, reference, np.random.default_rng([seed, 1]), sensor=sensors[0].name)
        driven, sensors, _ = effect.apply(0.3)
    driven = loaded(driven, share, place)
    runs = [measure(simulate(driven, road), sensors, RATE_HZ, seed + i, noise_share=0.01) for i, road in enumerate(roads)]
    file = believed_vehicle(runs[0], Belief(cg_std=0.0075), seed, vehicle)
    return vehicle, file, [uniform_run(run, f"run_{i}", from_s=SETTLED) for i, run in enumerate(runs)]


def test_a_run_without_travel_leaves_the_mass_unobservable():
    _, file, (run, _) = runs_of(9201, 0.0, SITTING, transducers=False)
    plant_ = build_plant(file, dict.fromkeys(file.sensors, 3), 0.3, 0.5)
    view = calibrate(RunData(plant_, measurement(plant_, run), Settings())).view
    load = next(h for h in library()["mass_change"].hypotheses(view) if h.moves_cg)
    mass = view.plant.vehicle.bodies["cab"].mass.value
    forces = tuple(e for e in load.columns(view, {})[0] if e.where is Where.WRENCH)
    heavier = mass * view.push([forces])[:, :, 0]
    _, ports = port_columns(view, file_parameters(view.plant))
    adjustables, body = balanced_columns(view, ["cab"])
    inertia = view.plant.vehicle.bodies["cab"].inertia
    size = np.sqrt(np.diag(inertia))
    relative = inertia / np.outer(size, size)
    weights = [relative["xyz".index(a.axis[1]), "xyz".index(a.axis[2])] if a.kind == "inertia" else 0.0 for a in adjustables]
    # all masses, stiffness and damping scaled together move as before; the rotation at rest is not scaled
    reached = body[:, body.shape[1] - heavier.shape[1] :]
    together = heavier + ports.sum(axis=2) + reached @ np.array(weights)
    assert np.sqrt(np.mean(together**2)) < 0.03 * np.sqrt(np.mean(heavier**2))


def test_a_load_that_came_on_long_ago_is_one_from_the_start():
    """Mass and first moments with the bodies, bases and mount forces that they turn; the weight itself is constant by then."""
    _, file, (run, _) = runs_of(9201, 0.0, SITTING, transducers=False)
    plant_ = build_plant(file, dict.fromkeys(file.sensors, 3), 0.3, 0.5)
    view = RunView(RunData(plant_, measurement(plant_, run), Settings()), ModelState(*file_parameters(plant_)))
    changing, constant = (h for h in library()["mass_change"].hypotheses(view) if h.location == "cab")
    long_ago = changing.columns(view, {"at": -100.0, "over": 0.5})
    assert len(long_ago) == 4 + 6  # three moments and three products of inertia beside mass and first moments
    for column, always in zip(long_ago, constant.forces(view, {})):
        wanted = tuple(e for e in always if e.where is not Where.MEAN)
        got = {(e.where, e.index): 0.0 for e in (*column, *wanted)}
        for sign, effects in ((1.0, column), (-1.0, wanted)):
            for e in effects:
                got[e.where, e.index] = got[e.where, e.index] + sign * e.signal
        size = max(float(np.std(e.signal)) for e in wanted)
        assert max(float(np.std(left)) for left in got.values()) < 1e-9 * size


def test_a_load_lies_on_the_body_that_carries_it():
    _, file, (run, _) = runs_of(9201, 0.0, SITTING, transducers=False)
    plant_ = build_plant(file, dict.fromkeys(file.sensors, 3), 0.3, 0.5)
    view = RunView(RunData(plant_, measurement(plant_, run), Settings()), ModelState(*file_parameters(plant_)))
    farthest = max(float(np.linalg.norm(m.position - file.bodies["cab"].cg)) for m in file.mounts.values())
    for load in (h for h in library()["mass_change"].hypotheses(view) if h.location == "cab"):
        for kg in (-60.0, 60.0):
            assert load.meaningful(np.array([kg, 1.2 * farthest * kg, 0.0, 0.0]), {})
            assert not load.meaningful(np.array([kg, 2.5 * farthest * kg, 0.0, 0.0]), {})  # that is a CG which lies elsewhere


def test_mounts_with_rotational_stiffness_can_carry_a_load():
    _, file, (run, _) = runs_of(9201, 0.0, SITTING, transducers=False)
    stiff = {
        name: dataclasses.replace(m, elements={**m.elements, "roll": KelvinVoigt(stiffness=2e3, damping=20.0)})
        for name, m in file.mounts.items()
    }
    turning = dataclasses.replace(file, mounts=stiff)
    plant_ = build_plant(turning, dict.fromkeys(turning.sensors, 3), 0.3, 0.5)
    assert any(p.axis == "roll" for p in plant_.ports)
    view = RunView(RunData(plant_, measurement(plant_, run), Settings()), ModelState(*file_parameters(plant_)))
    load = next(h for h in library()["mass_change"].hypotheses(view) if h.moves_cg)
    columns = load.columns(view, {})
    assert len(columns) == 4 and all(np.all(np.isfinite(e.signal)) for column in columns for e in column)


def require_load(answer: Diagnosis, added: float) -> None:
    """Require a load at ``SITTING`` as the only cause, with its mass and place."""
    assert answer.verdict == "explained"
    assert [(c.id, c.location) for c in answer.causes] == [("mass_change", "cab")], answer.sentence
    found = {p.name: p for p in answer.causes[0].parameters}
    mass = found["added mass"]
    assert abs(mass.value - added) < 2.5 * mass.std
    assert mass.std < 0.25 * mass.value
    for axis, true in zip("xy", SITTING):
        place = found[f"place from the CG {axis}"]
        assert abs(place.value - true) < 2.5 * place.std + 0.02


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9211, 9212, 9213])
def test_static_travel_determines_a_load_and_its_position(seed):
    vehicle, file, (run, other) = runs_of(seed, 0.1, SITTING, transducers=True)
    require_load(diagnose(file, run, [other]), 0.1 * vehicle.mass)


def weighed(file: Vehicle, vehicle: CabVehicle, share: float, std: float, seed: int) -> Vehicle:
    """Return the file with the loads of its mounts, weighed to ``std`` with a load of a share of the true mass at ``SITTING``."""
    load = share * vehicle.mass
    cg = vehicle.cg + load / (vehicle.mass + load) * SITTING
    body = dataclasses.replace(file.bodies["cab"], mass=Prior(vehicle.mass + load), cg=cg)
    true = dataclasses.replace(file, bodies={**file.bodies, "cab": body})
    forces = static_forces(true, file.mount_names, ("cab",)) + std * np.random.default_rng(seed).standard_normal(4)
    mounts = {
        name: dataclasses.replace(file.mounts[name], static_load=Prior(float(force), std))
        for name, force in zip(file.mount_names, forces)
    }
    return dataclasses.replace(file, mounts=mounts)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9231, 9233, 9234])
def test_weighed_loads_determine_a_load_without_travel(seed):
    vehicle, file, (run, other) = runs_of(seed, 0.12, SITTING, transducers=False)
    require_load(diagnose(weighed(file, vehicle, 0.12, 30.0, seed), run, [other]), 0.12 * vehicle.mass)


def test_loads_that_were_weighed_without_it_say_nothing_of_a_load():
    vehicle, file, _ = runs_of(9201, 0.0, SITTING, transducers=False)
    fits, heavy = (weighed(file, vehicle, share, 30.0, 1) for share in (0.0, 0.12))
    stated = balances(heavy, "cab")
    assert balances(file, "cab") == () and contradiction(file, "cab") == contradiction(fits, "cab") == ""
    assert contradicted(heavy, stated) and not contradicted(fits, balances(fits, "cab")) and not absurd(heavy, stated)
    mass, gravity = 0.12 * vehicle.mass, file.gravity
    assert [(b.body, b.coordinate) for b in stated] == [("cab", 2), ("cab", 3), ("cab", 4)]
    cg = mass * SITTING - (vehicle.mass + mass) * (file.bodies["cab"].cg - vehicle.cg)
    wanted = gravity * np.array([vehicle.mass + mass - file.bodies["cab"].mass.value, cg[1], -cg[0]])
    assert [b.left for b in stated] == pytest.approx(wanted, abs=250.0)
    words = contradiction(heavy, "cab")
    assert f"{stated[0].left:.4g} +-" in words and "N upwards" in words and words.endswith("N m of pitch left")
    assert any(words in message for message in geometry_of(heavy).ignored) and not geometry_of(fits).ignored
    # a planned payload is in the mass, and not in loads that were weighed before
    planned = with_payload(fits, "cab", mass)
    assert contradiction(planned, "cab") == "" and all(m.static_load is None for m in planned.mounts.values())
    # loads in kilograms are no load of the cab
    light = {n: dataclasses.replace(m, static_load=Prior(m.static_load.value / 9.81, 3.0)) for n, m in fits.mounts.items()}
    other_unit = dataclasses.replace(fits, mounts=light)
    assert absurd(other_unit, balances(other_unit, "cab"))
    assert "of cab differ from its weight by" in contradiction(other_unit, "cab")
    # a weight on the body adds what was measured
    weight = np.array([0.0, 0.0, -mass * gravity, *np.cross(SITTING, [0.0, 0.0, -mass * gravity])])
    told = balance_of([(b.body, b.coordinate) for b in stated], file, "cab", weight)
    assert [*told.values()] == pytest.approx(gravity * mass * np.array([1.0, SITTING[1], -SITTING[0]]))


def test_weighed_loads_are_rows_of_the_diagnosis_where_they_contradict_the_file():
    vehicle, file, (run, _) = runs_of(9201, 0.0, SITTING, transducers=False)
    for share, rows in ((0.0, ()), (0.12, (("cab", 2), ("cab", 3), ("cab", 4)))):
        plant_ = build_plant(weighed(file, vehicle, share, 30.0, 1), dict.fromkeys(file.sensors, 3), 0.3, 0.5)
        off = dataclasses.replace(file.bodies["cab"], cg=file.bodies["cab"].cg + 0.02 * np.eye(3)[0])
        moved = dataclasses.replace(plant_, vehicle=dataclasses.replace(plant_.vehicle, bodies={"cab": off}))
        plants = (
            plant_, dataclasses.replace(moved, named_cg={("cab", "x"): 0.02}),
            dataclasses.replace(moved, body_errors={("cg", "cab", "x"): 0.02}),
        )  # fmt: skip
        tables = [
            mean_table(RunView(RunData(p, measurement(p, run), Settings()), ModelState(*file_parameters(p)))) for p in plants
        ]
        assert [t.weighed for t in tables] == [rows] * 3
        if rows:
            left = [t.residual[-3:] * t.std[-3:] for t in tables]
            # what a cause names is no part of the weight that the model has, what calibration found is
            assert left[1] == pytest.approx(left[0])
            total = sum(m.static_load.value for m in plant_.vehicle.mounts.values())
            assert left[2] - left[0] == pytest.approx([0.0, 0.0, 0.02 * total], abs=1e-6 * total)


@pytest.mark.slow
def test_a_load_beside_another_cause_is_no_calibration_of_the_cg():
    _, file, (run, other) = runs_of(9221, 0.15, SITTING, transducers=False, fault="sensor_delay")
    answer = diagnose(file, run, [other])
    assert {c.id for c in answer.causes} == {"mass_change", "sensor_delay"}, answer.sentence
