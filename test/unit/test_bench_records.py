# Copyright 2026 ride_estimation contributors
import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.reversals import find_motion, noise_level
from ride_estimation.io.bench_records import ReadOptions, read_bench_record, read_operating_points

N = 2000
T = np.arange(N) * 1e-3
X = 5e-3 * np.sin(2 * np.pi * 3 * T)
F = 1e5 * X + 40 * np.sign(np.gradient(X))


def make(t=T, x=X, f=F):
    return BenchRecord("bench.csv", np.array(t, dtype=float), np.array(x, dtype=float), np.array(f, dtype=float))


def changed(values, at, value):
    out = np.array(values, dtype=float)
    out[at] = value
    return out


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (make(T[:50], X[:50], F[:50]), "too short: 50 samples"),
        (make(T, X[:-1], F), "differ in length"),
        (make(T, changed(X, 7, np.nan), F), "displacement has 1 values that are not finite, the first at sample 7"),
        (make(T, X, changed(F, slice(3, 5), np.inf)), "force has 2 values"),
        (make(changed(T, 10, T[9]), X, F), "time does not increase"),
        (make(T[::-1], X, F), "time does not increase"),
        (make(T + 0.05 * (np.arange(N) // 150), X, F), "samples without a gap"),
        (make(T, np.full(N, 1e-3), F), "displacement is constant"),
        (make(T, X, np.full(N, 5.0)), "force is constant"),
        (make(T, 1e3 * X, F), "millimetres given as metres"),
        (make(T, X, 1e-3 * F / 10), "kN given as N"),
        (make(T, 1e-6 * X, F), "1000 times stiffer"),
    ],
)
def test_bad_records_are_refused_with_the_reason(record, says):
    with pytest.raises(InputDataError, match=says):
        check_record(record)


def test_a_force_of_the_wrong_sign_is_refused_and_a_late_one_warned_of():
    v = np.gradient(X, T)
    spring, damper = 1e5 * X + 50 * v, 3e3 * v
    for force in (spring, damper):
        assert not check_record(make(T, X, force)).warnings
        with pytest.raises(InputDataError, match="--sign opposed"):
            check_record(make(T, X, -force))
        # a mechanism that really pushes away from rest can be accepted
        assert any("opposite signs" in w for w in check_record(make(T, X, -force), allow_stiffness_outside=True).warnings)
    # 8 ms late at 3 Hz: the loop of the spring turns the other way round; 8 ms early it only looks more damped
    assert any("late against the displacement" in w for w in check_record(make(T, X, np.roll(spring, 8))).warnings)
    assert not any("late" in w for w in check_record(make(T, X, np.roll(spring, -8))).warnings)
    # a record that ends where it did not begin gives its spring energy back without being suspicious
    assert not check_record(make(T[:900], X[83:983], spring[83:983])).warnings
    t = np.arange(2000) * 1e-3
    out = 5e-3 * (1.0 - t / t[-1])
    assert not check_record(make(t, out, 1e5 * out)).warnings


def test_implausible_stiffness_can_be_accepted_and_is_still_said():
    assert any("1000 times softer" in w for w in check_record(make(T, 1e3 * X, 0.1 * F), allow_stiffness_outside=True).warnings)


def test_small_time_jitter_is_removed():
    rng = np.random.default_rng(0)
    checked = check_record(make(T + 1e-6 * rng.standard_normal(N)))
    assert np.ptp(np.diff(checked.time_s)) < 1e-12


def test_stamps_that_jitter_are_resampled_and_a_lost_sample_is_filled():
    rng = np.random.default_rng(3)
    t = T + 2e-4 * rng.uniform(-1, 1, N)  # a fifth of a step: far beyond what counts as uniform
    keep = np.delete(np.arange(N), [400, 1200])
    x = 5e-3 * np.sin(2 * np.pi * 3 * t)
    checked = check_record(make(t[keep] + 7.0, x[keep], 1e5 * x[keep]))
    assert np.ptp(np.diff(checked.time_s)) < 1e-12
    truth = 5e-3 * np.sin(2 * np.pi * 3 * (checked.time_s - 7.0))
    assert np.abs(checked.displacement - truth)[5:-5].max() < 1e-6
    assert any("resampled" in w for w in checked.warnings)


def test_stamps_that_were_only_rounded_are_taken_as_even():
    t = np.arange(N) / 1024.0
    x = 5e-3 * np.sin(2 * np.pi * 3 * t)
    checked = check_record(make(np.round(t, 4), x, 1e5 * x))
    assert np.array_equal(checked.displacement, x)
    assert checked.warnings == ()


def test_beside_a_gap_the_longest_part_is_used_and_it_is_said():
    t = np.concatenate([T[:700], T[700:] + 0.5])
    checked = check_record(make(t, X, F))
    assert abs(checked.samples - 1300) <= 2
    assert any("longest part is used, 0.69" in w or "longest part is used, 0.7" in w for w in checked.warnings)


def test_clipped_force_is_noticed_and_rest_is_not():
    assert any("force looks clipped" in w for w in check_record(make(T, X, np.clip(F, -300, 300))).warnings)
    rest = np.concatenate([np.zeros(500), X[:1500]])
    assert check_record(make(T, rest, 1e5 * rest)).warnings == ()


def test_noise_is_estimated_from_the_signal_alone():
    rng = np.random.default_rng(1)
    for std in (1e-7, 1e-6, 1e-5):
        # 10 %: the median of about 20 000 values of four difference orders
        assert noise_level(np.tile(X, 10) + std * rng.standard_normal(10 * N)) == pytest.approx(std, rel=0.1)


def test_reversals_of_a_noisy_sine_are_those_of_the_sine():
    rng = np.random.default_rng(2)
    motion = find_motion(X + 2e-6 * rng.standard_normal(N), 1e-3)
    # 6 periods have 12 extrema; the ends add at most one
    assert abs(motion.directions.size - 13) <= 1
    inner = motion.anchors[1:-1]
    assert np.abs(np.abs(inner) - 5e-3) == pytest.approx(0.0, abs=1e-5)
    assert np.all(np.diff(motion.directions) != 0)


def test_reversals_without_noise_are_exact():
    motion = find_motion(np.array([0.0, 1, 2, 1, 0, -1, 0, 3, 3, 2]), 1.0, raw=True)
    assert motion.starts.tolist() == [0, 2, 5, 7, 10]
    assert motion.directions.tolist() == [1, -1, 1, -1]


def write_csv(path, header, *columns, delimiter=","):
    np.savetxt(path, np.column_stack(columns), delimiter=delimiter, header=header, comments="")
    return path


def test_units_come_from_column_names(tmp_path):
    path = write_csv(tmp_path / "a.csv", "time_ms,displacement_mm,force_kn", 1e3 * T, 1e3 * X, 1e-3 * F)
    record = read_bench_record(path)
    assert record.displacement == pytest.approx(X, abs=1e-12)
    assert record.force == pytest.approx(F, abs=1e-9)
    assert record.step_s == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize(
    ("header", "stroke", "force"),
    [
        ("time_s,displacement_in,force_lbf", 0.0254, 4.4482216152605), ("time_s,travel_in,load_kip", 0.0254, 4448.2216152605),
        ("time,displacement,force\ns,mm,kN", 1e-3, 1e3), ("time,displacement [cm],force\n[s],,(daN)", 1e-2, 10.0),
    ],
)  # fmt: skip
def test_units_of_other_countries_and_a_line_of_units(tmp_path, header, stroke, force):
    t = np.arange(4000) / 1000.0
    x, f = np.sin(12.0 * t) * 1e-3 / stroke, 200.0 * np.sin(12.0 * t + 0.1) / force
    path = tmp_path / "record.csv"
    path.write_text("\n".join([header, *(f"{a:.6f},{b:.9g},{c:.9g}" for a, b, c in zip(t, x, f))]))
    record = read_bench_record(path)
    assert record.displacement == pytest.approx(x * stroke, abs=1e-9)
    assert record.force == pytest.approx(f * force, abs=1e-5)


def test_units_in_brackets_semicolons_and_decimal_commas(tmp_path):
    lines = ["Time [s];Displacement [mm];Load (kN)"]
    lines += [f"{t:.4f};{1e3 * x:.9f};{1e-3 * f:.9f}".replace(".", ",") for t, x, f in zip(T, X, F, strict=True)]
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines), encoding="utf-8")
    record = read_bench_record(path)
    assert record.displacement == pytest.approx(X, abs=1e-11)
    assert record.force == pytest.approx(F, abs=1e-5)


