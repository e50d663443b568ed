# Copyright 2026 ride_estimation contributors
"""Identification of jounce bumpers on a synthetic programme whose bumper is written independently (J5, J12-J15)."""

import itertools

import jounce_programme as programme
import numpy as np
import pytest

from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.jounce import fit_static, pre_estimate
from ride_estimation.identification.bench.jounce_analysis import identify_jounce, network_mapping
from ride_estimation.identification.bench.jounce_choice import NetworkChoice
from ride_estimation.identification.bench.jounce_columns import contact_cell
from ride_estimation.identification.bench.jounce_model import as_load, compression_side, loaded_nrmse, split_static
from ride_estimation.identification.bench.lolimot import NetworkInputs, pole_std, train_network
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.time_domain import prepare

DYNAMIC = ("dynamic_ramps", "amplitude_sweep", "road_a", "road_b")


@pytest.fixture(scope="module")
def measured():
    return programme.measured(0)


def records(measured, names, prefix=""):
    return [check_record(BenchRecord(prefix + n, *measured[n][:3])) for n in names]


def loads(measured, names):
    return [as_load(prepare(r), 1.0) for r in records(measured, names)]


@pytest.fixture(scope="module")
def static_box(measured):
    (load,) = loads(measured, ["static_ramps"])
    return fit_static([load], 0.075), load


def test_objective_is_the_std_normalised_error_while_loaded(measured):
    # J5: document 004 (2)
    (load,) = loads(measured, ["road_a"])
    model = 0.9 * load.force
    on = load.travel > 0
    f = load.force[on]
    expected = np.sqrt(np.sum((f - model[on]) ** 2) / np.sum((f - f.mean()) ** 2))
    assert loaded_nrmse(load, model) == pytest.approx(expected, abs=1e-12)


def test_static_stage_finds_curve_and_height(static_box):
    # J12 stage 1, J6: heights and forces are told where loops saturate (below 90 % of the largest travel)
    box, load = static_box
    travel = np.array([0.02, 0.035, 0.05, 0.06])
    spline = box.basis(travel)
    assert spline @ box.static == pytest.approx(programme.static_force(travel), rel=0.03)
    assert spline @ box.height == pytest.approx(programme.height(travel), rel=0.12)
    assert loaded_nrmse(load, box.force(load)) < 0.03


def test_pre_estimate_of_the_cells_brings_most_of_the_dynamic_force(static_box, measured):
    # J12 stage 2: envelope of the dynamic stiffening
    box, _ = static_box
    dynamic = loads(measured, ["dynamic_ramps", "amplitude_sweep"])
    before = np.mean([loaded_nrmse(x, box.force(x)) for x in dynamic])
    started = pre_estimate(box, dynamic)
    after = np.mean([loaded_nrmse(x, started.force(x)) for x in dynamic])
    assert after < 0.6 * before
    assert np.all(np.diff(started.contacts) >= 0) and np.all(started.stiffness >= 0)


def test_network_grows_better_with_stable_poles(static_box, measured):
    # J14 on two dynamic records: M = 1 to 5 improves, poles negative and slower than half the sample rate allows
    box, _ = static_box
    inputs = [
        NetworkInputs(x, lambda u: np.maximum(box.basis(u) @ box.static, 0.0), x.force)
        for x in loads(measured, ["dynamic_ramps", "amplitude_sweep"])
    ]
    network, history = train_network(inputs, 5)
    assert history[-1] < 0.8 * history[0], history
    assert np.all(np.diff(history) < 1e-4)
    assert np.all(network.alpha > 0) and np.all(network.alpha * inputs[0].load.step_s < 2.0)
    assert np.mean([loaded_nrmse(i.load, network.force(i)) for i in inputs]) < 0.12
    weights = network.weights(inputs[0].travel, inputs[0].rate)
    assert np.allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    # the initial state of the exported element: at rest at 40 mm with its own force the state does not move
    travels = np.linspace(0.0, 0.075, 20)
    static = np.maximum(box.basis(travels) @ box.static, 0.0)
    static[0] = 0.0
    element = element_from_mapping(network_mapping(network, travels.tolist(), static.tolist()))
    u, f = element._inputs(-0.04)
    rest = (np.array(element.travel_inputs) * u + np.array(element.force_inputs) * f) / np.array(element.poles)
    state = element.consistent_state(-0.04, element.force(rest, -0.04, 0.0))
    assert state == pytest.approx(rest, rel=1e-6, abs=1e-3)


