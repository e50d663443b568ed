# Copyright 2026 ride_estimation contributors
"""Fleets: nothing is lost when a run fails or takes its process with it, what is finished is kept, the table tells all."""

from __future__ import annotations

import csv
import dataclasses
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import fleet_work
import numpy as np
import pytest
from worlds.adapters import recording as as_recording
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.cli import fleet
from ride_estimation.cli.fleet import find_recordings, folder_name
from ride_estimation.cli.main import main
from ride_estimation.cli.pool import DIED, Outcome, run_on_cluster, run_on_pool
from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.run_metrics import Metric
from ride_estimation.io.run_table import write_run_table
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.reporting.fleet_report import fleet_page
from ride_estimation.reporting.outliers import find_outliers
from ride_estimation.reporting.page import Table, Text


def test_a_pool_outlives_a_death_and_an_exception() -> None:
    items = [1, 2, 13, 4, -5, 6, 7]
    found = {outcome.item: outcome for outcome in run_on_pool(items, 2, fleet_work.square)}
    assert set(found) == set(items)
    assert found[13].value is None and found[13].error == DIED
    assert found[-5].error == "ValueError: no square of -5"
    assert {i: found[i].value for i in (1, 2, 4, 6, 7)} == {1: 1, 2: 4, 4: 16, 6: 36, 7: 49}


@pytest.mark.slow
def test_a_cluster_gives_the_same() -> None:
    distributed = pytest.importorskip("distributed")
    items = [1, 2, -5, 7]
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        found = {o.item: (o.value, o.error) for o in run_on_cluster(items, cluster.scheduler_address, fleet_work.square)}
    assert found[7] == (49, "") and found[-5][0] is None and "no square of -5" in found[-5][1]


def test_a_missing_cluster_library_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputDataError, match=r"ride_estimation\[fleet\]"):
        next(run_on_cluster([1], "tcp://127.0.0.1:1", fleet_work.square))


def test_recordings_are_found_once_and_get_folders_of_their_own(tmp_path: Path) -> None:
    for name in ("a/metadata.yaml", "a/a_0.mcap", "b/run.bag", "b/x 1.mcap", "c/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    found = find_recordings(tmp_path)
    assert list(found) == ["a", "b/run.bag", "b/x 1.mcap"]
    names = [folder_name(n) for n in (*found, "b/x_1.mcap", "b__x_1.mcap", ".")]
    assert len(set(names)) == len(names) and not any("/" in n or n.startswith(".") for n in names)


@dataclasses.dataclass(frozen=True)
class Fleet:
    folder: Path
    vehicle: Path


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    """Two recordings of one vehicle, a truncated one and one of something else."""
    root = tmp_path_factory.mktemp("fleet")
    rng = np.random.default_rng(5)
    cab = random_vehicle(rng, "rubber")
    sensors = random_sensors(cab, rng)
    data = measure(drive(cab, Road.random(rng), 4.0, 5), sensors, 200.0, 5, noise_share=0.01)
    vehicle = root / "vehicle.yaml"
    vehicle.write_text(vehicle_yaml(cab, data.sensors, None, 5))
    write_bag(root / "in" / "one", as_recording(data), load_vehicle(vehicle).sensors)
    shutil.copytree(root / "in" / "one", root / "in" / "two")
    whole = next((root / "in" / "one").glob("*.mcap"))
    (root / "in" / "broken.mcap").write_bytes(whole.read_bytes()[:2000])
    return Fleet(root / "in", vehicle)


def in_this_process(items: Sequence[Any], workers: int, work: Any) -> Iterator[Outcome[Any, Any]]:
    """The pool without processes: what it does with them is tested above."""
    for item in items:
        yield Outcome(item, work(item))


def table(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "fleet.csv").open(newline="") as stream:
        return {row["run"]: row for row in csv.DictReader(stream)}


def test_a_fleet_end_to_end(
    runs: Fleet, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "run_on_pool", in_this_process)
    arguments = ["fleet", str(runs.folder), "--vehicle", str(runs.vehicle), "--out", str(tmp_path), "--workers", "2"]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "3 runs: 2 replayed, 0 kept from before, 1 failed" in told and "failed: broken.mcap" in told
    rows = table(tmp_path)
    assert rows["broken.mcap"]["status"] == "failed" and rows["broken.mcap"]["error"]
    one, two = rows["one"], rows["two"]
    assert one["digest"] == two["digest"] != ""
    columns = [c for c in one if c not in ("run", "recording SHA-256")]
    assert len(columns) > 40 and all(one[c] == two[c] for c in columns)
    assert all("[" in c for c in columns if c not in ("status", "error", "digest") and not c.endswith(" usable"))
    page = (tmp_path / "report.html").read_text()
    assert "broken.mcap" in page and "2 of 3 runs evaluated" in page
    # again: finished runs are kept, the broken one is tried again; other settings replay all
    assert main(arguments) == 0
    assert "3 runs: 0 replayed, 2 kept from before, 1 failed" in capsys.readouterr().out
    assert table(tmp_path)["one"]["digest"] == one["digest"]
    (tmp_path / "runs" / "two" / "fleet_job.json").write_text("{")
    assert main([*arguments, "--without", list(load_vehicle(runs.vehicle).sensors)[-1]]) in (0, 2)
    assert " kept from before" in (told := capsys.readouterr().out) and "0 kept" in told


def test_bad_input(runs: Fleet, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "run_on_pool", in_this_process)
    common = ["--vehicle", str(runs.vehicle), "--out", str(tmp_path / "out")]
    assert main(["fleet", str(tmp_path / "none"), *common]) == 2
    assert "no such folder" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["fleet", str(tmp_path / "empty"), *common]) == 2
    assert "no recording below it" in capsys.readouterr().err
    assert main(["fleet", str(runs.folder), *common, "--workers", "0"]) == 2
    shutil.copy(runs.folder / "broken.mcap", tmp_path / "empty")
    assert main(["fleet", str(tmp_path / "empty"), *common]) == 2
    assert "not one of 1 runs" in capsys.readouterr().err


