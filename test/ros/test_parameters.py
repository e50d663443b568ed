# Copyright 2026 ride_estimation contributors
"""The parameter table: what it declares, refuses and documents."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
import yaml
from rclpy.parameter import Parameter

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.nodes.estimator_parameters import PIPELINE_PARAMETERS, TABLE, documents, pipeline_settings
from ride_estimation.nodes.parameters import NodeParameter, problems, verdict

ROOT = Path(__file__).resolve().parents[2]
DEFAULTS = {p.name: p.default for p in TABLE}


def test_files_are_written_from_the_table() -> None:
    for name, text in documents().items():
        assert (ROOT / name).read_text(encoding="utf-8") == text, f"{name}: write it again with --write"


def test_parameter_file_holds_every_default_with_its_type() -> None:
    loaded = yaml.safe_load(documents()["config/nodes/estimator.yaml"])["/**"]["ros__parameters"]
    assert loaded == DEFAULTS
    assert {name: type(value) for name, value in loaded.items()} == {name: type(value) for name, value in DEFAULTS.items()}


def test_every_parameter_file_line_is_commented() -> None:
    lines = documents()["config/nodes/estimator.yaml"].splitlines()
    for number, line in enumerate(lines):
        if line.startswith("    ") and not line.strip().startswith("#"):
            assert lines[number - 1].strip().startswith("#"), line


def test_every_setting_of_the_estimators_is_a_parameter() -> None:
    assert {p.name for p in PIPELINE_PARAMETERS} == {f.name for f in dataclasses.fields(PipelineSettings)}


def test_defaults_are_those_of_the_estimators() -> None:
    assert pipeline_settings(DEFAULTS) == PipelineSettings()


@pytest.mark.parametrize("parameter", [p for p in PIPELINE_PARAMETERS if p.lower is not None], ids=lambda p: p.name)
def test_ranges_are_those_of_the_estimators(parameter: NodeParameter) -> None:
    assert parameter.lower is not None
    assert parameter.upper is not None
    for bound in (parameter.lower, parameter.upper):
        value = type(parameter.default)(bound)
        assert problems(TABLE, {parameter.name: value}) == []
        pipeline_settings({**DEFAULTS, parameter.name: value})
    outside = parameter.upper * 1.01 + 1
    assert len(problems(TABLE, {parameter.name: type(parameter.default)(outside)})) == 1
    with pytest.raises(ConfigurationError, match=parameter.name):
        pipeline_settings({**DEFAULTS, parameter.name: outside})


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("diagnostics_period", 0.01, "allowed: 0.1 to 60 s"),
        ("diagnostics_period", math.nan, "allowed: 0.1 to 60 s"),
        ("rate_hz", 5.0, "allowed: 0 or 20 to 20000 Hz"),
        ("executor", "multi", "allowed: events, single"),
        ("autostart", "yes", "is not true or false"),
        ("publish_every", 1.5, "is not a whole number"),
        ("publish_every", True, "is not a whole number"),
    ],
)
def test_refusal_names_parameter_value_and_what_is_allowed(name: str, value: object, reason: str) -> None:
    (problem,) = problems(TABLE, {name: value})
    assert problem.startswith(f"{name}: ")
    assert reason in problem


def test_all_refusals_come_at_once() -> None:
    answer = verdict(TABLE, [Parameter("largest_ratio", value=0.5), Parameter("executor", value="none")])
    assert not answer.successful
    assert "largest_ratio" in answer.reason
    assert "executor" in answer.reason


def test_every_number_has_a_range_and_every_physical_one_a_unit() -> None:
    for parameter in TABLE:
        if isinstance(parameter.default, (int, float)) and not isinstance(parameter.default, bool):
            assert parameter.lower is not None, parameter.name
            assert parameter.unit, parameter.name