def test_pole_of_a_network_has_an_honest_standard_deviation():
    # one local model whose pole is known, 20 noises: scatter of the pole over its mean stated std; 20 give 16 %, three of those
    rng = np.random.default_rng(5)
    h = 2e-3
    t = np.arange(4000) * h
    u = 0.03 + 0.02 * np.sin(2 * np.pi * (0.3 * t + 0.4 * t**2))
    static = lambda travel: 8e4 * travel + 2e7 * travel**3  # noqa: E731
    slow = np.zeros(t.size)
    slow[0] = u[0]
    for k in range(1, t.size):  # u behind 30 / (s + 30), exact for straight pieces
        e = np.exp(-30 * h)
        part = (1 - e) / (30 * h)
        slow[k] = e * slow[k - 1] + (part - e) * u[k - 1] + (1 - part) * u[k]
    clean = static(u) + 5e4 * (u - slow)
    poles, stds = [], []
    for _ in range(20):
        record = check_record(BenchRecord("sweep", t, u, clean + 20.0 * rng.standard_normal(t.size)))
        load = as_load(prepare(record), 1.0)
        inputs = [NetworkInputs(load, static, load.force)]
        network, _ = train_network(inputs, 1)
        poles.append(network.alpha[0])
        stds.append(pole_std(network, inputs)[0])
    assert np.mean(poles) == pytest.approx(30.0, abs=4.0 * np.mean(stds) / np.sqrt(20))
    assert np.std(poles, ddof=1) / np.mean(stds) == pytest.approx(1.0, abs=0.48)


def test_a_record_that_begins_loaded_begins_at_rest():
    # a cell held at one travel carries nothing, also from the first sample on; moved from there it is the element's cell
    held = contact_cell(np.full(50, 0.03), 1e-3, 0.01, 2e-3, 5.0)
    assert np.all(held == 0.0)
    t = np.arange(800) * 1e-3
    travel = 0.03 + 0.02 * np.sin(2 * np.pi * 2.0 * t) * np.clip(5 * t, 0.0, 1.0)
    element = element_from_mapping(
        {"kind": "contact_maxwell", "stiffness_n_per_m": 1.0, "corner_rad_per_s": 5.0, "contact_point_m": 0.01, "entry_m": 2e-3}
    )
    found = contact_cell(travel, 1e-3, 0.01, 2e-3, 5.0)
    assert found == pytest.approx(-element.response(t, -travel), abs=1e-12)
    assert found.max() > 0.005


@pytest.mark.slow
def test_the_size_of_a_network_is_chosen_on_records_it_did_not_see(measured):
    names = ["dynamic_ramps", "amplitude_sweep", "road_a"]
    found = identify_jounce(
        records(measured, names), records(measured, ["road_b"]), "local_linear_network_dahl",
        static=records(measured, ["static_ramps"]),
    )  # fmt: skip
    choice = found.choice
    # the training set of the document: sweep and roads; the static record gives its curve and is not trained on
    assert set(found.fitted) == set(choice.left_out) == set(choice.white) == set(names)
    assert choice.models == min(choice.sizes, key=choice.sizes.get) <= 10
    left_out, white = mean(choice.left_out), mean(choice.white)
    # what is said of records left out holds on a road that nobody used: not better than by half, not worse than said
    assert 0.5 * left_out < found.held_out["road_b"] + 0.03 and found.held_out["road_b"] < 1.5 * left_out
    # beyond half as much again as the white box the network is refused with a sentence, on the unseen road too
    assert choice.unseen == {"road_b": found.held_out["road_b"]}
    assert bool(choice.refusal) == (left_out > 1.5 * white or choice.unseen["road_b"] > 1.5 * choice.white_unseen["road_b"])
    assert (choice.refusal in found.warnings) == bool(choice.refusal)


