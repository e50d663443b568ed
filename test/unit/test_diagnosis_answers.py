# Copyright 2026 ride_estimation contributors
"""What an answer may say: verdict, causes, sentence and extended vehicle agree, nothing proven is hidden."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_runs import GRAVITY, MASS, STIFFNESS, quarter_car, quarter_car_run

from ride_estimation.diagnosis import diagnose as chain
from ride_estimation.diagnosis.answer import gain as gains
from ride_estimation.diagnosis.answer.result import (
    EXPLAINED,
    INSUFFICIENT,
    NO_DISCREPANCY,
    Diagnosis,
    Gain,
    NamedCause,
    ValidationGain,
)
from ride_estimation.diagnosis.answer.verdict import (
    causes_per_effect,
    describe,
    force_laws,
    gained_nothing,
    left_elsewhere,
    proven,
    right_elsewhere,
    unexplained_run,
)
from ride_estimation.diagnosis.calibration.baseline import mean_table
from ride_estimation.diagnosis.calibration.linear_model import file_parameters
from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose, form_variance
from ride_estimation.diagnosis.hypotheses.port_groups import port_groups
from ride_estimation.diagnosis.hypotheses.sensor_column import turned_column
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import missing_forces
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.free_law import FreeLaw
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.frames import rotation_matrices
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle


def gain_of(*runs: tuple[float, float, float, tuple[float, float]]) -> Gain:
    rows = tuple(ValidationGain(f"run{i}", before, after, ci, floor) for i, (before, after, floor, ci) in enumerate(runs))
    return Gain("", 0.1, 0.1, 0.01, rows)


def agree(answer: Diagnosis, stated: Vehicle) -> None:
    """Check that the parts of an answer say the same."""
    if answer.verdict in (NO_DISCREPANCY, INSUFFICIENT):
        assert not answer.causes
    if answer.verdict == EXPLAINED:
        assert answer.causes
    for cause in answer.causes:
        assert 0.0 <= cause.confidence <= 1.0
        assert cause.location in answer.sentence
    laws = {c.id for c in answer.causes} - {"mass_change", "cg_offset", "sensor_clipping", "sensor_bias"}
    plain = all(isinstance(e, KelvinVoigt) for m in answer.extended.mounts.values() for e in m.elements.values())
    assert plain == (not laws), answer.sentence
    moved = answer.extended.bodies["body_mass"].mass.value != stated.bodies["body_mass"].mass.value
    assert moved == any(c.id == "mass_change" for c in answer.causes)
    for run in answer.gain.validation if answer.gain is not None else ():
        assert (run.extended == run.baseline) or answer.causes


def friction(x: float, v: float) -> float:
    return 160.0 * float(np.tanh(v / 0.01))


@pytest.mark.parametrize("law", [None, friction, lambda x, v: -3e5 * max(-x - 0.012, 0.0)], ids=["clean", "friction", "stop"])
def test_verdict_causes_and_extended_vehicle_agree(law):
    vehicle = quarter_car()
    answer = diagnose(vehicle, quarter_car_run(3, law=law), [quarter_car_run(4, law=law)])
    agree(answer, vehicle)
    assert (answer.verdict == NO_DISCREPANCY) == (law is None)


def test_a_short_run_is_insufficient_and_changes_nothing():
    vehicle = quarter_car()
    answer = diagnose(vehicle, quarter_car_run(3, seconds=8.0))
    assert answer.verdict == INSUFFICIENT and answer.extended is vehicle
    agree(answer, vehicle)


def test_an_unknown_load_is_found_by_how_far_it_makes_the_mount_sink():
    vehicle = quarter_car()
    travel = Sensor("travel", "displacement", "/travel", "body_mass", mount="strut", axis="z", noise_std=1e-4)
    body = vehicle.bodies["body_mass"]
    lighter = dataclasses.replace(body, mass=dataclasses.replace(body.mass, value=MASS - 50.0, std=2.0))
    stated = dataclasses.replace(
        vehicle, bodies={"body_mass": lighter}, sensors={**vehicle.sensors, "travel": travel}
    )
    sag = -50.0 * GRAVITY / STIFFNESS
    answer = diagnose(stated, quarter_car_run(3, sag=sag), [quarter_car_run(4, sag=sag)])
    agree(answer, stated)
    assert [c.id for c in answer.causes] == ["mass_change"] and answer.verdict == EXPLAINED
    added = answer.causes[0].parameters[0]
    assert added.name == "added mass" and abs(added.value - 50.0) < 2.0 * added.std < 25.0
    empty = diagnose(stated, quarter_car_run(3, sag=-5e-4), [quarter_car_run(4, sag=-5e-4)])
    assert empty.verdict == NO_DISCREPANCY  # half a millimetre is the zero of the transducer


def test_a_fault_of_the_validation_run_alone_is_found_there():
    vehicle, run, other = quarter_car(), quarter_car_run(3), quarter_car_run(4)
    values = other.data["body"].copy()
    limit = GRAVITY + 1.2 * float(np.std(values[:, 2]))
    values[:, 2] = np.minimum(values[:, 2], limit)
    cut = dataclasses.replace(
        other, name="other", data={**other.data, "body": values},
        clipped_at={"body": np.array([[-np.inf] * 3, [np.inf, np.inf, limit]])},
    )
    answer = diagnose(vehicle, run, [cut])
    agree(answer, vehicle)
    assert [c.id for c in answer.causes] == ["sensor_clipping"]
    assert "other does" in answer.sentence and any("validation run other" in w for w in answer.warnings)


def test_a_gain_whose_interval_is_wide_is_not_called_nothing():
    settings = Settings()
    assert gained_nothing(gain_of((0.899, 0.649, 0.02, (-0.05, 0.4))), settings) == ""
    assert "gained nothing" in gained_nothing(gain_of((0.30, 0.29, 0.02, (-0.02, 0.05))), settings)


def test_a_law_that_gains_within_the_strokes_it_was_fitted_on_gained_something():
    deeper = gain_of((0.30, 0.39, 0.03, (-0.24, 0.10))).validation[0]
    assert "gained nothing" in gained_nothing(Gain("", 0.2, 0.1, 0.04, (deeper,)), Settings())
    inside, outside = (dataclasses.replace(deeper, in_range=(0.18, left, 0.04)) for left in (0.13, 0.18))
    assert gained_nothing(Gain("", 0.2, 0.1, 0.04, (inside,)), Settings()) == ""
    assert "gained nothing" in gained_nothing(Gain("", 0.2, 0.1, 0.04, (outside,)), Settings())


def test_only_a_significant_gain_on_every_run_is_proven():
    settings = Settings()
    assert proven(gain_of((0.82, 0.55, 0.01, (0.22, 0.32))), settings)
    assert not proven(gain_of((0.82, 0.55, 0.01, (0.22, 0.32)), (0.8, 0.7, 0.01, (-0.01, 0.2))), settings)
    assert not proven(gain_of((0.82, 0.80, 0.01, (0.01, 0.03))), settings)  # no relevant share


def test_what_is_left_elsewhere_is_a_share_of_what_could_be_removed():
    settings = Settings()
    assert left_elsewhere(gain_of((0.2, 0.1, 0.0, (0.0, 0.2))), settings) == pytest.approx(0.25)
    assert left_elsewhere(gain_of((0.02, 0.02, 0.019, (0.0, 0.0))), settings) is None
    # a load that static travel shows removes nothing of 1.2 % that a right model may leave nearly as well
    assert left_elsewhere(gain_of((0.012, 0.0125, 0.0, (0.0, 0.0))), settings) is None
    # beyond the strokes of the fitted run nobody knows the law: within them, four per cent are left
    rougher = dataclasses.replace(gain_of((0.3, 0.2, 0.0, (0.0, 0.2))).validation[0], in_range=(0.2, 0.04, 0.0))
    assert left_elsewhere(Gain("", 0.1, 0.1, 0.01, (rougher,)), settings) == pytest.approx(0.04)


def test_what_a_model_without_causes_may_miss_named_causes_may_miss_too():
    settings = Settings()
    least = 2.5 * settings.adequacy
    for beyond in (0.9, 1.1):
        after = float(np.hypot(0.005, beyond * least))
        gain = gain_of((float(np.hypot(0.04, 0.005)), after, 0.005, (0.0, 0.1)))
        assert left_elsewhere(gain, settings) == pytest.approx((beyond * least / 0.04) ** 2)
        assert right_elsewhere(gain, settings) == (beyond < 1.0)
    # a noisy run on which much of the error is noise tells all the same
    assert left_elsewhere(gain_of((0.042, 0.039, 0.037, (0.0, 0.1))), settings) == pytest.approx(0.385, abs=0.005)


@pytest.mark.parametrize(("after", "said"), [(0.012, False), (0.017, True)])
def test_an_explanation_says_how_much_remains_from_half_again_the_noise_on(after: float, said: bool):
    cause = NamedCause("backlash", "fl", "z", (), 0.6, (), "", "", "")
    words = describe(EXPLAINED, [cause], gain_of((0.04, after, 0.01, (0.0, 0.1))), 0.1)
    assert ("of the error energy above the noise floor remain unexplained" in words) is said


def part(cause: str, axis: str, *ports: int, at: str = "mount") -> SimpleNamespace:
    return SimpleNamespace(hypothesis=SimpleNamespace(cause=cause, axis=axis, ports=ports, location=at))


@pytest.mark.parametrize(
    ("fitted", "count"),
    [
        ([part("stiffness_nonlinearity", "z", 2, 5), part("bump_stop", "z", 5)], 1),
        ([part("stiffness_nonlinearity", "z", 2), part("bump_stop", "z", 5)], 2),
        ([part("stiffness_nonlinearity", "z", 2), part("bump_stop", "z", 5), part("backlash", "z", 2, 5)], 1),
        ([part("stiffness_nonlinearity", "z", 2), part("coulomb_friction", "z", 2)], 2),
        ([part("sensor_gain", "z"), part("sensor_gain", "z")], 2),
    ],
)
def test_laws_of_one_kind_at_shared_mounts_are_one_force_law(fitted: list[SimpleNamespace], count: int):
    assert force_laws(fitted) == count


def test_one_effect_stands_for_causes_that_act_by_forces_or_for_those_of_one_sensor():
    forces = [part("backlash", "z", 2), part("mass_change", "", at="cab")]
    fitted = [*forces, part("sensor_gain", "z", at="a"), part("sensor_delay", "", at="a")]
    assert causes_per_effect(fitted, ("a", "b")) == (2, 2)
    assert causes_per_effect(fitted[2:], ("a", "b")) == (2,)
    assert causes_per_effect(fitted[2:], ("a", "b"), soft=True) == (1, 2)
    assert causes_per_effect((), ("a", "b")) == ()


def test_a_validation_run_far_above_its_floor_is_unexplained_whatever_the_fitted_run_says():
    settings = Settings()
    assert unexplained_run(gain_of((0.02, 0.02, 0.019, (0.0, 0.0)), (0.101, 0.101, 0.019, (0.0, 0.0))), settings) == "run1"
    assert unexplained_run(gain_of((0.04, 0.04, 0.019, (0.0, 0.0))), settings) == ""
    # named causes count as far as they go
    assert unexplained_run(gain_of((0.39, 0.30, 0.04, (0.0, 0.2))), settings) == "run0"
    assert unexplained_run(gain_of((0.39, 0.05, 0.04, (0.3, 0.4))), settings) == ""


def test_a_wild_model_asks_for_finite_forces():
    rng = np.random.default_rng(2)
    transfer = rng.normal(size=(5, 3, 4)) + 1j * rng.normal(size=(5, 3, 4))
    residual = rng.normal(size=(5, 3)).astype(complex)
    noise = np.tile(1e-8 * np.eye(3, dtype=complex), (5, 1, 1))
    wild = missing_forces(residual, transfer, np.full((5, 4), 1e18), noise)
    np.testing.assert_allclose(np.einsum("fij,fj->fi", transfer, wild), residual, rtol=1e-6)
    usual = missing_forces(residual, transfer, np.full((5, 4), 1e-4), noise)
    shaped = 1e-4 * np.conj(np.swapaxes(transfer, 1, 2))
    expected = shaped @ np.linalg.solve(transfer @ shaped + noise, residual[:, :, None])
    np.testing.assert_allclose(usual, expected[:, :, 0], rtol=1e-6)


def test_a_sensor_turned_by_far_is_seen_as_the_rotation_that_it_is():
    vehicle, run = quarter_car(), quarter_car_run(3)
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    view = RunView(RunData(plant, measurement(plant, run), Settings()), ModelState(*file_parameters(plant)))
    angle = np.radians(-18.0)
    column = turned_column(view, "base", 0, angle)
    reading = view.grid.signal(view.data.input_spectrum)
    turn = rotation_matrices(angle * np.eye(3)[:1])[0]
    for effect in (e for e in column if e.where is Where.INPUT):
        expected = reading @ (turn - np.eye(3))[effect.index]
        np.testing.assert_allclose(angle * effect.signal, expected, atol=1e-9 * np.abs(reading).max())
    means = {e.index: angle * float(e.signal[0]) for e in column if e.where is Where.MEAN}
    gravity = np.array([0.0, 0.0, GRAVITY])
    rows = [i for i, s in enumerate(mean_table(view).signals) if s.sensor == "base"]
    np.testing.assert_allclose([means.get(r, 0.0) for r in rows], turn.T @ gravity - gravity, atol=1e-9)


def test_the_mounts_of_an_axle_and_of_a_side_are_places_of_a_law():
    vehicle = load_vehicle(Path("config/vehicles/truck_cab.yaml"))
    ports = [p for p in build_plant(vehicle, dict.fromkeys(vehicle.sensors, 3)).ports if p.axis == "z"]
    view = SimpleNamespace(
        plant=SimpleNamespace(vehicle=vehicle, ports=ports), deflection=np.random.default_rng(0).normal(size=(50, len(ports)))
    )
    found = {s.location: {ports[p].mount for p in s.ports} for s in port_groups(view)}
    assert found["rear"] == {"rear_left", "rear_right"} and found["left"] == {"front_left", "rear_left"}
    assert set(found) == {"front", "rear", "left", "right", "all", *(p.mount for p in ports)}


def test_what_the_form_of_a_law_leaves_open_is_in_stiffness_and_damping() -> None:
    """Half of 0.5 % of the energy of a friction of 100 N beside springs of 440 N and dampers of 110 N, at its own port only."""
    friction = 100.0 * np.sign(np.sin(np.linspace(0.0, 20.0 * np.pi, 10000, endpoint=False) + 1e-4))
    state = SimpleNamespace(stiffness=np.array([44e3, 44e3]), damping=np.array([2.2e3, 2.2e3]))
    view = SimpleNamespace(scales=[(0.01, 0.05), (0.01, 0.05)], state=state)

    def columns(view: object, shape: object) -> list[tuple[Effect, ...]]:
        return [(Effect(Where.PORT, 1, friction),), (Effect(Where.MEAN, 0, np.ones(1)),)]

    law = SimpleNamespace(hypothesis=SimpleNamespace(columns=columns), shape={}, coefficients=np.array([1.0, 1.0]))
    found = form_variance(SimpleNamespace(view=view, fitted=(law,)), 2)  # type: ignore[arg-type]
    np.testing.assert_allclose(found[:, 1], [0.0025 * (100.0 / 440.0) ** 2, 0.0025 * (100.0 / 110.0) ** 2], rtol=1e-9)
    assert np.all(found[:, 0] == 0.0) and np.all(form_variance(None, 2) == 0.0)


def verdict_of(monkeypatch, elsewhere: float | None, remaining: float, law: FreeLaw, *fitted: SimpleNamespace, right=False):
    """Return verdict, share that remains and probability of the library for causes that leave so much."""
    monkeypatch.setattr(chain, "remaining_energy", lambda work, base, gain: (remaining, remaining))
    monkeypatch.setattr(chain, "left_elsewhere", lambda gain, settings: elsewhere)
    monkeypatch.setattr(chain, "right_elsewhere", lambda gain, settings: right)
    accepted, plant = SimpleNamespace(fitted=fitted), SimpleNamespace(sensors=("a", "b"))
    work = SimpleNamespace(settings=Settings(), selection=SimpleNamespace(accepted=accepted), plant=plant)
    judged = SimpleNamespace(refuted=False, gain=None, law=law, work=work)
    return chain._verdict(work, None, judged, tuple(SimpleNamespace(id=f.hypothesis.cause) for f in fitted))


def test_several_causes_that_rather_mimic_one_unlisted_effect_explain_nothing(monkeypatch):
    # a law of another form explains 7.5 % more: one cause may have that form, of two an unlisted effect is likelier
    law, friction, bent = FreeLaw("all", "x", 0.075), part("coulomb_friction", "x", 0), part("stiffness_nonlinearity", "x", 0)
    assert verdict_of(monkeypatch, 0.001, 0.0, law, friction)[0] == "explained"
    # the right mount with a law of another form: the confidence agrees with the verdict
    assert verdict_of(monkeypatch, 0.001, 0.0, FreeLaw("all", "x", 0.6, 0.0, (0,)), friction)[::2] == ("explained", 0.5)
    verdict, _, known = verdict_of(monkeypatch, 0.001, 0.0, law, friction, bent)
    # odds 0.111 / 0.15 over the Lomax density of a mean of 0.013, averaged over 0.062 to 0.088
    right = ((1.0 + 0.062 / 0.026) ** -3 - (1.0 + 0.088 / 0.026) ** -3) / 0.026
    assert verdict == "unexplained" and known == pytest.approx(1.0 / (1.0 + 1.0 / (1.35 * right)))
    # two descriptions of one force are one cause
    assert verdict_of(monkeypatch, 0.001, 0.0, law, bent, part("bump_stop", "x", 0))[0] == "explained"


def test_what_is_left_where_nothing_was_fitted_decides_over_what_is_left_beyond_the_noise_of_the_run(monkeypatch):
    law, play = FreeLaw("", "", 0.0), part("backlash", "z", 2)
    assert verdict_of(monkeypatch, 0.18, 0.48, law, play)[0] == "explained"
    assert verdict_of(monkeypatch, None, 0.48, law, play)[0] == "unexplained"
    assert verdict_of(monkeypatch, 0.6, 0.02, law, play)[0] == "unexplained"
    assert verdict_of(monkeypatch, 0.6, 0.02, law, play, right=True)[0] == "explained"
    # a law at another mount that explains a fifth more speaks against a cause however little that leaves, one at its own does not
    assert verdict_of(monkeypatch, 0.02, 0.02, FreeLaw("fl", "y", 0.21, 0.03, (1,)), play)[0] == "unexplained"
    assert verdict_of(monkeypatch, 0.02, 0.02, FreeLaw("fl", "z", 0.21, 0.03, (2, 5)), play)[0] == "explained"
    assert verdict_of(monkeypatch, 0.3, 0.02, FreeLaw("fl", "z", 0.21, 0.03, (2, 5)), play)[0] == "unexplained"


@pytest.mark.parametrize(
    ("excess", "known_share", "gained", "after", "named"),
    [
        (0.99, 0.0, True, 0.1, True), (0.99, 0.0, False, 0.1, False), (0.99, 0.9, True, 0.1, False),
        (1.01, 0.0, False, 0.1, True), (1.01, 0.0, True, 0.14, True),
        # of 0.2 that a model misses elsewhere that explains the run, a cause leaves 64 % of the energy
        (1.01, 0.0, True, 0.16, False), (1.09, 0.0, True, 0.16, False), (1.2, 0.0, True, 0.16, True),
    ],
)  # fmt: skip
def test_where_nothing_is_left_above_the_noise_a_cause_needs_a_gain_beyond_doubt(
    monkeypatch, excess, known_share, gained, after, named
):
    law = FreeLaw("all", "x", known_share)
    accepted = SimpleNamespace(fitted=(part("coulomb_friction", "x", 0),), in_band=True, causes=("coulomb_friction",))
    selector = SimpleNamespace(base_excess=excess, better_law=lambda _: law, runner_up=lambda _: None)
    for name, value in (
        ("predict", None), ("refusal", ""), ("measured_gain", (gain_of((0.2, after, 0.0, (0.05, 0.2))), [])),
        ("gained_nothing", ""), ("remaining_energy", (0.0, 0.0)), ("judged_in_band", True), ("proven", gained),
        ("discrepancy", False),
    ):  # fmt: skip
        monkeypatch.setattr(chain, name, lambda *_, value=value: value)
    monkeypatch.setattr(chain.dataclasses, "replace", lambda thing, **changes: SimpleNamespace(**{**vars(thing), **changes}))
    selection = SimpleNamespace(accepted=accepted)
    plant = SimpleNamespace(sensors=())
    work = SimpleNamespace(selection=selection, settings=Settings(), data=None, extended=None, selector=selector, plant=plant)
    assert (chain._accepted_or_not(work, None, []).refused == "") is named


@pytest.mark.parametrize(("factor", "settled", "words"), [
    (1.05, True, "the extended model is worse there"), (1.01, True, ""), (0.5, True, ""), (0.5, False, "did not settle"),
])  # fmt: skip
def test_a_validation_run_that_the_extended_model_predicts_worse_is_said(monkeypatch, factor, settled, words):
    every, signal = np.arange(8), np.full(8, 100.0)
    part = SimpleNamespace(errors=np.ones(8), view=None, told=lambda blocks: blocks)
    monkeypatch.setattr(gains, "block_squares", lambda prediction: (prediction.errors, signal))
    monkeypatch.setattr(gains, "noise_squares", lambda view: np.full(8, 0.25))
    predicted = gains._Predicted(factor**2 * np.ones(8), every, every) if settled else None
    monkeypatch.setattr(gains, "_predicted", lambda work, run: predicted)
    work = SimpleNamespace(
        settings=Settings(), splits=SimpleNamespace(judge=every), extended=SimpleNamespace(fitted=("law",)),
        data=SimpleNamespace(measured=SimpleNamespace(name="run")), plant=SimpleNamespace(outputs=()), selection=None,
    )
    other = SimpleNamespace(measured=SimpleNamespace(name="other"))
    run = gains.ValidationRun(other, np.zeros((0, 1)), np.ones(8), signal, np.full(8, 0.25))
    gain, warnings = gains.measured_gain(work, part, part, [run])
    assert [w for w in warnings if words and words in w] == warnings
    assert len(warnings) == bool(words)
    # without a run that counts, the blocks of the run itself judge
    assert gain.validation[0].run == ("other" if settled else "run (judge blocks)")
    if settled:
        judged = gain.validation[0]
        assert (judged.baseline, judged.extended, judged.noise_floor) == pytest.approx((0.1, 0.1 * factor, 0.05))
