# Copyright 2026 ride_estimation contributors
"""What exists between configure and cleanup: one vehicle, its pipeline, and the counters of its input topics."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.numerical_guard import NUMERICAL_ERRORS
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.estimation.warm_up import warm_up
from ride_estimation.io.messages import Converter, Sample, make_converter
from ride_estimation.io.vehicle_file import body_layout
from ride_estimation.nodes.cdr import Reader, make_reader
from ride_estimation.nodes.hint_status import hint_status
from ride_estimation.nodes.inputs import input_topics
from ride_estimation.nodes.node_health import TopicState, pipeline_statuses, silence_words
from ride_estimation.nodes.silence import Silence
from ride_estimation.vehicles.vehicle import Body, Vehicle

#: what decoding a damaged message raises (RMWError of rclpy is a RuntimeError)
DECODE_ERRORS = (RuntimeError, ValueError, OverflowError, struct.error)

UNDECODABLE = "message_not_decodable"
WRONG_TYPE = "message_type_not_accepted"


class Session:
    """One configured estimator.

    Parameters
    ----------
    vehicle
        Checked vehicle.
    settings
        Of the estimators.

    Raises
    ------
    ConfigurationError
        No accelerometers, or a layout that does not determine the motion of the body.
    """

    def __init__(self, vehicle: Vehicle, settings: PipelineSettings) -> None:
        self.vehicle = vehicle
        self.pipeline = Pipeline(vehicle, settings)
        layout = body_layout(vehicle, self.body.name)
        if not layout.complete:
            raise ConfigurationError(layout.sentence(self.body.name), where=f"sensor layout of {vehicle.name}")
        self.topics = input_topics(vehicle.sensors)
        self.states = {t.name: TopicState(t.name, tuple(s.name for s in t.sensors)) for t in self.topics.values()}
        self._decoders: dict[tuple[str, str], tuple[Reader, Converter] | None] = {}
        self._ticks = 0
        self._unpublished = 0
        self._silence = Silence()

    @property
    def body(self) -> Body:
        """Return the body whose loads are estimated."""
        return self.pipeline.geometry.body

    @property
    def mount_names(self) -> tuple[str, ...]:
        """Return the mounts whose forces are estimated, the order of every (.., M, 3) array."""
        return self.pipeline.geometry.mount_names

    def warm_up(self) -> None:
        """Run a made-up drive through a throw-away pipeline, so that all kernels are compiled before the first message."""
        warm_up(self.vehicle, self.pipeline.settings)

    def change_settings(self, settings: PipelineSettings) -> None:
        """Go on with other settings from what was learned so far; the time base begins anew."""
        learned = self.pipeline.save_state()
        self.pipeline = Pipeline(self.vehicle, settings)
        self.pipeline.load_state(learned)

    def receive(self, topic: str, type_name: str, payload: bytes) -> tuple[OutputBlock, ...]:
        """Decode one message and let the pipeline observe every sensor it carries; nothing is dropped uncounted.

        Parameters
        ----------
        topic
            One of :attr:`topics`.
        type_name
            Message type.
        payload
            CDR bytes.
        """
        state = self.states[topic]
        state.received += 1
        key = (topic, type_name)
        if key not in self._decoders:
            converter = make_converter(type_name, self.topics[topic].sensors)
            self._decoders[key] = None if converter is None else (make_reader(type_name), converter)
        decoder = self._decoders[key]
        if decoder is None:
            state.rejected[WRONG_TYPE] += 1
            return ()
        read, convert = decoder
        try:
            samples = convert(read(payload))
        except DECODE_ERRORS:
            state.rejected[UNDECODABLE] += 1
            return ()
        blocks: tuple[OutputBlock, ...] = ()
        for sample in samples:
            if sample.rejection:
                state.rejected[sample.rejection] += 1
            else:
                blocks += self._observe(sample)
        return blocks

    def _observe(self, sample: Sample) -> tuple[OutputBlock, ...]:
        try:
            return self.pipeline.observe(sample.sensor, sample.stamp_ns, sample.values, sample.variance)
        except NUMERICAL_ERRORS as error:
            self.pipeline.recover(error)
            return ()

    def ticks_to_publish(self, good: NDArray[np.bool_], every: int) -> list[int]:
        """Return the ticks of a block to publish: every n-th, of those that hold an estimate."""
        chosen = []
        for tick, usable in enumerate(good.tolist()):
            due = self._ticks % every == 0
            self._ticks += 1
            if not usable:
                self._unpublished += 1
            elif due:
                chosen.append(tick)
        return chosen

    def look(self, passed_s: float, limit_s: float) -> bool:
        """Notice topics and estimates that stop or come back on the steady clock; return whether one did.

        Parameters
        ----------
        passed_s
            Time since the last look [s].
        limit_s
            Longest silence that is nothing unusual [s].
        """
        changed = [state.silence.look(state.arrived, passed_s, limit_s) for state in self.states.values()]
        # twice as long: estimates follow their inputs, and where those have stopped it is they who are named
        return any([*changed, self._silence.look(self._ticks - self._unpublished, passed_s, 2.0 * limit_s)])

    def listen(self) -> None:
        """Begin to listen for silence, after a time in which nobody was subscribed."""
        for silence in (self._silence, *(state.silence for state in self.states.values())):
            silence.forgive()

    def statuses(self) -> Iterator[DiagnosticStatus]:
        """Return the statuses of the estimates, of every sensor and of every topic."""
        silent = silence_words(self.states.values(), self._silence)
        topics = {name: state for state in self.states.values() for name in state.sensors}
        yield from pipeline_statuses(self.pipeline.health(), self.body.name, self._unpublished, silent, topics)
        yield hint_status(self.pipeline.hints(), self.body.name)
        for state in self.states.values():
            yield state.status()
