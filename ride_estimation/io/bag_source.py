# Copyright 2026 ride_estimation contributors
"""Messages of a recorded run from any container: rosbag2 folder, ``.mcap``, ``.db3``, ROS 1 ``.bag``.

Every file is read once, from the front, by a reader of this package that unpacks no more than a budget and compares all sizes and
checksums; what stands before a damage can be used (``salvage``), whatever the container.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.io.bags_bulk import Collector, Layout, RawMessage, TopicMessages, in_order
from ride_estimation.io.bounded import TooLargeError, allowance, unpack
from ride_estimation.io.document import read_yaml
from ride_estimation.io.mcap_records import DAMAGE, Contents, Ending, read_ending
from ride_estimation.io.ros1_records import ros1_messages
from ride_estimation.io.sqlite_messages import sqlite_messages, sqlite_topics

#: On broken files the libraries raise nearly anything (seen: FileNotFoundError, KeyError, OverflowError, ZstdError,
#: sqlite3.Error, struct.error); every use turns it into an InputDataError that quotes it.
READER_ERRORS = (Exception,)
SUFFIXES = (".mcap", ".db3", ".bag")
_CDR = "cdr"

#: hands the messages of one file to a collector
Feed = Callable[[Collector], None]


@functools.cache
def type_store(which: Stores) -> Typestore:
    """Return the message types of a distribution; they take a third of a second to make and are never changed."""
    return get_typestore(which)


@dataclasses.dataclass(frozen=True)
class BagSource:
    """An open run.

    Attributes
    ----------
    path
        Where it is.
    types
        Topic -> message type.
    counts
        Topic -> number of messages.
    unreadable
        Topic -> why its messages cannot be decoded.
    feeds
        Hand the messages of its files to a collector.
    salvage
        Whether the messages before a damage are to be used.
    deserialize
        ``deserialize(raw, type)`` returns a message object.
    little_endian_cdr
        Whether the raw bytes are CDR, so that they can be decoded in bulk.
    warnings
        What was wrong and could be worked around.
    """

    path: Path
    types: Mapping[str, str]
    counts: Mapping[str, int]
    unreadable: Mapping[str, str]
    feeds: Sequence[Feed]
    salvage: bool
    deserialize: Callable[[bytes, str], Any]
    little_endian_cdr: bool
    warnings: tuple[str, ...] = ()

    def read(self, layouts: Mapping[str, Layout | None]) -> tuple[dict[str, TopicMessages], tuple[str, ...]]:
        """Return the messages of some topics, decoded where a layout is given, and what was damaged.

        Raises
        ------
        InputDataError
            The file is damaged and ``salvage`` is not set, or nothing is left of it, or it unpacks to too much.
        """
        for topic in layouts:
            if topic in self.unreadable:
                raise InputDataError(f"{self.path}: topic {topic}: {self.unreadable[topic]}")
        collector, warnings = Collector(layouts), []
        for feed in self.feeds:
            reason = _fed(self.path, feed, collector)
            if reason:
                warnings.append(_damaged(self.path, reason, collector, self.salvage))
        return collector.finished(), tuple(warnings)

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield (topic, receive time [ns], raw bytes) in order of arrival; raises as :meth:`read`."""
        yield from in_order(self.read(dict.fromkeys(topics))[0])


def open_bag(path: Path, *, salvage: bool = False) -> BagSource:
    """Open a run.

    Parameters
    ----------
    path
        rosbag2 folder (``metadata.yaml`` may be missing), ``.mcap``, ``.db3`` or ROS 1 ``.bag`` file.
    salvage
        Use what is readable of a damaged file.

    Raises
    ------
    InputDataError
        Missing path, no bag, empty, truncated or corrupt file.
    """
    files, packed, warnings = bag_files(path), False, []
    if path.is_dir():
        metadata = files[0].parent / "metadata.yaml"
        if metadata.exists():
            files, packed = _listed(metadata, files)
        elif len(files) > 1:
            raise InputDataError(f"{path}: metadata.yaml is missing and there are {len(files)} files; name one of them")
        else:
            warnings.append("metadata.yaml is missing; the file was read directly")
    source = BagSource(path, {}, {}, {}, (), salvage, _cdr_reader, True, tuple(warnings))
    opened = [_OPENERS[file.suffix](source, file) for file in files]
    types, unreadable, counts = dict[str, str](), dict[str, str](), Counter[str]()
    for part in opened:
        counts.update(part.counts)
        unreadable.update(part.unreadable)
        for topic, kind in part.types.items():
            if types.setdefault(topic, kind) != kind:
                unreadable[topic] = f"its messages are of several types ({types[topic]}, {kind})"
    feeds = [feed for part in opened for feed in part.feeds]
    if packed:
        size = sum(file.stat().st_size for file in files)
        feeds = [functools.partial(_unpacked_feed, feeds=feeds, size=size)]
    return dataclasses.replace(opened[0], types=types, counts=counts, unreadable=unreadable, feeds=feeds)