def test_the_table_as_parquet_says_the_same(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = [{"run": "a", "x [N]": 1.5, "error": ""}, {"run": "b", "error": "no"}]
    write_run_table(tmp_path / "t.parquet", ["run", "x [N]", "error"], rows)
    assert parquet.read_table(tmp_path / "t.parquet").to_pylist() == [
        {"run": "a", "x [N]": 1.5, "error": ""}, {"run": "b", "x [N]": None, "error": "no"},
    ]  # fmt: skip
    with pytest.raises(InputDataError, match="csv"):
        write_run_table(tmp_path / "t.xls", [], [])


def test_outliers_weigh_spread_and_own_uncertainty() -> None:
    def run(value: float, std: float | None = 1.0, sure: bool = True) -> dict[str, Metric]:
        return {"k": Metric("k", value, std, "N/m", sure)}

    usual = [(f"r{i}", run(100.0 + i)) for i in range(5)]
    assert [o.run for o in find_outliers([*usual, ("odd", run(200.0))])] == ["odd"]
    for harmless in (run(200.0, std=40.0), run(200.0, sure=False), run(103.0)):
        assert not find_outliers([*usual, ("odd", harmless)])
    assert not find_outliers([("a", run(1.0)), ("b", run(100.0))])  # two runs tell nothing


def test_the_summary_says_per_run_what_stands_out() -> None:
    @dataclasses.dataclass(frozen=True)
    class Row:
        name: str
        status: str
        error: str
        result: dict[str, Any]
        labels: dict[str, str]
        report: str = ""

    def result(factor: float) -> dict[str, Any]:
        names = [f"p{i}" for i in range(7)]
        parameters = [{"name": n, "value": factor * 10.0, "std": 0.1, "unit": "N/m", "status": "valid"} for n in names]
        def bounds(least: float) -> dict[str, float]:
            return {"equivalent_lower_n": least, "equivalent_upper_n": 2e3}

        mounts = [
            {"mount": "left", "axis": a, "equivalent_amplitude_n": n * factor, **bounds(least)}
            for a, n, least in (("y", 1500.0, 0.0), ("z", 1200.0, 1000.0))
        ]
        comfort = {"places": [{"location": "seat", "z": {"a_w_m_per_s2": 0.5}, "a8_m_per_s2": 0.6 * factor}]}
        loads = {"durability": {"slope": 5.0, "mounts": mounts}, "comfort": comfort}
        return {"run": {"duration_s": 5.0}, "warnings": [], "parameters": parameters, **loads}

    rows = [Row(f"r{i}", "done", "", result(1.0 + 0.001 * i), {"tags": "empty"}, "runs/r/report.html") for i in range(5)]
    rows += [Row("odd", "done", "", result(2.0), {"tags": "loaded"}), Row("bad", "failed", "why it failed", {}, {})]
    page = fleet_page("folder", rows)
    texts = [b.text for b in page.blocks if isinstance(b, Text)]
    # the answer first: a load that is not known (y) is none
    assert texts[0] == (
        "6 of 7 runs evaluated, 1 failed, 1 outliers; the most damaging load is left z in odd: equivalent amplitude 2.4 kN; "
        "A(8) is highest in odd: 1.2 m/s²."
    )
    (runs,) = [b for b in page.blocks if isinstance(b, Table) and "most damaging" in b.headers]
    at = runs.headers.index("most damaging")
    assert [str(cell) for cell in runs.rows[0][at : at + 3]] == ["left z", "1.2", "0.6"]
    assert [str(cell) for cell in runs.rows[-1][at : at + 3]] == ["", "", ""]
    (by_tag,) = [b for b in page.blocks if isinstance(b, Table) and "empty (5)" in b.headers]
    (line,) = [row for row in by_tag.rows if row[0] == "p0"]
    assert line[1] == "N/mm" and line[2:] == pytest.approx((0.01002, 0.02))
    # tables stand below their own heading
    (spread,) = [b for b in page.blocks if isinstance(b, Table) and "robust std" in b.headers]
    assert page.blocks.index(spread) < page.blocks.index(by_tag)
    (odd,) = [t for t in texts if t.startswith("odd:")]
    assert "p0 20 instead of 10.0" in odd and "and 4 more" in odd
