# Copyright 2026 ride_estimation contributors
"""Event markers of a run: from a table, from the text columns of its logger file, from the text topics of its bag.

Markers are named where a time is wanted: ``start`` is the first marker of that name, ``lap#2`` the second one called lap.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_source import open_bag
from ride_estimation.io.files.channels import split_heading, time_factor
from ride_estimation.io.recorded_run import is_measurement_file
from ride_estimation.io.text_table import read_text_table

#: type of the messages that carry a marker
_TEXT = "std_msgs/msg/String"
#: headings of the names in a table of markers
_NAMES = ("event", "marker", "name", "label", "text", "comment")
#: a time beyond counts from 1970 [s]
_UNIX = 1e8
#: most markers a message lists
_LISTED = 12


@dataclasses.dataclass(frozen=True)
class Event:
    """A marker and its time since the first stamp of the run [s]."""

    name: str
    time_s: float


def run_events(
    path: str | Path, start_ns: int, own: Sequence[tuple[int, str]] = (), table: str | Path = ""
) -> tuple[Event, ...]:
    """Return the markers of a run in the order of time.

    Parameters
    ----------
    path
        Bag or measurement file.
    start_ns
        First stamp of the run [ns].
    own
        Markers that were read with it: stamp [ns], name.
    table
        CSV with a column of time (since the first stamp of the run, or since 1970) and a column of names; by default
        ``RUN.events.csv`` beside the run, where there is one.

    Raises
    ------
    InputDataError
        A table that cannot be read.
    """
    path = Path(path)
    beside = table_beside(path)
    found = [Event(name, (stamp - start_ns) * 1e-9) for stamp, name in own]
    if not is_measurement_file(path):
        source = open_bag(path, salvage=True)
        topics = [topic for topic, kind in source.types.items() if kind == _TEXT and source.counts[topic]]
        for _, received, raw in source.messages(topics) if topics else ():
            found.append(Event(str(source.deserialize(raw, _TEXT).data).strip(), (received - start_ns) * 1e-9))
    if table or beside.is_file():
        found += _table_events(Path(table or beside), start_ns)
    return tuple(sorted((event for event in found if event.name), key=lambda event: event.time_s))


def table_beside(path: Path) -> Path:
    """Return where the table of markers of a run is, if there is one."""
    return path.with_name(f"{path.stem}.events.csv")


def moment(limit: float | str | None, events: Sequence[Event], after: float = -np.inf) -> float | None:
    """Return the time of a limit: a number as it is, a marker by its name.

    Parameters
    ----------
    limit
        Seconds, ``NAME``, ``NAME#2``, or None.
    events
        Of the run.
    after
        Markers before this time do not count [s].

    Raises
    ------
    InputDataError
        No such marker.
    """
    if not isinstance(limit, str):
        return limit
    name, _, place = limit.rpartition("#")
    number = int(place) if name and place.isdigit() else 1
    wanted = name if name and place.isdigit() else limit
    times = [event.time_s for event in events if event.name == wanted and event.time_s > after]
    if number < 1 or len(times) < number:
        listed = ", ".join(f"{event.name} ({event.time_s:.3f} s)" for event in events[:_LISTED])
        more = f" and {len(events) - _LISTED} more" if len(events) > _LISTED else ""
        there = f"there are {listed}{more}" if events else "the run has no markers"
        raise InputDataError(f"no marker {limit!r}; {there}")
    return times[number - 1]


def _table_events(path: Path, start_ns: int) -> list[Event]:
    """Return the markers of a table."""
    table = read_text_table(path)
    heads = [split_heading(cell) for cell in table.rows[0]] if table.rows else []
    factors = [time_factor(*head) for head in heads]
    clock = next((i for i, factor in enumerate(factors) if factor is not None), None)
    names = [i for i, head in enumerate(heads) if i != clock and head[0].strip().lower() in _NAMES]
    names = names or [i for i in range(len(heads)) if i != clock]
    if clock is None or not names:
        raise InputDataError(f"{path}: a table of markers has a column of time (time [s]) and one of names (event)")
    found = []
    for line, row in zip(table.lines[1:], table.rows[1:]):
        try:
            seconds = table.number(row[clock]) * float(factors[clock] or 1.0)
        except ValueError:
            raise InputDataError(f"{path}: row {line}: {row[clock]!r} is not a time") from None
        found.append(Event(row[names[0]].strip(), seconds - start_ns * 1e-9 if seconds > _UNIX else seconds))
    return found
