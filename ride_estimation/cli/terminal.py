# Copyright 2026 ride_estimation contributors
"""Where a command meets the terminal: text from outside (names of topics, files, mounts) is shown and never obeyed."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator
from typing import TextIO

from ride_estimation.text import printable


class _Printable(io.TextIOBase):
    """A text stream that writes everything in a printable form; a carriage return at the beginning goes through (progress)."""

    def __init__(self, target: TextIO) -> None:
        self._target = target

    def write(self, text: str) -> int:
        """Write a text, escaped where a terminal would obey it or its encoding cannot express it."""
        begin = "\r" if text.startswith("\r") else ""
        self._target.write(begin + printable(text[len(begin) :], getattr(self._target, "encoding", None) or "utf-8"))
        return len(text)

    def flush(self) -> None:
        """Flush the stream behind; at the end of the interpreter it may be closed already."""
        if not getattr(self._target, "closed", False):
            self._target.flush()

    def isatty(self) -> bool:
        """Return whether a person looks on."""
        return self._target.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the stream behind."""
        return self._target.fileno()


@contextlib.contextmanager
def printable_output() -> Iterator[None]:
    """Make standard output and standard error printable while the block runs."""
    with contextlib.redirect_stdout(_Printable(sys.stdout)), contextlib.redirect_stderr(_Printable(sys.stderr)):
        yield