def test_tabs_with_decimal_commas_of_another_encoding(tmp_path):
    rows = ["t [s]\tdist [mm]\tload [N]"]
    rows += ["\t".join(f"{v:.9f}".replace(".", ",") for v in row) for row in zip(T, 1e3 * X, F)]
    path = tmp_path / "a.tsv"
    path.write_bytes(("# Prüfstand °C\n" + "\n".join(rows)).encode("cp1252"))
    record = read_bench_record(path)
    assert record.displacement == pytest.approx(X, abs=1e-11)
    assert record.force == pytest.approx(F, abs=1e-8)


def test_npz_and_named_columns(tmp_path):
    np.savez(tmp_path / "a.npz", s=T, way=X, load_cell=-F)
    options = ReadOptions(time="s", displacement="way", force="load_cell", displacement_unit="m", force_unit="N", sign="opposed")
    assert read_bench_record(tmp_path / "a.npz", options).force == pytest.approx(F)


@pytest.mark.parametrize(
    ("header", "options", "says"),
    [
        ("time_s,displacement,force_n", {}, "unit of column 'displacement' is not stated"),
        ("time_s,displacement_mm,weight", {}, "force: no column looks like it"),
        ("time_s,displacement_mm,force_n", {"force": "F2"}, "force: no column 'F2'"),
        ("time_s,displacement_mm,force_n", {"force_unit": "furlong"}, "unit 'furlong'"),
        ("x,displacement_mm,force_n", {}, "displacement: several columns could be it"),
        ("stamp,displacement_mm,force_n", {}, "state --rate HZ"),
    ],
)
def test_ambiguous_columns_are_refused(tmp_path, header, options, says):
    path = write_csv(tmp_path / "a.csv", header, T, 1e3 * X, F)
    with pytest.raises(InputDataError, match=says):
        read_bench_record(path, ReadOptions(**options))


