# Copyright 2026 ride_estimation contributors
"""What a person sees of a long job: stages by name, percent of the whole, no silence."""

from __future__ import annotations

import importlib
import io
import sys
import time

import pytest

from ride_estimation import jit
from ride_estimation.cli import progress
from ride_estimation.cli.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_log_gets_a_line_per_stage_and_is_never_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    log = io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    monkeypatch.setattr(progress, "_LINE_S", 0.02)
    with Progress("replay", shares={"reading": 0.2, "estimating": 0.6, "report": 0.2}) as shown:
        shown.begin("reading")
        shown.begin("estimating")
        shown.advance(1.0, 2.0)
        time.sleep(0.1)
        shown.begin("report")
    lines = [line.split() for line in log.getvalue().splitlines()]
    assert all(line[0] == "replay:" for line in lines)
    percents = {stage: [line[1] for line in lines if line[-1] == stage] for stage in ("reading", "estimating", "report")}
    assert percents["reading"] == ["0"]
    assert percents["estimating"][0] == "20"
    assert set(percents["estimating"][1:]) == {"50"}
    assert percents["report"] == ["80"]


def test_a_terminal_keeps_a_line_per_stage_and_ends_at_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with Progress("replay", shares={"reading": 0.5, "report": 0.5}) as shown:
        shown.begin("reading")
        shown.begin("report")
    lines = screen.getvalue().split("\n")
    assert [line.rpartition("\r")[2].split()[-1] for line in lines[:-1]] == ["reading", "report"]
    assert "100 %" in lines[1] and lines[2] == ""


def test_a_line_is_no_wider_than_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("COLUMNS", "80")
    with Progress("replay") as shown:
        shown.begin("reading")
        shown.begin("compiling for this machine, once: about 20 s of processor time, shared by 2 process(es)")
    short, long, _ = screen.getvalue().split("\n")
    assert len(short.rpartition("\r")[2].rstrip()) == 62
    assert max(map(len, long.split("\r"))) == 79


def test_what_fails_does_not_end_at_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with pytest.raises(ValueError), Progress("replay", shares={"reading": 0.5}) as shown:
        shown.begin("reading")
        raise ValueError
    assert "100 %" not in screen.getvalue() and screen.getvalue().endswith("\n")


def test_it_says_when_kernels_are_compiled_and_not_when_they_run(monkeypatch: pytest.MonkeyPatch) -> None:
    if not jit.COMPILED:
        pytest.skip("without numba nothing is compiled")
    log = io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    seen: list[bool] = []
    with Progress("replay", shares={"reading": 1.0}) as shown:
        kernel = jit.compile_kernel(_halved)
        assert not kernel.signatures
        kernel._dispatcher._cache = importlib.import_module("numba.core.caching").NullCache()
        events = importlib.import_module("numba.core.event")

        class Look(events.Listener):
            def on_start(self, event: object) -> None:
                seen.append(jit.compiling())
                shown.begin("within")

            def on_end(self, event: object) -> None: ...

        look = Look()
        events.register("numba:compile", look)
        try:
            assert kernel(3.0) == 1.5
        finally:
            events.unregister("numba:compile", look)
        assert kernel(5.0) == 2.5
        shown.begin("after")
    lines = log.getvalue().splitlines()
    assert seen == [True] and not jit.compiling()
    assert next(line for line in lines if "within" in line).endswith("within (compiling for this machine, once)")
    assert next(line for line in lines if "after" in line).endswith("after")


def _halved(value: float) -> float:
    return 0.5 * value
