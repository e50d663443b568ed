# Copyright 2026 ride_estimation contributors
"""Measured loops of a magnetorheological damper (labcontrol-data/mr-damper, DOI 10.5281/zenodo.4445334).

The authors publish fitted Dahl parameters per voltage: viscous kx [N s/mm], friction kw [N], rho [1/mm].
"""

import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.columns import simulate
from ride_estimation.identification.bench.ladder import climb, residual_offset
from ride_estimation.identification.bench.models import LADDER, model_by_name
from ride_estimation.identification.bench.reversals import noise_level
from ride_estimation.identification.bench.time_domain import prepare
from ride_estimation.io.bench_records import ReadOptions, read_bench_record
from ride_estimation.metrics import nrmse

OPTIONS = ReadOptions(
    time="Tout", displacement="dist", force="forc", time_unit="s", displacement_unit="mm", force_unit="N", zero="mean"
)
SERIES = {
    0.0: [f"ensaio{i}.1" for i in range(1, 11)],
    0.8712: [f"ensaio{i}.2.2" for i in range(1, 11)],
    1.98: [f"ensaio.B.{i}" for i in (1, 3, 5, 6, 7, 8, 9, 10)],
    3.212: [f"ensaio.A.{i}" for i in range(1, 11)],
}
#: means of the authors' table (Ensaios.ods): kx [N s/mm], kw [N], rho [1/mm]
PUBLISHED = {
    0.0: (0.80204993, 50.236842, 42.7448555),
    0.8712: (1.31408788, 209.66316, 20.43085),
    1.98: (2.576181, 380.6109464, 13.53070161),
    3.212: (5.572627, 562.065351, 7.8277322),
}
#: rungs that are compared; those with more cells or a cubic spring bring nothing here and take most of the time
MODELS = ("linear_spring", "kelvin_voigt", "dahl", "berg_viscous", "berg")

@pytest.fixture(scope="module")
def damper(real_data):
    folder = real_data("mr_damper_loops_labcontrol")

    def read(name):
        return prepare(read_bench_record(folder / f"{name}.mat", OPTIONS))

    return folder, read


def test_every_run_is_read_or_refused_with_a_reason(damper):
    folder, _ = damper
    read, refused = 0, []
    for path in sorted(folder.glob("*.mat")):
        try:
            record = read_bench_record(path, OPTIONS)
        except InputDataError as error:
            refused.append(str(error))
        else:
            read += 1
            assert 1e3 < np.ptp(record.force) / np.ptp(record.displacement) < 1e6
    # one file holds the time axis of a simulation beside a shorter measurement
    assert read == 85 and len(refused) == 1 and "differ in length" in refused[0]


def published_errors(voltage, unseen):
    """NRMSE of the authors' parameters of the Dahl law on each unseen run, force offset left free as for the ladder."""
    viscous, friction, rho = PUBLISHED[voltage]
    dahl = model_by_name("dahl")
    theta, coefficients = dahl.searched(np.array([0.0, 1e3 * viscous, friction, 1e-3 / rho]))
    errors = []
    for item in unseen:
        force, keep = simulate(dahl.layout, item.motion, theta, coefficients)[item.fitted], item.fitted
        errors.append(nrmse(item.force[keep], force + residual_offset(item.force[keep], force)))
    return np.array(errors)


@pytest.mark.parametrize("voltage", list(SERIES))
def test_ladder_on_unseen_runs(damper, voltage):
    # the authors' own fit (13 to 28 % on these runs) and the spring-damper (32 to 39 %) are the bars: every single unseen run has
    # to be better explained than by both. Identified on half of the runs
    _, read = damper
    runs = [read(n) for n in SERIES[voltage]]
    fitted, unseen = runs[::2], runs[1::2]
    rungs, chosen = climb([m for m in LADDER if m.name in MODELS], fitted, unseen)
    errors = {r.fit.model.name: np.array([h.scores()["std"] for h in r.held_out]) for r in rungs}
    best = rungs[chosen].fit.model
    assert best.layout.friction != 0
    published = published_errors(voltage, unseen)
    # the same law with the same number of parameters, and the rung the ladder chooses
    for name in ("dahl", best.name):
        assert np.all(errors[name] < published), (name, errors[name], published)
        assert np.all(errors[name] < errors["kelvin_voigt"])
    # the chosen rung is not worse on average than the Dahl law it has to justify its extra parameters against
    assert rungs[chosen].mse <= {r.fit.model.name: r.mse for r in rungs}["dahl"]
    # what is not explained is more than the force channel's noise, and stays said: no law of the ladder has the shape of the loop
    noise = max(noise_level(item.force) / float(np.std(item.force)) for item in unseen)
    assert np.min(errors[best.name]) > noise


def test_identified_parameters_beside_the_published_ones(damper):
    # 0 V: the same law, the same runs; the authors fit run by run, here all runs at once
    _, read = damper
    rungs, _ = climb([model_by_name("dahl")], [read(n) for n in SERIES[0.0]], [read("ensaio10.1")])
    _, viscous, friction, presliding = rungs[0].fit.values
    assert 1e-3 * viscous == pytest.approx(PUBLISHED[0.0][0], rel=0.2)
    assert friction == pytest.approx(PUBLISHED[0.0][1], rel=0.1)
    assert 1e-3 / presliding == pytest.approx(PUBLISHED[0.0][2], rel=0.25)


def test_friction_grows_with_voltage(damper):
    _, read = damper
    friction = []
    for names in SERIES.values():
        rungs, _ = climb([model_by_name("dahl")], [read(n) for n in names[:4]], [read(names[5])])
        friction.append(rungs[0].fit.values[2])
    assert np.all(np.diff(friction) > 0), friction