@pytest.mark.parametrize(
    ("left_out", "unseen", "named"),
    [
        (0.06, {}, ""),
        (0.06, {"a": 0.07, "b": 0.08}, ""),
        (0.08, {}, "on records left out in turn the network is 8 %"),
        (0.06, {"a": 0.07, "b": 0.13}, "on b the network is 13 %"),
    ],
)
def test_a_network_far_behind_the_white_box_is_refused_in_words(left_out, unseen, named):
    white = {name: {"a": 0.05, "b": 0.08}[name] for name in unseen}
    found = NetworkChoice(4, 1e-4, {4: left_out}, {"road": left_out}, {"road": 0.05}, unseen, white)
    assert bool(found.refusal) == bool(named) and named in found.refusal


def test_a_network_needs_something_to_leave_out(measured):
    t, u, f, _ = measured["amplitude_sweep"]
    one = [check_record(BenchRecord("one", t[:1500], u[:1500], f[:1500]))]
    with pytest.raises(InputDataError, match="nothing can be left out"):
        identify_jounce(one, [], "local_linear_network", static=records(measured, ["static_ramps"]))


def test_a_static_record_apart_is_no_option_of_the_white_box(measured):
    with pytest.raises(InputDataError, match="for networks"):
        identify_jounce(records(measured, ["road_a"]), [], static=records(measured, ["static_ramps"]))


def test_a_two_sided_force_is_refused(measured):
    t, u, f, _ = measured["road_a"]
    with pytest.raises(InputDataError, match="only pushes"):
        compression_side([prepare(check_record(BenchRecord("bushing", t, u, f - 0.5 * f.max())))])


def test_a_programme_without_a_slow_record_is_refused(measured):
    with pytest.raises(InputDataError, match="slow record"):
        split_static(loads(measured, ["dynamic_ramps", "road_a"]))


@pytest.fixture(scope="module")
def three_models(measured):
    held = programme.measured(7)
    found = {}
    for model in ("jounce_bumper", "local_linear_network", "local_linear_network_dahl"):
        found[model] = identify_jounce(
            records(measured, ["static_ramps", *DYNAMIC]), records(held, ["road_a", "road_b"], "held "), model,
            models=None if model == "jounce_bumper" else 10,
        )
    return found


def mean(scores):
    return float(np.mean(list(scores.values())))


def floors(measured, noise):
    """NRMSE that the true force itself has against the measured one: noise over the force's standard deviation while loaded."""
    return {name: noise / float(np.std(f[u > 0.0])) for name, (_, u, f, _) in measured.items()}


def noise_free(seed, names, prefix):
    """Records of the true force: the score against them is the error of the model alone."""
    paths = programme.programme(seed)
    return [check_record(BenchRecord(prefix + n, *paths[n])) for n in names]


def test_noise_floor_is_the_documents(measured):
    # 1.7 % on average in the document notes, which ask for 3 % above it
    assert mean(floors(measured, 14.0)) == pytest.approx(0.017, abs=0.001)


@pytest.mark.slow
def test_white_box_reaches_three_per_cent(measured, three_models):
    # J12, J13: each stage improves; 3 % at the noise floor of the document notes
    white = three_models["jounce_bumper"]
    stages = [mean(s) for s in white.stages.values()]
    assert all(b < a for a, b in itertools.pairwise(stages)), stages
    assert mean(white.fitted) < 0.03
    # the floor that is reported is the true one, to the accuracy of an estimated noise level
    for name, floor in floors(measured, 14.0).items():
        assert white.noise_floor[name] == pytest.approx(floor, rel=0.1)
    # roads of another seed, not fitted
    assert mean(white.held_out) < 0.03
    # every quantity but the travel that is chosen has an interval, and the truth lies in it
    values = {name: (value, std) for name, value, _, std in white.quantities}
    assert [n for n, (_, std) in values.items() if std is None] == ["reference_travel"]
    end = np.array([values["reference_travel"][0]])
    truths = {
        "static_force_at_reference": programme.static_force(end)[0], "hysteresis_height_at_reference": programme.height(end)[0],
        **{f"cell_{i + 1}_stiffness": k for i, k in enumerate(programme.STIFFNESS)},
        **{f"cell_{i + 1}_contact_point": u for i, u in enumerate(programme.CONTACTS)},
        "entry": programme.ENTRY,
    }  # fmt: skip
    off = {n: abs(values[n][0] - truth) / values[n][1] for n, truth in truths.items()}
    assert max(off.values()) < 3.0, off
    # the element in the vehicle file is the fitted model
    assert mean(white.exported) < 1.1 * mean(white.fitted)


