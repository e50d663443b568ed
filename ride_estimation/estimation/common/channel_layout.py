# Copyright 2026 ride_estimation contributors
"""Where every quantity stands in an aligned block."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import turn_channels
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.frames import AXES
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.streams import Block

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@dataclasses.dataclass(frozen=True)
class ChannelLayout:
    """Streams and columns of an aligned block.

    Attributes
    ----------
    body_streams, body_columns, gyro_columns
        Of the sensors of the body, in file order.
    own_columns
        Name and columns of every sensor of the body among ``body_columns``.
    base
        Mount, stream, first column and rotation of every base sensor.
    base_arrays
        The same as arrays: streams, first columns, mounts, rotations.
    transducers
        Mount, axis, stream and column of every displacement transducer.
    cells
        Name, mount, stream and first column of every load cell.
    needed
        Streams that must speak for anything to be learned.
    speed
        Stream and column of the speed of the vehicle, None where no sensor measures it.
    full_scale
        Per stream first and end of the columns that have a full scale, and the magnitude that counts as such.
    """

    body_streams: IntArray
    body_columns: IntArray
    gyro_columns: IntArray
    own_columns: tuple[tuple[str, slice], ...]
    base: tuple[tuple[int, int, int, Array], ...]
    base_arrays: tuple[IntArray, IntArray, IntArray, Array]
    transducers: tuple[tuple[int, int, int, int], ...]
    cells: tuple[tuple[str, int, int, int], ...]
    needed: IntArray
    speed: tuple[int, int] | None
    full_scale: tuple[IntArray, IntArray, Array]

    @staticmethod
    def of(
        geometry: Geometry, sensors: Sequence[Sensor], columns: Sequence[slice], cells: Sequence[tuple[str, int]]
    ) -> ChannelLayout:
        """Find all places.

        Parameters
        ----------
        geometry
            Which sensor measures what.
        sensors
            One per stream.
        columns
            Of every stream in a block.
        cells
            Name and mount of the load cells.
        """
        a, index = geometry, {s.name: i for i, s in enumerate(sensors)}
        start = {s.name: c.start for s, c in zip(sensors, columns, strict=True)}
        gyros = [s for s in a.body_sensors if s.kind == "imu"]
        base = tuple((i, index[s.name], start[s.name], s.rotation) for i, s in enumerate(a.base_sensors) if s is not None)
        meter = a.speed_sensor
        first = np.array([c.start for c in columns], dtype=np.int64)
        # a body sensor that is missing is made up for by the others, as long as the motion stays complete
        needed = [stream for _, stream, _, _ in base] + [index[s.name] for s in a.transducers if not a.has_base_motion]
        return ChannelLayout(
            body_streams=np.array([index[s.name] for s in a.body_sensors], dtype=np.int64),
            body_columns=_spread([start[s.name] for s in a.body_sensors]),
            gyro_columns=_spread([start[s.name] + 3 for s in gyros]),
            own_columns=tuple((s.name, slice(3 * i, 3 * i + 3)) for i, s in enumerate(a.body_sensors)),
            base=base,
            base_arrays=(
                np.array([stream for _, stream, _, _ in base], dtype=np.int64),
                np.array([column for _, _, column, _ in base], dtype=np.int64),
                np.array([i for i, _, _, _ in base], dtype=np.int64),
                np.array([rotation for _, _, _, rotation in base], dtype=float).reshape(-1, 3, 3),
            ),
            transducers=tuple(
                (a.mount_names.index(s.mount), AXES.index(s.axis), index[s.name], start[s.name]) for s in a.transducers
            ),
            cells=tuple((name, i, index[name], start[name]) for name, i in cells),
            needed=np.array(needed, dtype=np.int64),
            speed=None if meter is None else (index[meter.name], start[meter.name]),
            full_scale=(
                first, first + np.minimum(3, [s.channels for s in sensors]), 0.999 * np.array([s.reach for s in sensors]),
            ),
        )  # fmt: skip

    def bases(self, block: Block, mounts: int) -> tuple[Array, BoolArray]:
        """Return the specific force of the bases in body axes (K, M, 3) and which spoke (K, M)."""
        base = np.zeros((len(block.values), mounts, 3))
        spoke = np.zeros((len(block.values), mounts), dtype=bool)
        turn_channels(block.values, block.valid, *self.base_arrays, base, spoke)
        return base, spoke

    def speed_of(self, block: Block) -> tuple[Array, BoolArray] | None:
        """Return the speed of the vehicle at the ticks, shape (K,), and where it is measured; None without a sensor of it."""
        if self.speed is None:
            return None
        stream, column = self.speed
        return np.ascontiguousarray(block.values[:, column]), np.ascontiguousarray(block.valid[:, stream])

    def cell_readings(self, block: Block, sensors: Sequence[Sensor]) -> Iterator[tuple[str, int, Array]]:
        """Return name, mount and force in body axes (K, 3) of every load cell that spoke throughout."""
        for name, i, stream, start in self.cells:
            if block.valid[:, stream].all():
                yield name, i, block.values[:, start : start + 3] @ sensors[stream].rotation.T

    def travels(self, block: Block, mounts: int) -> tuple[Array, BoolArray]:
        """Return what displacement transducers say (K, M, 3) and which spoke (K, M, 3)."""
        travel = np.zeros((len(block.values), mounts, 3))
        spoke = np.zeros(travel.shape, dtype=bool)
        for i, axis, stream, start in self.transducers:
            travel[:, i, axis] = block.values[:, start]
            spoke[:, i, axis] = block.valid[:, stream]
        return travel, spoke


def _spread(starts: Sequence[int]) -> IntArray:
    """Return three columns from each start on."""
    return (np.array(starts, dtype=np.int64)[:, None] + np.arange(3)).ravel()
