# Copyright 2026 ride_estimation contributors
"""How well stiffness and damping are known before a run: the same for the node, the model of the whole run and the diagnosis."""

import dataclasses
import math

import pytest

from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.free_parameters import find_free_parameters_of
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.frames import AXES
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.prior import DAMPING_LOG_STD, STIFFNESS_LOG_STD, log_std
from ride_estimation.vehicles.vehicle import Prior


def test_the_logarithm_of_a_lognormal_number_scatters_by_what_its_mean_and_deviation_say():
    assert log_std(Prior(100.0, 50.0), 100.0, 0.3) == pytest.approx(math.sqrt(math.log(1.25)))
    assert log_std(Prior(100.0), 100.0, 0.3) == 0.3
    assert log_std(None, 100.0, 0.3) == 0.3


@pytest.mark.parametrize("stated", [True, False])
def test_all_who_ask_take_a_vehicle_file_for_equally_well_known(stated):
    vehicle = load_vehicle("truck_cab")
    if not stated:
        bare = {n: dataclasses.replace(m, priors={}) for n, m in vehicle.mounts.items()}
        vehicle = dataclasses.replace(vehicle, mounts=bare)
    of_run = Plant(vehicle)
    mounts = [m.name for m in of_run.mounts]
    online = find_free_parameters_of(of_run.mounts, PipelineSettings())
    tested = build_plant(vehicle, {n: 3 for n, s in vehicle.sensors.items() if s.kind != "displacement"})
    for role, (part, usual) in enumerate(
        ((of_run.slow.log_stiffness, STIFFNESS_LOG_STD), (of_run.slow.log_damping, DAMPING_LOG_STD))
    ):
        found = {(p.mount, p.axis): (p.stiffness_log_std, p.damping_log_std)[role] for p in tested.ports}
        for f in (f for f in online if f.role == role):
            whole = of_run.slow.std[part][3 * f.mount + f.axis]
            assert f.std == pytest.approx(whole) == found[mounts[f.mount], AXES[f.axis]]
            assert (f.std == usual) != stated