def _listed(metadata: Path, files: Collection[Path]) -> tuple[tuple[Path, ...], bool]:
    """Return the files a ``metadata.yaml`` lists, in its order, and whether their messages are compressed one by one."""
    where = metadata.parent
    try:
        said = read_yaml(metadata)["rosbag2_bagfile_information"]
        mode, form = str(said.get("compression_mode") or "none").lower(), str(said.get("compression_format") or "").lower()
        names = [PurePath(str(name)).name for name in said["relative_file_paths"]]
    except RideEstimationError:
        raise
    except READER_ERRORS as error:
        raise InputDataError(f"{metadata}: does not describe a bag ({_words(error)})") from error
    if mode == "file":
        raise InputDataError(f"{where}: its files are compressed as a whole; unpack them first (zstd -d) or convert the bag")
    if mode not in ("none", "message") or (mode == "message" and form != "zstd"):
        raise InputDataError(f"{where}: compression {mode!r} by {form!r} is unknown; allowed: message by message with zstd")
    found = {file.name: file for file in files}
    missing = [name for name in names if name not in found]
    if missing or not names:
        raise InputDataError(f"{where}: metadata.yaml lists {', '.join(missing) or 'no file'}, there are {', '.join(found)}")
    return tuple(found[name] for name in names), mode == "message"


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return the storage files of a run; a folder that only holds the folder of a bag stands for that bag.

    Raises
    ------
    InputDataError
        The path does not exist, holds no bag or several.
    """
    if not path.exists():
        raise InputDataError(f"{path}: does not exist")
    if path.is_file():
        if path.suffix not in SUFFIXES:
            raise InputDataError(f"{path}: not a bag; allowed: a rosbag2 folder or a file ending in {', '.join(SUFFIXES)}")
        if path.stat().st_size == 0:
            raise InputDataError(f"{path}: the file is empty")
        return (path,)
    by_folder: dict[Path, list[Path]] = {}
    below = (p for pattern in ("*", "*/*", "*/*/*") for p in path.glob(pattern))
    for file in sorted(p for p in below if p.suffix in SUFFIXES and p.is_file()):
        by_folder.setdefault(file.parent, []).append(file)
    near = [folder for folder in by_folder if path in (folder, folder.parent)]
    if path in near or len(by_folder) == len(near) == 1:
        return tuple(by_folder[path if path in near else near[0]])
    if not by_folder:
        raise InputDataError(f"{path}: the folder contains no {', '.join(SUFFIXES)} file")
    names = [str(folder.relative_to(path)) for folder in by_folder]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    shown = f"{', '.join(names[:3])}{more}"
    raise InputDataError(f"{path}: a folder of recordings ({shown}): name one of them; 'fleet' takes them all")


def checksum_of(path: Path) -> str:
    """Return the SHA-256 over the storage files of a run in the order of their names."""
    digest = hashlib.sha256()
    for file in bag_files(path):
        with file.open("rb") as stream:
            while chunk := stream.read(1 << 20):
                digest.update(chunk)
    return digest.hexdigest()


def _words(error: BaseException) -> str:
    if isinstance(error, struct.error):
        return "a record is cut off or too short"
    if isinstance(error, KeyError):
        return f"a record without {error}"
    return " ".join(str(error).split()) or type(error).__name__


def _fed(path: Path, feed: Feed, collector: Collector) -> str:
    """Let a file hand over its messages; return what is wrong with it, or nothing."""
    try:
        feed(collector)
    except TooLargeError as error:
        raise InputDataError(f"{path}: {error} for a file of this size") from error
    except READER_ERRORS as error:
        return _words(error)
    return ""


def _damaged(path: Path, reason: str, collector: Collector, allowed: bool) -> str:
    """Return the warning that a file is damaged and the messages before are used.

    Raises
    ------
    InputDataError
        Nothing can be recovered, or it is not wanted (the message says how much there is).
    """
    count, duration = collector.extent
    if not count:
        raise InputDataError(f"{path}: the file cannot be read ({reason}) and no message could be recovered")
    what = f"{count} messages over {duration:.1f} s"
    if not allowed:
        raise InputDataError(
            f"{path}: the file is truncated or corrupt ({reason}); {what} before the damage can be recovered with --salvage"
        )
    return f"the file is truncated or corrupt ({reason}); used are the {what} before the damage"


def _unpacked_feed(collector: Collector, feeds: Sequence[Feed], size: int) -> None:
    """Hand over messages that are compressed one by one."""
    collector.allow(size)
    budget = allowance(size)
    packed = Collector(dict.fromkeys(collector.topics))
    damage: Exception | None = None
    for feed in feeds:
        try:
            feed(packed)
        except READER_ERRORS as error:
            damage = error
    for topic, arrival, data in in_order(packed.finished()):
        raw = unpack(data, "zstd", budget)
        budget -= len(raw)
        collector.add(topic, arrival, raw)
    collector.flush()
    if damage is not None:
        raise damage


def _open_mcap(source: BagSource, file: Path) -> BagSource:
    ending, reason = _ending(file)
    contents = None if ending is None else ending.contents
    if contents is None:
        scan = Collector({})
        reason = _fed(source.path, lambda collector: collector.take_mcap(file, ending), scan) or reason
        if reason:
            _damaged(source.path, reason, scan, source.salvage)
        contents = scan.contents

    def feed(collector: Collector) -> None:
        try:
            collector.take_mcap(file, ending)
        except DAMAGE as error:
            raise error if isinstance(error, TooLargeError) else ValueError(reason or _words(error)) from error

    return dataclasses.replace(source, feeds=(feed,), **_of_channels(contents))


def _ending(file: Path) -> tuple[Ending | None, str]:
    """Return the end of an MCAP file, or what is wrong with it."""
    try:
        with file.open("rb") as stream:
            return read_ending(stream), ""
    except DAMAGE as error:
        return None, _words(error)


def _of_channels(contents: Contents) -> dict[str, Any]:
    """Return types, counts and what cannot be decoded, by topic."""
    types, counts, unreadable = dict[str, str](), Counter[str](), dict[str, str]()
    for number, channel in contents.channels.items():
        kind, count = contents.schemas.get(channel.schema, ""), contents.counts.get(number, 0)
        counts[channel.topic] += count
        if types.setdefault(channel.topic, kind) != kind:
            unreadable[channel.topic] = f"its messages are of several types ({types[channel.topic]}, {kind})"
        elif count and channel.encoding != _CDR:
            unreadable[channel.topic] = f"its messages are encoded as {channel.encoding!r}; only {_CDR!r} can be read"
    return {"types": types, "counts": counts, "unreadable": unreadable}


def _open_db3(source: BagSource, file: Path) -> BagSource:
    try:
        topics = sqlite_topics(file)
    except READER_ERRORS as error:
        raise InputDataError(f"{source.path}: the file cannot be read ({_words(error)}): truncated, corrupt or no bag") from error
    counts = Counter[str]()
    for topic in topics:
        counts[topic.name] += topic.messages
    return dataclasses.replace(
        source,
        types={t.name: t.message_type for t in topics},
        counts=counts,
        unreadable={
            t.name: f"its messages are encoded as {t.encoding!r}; only {_CDR!r} can be read" for t in topics if t.encoding != _CDR
        },
        feeds=(lambda collector: _take_all(collector, file, sqlite_messages(file)),),
    )


def _open_ros1(source: BagSource, file: Path) -> BagSource:
    types, counts = dict[str, str](), Counter[str]()

    def feed(collector: Collector) -> None:
        _take_all(collector, file, ((m.topic, m.arrival_ns, m.raw) for m in ros1_messages(file)))

    def scan(collector: Collector) -> None:
        for message in ros1_messages(file):
            types[message.topic] = message.message_type
            counts[message.topic] += 1
            collector.pass_over(message.arrival_ns)

    seen = Collector({})
    reason = _fed(source.path, scan, seen)
    if reason:
        _damaged(source.path, reason, seen, source.salvage)
    deserialize = type_store(Stores.ROS1_NOETIC).deserialize_ros1
    return dataclasses.replace(
        source, types=types, counts=counts, feeds=(feed,), deserialize=deserialize, little_endian_cdr=False
    )


_OPENERS: Mapping[str, Callable[[BagSource, Path], BagSource]] = {".mcap": _open_mcap, ".db3": _open_db3, ".bag": _open_ros1}


def _take_all(collector: Collector, file: Path, messages: Iterable[RawMessage]) -> None:
    collector.allow(file.stat().st_size)
    for topic, arrival, raw in messages:
        if topic in collector.topics:
            collector.add(topic, arrival, raw)
        else:
            collector.pass_over(arrival)
    collector.flush()


def _cdr_reader(raw: bytes, kind: str) -> Any:
    """Return the message object of CDR bytes.

    Tolerates the bytes Fast DDS leaves behind a message that ends in empty sequences: it reserves the alignment of every
    sequence of doubles, also of empty ones (JointState without velocity and effort).
    """
    deserialize = type_store(Stores.ROS2_JAZZY).deserialize_cdr
    try:
        return deserialize(raw, kind)
    except SerdeError:
        for spare in (4, 8, 12):
            try:
                return deserialize(raw[:-spare], kind)
            except SerdeError:
                continue
        raise
