# Copyright 2026 ride_estimation contributors
"""What exists between configure and cleanup: one vehicle, its pipeline, and the counters of its input topics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.io.messages import decode
from ride_estimation.nodes.inputs import input_topics
from ride_estimation.nodes.node_health import TopicState
from ride_estimation.vehicles.vehicle import Body, Vehicle


class Session:
    """One configured estimator.

    Parameters
    ----------
    vehicle
        Checked vehicle.
    settings
        Of the estimators.
    """

    def __init__(self, vehicle: Vehicle, settings: PipelineSettings) -> None:
        self.vehicle = vehicle
        self.pipeline = Pipeline(vehicle, settings)
        self.topics = input_topics(vehicle.sensors)
        self.states = {t.name: TopicState(t.name, tuple(s.name for s in t.sensors)) for t in self.topics.values()}
        self._ticks = 0
        self._unpublished = 0

    @property
    def body(self) -> Body:
        """Return the body whose loads are estimated."""
        return self.vehicle.bodies[next(iter(self.vehicle.mounts.values())).body]

    def change_settings(self, settings: PipelineSettings) -> None:
        """Go on with other settings from what was learned so far."""
        learned = self.pipeline.save_state()
        self.pipeline = Pipeline(self.vehicle, settings)
        self.pipeline.load_state(learned)

    def receive(self, topic: str, type_name: str, payload: bytes) -> tuple[OutputBlock, ...]:
        """Decode one message and let the pipeline observe every sensor it carries."""
        raise RuntimeError

    def ticks_to_publish(self, good: NDArray[np.bool_], every: int) -> list[int]:
        """Return the ticks of a block to publish: every n-th, of those that hold an estimate."""
        chosen = []
        for tick, usable in enumerate(good):
            due = self._ticks % every == 0
            self._ticks += 1
            if not usable:
                self._unpublished += 1
            elif due:
                chosen.append(tick)
        return chosen

    def statuses(self) -> Iterator[DiagnosticStatus]:
        """Return one status per topic and those of the pipeline."""
        for state in self.states.values():
            yield state.status()
