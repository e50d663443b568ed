# Copyright 2026 ride_estimation contributors
"""What makes a diagnosis fast changes nothing: whitened transfer functions, rows prepared once, several threads."""

from __future__ import annotations

import time
import types

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.calibration.regression import Regression, side_by_side
from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.common.parallel import in_order
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import make_grid
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.runs.injection import Injector
from ride_estimation.diagnosis.search.screening import Projector

N, NY = 600, 3


def complex_normal(rng, *shape):
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


@pytest.mark.parametrize(("single", "tolerance"), [(False, 1e-12), (True, 1e-5)])  # rounding of either precision
def test_columns_reach_the_whitened_outputs_as_written_out_effect_by_effect(single, tolerance):
    rng = np.random.default_rng(1)
    grid = make_grid(N, 100.0, (0.5, 30.0))
    f = len(grid.omega)
    entries = {Where.PORT: 4, Where.WRENCH: 2, Where.INPUT: 3}
    plain = {where: complex_normal(rng, f, NY, count) for where, count in entries.items()}
    response = types.SimpleNamespace(
        output_from_port=plain[Where.PORT], output_from_wrench=plain[Where.WRENCH], output_from_input=plain[Where.INPUT]
    )
    whitener = complex_normal(rng, f, NY, NY)

    def effect(where, index):
        return Effect(where, index, rng.standard_normal(N))

    mean = Effect(Where.MEAN, 0, np.ones(1))
    columns = [
        (effect(Where.PORT, 2),), (effect(Where.OUTPUT, 1), mean), (effect(Where.PORT, 0), effect(Where.PORT, 3)), (mean,),
        (effect(Where.WRENCH, 1), effect(Where.WRENCH, 0), effect(Where.PORT, 0)), (effect(Where.INPUT, 2),),
        (effect(Where.OUTPUT, 0), effect(Where.OUTPUT, 2)),
    ]  # fmt: skip
    expected = np.zeros((f, NY, len(columns)), dtype=complex)
    for j, column in enumerate(columns):
        for e in column:
            if e.where is not Where.MEAN:
                transfer = np.eye(NY)[None] if e.where is Where.OUTPUT else plain[e.where]
                seen = transfer[:, :, e.index] * grid.spectrum(e.signal)[:, None]
                expected[:, :, j] += np.einsum("fij,fj->fi", whitener, seen)
    got = Injector(grid, response, whitener).whitened(columns, single)
    np.testing.assert_allclose(got, expected, atol=tolerance * np.abs(expected).max())
    alone = Injector(grid, response, whitener).whitened([columns[0], columns[0]], single)
    np.testing.assert_allclose(alone[:, :, 1], expected[:, :, 0], atol=tolerance * np.abs(expected).max())


def test_rows_prepared_apart_join_to_the_normal_matrix_of_all_of_them():
    rng = np.random.default_rng(2)
    blocks = np.array([0, 2, 3])
    columns, residual = rng.standard_normal((4, 50, 3)), rng.standard_normal((4, 50))
    means = rng.standard_normal((2, 8))
    regression = Regression(residual, columns, rng.standard_normal(2), means[:, :3], np.ones(3), np.zeros(3), temper=2.0)
    projector = Projector(regression, blocks)
    rows = rng.standard_normal((4, 50, 5)) * np.array([1.0, 1e-6, 1e6, 1.0, 3.0])
    whole = projector.reduce(rows, means[:, 3:])
    parts = [projector.pushed(rows[:, :, part], means[:, 3:][:, part]) for part in (slice(0, 2), slice(2, 5))]
    for a, b in zip(projector.join(*parts), whole):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())
    # brute force: candidates together with the baseline, the baseline eliminated (Schur complement)
    root = np.sqrt(2.0)
    full = np.vstack([np.concatenate([columns, rows], axis=2)[blocks].reshape(-1, 8), root * means])
    target = np.concatenate([residual[blocks].ravel(), regression.mean_residual])
    gram = full.T @ full
    gram[:3, :3] += 2.0 * np.eye(3)
    right = full.T @ target
    eliminated = gram[3:, 3:] - gram[3:, :3] @ np.linalg.solve(gram[:3, :3], gram[:3, 3:])
    size = np.sqrt(np.outer(np.diag(eliminated), np.diag(eliminated)))
    np.testing.assert_allclose(whole[0] / size, eliminated / size, atol=1e-5)  # cross products are in single precision
    reduced = right[3:] - gram[3:, :3] @ np.linalg.solve(gram[:3, :3], right[:3])
    np.testing.assert_allclose(whole[1] / np.sqrt(np.diag(size)), reduced / np.sqrt(np.diag(size)), atol=1e-4)


def test_rows_that_leave_out_leading_zeros_count_as_those_with_them():
    rng = np.random.default_rng(3)
    blocks = np.array([0, 1, 3])
    columns, residual = rng.standard_normal((4, 50, 3)), rng.standard_normal((4, 50))
    regression = Regression(residual, columns, np.zeros(0), np.zeros((0, 3)), np.ones(3), np.zeros(3))
    fresh = rng.standard_normal((4, 20, 1))
    replaced = regression.replaced([1], fresh, residual, (np.ones(3), np.zeros(3)), 1.0)
    short, whole = rng.standard_normal((4, 20, 2)), np.zeros((4, 50, 2))
    whole[:, 30:] = short
    for r in (regression, replaced):
        projector, means = Projector(r, blocks), np.zeros((0, 2))
        for a, b in zip(projector.reduce(short, means), projector.reduce(whole, means)):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6 * np.abs(b).max())
        # parts of different length join
        other = projector.pushed(rng.standard_normal((4, 50, 1)), means[:, :1])
        for a, b in zip(*(projector.join(other, projector.pushed(rows, means)) for rows in (short, whole))):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6 * np.abs(b).max())
        np.testing.assert_allclose(r.candidate_grams(short), r.candidate_grams(whole), rtol=1e-6, atol=1e-6)
        few, all_of_them = (r.extended(rows, means, 1.0).grams for rows in (short, whole))
        np.testing.assert_allclose(few, all_of_them, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(side_by_side(short, columns), np.concatenate([whole, columns], axis=2))


def test_values_come_in_the_order_of_the_items_whoever_is_ready_first():
    def work(item: int) -> int:
        time.sleep(0.02 if item == 0 else 0.0)
        return item * item

    assert list(in_order(work, [0, 1, 2, 3], 3)) == list(in_order(work, [0, 1, 2, 3], 1)) == [0, 1, 4, 9]
    with pytest.raises(ZeroDivisionError):
        list(in_order(lambda item: 1 // item, [1, 0], 2))


def test_an_answer_does_not_depend_on_the_number_of_threads():
    run = quarter_car_run(14, seconds=24.0, law=lambda x, v: 60.0 * np.tanh(v / 0.002))
    one, two = (diagnose(quarter_car(), run, settings=Settings(threads=n)).to_mapping() for n in (1, 3))
    assert one == two
    assert one["verdict"] == "explained"
