# Copyright 2026 ride_estimation contributors
"""The folder of compiled code removes old code of its own and nothing else; kernels are compiled ahead in shares."""

from __future__ import annotations

import importlib
import os
import runpy
import shutil
import subprocess
import sys
import time
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ride_estimation import jit
from ride_estimation.estimation import compile_ahead
from ride_estimation.estimation.kernel_list import KERNELS
from ride_estimation.jit import COMPILED, cache_folder, compile_for, compile_kernel, in_shares, recorded_calls


def test_only_compiled_code_of_this_package_is_ever_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIDE_ESTIMATION_CACHE", str(tmp_path))
    old, young, foreign = tmp_path / "0123456789abcdef", tmp_path / "fedcba9876543210", tmp_path / "photos"
    for folder in (old, young, foreign):
        folder.mkdir()
    month = time.time() - 30 * 86400.0
    for folder in (old, foreign):
        os.utime(folder, (month, month))
    made = cache_folder.__wrapped__("signals")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([young.name, "photos", made.name])


def test_shares_cost_about_the_same_and_hold_everything_once() -> None:
    sizes = [100, 70, 60, 30, 20, 20, 10]
    shares = in_shares(sizes, 3)
    assert sorted(i for share in shares for i in share) == list(range(len(sizes)))
    sums = [sum(sizes[i] for i in share) for share in shares]
    # the longest-first rule is within 4/3 of the best possible (Graham, SIAM J. Appl. Math. 17, 416, 1969)
    assert max(sums) <= 4 / 3 * sum(sizes) / 3
    assert in_shares([5], 3) == [[0], [], []]


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
def test_a_kernel_is_compiled_for_the_arguments_it_was_called_with() -> None:
    kernel = compile_kernel(_scaled)
    with recorded_calls() as calls:
        kernel(np.ones((2, 3)), np.ones(3, dtype=bool), 2, np.asfortranarray(np.ones((3, 2))))
    assert not calls  # not one of the package
    compile_for(kernel, "f2C b1C f f2F")
    assert [str(s) for s in kernel.signatures[1]][2] == "float64"  # type: ignore[attr-defined]


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
def test_a_second_installation_takes_up_what_the_first_one_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code belongs to its sources, wherever they lie; other sources have code of their own."""
    cache = importlib.import_module("numba.core.caching").CompileResultCacheImpl
    monkeypatch.setattr(cache, "_locator_classes", cache._locator_classes)
    monkeypatch.setenv("RIDE_ESTIMATION_CACHE", str(tmp_path / "cache"))
    name = "ride_estimation.signals.tripled"
    monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    taken_up, given = [], []
    for place, factor in (("workspace", 3.0), ("environment", 3.0), ("newer", 4.0)):
        package = tmp_path / place / "ride_estimation"
        (package / "signals").mkdir(parents=True)
        shutil.copy(str(jit.__file__), package)
        text = f"from ride_estimation.jit import compile_kernel\ndef tripled(x):\n    return {factor} * x\n"
        (package / "signals" / "tripled.py").write_text(text, encoding="utf-8")
        installed = runpy.run_path(str(package / "jit.py"))
        names: dict[str, Any] = {"__name__": name}
        exec(compile(text, package / "signals" / "tripled.py", "exec"), names)
        kernel = installed["compile_kernel"](names["tripled"])
        given.append(kernel(2.0))
        taken_up.append(sum(kernel.stats.cache_hits.values()))
    assert given == [6.0, 6.0, 8.0]
    assert taken_up == [0, 1, 0]


def _scaled(a: np.ndarray, b: np.ndarray, c: float, d: np.ndarray) -> float:
    return float(a[0, 0] * c * d[0, 0]) if b[0] else 0.0


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
def test_what_a_drive_calls_is_compiled_ahead() -> None:
    code = (
        "from ride_estimation.estimation.common.settings import PipelineSettings\n"
        "from ride_estimation.estimation.warm_up import warm_up\n"
        "from ride_estimation.io.vehicle_file import load_vehicle\n"
        "from ride_estimation.jit import recorded_calls\n"
        "with recorded_calls() as calls:\n"
        "    warm_up(load_vehicle('truck_cab'), PipelineSettings())\n"
        "print(*(f'{n}|{a}' for n, a in calls), sep='\\n')\n"
    )
    shown = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    called = {tuple(line.split("|")) for line in shown.splitlines()}
    missing = called - set(KERNELS)
    # a few kernels that changed since are compiled when they are called; many would make the list useless
    assert len(called) > 20 and len(missing) <= 0.2 * len(called), f"run benchmarks/kernel_list.py --write: {sorted(missing)}"


class _Finished:
    """A process that ended with a code, or does not end."""

    def __init__(self, code: int | None) -> None:
        self.code, self.killed = code, False

    def wait(self, timeout: float) -> int:
        if self.code is None:
            raise subprocess.TimeoutExpired("compile", timeout)
        return self.code

    def kill(self) -> None:
        self.killed = True


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
@pytest.mark.parametrize("code", [0, 1, None])
def test_every_share_has_its_process_and_only_complete_work_is_noted(
    code: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[list[str]] = []
    processes: list[_Finished] = []
    said: list[str] = []

    def start(command: list[str], **_: object) -> _Finished:
        started.append(command[-2:])
        processes.append(_Finished(code))
        return processes[-1]

    monkeypatch.setattr(compile_ahead, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(compile_ahead.os, "sched_getaffinity", lambda _: range(3), raising=False)
    monkeypatch.setattr(compile_ahead.subprocess, "Popen", start)
    assert compile_ahead.compile_ahead(said.append) == 3
    assert started == [["0", "3"], ["1", "3"], ["2", "3"]]
    assert len(said) == 1
    assert said[0].startswith("compiling for this machine, once: about 20 s")
    assert all(p.killed for p in processes)
    again = compile_ahead.compile_ahead(said.append)
    assert again == (0 if code == 0 else 3)
    assert len(said) == (1 if code == 0 else 2), "nothing to do is nothing to say"


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
def test_a_cache_that_cannot_be_written_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(compile_ahead, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(compile_ahead.os, "access", lambda *_: False)
    assert compile_ahead.compile_ahead(said.append) == 0
    assert said[0].startswith(f"compiled code cannot be kept in {tmp_path}: every start compiles anew")


@pytest.mark.skipif(not COMPILED, reason="without numba there are no kernels")
def test_an_interrupt_ends_all_compilers_and_notes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    processes: list[_Finished] = []

    class Interrupted(_Finished):
        def wait(self, timeout: float) -> int:
            raise KeyboardInterrupt

    def start(*_: object, **__: object) -> _Finished:
        processes.append(Interrupted(None))
        return processes[-1]

    monkeypatch.setattr(compile_ahead, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(compile_ahead.subprocess, "Popen", start)
    with pytest.raises(KeyboardInterrupt):
        compile_ahead.compile_ahead(lambda words: None)
    assert processes
    assert all(p.killed for p in processes)
    assert not list(tmp_path.iterdir())


def test_code_that_others_could_have_put_there_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIDE_ESTIMATION_CACHE", str(tmp_path))
    for mode, used in ((0o755, True), (0o775, True), (0o777, False)):
        tmp_path.chmod(mode)
        assert (cache_folder.__wrapped__("elements").parent == tmp_path) == used
