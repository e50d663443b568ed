# Copyright 2026 ride_estimation contributors
"""Results of a replay as files for other programs; recordings are tested with the import."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.files.formats import read_measurement_file


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """What a replay leaves, with known numbers."""
    rng = np.random.default_rng(0)
    n = 50
    np.savez(
        tmp_path / "signals.npz", time_s=np.arange(n) / 200.0, stamp_ns=7_000_000_000 + 5_000_000 * np.arange(n),
        valid=np.ones(n, bool), cg_accel=rng.normal(size=(n, 6)), inertial_load=rng.normal(size=(n, 6)),
        mount_names=np.array(["left", "right"]), mount_force=rng.normal(size=(n, 2, 3)),
    )  # fmt: skip
    (tmp_path / "result.json").write_text("{}")
    return tmp_path


@pytest.mark.parametrize(
    ("suffix", "module"),
    [(".csv", "csv"), (".parquet", "pyarrow"), (".mf4", "asammdf"), (".rpc", "rpc3"), (".rsp", "rpc3"), (".drv", "rpc3")],
)
def test_every_signal_with_its_unit(suffix: str, module: str, folder: Path) -> None:
    pytest.importorskip(module)
    file = folder / f"run{suffix}"
    assert main(["export-file", str(folder), "--out", str(file)]) == 0
    found = read_measurement_file(file)
    by_name = {channel.name: channel for channel in found.channels}
    assert len(by_name) == 1 + 6 + 6 + 6
    with np.load(folder / "signals.npz") as signals:
        for name, unit, values in (
            ("cg_accel.pitch", "rad/s^2", signals["cg_accel"][:, 4]),
            ("inertial_load.roll", "N m", signals["inertial_load"][:, 3]),
            ("mount_force.right.z", "N", signals["mount_force"][:, 1, 2]),
        ):
            assert by_name[name].unit == unit
            kept = values.astype(np.float32) if module == "rpc3" else values  # RPC III has 32-bit numbers
            assert np.array_equal(by_name[name].values, kept)
        assert np.allclose(by_name["valid"].time_s, signals["time_s"], rtol=0.0, atol=1e-12)
    if suffix == ".mf4":
        assert found.start_ns == 7_000_000_000


def test_bad_input(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-file", str(folder), "--out", str(tmp_path / "run.xls")]) == 2
    assert ".mf4" in capsys.readouterr().err
    assert main(["export-file", str(tmp_path / "none"), "--out", str(tmp_path / "run.csv")]) == 2
    assert "--vehicle" in capsys.readouterr().err
    np.savez(folder / "signals.npz", time_s=np.zeros(3))
    assert main(["export-file", str(folder), "--out", str(tmp_path / "run.csv")]) == 2
    assert "stamp_ns" in capsys.readouterr().err
    n = 5
    whole = {
        "time_s": np.arange(n) / 200.0, "stamp_ns": np.arange(n), "valid": np.ones(n, bool), "cg_accel": np.zeros((n, 6)),
        "mount_names": np.array(["a"]), "mount_force": np.zeros((n, 1, 3)),
    }  # fmt: skip
    for name, array in (
        ("cg_accel", np.zeros((n, 3))), ("mount_force", np.zeros((n, 2, 3))), ("time_s", np.zeros(())),
        ("stamp_ns", np.zeros(n)), ("cg_accel", np.full((n, 6), "x")), ("mount_names", np.zeros(1)),
    ):  # fmt: skip
        np.savez(folder / "signals.npz", **(whole | {name: array}))
        assert main(["export-file", str(folder), "--out", str(tmp_path / "run.csv")]) == 2
        assert "not the results of a replay" in capsys.readouterr().err
