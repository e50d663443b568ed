# Copyright 2026 ride_estimation contributors
"""What a person sees of a long job: stages by name, percent of the whole, no silence."""

from __future__ import annotations

import io
import sys
import time

import pytest

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


def test_what_fails_does_not_end_at_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with pytest.raises(ValueError), Progress("replay", shares={"reading": 0.5}) as shown:
        shown.begin("reading")
        raise ValueError
    assert "100 %" not in screen.getvalue() and screen.getvalue().endswith("\n")
