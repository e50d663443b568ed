# Copyright 2026 ride_estimation contributors
"""Hints of the estimator on /diagnostics."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.faults.hints import Hint
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes.hint_status import hint_status
from ride_estimation.nodes.session import Session


def test_a_hint_carries_cause_place_and_strength():
    hint = Hint("sensor_delay", "cab_front_left", "", 0.004, 0.0002, "s", "cab_front_left looks like sensor delay")
    status = hint_status([hint], "cab")
    assert (status.level, status.name, status.message) == (DiagnosticStatus.WARN, "hints", hint.words)
    values = {pair.key: pair.value for pair in status.values}
    assert (values["hint 1 cause"], values["hint 1 location"], values["hint 1 unit"]) == ("sensor_delay", "cab_front_left", "s")
    assert float(values["hint 1 strength"]) == 0.004


def test_nothing_suspected_is_said_too():
    session = Session(load_vehicle("config/vehicles/truck_cab.yaml"), PipelineSettings())
    (status,) = [s for s in session.statuses() if s.name == "hints"]
    assert (status.level, status.message) == (DiagnosticStatus.OK, "nothing suspected")
