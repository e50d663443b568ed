# Copyright 2026 ride_estimation contributors
"""Messages of ``.db3`` files (SQLite storage of rosbag2).

A database may hold views, generated columns and pages that lead in circles, which cost far more than their size. So only plain
tables are read, in the order they lie, no value may be larger than the file, and a query may take no more steps than reading the
file once can need.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

#: columns that are read
_COLUMNS = {"topics": ("id", "name", "type", "serialization_format"), "messages": ("topic_id", "timestamp", "data")}
#: steps of a query between two looks at the budget; what a file may need beyond its size
_LOOK, _SPARE_STEPS = 10_000, 10_000_000
#: steps of a query per byte of the file: a row takes twenty steps and at least ten bytes
_STEPS_PER_BYTE = 4


class Topic(NamedTuple):
    """A row of the table ``topics`` and how many messages it has."""

    name: str
    message_type: str
    encoding: str
    messages: int


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a database for reading, within its budget."""
    size = path.stat().st_size
    with contextlib.closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 1 << 16), 1 << 30))
        steps = iter(range((_SPARE_STEPS + _STEPS_PER_BYTE * size) // _LOOK))
        database.set_progress_handler(lambda: next(steps, None) is None, _LOOK)
        for table, columns in _COLUMNS.items():
            found = database.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)).fetchall()
            if [kind for kind, _ in found] != ["table"] or str(found[0][1]).upper().startswith("CREATE VIRTUAL"):
                raise ValueError(f"it has no plain table {table!r}")
            plain = {row[1] for row in database.execute(f"PRAGMA table_xinfo({table})") if row[6] == 0}
            missing = [name for name in columns if name not in plain]
            if missing:
                raise ValueError(f"its table {table!r} has no plain column {', '.join(missing)}")
        yield database


def sqlite_topics(path: Path) -> tuple[Topic, ...]:
    """Return the topics of a file.

    Raises
    ------
    ValueError, sqlite3.Error
        Damaged, or no such file.
    """
    with _opened(path) as database:
        counts = dict(database.execute("SELECT topic_id, count(*) FROM messages NOT INDEXED GROUP BY topic_id"))
        topics = database.execute(f"SELECT {', '.join(_COLUMNS['topics'])} FROM topics NOT INDEXED").fetchall()
    for row in topics:
        if not all(isinstance(text, str) for text in row[1:]):
            raise ValueError(f"topic {row[0]!r} has no name, type or encoding")
    return tuple(Topic(name, kind, encoding, counts.get(number, 0)) for number, name, kind, encoding in topics)


def sqlite_messages(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Yield topic, receive time [ns] and bytes of the messages in the order of the file.

    Raises
    ------
    ValueError, TypeError, sqlite3.Error
        Damaged: where it is met. More bytes than the file has are damage too.
    """
    size = path.stat().st_size
    with _opened(path) as database:
        names = dict(database.execute("SELECT id, name FROM topics NOT INDEXED"))
        for topic, stamp, length, data in database.execute(
            "SELECT topic_id, timestamp, length(data), data FROM messages NOT INDEXED"
        ):
            size -= length
            if size < 0:
                raise ValueError("its messages hold more bytes than the file")
            if not isinstance(data, bytes):
                raise TypeError(f"a message that is no bytes but {type(data).__name__}")
            yield names[topic], stamp, data
