# Copyright 2026 ride_estimation contributors
"""Inputs that stop, one or all at once, are an error on the steady clock; a node that was busy itself is none."""

from __future__ import annotations

from collections.abc import Container
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from ride_estimation.nodes import estimator_node
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.nodes.silence import LOOK_PERIOD_S, Silence
from ros.conftest import Ros
from ros.drive import drive

VICTIM = "/cab/front_left/accel"
LIMIT_S = 0.5


class Drive:
    """A node that is driven by hand: messages, looks and the steady clock."""

    def __init__(self, ros: Ros, clock: list[float]) -> None:
        self.node = EstimatorNode(context=ros.context, use_global_arguments=False)
        ros.add(self.node)
        assert self.node.session is not None
        self._messages = drive(self.node.session.vehicle, 60.0)
        self._clock = clock
        self.reports: list[float] = []
        self.node._publish_diagnostics = lambda: self.reports.append(clock[0])  # type: ignore[method-assign]

    def go(self, seconds: float, dead: Container[str] = ()) -> None:
        for _ in range(round(seconds / LOOK_PERIOD_S)):
            for _ in range(8 * 10):  # 8 topics at 100 Hz
                message = next(self._messages)
                if message.topic not in dead:
                    self.node._arrived(message.topic, self.node.session.states[message.topic], message.payload)
            self._clock[0] += LOOK_PERIOD_S
            self.node.look()

    def said(self) -> dict[str, tuple[bytes, str]]:
        return {s.name: (s.level, s.message) for s in self.node._statuses()}


@pytest.fixture
def driven(ros_single: Ros, monkeypatch: pytest.MonkeyPatch) -> Drive:
    clock = [1000.0]
    monkeypatch.setattr(estimator_node, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    return Drive(ros_single, clock)


def test_all_inputs_dead_is_an_error_within_the_limit_and_ends_when_they_return(driven: Drive) -> None:
    driven.go(3.0)
    topics = list(driven.node.session.topics)
    sensors = [name for state in driven.node.session.states.values() for name in state.sensors]
    assert {driven.said()[f"topic {t}"][0] for t in topics} == {DiagnosticStatus.OK}
    driven.reports.clear()
    stopped = driven._clock[0]
    driven.go(LIMIT_S - LOOK_PERIOD_S, dead=topics)
    assert not driven.reports
    driven.go(3.0 * LOOK_PERIOD_S, dead=topics)
    assert driven.reports[0] - stopped <= LIMIT_S + 2.0 * LOOK_PERIOD_S, "it is told at once, not at the next report"
    driven.go(5.0, dead=topics)
    said = driven.said()
    for name in (*(f"topic {t}" for t in topics), *(f"sensor {s}" for s in sensors)):
        assert said[name][0] == DiagnosticStatus.ERROR
        assert said[name][1].startswith("has stopped")
    level, message = said["estimates"]
    assert level == DiagnosticStatus.ERROR
    assert message.startswith("all inputs stopped: nothing received for 5.")
    driven.go(2.0)
    said = driven.said()
    assert {said[f"topic {t}"] for t in topics} == {(DiagnosticStatus.OK, "receiving")}
    assert "stopped" not in said["estimates"][1]
    assert all(not said[f"sensor {s}"][1].startswith("has stopped") for s in sensors)


def test_one_dead_input_is_named_by_its_topic(driven: Drive) -> None:
    driven.go(2.0)
    driven.go(1.0, dead=[VICTIM])
    said = driven.said()
    assert said[f"topic {VICTIM}"][0] == DiagnosticStatus.ERROR
    assert said["estimates"][0] == DiagnosticStatus.ERROR
    assert said["estimates"][1].startswith(f"{VICTIM} stopped")
    others = [t for t in driven.node.session.topics if t != VICTIM]
    assert {said[f"topic {t}"][0] for t in others} == {DiagnosticStatus.OK}


def test_messages_without_a_usable_sample_are_no_estimates_and_that_is_an_error(driven: Drive) -> None:
    driven.go(2.0)
    driven.node.session.pipeline.observe = lambda *_: ()  # as if every sample were refused
    driven.go(1.5)
    level, message = driven.said()["estimates"]
    assert level == DiagnosticStatus.ERROR
    assert message.startswith("no estimate for")


def test_a_node_that_was_busy_itself_does_not_call_its_inputs_dead(driven: Drive) -> None:
    driven.go(2.0)
    driven.reports.clear()
    driven._clock[0] += 30.0  # the messages of this time wait behind the look
    driven.node.look()
    assert not driven.reports
    driven.go(0.5)
    assert driven.said()[f"topic {VICTIM}"] == (DiagnosticStatus.OK, "receiving")


def test_a_node_that_is_activated_again_listens_and_begins_to_wait_anew(driven: Drive) -> None:
    driven.go(2.0)
    driven.go(1.0, dead=list(driven.node.session.topics))
    driven.node.trigger_deactivate()
    driven.node.trigger_activate()
    assert driven.said()[f"topic {VICTIM}"] == (DiagnosticStatus.OK, "receiving")
    assert set(driven.node._subscriptions_by_topic) == set(driven.node.session.topics)


def silence_of(intervals_s: list[float], limit_s: float) -> float:
    """Return the longest silence that was too long while messages came at these intervals; 0 where none was."""
    silence, count, worst, due = Silence(), 1, 0.0, 0.0
    silence.look(count, LOOK_PERIOD_S, limit_s)
    for interval in intervals_s:
        due += interval
        while due > LOOK_PERIOD_S / 2:
            due -= LOOK_PERIOD_S
            count += due <= LOOK_PERIOD_S / 2
            silence.look(count, LOOK_PERIOD_S, limit_s)
            worst = max(worst, silence.seconds) if silence.too_long else worst
    return worst


def test_a_slow_topic_and_bursts_are_not_silent_and_a_dead_one_is() -> None:
    assert silence_of([1.0] * 20, LIMIT_S) == 0.0
    assert silence_of([2.0] * 20, LIMIT_S) == 0.0
    assert silence_of([1.0] * 20 + [5.0], LIMIT_S) > 3.0
    assert silence_of([0.1] * 40 + [2.0], LIMIT_S) > LIMIT_S
