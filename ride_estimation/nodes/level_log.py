# Copyright 2026 ride_estimation contributors
"""Diagnostics as lines of the log: whoever follows a launch reads what changed, not what is."""

from __future__ import annotations

import dataclasses
import re
from collections import defaultdict
from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticStatus

#: shortest time from one line to the next about the same status, unless that became worse [s]
QUIET_S = 5.0
#: key of a status that counts how often estimates began again, and why
_RESTART = "restart "
_NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclasses.dataclass
class _Said:
    """What the log says of one status: level, message without its numbers, and when."""

    level: bytes = DiagnosticStatus.OK
    words: str = ""
    at_s: float = float("-inf")


class LevelLog:
    """Writes a line when a status changes its level, or an error becomes another one, and when estimates begin again.

    What changed alike at one look is one line. What becomes worse is said at once, what becomes better or different
    :data:`QUIET_S` seconds after the line before.

    Parameters
    ----------
    write
        Takes level and line.
    """

    def __init__(self, write: Callable[[bytes, str], None]) -> None:
        self._write = write
        self._said: defaultdict[str, _Said] = defaultdict(_Said)
        self._restarts: dict[str, int] = {}

    def note(self, statuses: Iterable[DiagnosticStatus], now_s: float) -> None:
        """Compare statuses with what was said; ``now_s`` is steady time [s]."""
        alike: defaultdict[tuple[bytes, str, str], list[tuple[str, str]]] = defaultdict(list)
        for status in statuses:
            said, words = self._said[status.name], _NUMBER.sub("#", status.message)
            changed = status.level != said.level or (status.level == DiagnosticStatus.ERROR and words != said.words)
            if changed and (status.level > said.level or now_s - said.at_s >= QUIET_S):
                self._said[status.name] = _Said(status.level, words, now_s)
                kind, _, name = status.name.partition(" ")
                alike[(status.level, kind, words)].append((name, status.message))
            self._note_restarts(status)
        for (level, kind, _), found in alike.items():
            names, messages = zip(*found, strict=True)
            others = "" if len(set(messages)) == 1 else " (the others alike)"
            self._write(level, f"{kind} {', '.join(names)}".rstrip() + f": {messages[0]}{others}")

    def _note_restarts(self, status: DiagnosticStatus) -> None:
        for pair in status.values:
            if pair.key.startswith(_RESTART):
                count = int(pair.value)
                if count > self._restarts.get(pair.key, 0):
                    self._write(DiagnosticStatus.WARN, f"estimates start again: {pair.key.removeprefix(_RESTART)}")
                self._restarts[pair.key] = count
