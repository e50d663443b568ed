# Copyright 2026 ride_estimation contributors
"""Everything that tests the samples of a block before they are used: which sensor is which, and which is fit to be used."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.channel_layout import ChannelLayout
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.faults.base_balance import BaseBalance
from ride_estimation.estimation.faults.base_check import BaseCheck
from ride_estimation.estimation.faults.base_faults import BaseFaults
from ride_estimation.estimation.faults.base_noise import BaseNoise
from ride_estimation.estimation.faults.gyro_check import GyroCheck
from ride_estimation.estimation.faults.health import SensorHealth, sensor_health
from ride_estimation.estimation.faults.input_watch import InputWatch
from ride_estimation.estimation.faults.left_out import DISAGREES
from ride_estimation.estimation.faults.rigid_check import RigidCheck
from ride_estimation.estimation.faults.sensor_gate import GateVerdict, SensorGate
from ride_estimation.estimation.faults.swapped_topics import SwappedTopics
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.sensor_errors.sensor_faults import FaultTest
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.streams import Block, StreamHealth

Array = NDArray[np.float64]


class InputChecks:
    """The checks of one geometry, in the order in which they test a block.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    sensors
        One per stream.
    layout
        Places of the streams in a block.
    columns
        Columns of every stream in a block.
    motion
        Geometry of the body's channels.
    """

    def __init__(
        self, geometry: Geometry, sensors: Sequence[Sensor], layout: ChannelLayout, columns: Sequence[slice],
        motion: CgMotionEstimator,
    ) -> None:  # fmt: skip
        a, self._layout = geometry, layout
        n = 3 * len(a.body_sensors)
        base = [s for s in a.base_sensors if s is not None]
        starts = [c.start for c in columns]
        index = {s.name: i for i, s in enumerate(sensors)}
        streams = [index[s.name] for s in (*a.body_sensors, *base)]
        self._swaps = SwappedTopics(a.body_sensors, base, streams, [starts[i] for i in streams], motion.rows[:n])
        self.gyros = GyroCheck(a.body_sensors, motion.gyros, motion.rows[:n], a.free)
        self.watch = InputWatch(layout)
        check = RigidCheck(motion.rows[:n], motion.directions[:n], motion.points[:n], a.body_sensors, a.vehicle.gravity)
        self._gate = SensorGate(
            sensors, starts, layout.body_streams.tolist(), [stream for _, stream, _, _ in layout.base],
            [stream for _, _, stream, _ in layout.transducers], check, a.vehicle.gravity,
        )  # fmt: skip
        base_streams, base_starts = layout.base_arrays[0].tolist(), layout.base_arrays[1].tolist()
        self._bases = BaseCheck(base, base_streams, base_starts)
        self._new_base_faults(a)
        self._balance = BaseBalance(a)
        self._noise = BaseNoise(base)
        #: readings of base sensors and transducers of the last block, None where one of them is not fit
        self._readings: tuple[Array, Array] | None = None
        #: columns of the base sensors and of the transducers, and their streams
        self._read = (
            (layout.base_arrays[1][:, None] + np.arange(3)).ravel(), [column for _, _, _, column in layout.transducers],
            np.array([*base_streams, *(stream for _, _, stream, _ in layout.transducers)], dtype=np.int64),
        )  # fmt: skip
        #: stream -> reason -> ticks at which a base sensor was left out against the others
        self._lost: dict[int, Counter[str]] = {}

    def _new_base_faults(self, geometry: Geometry) -> None:
        streams, starts, *_ = self._layout.base_arrays
        base = [s for s in geometry.base_sensors if s is not None]
        self._geometry = geometry
        self._base_faults = BaseFaults(base, streams.tolist(), starts.tolist(), geometry.vehicle.gravity)

    def take_installation(self, geometry: Geometry) -> None:
        """Judge the bases anew, by the installation that the sensors of a geometry state."""
        self._new_base_faults(geometry)
        self._balance = BaseBalance(geometry)

    def reset(self, same_time: bool = False) -> None:
        """Begin anew; what was found out about the sensors stays.

        Parameters
        ----------
        same_time
            Whether the time base goes on: gyros are compared with readings, which a failure of the estimates does not touch.
        """
        self._gate.reset()
        self._swaps.reset()
        if not same_time:
            self.gyros.reset()
        self._bases.reset()
        self._base_faults.reset()
        self._noise.reset()
        if self._balance.possible:
            self._balance.reset()

    def put_right(self, block: Block, dt: float) -> tuple[Block, str]:
        """Exchange the readings of sensors whose topics are exchanged; words where an exchange was found or ended just now.

        Parameters
        ----------
        block
            Aligned samples.
        dt
            Tick [s].
        """
        values, valid = self._swaps.exchange(block.values, block.valid)
        found = self._swaps.observe(values, valid, dt)
        if self._balance.exchanged is not None:
            found = found or self._swaps.toggle(*(self._swaps.bodies + n for n in self._balance.exchanged))
            self._balance.exchanged = None
            # what was said of them was said of each other's readings
            self._new_base_faults(self._geometry)
        if found:
            values, valid = self._swaps.exchange(block.values, block.valid)
            self.watch.renew()
        return block if values is block.values else dataclasses.replace(block, values=values, valid=valid), found

    def contradicted_gyros(self, block: Block, motion: CgMotionEstimator, dt: float) -> Sequence[int]:
        """Return gyros whose rates the accelerometers contradict, found with this block.

        Parameters
        ----------
        block
            Samples in their places.
        motion
            Of the body, for the axes of the gyros.
        dt
            Tick [s].
        """
        if not self.gyros.possible:
            return ()
        layout = self._layout
        rates = motion.body_rates(np.take(block.values, layout.gyro_columns, axis=1))
        measured = np.take(block.values, layout.body_columns, axis=1)
        return self.gyros.observe(measured, rates, np.take(block.valid, layout.body_streams, axis=1), dt)

    def judged(self, block: Block, rate: Array, force: Array, dt: float) -> GateVerdict:
        """Return which samples may be used, and for how long what was learned is spoiled by a sensor found to be wrong just now.

        Parameters
        ----------
        block
            Samples put right.
        rate, force
            Latest angular rate and specific force of the body, shape (3,).
        dt
            Tick [s].
        """
        gate = self._gate.judge(block, rate, dt)
        verdict = self._bases.judged(block, gate, dt)
        verdict = self._base_faults.judged(block, verdict, force, dt)
        if self._noise.possible:
            streams = self._layout.base_arrays[0]
            self._keep_readings(block, gate)
            verdict = self._noise.judged(verdict, streams)
            if self._balance.possible:
                verdict = self._balance.judged(verdict, streams)
        if verdict.valid is not gate.valid:
            self._count(gate, verdict)
        return verdict

    def _keep_readings(self, block: Block, verdict: GateVerdict) -> None:
        # sensors that only disagree with others are weighed on: that may be the fault of one of those
        columns, displaced, streams = self._read
        fit = bool(verdict.valid[:, streams].all()) and not verdict.suspects
        self._readings = (np.take(block.values, columns, axis=1), np.take(block.values, displaced, axis=1)) if fit else None
        if self._readings is None:
            self._noise.interrupt()
        else:
            self._noise.gather(self._readings[0])

    def _count(self, gate: GateVerdict, verdict: GateVerdict) -> None:
        lost = (gate.valid & ~verdict.valid).sum(axis=0)
        for stream in np.flatnonzero(lost).tolist():
            self._lost.setdefault(stream, Counter())[DISAGREES] += int(lost[stream])

    def weigh(self, load: Array, horizontal: Array, body: Array) -> None:
        """Take the loads of a block for the balance of the body.

        Parameters
        ----------
        load
            Wrench the mounts carry, shape (K, 6) [N, N m].
        horizontal
            Forces of the mounts along x and y, shape (K, M, 2) [N].
        body
            Vertical specific force of the body at the mounts, shape (K, M).
        """
        if self._readings is None:
            self._balance.interrupt()
        else:
            self._balance.gather(load, horizontal, body, *self._readings)

    @property
    def bases_inconsistent(self) -> bool:
        """Return whether one of the base sensors is wrong and none can be isolated."""
        # of readings that are no longer used a contradiction is none
        weighed = self._balance.possible and self._balance.inconsistent and self._readings is not None
        return self._bases.inconsistent or self._noise.inconsistent or weighed

    @property
    def fault_tests(self) -> Sequence[FaultTest]:
        """Return the test of the base sensors, none where a frame that twists resembles a late one."""
        return (self._base_faults.test,) if self._base_faults.finds_delays else ()

    @property
    def suspicion(self) -> str:
        """Return why nothing learned is called valid, empty where nothing speaks against it."""
        if self._balance.possible and self._balance.undecided:
            return "they changed just now: changed mounts and a wrong base sensor cannot be distinguished yet"
        return self._base_faults.suspicion

    def follow_changes(self, count: int) -> None:
        """Take how often parameters changed faster than driving explains: a sensor that went wrong has them change too."""
        if self._balance.possible:
            self._balance.follow_changes(count)

    @property
    def weighs(self) -> bool:
        """Return whether :meth:`weigh` is of use."""
        return self._balance.possible

    def learn(self, dt: float) -> None:
        """Do what may wait until the forces of a block are handed out."""
        self._base_faults.learn(dt)
        if self._noise.possible:
            self._noise.learn(dt)
        if self._balance.possible:
            self._balance.learn(dt)

    def health(self, streams: Mapping[str, StreamHealth], ratio: Mapping[str, float]) -> dict[str, SensorHealth]:
        """Return counts and figures of every sensor.

        Parameters
        ----------
        streams
            Counters of the aligner.
        ratio
            Size of the residuals of body sensors over what is expected.
        """
        watch, lost = self.watch, self._lost
        refused = {n: self._gate.refused.get(n, Counter()) + lost.get(n, Counter()) for n in {*self._gate.refused, *lost}}
        return sensor_health(streams, watch.clipped.tolist(), watch.invalid.tolist(), ratio, refused)

    def messages(self) -> list[str]:
        """Return sentences about the sensors."""
        found = self._swaps.messages() + self.gyros.messages() + self._gate.messages() + self._bases.messages()
        return found + self._base_faults.messages() + self._balance.messages() + self._noise.messages()

    def save(self) -> dict[str, Any]:
        """Return what was found out about the sensors as entries of a saved state."""
        return {
            "gate": self._gate.save(), "swapped": self._swaps.save(), "base_faults": self._base_faults.save(),
            "gyros": self.gyros.save(), "base_balance": self._balance.save(),
            "lost": {str(stream): dict(counts) for stream, counts in self._lost.items()},
        }  # fmt: skip

    def load(self, state: Mapping[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self.gyros.load(state["gyros"])
        self._base_faults.load(state["base_faults"])
        self._balance.load(state["base_balance"])
        self._lost = {int(stream): Counter(counts) for stream, counts in state["lost"].items()}
        self._gate.load(state["gate"])
        self._swaps.load(state["swapped"])
