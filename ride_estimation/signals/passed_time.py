# Copyright 2026 ride_estimation contributors
"""How much time has passed while a block waits, told from the stamps of several streams: no clock is read.

A stream that lags may be dead, or all streams were held back by a gateway that now sends them one after the other. In both cases
the newest stamp runs away. But time passes for all: where it does, several streams go forward together. A stream that goes
forward alone shows only that its samples were waiting somewhere.
"""

from __future__ import annotations


class PassedTime:
    """Time by which streams went forward together since :meth:`begin`.

    Attributes
    ----------
    passed
        That time [ns].
    """

    __slots__ = ("_alone", "_leader", "passed")

    def __init__(self) -> None:
        self.begin()

    def begin(self, passed: int = 0) -> None:
        """Begin again, with the time that has passed already [ns]."""
        self.passed = passed
        self._leader = -1
        self._alone = 0

    def sample(self, stream: int, advance: int, step: int) -> None:
        """Take note of a sample.

        Parameters
        ----------
        stream
            Index of its stream.
        advance
            By how much it moved the newest stamp of all forward, 0 where it did not [ns].
        step
            Usual distance of the samples of its stream: more it cannot witness [ns].
        """
        if stream == self._leader:
            self._alone += advance
            return
        self.passed += min(self._alone + advance, step)
        self._alone = 0
        if advance:
            self._leader = stream
