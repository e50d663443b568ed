# Copyright 2026 ride_estimation contributors
"""What the input of the pipeline says of itself: ticks without a sample, readings at full scale, variances stated in messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import count_unfit
from ride_estimation.estimation.common.channel_layout import ChannelLayout
from ride_estimation.signals.alignment import Block

Array = NDArray[np.float64]

#: time between two readings of the variances that messages state [s]
_EVERY = 1.0


class InputWatch:
    """Counters of every stream, and when stated variances are due.

    Parameters
    ----------
    layout
        Places of the streams in a block.
    """

    def __init__(self, layout: ChannelLayout) -> None:
        self._layout = layout
        streams = len(layout.full_scale[0])
        #: ticks at full scale and ticks without a sample per stream
        self.clipped, self.invalid = np.zeros(streams, dtype=np.int64), np.zeros(streams, dtype=np.int64)
        self.renew()

    def renew(self) -> None:
        """Read the stated variances with the next block."""
        self._age = _EVERY

    def observe(
        self, block: Block, dt: float, stated: Callable[[int], Sequence[float] | None], use: Callable[[int, Array], None]
    ) -> None:
        """Take one block.

        Parameters
        ----------
        block
            Aligned samples.
        dt
            Tick [s].
        stated
            Gives the variance that the messages of a stream state, None where they state nothing.
        use
            Called with the number of a sensor of the body and the variance (3,) its messages state.
        """
        count_unfit(block.values, block.valid, *self._layout.full_scale, self.invalid, self.clipped)
        self._age += len(block.values) * dt
        if self._age < _EVERY:
            return
        self._age = 0.0
        for n, stream in enumerate(self._layout.body_streams.tolist()):
            variance = stated(stream)
            if variance is not None and len(variance) >= 3 and all(np.isfinite(v) and v > 0.0 for v in variance[:3]):
                use(n, np.array(variance[:3], dtype=float))
