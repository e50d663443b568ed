# Copyright 2026 ride_estimation contributors
"""Looks at the last seconds as a whole (first estimate, reviews): spread over blocks, dropped at a gap, not lost at a stop."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.parameters import parameter_estimator
from ride_estimation.estimation.parameters.response import ModelResponse
from ride_estimation.estimation.pipeline import Pipeline

RATE = 250.0
#: a block is ten ticks
BLOCK_S = 10.0 / RATE


@functools.cache
def world():
    rng = np.random.default_rng(11)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    run = drive(cab, Road.random(rng), 13.0, 11, step=1e-3)
    data = measure(run, sensors, RATE, 11, noise_share=0.01, anti_alias=0.0)
    return list(arrivals(data)), believed_vehicle(data, seed=11), cab


def valid(pipeline):
    return sum(e.status is Status.VALID for e in pipeline.parameters())


def first_valid_at(pipeline, events, keep=lambda time: True):
    """Feed a run; return the time of the first block after which a stiffness or damping is valid, infinity without one."""
    for stamp, name, values in events:
        time = (stamp - START_NS) * 1e-9
        if keep(time) and pipeline.observe(name, stamp, values.tolist()) and valid(pipeline) > 1:
            return time
    return np.inf


def test_no_call_does_more_of_a_batch_estimate_than_its_share(monkeypatch):
    """The last seven seconds are passed many times in a look (27 chunks each); of that a block may do its share of the pace."""
    events, vehicle, cab = world()
    passes = [0]
    observe = ModelResponse.observe

    def counted(self, chunk):
        passes[0] += 1
        return observe(self, chunk)

    monkeypatch.setattr(ModelResponse, "observe", counted)
    pipeline = Pipeline(vehicle)
    most, total = 0, 0
    for stamp, name, values in events:
        passes[0] = 0
        pipeline.observe(name, stamp, values.tolist())
        most, total = max(most, passes[0]), total + passes[0]
    # one step may overdraw by itself, and the filter's own chunk comes on top
    assert most <= parameter_estimator._PACE * BLOCK_S + 2
    assert total > 20 * most
    found = {e.name: e for e in pipeline.parameters()}
    for i, mount in enumerate(cab.mount_names):
        assert abs(found[f"{mount}.z.stiffness"].value / cab.stiffness[i, 2] - 1.0) < 0.02


def test_result_does_not_depend_on_the_pace(monkeypatch):
    """At once or a step at a time: the first estimate sees the same chunks and what came meanwhile, so hardly differs."""
    events, vehicle, _ = world()
    found = []
    for pace in (parameter_estimator._PACE, 1e9):
        monkeypatch.setattr(parameter_estimator, "_PACE", pace)
        pipeline = Pipeline(vehicle)
        for stamp, name, values in events:
            pipeline.observe(name, stamp, values.tolist())
        found.append([(e.value, e.std) for e in pipeline.parameters() if e.name.endswith("z.stiffness")])
    values, stds = np.array(found)[:, :, 0], np.array(found)[:, :, 1]
    assert np.all(np.abs(values[0] - values[1]) < stds[1])


def test_a_gap_drops_a_batch_estimate():
    """The look that would end at t is interrupted just before; it needs as much motion again, after the filters settled."""
    events, vehicle, _ = world()
    undisturbed = first_valid_at(Pipeline(vehicle), events)
    assert undisturbed < 8.0
    cut = undisturbed - 0.1
    interrupted = Pipeline(vehicle)
    later = [event for event in events if event[0] - START_NS < (undisturbed + 2.5) * 1e9]
    assert first_valid_at(interrupted, later, lambda time: not cut < time < cut + 0.08) == np.inf


@pytest.mark.parametrize("stop", [0.1, 0.4])
def test_a_stop_of_the_vehicle_does_not_lose_the_batch_estimate(stop):
    """Motion ends while the look is under way (sensors go on reading rest): the estimate of what was seen still comes out."""
    events, vehicle, _ = world()
    end = first_valid_at(Pipeline(vehicle), events) - stop
    rest = {}
    for stamp, name, values in events:
        if stamp - START_NS < 0.5e9:
            rest[name] = values
    noise = np.random.default_rng(1)
    pipeline = Pipeline(vehicle)
    for stamp, name, values in events:
        time = (stamp - START_NS) * 1e-9
        # the motion fades within a tenth of a second
        share = np.exp(-max(time - end, 0.0) / 0.1)
        read = rest[name] + share * (values - rest[name]) + noise.normal(0.0, 1e-3, len(values))
        if pipeline.observe(name, stamp, read.tolist()) and valid(pipeline) > 1:
            break
    assert time < end + 1.5