@pytest.mark.slow
def test_grey_box_needs_the_friction_for_static_ramps(three_models):
    # J13, J15
    white, grey, dahl = (three_models[m] for m in ("jounce_bumper", "local_linear_network", "local_linear_network_dahl"))
    assert mean(white.fitted) < mean(dahl.fitted) < mean(grey.fitted)
    assert max(grey.fitted, key=grey.fitted.get) == "static_ramps"
    assert mean(dahl.fitted) < 0.08 and mean(dahl.held_out) < 0.08
    assert dahl.fitted["static_ramps"] < 0.4 * grey.fitted["static_ramps"]
    for found in (grey, dahl):
        assert mean(found.exported) < 1.15 * mean(found.fitted)
        poles = [value for name, value, _, _ in found.quantities if name.startswith("pole")]
        assert len(poles) == 10 and max(poles) < 0 and min(poles) > -2000.0
        assert all(std > 0 for name, _, _, std in found.quantities if name.startswith("pole"))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "noise"), [(11, 14.0), (12, 30.0)])
def test_white_box_against_the_noise_free_force(seed, noise):
    # other programmes. With 30 N the true force itself scores worse than 3 % against what is measured: no model can reach it
    measured = programme.measured(seed, noise)
    floor = mean(floors(measured, noise))
    truth = [*noise_free(seed, DYNAMIC, "true "), *noise_free(seed + 50, ("road_a", "road_b"), "unseen true ")]
    found = identify_jounce(records(measured, ["static_ramps", *DYNAMIC]), truth)
    assert (floor > 0.03) == (noise == 30.0)
    # 3 % of the force's standard deviation is what the model alone may be off, on fitted records and on roads of another seed
    assert mean(found.held_out) < 0.03, found.held_out
    # the score against measured force is the floor and the model's error in quadrature, nothing is fitted to the noise:
    # 200 parameters per 100 000 samples would lower it by 0.1 %
    assert mean(found.fitted) < np.hypot(floor, 0.03)
    assert mean(found.fitted) > 0.98 * floor


@pytest.mark.slow
@pytest.mark.parametrize("seed", [106, 201])
def test_white_box_of_other_bumpers(monkeypatch, seed):
    # contact points, stiffnesses, rates, entry and hysteresis drawn over more than a decade; an element comes out whatever is
    # drawn, and it is within 3 % of the noise-free force, on roads of another seed too
    rng = np.random.default_rng(seed)
    monkeypatch.setattr(programme, "CONTACTS", np.sort(np.concatenate([[0.0], 0.075 * rng.uniform(0.1, 0.85, 4)])))
    monkeypatch.setattr(programme, "STIFFNESS", np.exp(rng.uniform(np.log(3e3), np.log(1.2e5), 5)))
    monkeypatch.setattr(programme, "RATES", np.exp(rng.uniform(np.log(4), np.log(150), 5)))
    monkeypatch.setattr(programme, "ENTRY", float(np.exp(rng.uniform(np.log(0.4e-3), np.log(2e-3)))))
    size, bend = rng.uniform(0.6, 1.6), rng.uniform(1.5, 4.0)
    share = lambda u: np.clip(u / programme.REFERENCE, 0.0, None)  # noqa: E731
    monkeypatch.setattr(programme, "height", lambda u: 1800.0 * size * (0.3 * share(u) + 0.7 * share(u) ** bend))
    measured = programme.measured(seed)
    truth = [*noise_free(seed, DYNAMIC, "true "), *noise_free(seed + 50, ("road_a", "road_b"), "unseen true ")]
    found = identify_jounce(records(measured, ["static_ramps", *DYNAMIC]), truth)
    assert mean(found.held_out) < 0.03, found.held_out
    assert element_from_mapping(found.element).KIND == "jounce_bumper"