def test_a_text_cell_becomes_a_clear_error(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{t},{1e3 * x},{f}" for t, x, f in zip(T, X, F, strict=True)]
    rows[100] = rows[100].rsplit(",", 1)[0] + ",overload"
    path.write_text("time_s,displacement_mm,force_n\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(InputDataError, match="'overload' in data row 101 of column 'force_n'"):
        read_bench_record(path)


def test_a_displacement_that_never_passes_zero_is_centred_and_said(tmp_path):
    path = write_csv(tmp_path / "a.csv", "time_s,displacement_mm,force_n", T, 1e3 * X + 20.0, F)
    record = read_bench_record(path)
    assert record.displacement.mean() == pytest.approx(0.0, abs=1e-12)
    assert any("mean was subtracted" in w for w in record.warnings)
    kept = read_bench_record(path, ReadOptions(zero="none"))
    assert kept.displacement.min() == pytest.approx(0.015, rel=1e-3)


def test_table_of_harmonic_tests(tmp_path):
    path = write_csv(
        tmp_path / "k.csv",
        "frequency_hz,amplitude_mm,stiffness_n_per_mm,loss_energy_n_mm",
        [1.0, 10.0],
        [1.0, 0.1],
        [100.0, 120.0],
        [30.0, 0.4],
    )
    points = read_operating_points(path)
    assert np.abs(points.stiffness) == pytest.approx([1e5, 1.2e5])
    assert points.loss_energy == pytest.approx([30e-3, 0.4e-3])
    bad = write_csv(
        tmp_path / "b.csv", "frequency_hz,amplitude_mm,stiffness_n_per_mm,loss_energy_n_mm", [1.0], [1.0], [10.0], [99.0]
    )
    with pytest.raises(InputDataError, match="row 1 of the table"):
        read_operating_points(bad)
