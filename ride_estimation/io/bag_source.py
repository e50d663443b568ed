# Copyright 2026 ride_estimation contributors
"""Raw messages of a recorded run from any container: rosbag2 folder, ``.mcap``, ``.db3``, ROS 1 ``.bag``."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import heapq
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_limits import check_unpacked_size
from ride_estimation.io.bounded import allowance, unpack
from ride_estimation.io.mcap_records import has_summary, read_mcap, salvage_mcap

#: On broken files the readers and what they call raise nearly anything (seen: ReaderError, FileNotFoundError, KeyError,
#: OverflowError, ZstdError, sqlite3.Error, struct.error); every use turns it into an InputDataError that quotes it.
READER_ERRORS = (Exception,)
SUFFIXES = (".mcap", ".db3", ".bag")

@functools.cache
def type_store(which: Stores) -> Typestore:
    """Return the message types of a distribution; they take a third of a second to make and are never changed."""
    return get_typestore(which)


RawMessage = tuple[str, int, bytes]


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
    messages
        ``messages(topics)`` yields (topic, receive time [ns], raw bytes) in order of arrival.
    deserialize
        ``deserialize(raw, type)`` returns a message object.
    little_endian_cdr
        Whether the raw bytes are CDR, so that they can be decoded in bulk.
    warnings
        What was wrong and could be worked around.
    whole_mcap
        The one MCAP file that holds everything and has a good end, None where there is none.
    """

    path: Path
    types: Mapping[str, str]
    counts: Mapping[str, int]
    messages: Callable[[Collection[str]], Iterator[RawMessage]]
    deserialize: Callable[[bytes, str], Any]
    little_endian_cdr: bool
    warnings: tuple[str, ...] = ()
    whole_mcap: Path | None = None


def open_bag(path: Path, *, salvage: bool = False) -> BagSource:
    """Open a run.

    Parameters
    ----------
    path
        rosbag2 folder (``metadata.yaml`` may be missing), ``.mcap``, ``.db3`` or ROS 1 ``.bag`` file.
    salvage
        Use what is readable of a broken MCAP file.

    Raises
    ------
    InputDataError
        Missing path, no bag, empty, truncated or corrupt file.
    """
    files = bag_files(path)
    warnings: list[str] = []
    target = path if path.is_file() else files[0].parent
    if target.is_dir() and not (target / "metadata.yaml").exists():
        if len(files) > 1:
            raise InputDataError(f"{path}: metadata.yaml is missing and there are {len(files)} files; name one of them")
        target = files[0]
        warnings.append("metadata.yaml is missing; the file was read directly")
    try:
        source = _open_ros1(target) if target.suffix == ".bag" else _open_ros2(target)
    except InputDataError:
        raise
    except READER_ERRORS as error:
        if files[0].suffix == ".mcap" and len(files) == 1:
            return salvaged(path, files[0], salvage, _words(error))
        raise InputDataError(f"{path}: the file cannot be read ({_words(error)}): truncated, corrupt or no bag") from error
    return dataclasses.replace(source, path=path, warnings=tuple(warnings))


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
        raise InputDataError(f"{path}: the folder holds no {', '.join(SUFFIXES)} file")
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
    return " ".join(str(error).split()) or type(error).__name__


def _open_ros2(target: Path) -> BagSource:
    files, mode = bag_files(target), _compression_mode(target)
    if mode == "file":
        raise InputDataError(f"{target}: its files are compressed as a whole; unpack them first (zstd -d) or convert the bag")
    for file in files:
        if file.suffix == ".mcap" and (len(files) > 1 or not has_summary(file)):
            check_unpacked_size(file)
    with Ros2Reader(target) as reader:
        types, counts = _contents(reader.connections)

    whole = files[0] if len(files) == 1 and files[0].suffix == ".mcap" and mode != "message" else None

    def messages(topics: Collection[str]) -> Iterator[RawMessage]:
        if mode == "message":
            # message by message compression is undone here, with a limit; rosbags knows none
            parts = [_raw_messages(file, topics) for file in files]
            limit = allowance(sum(file.stat().st_size for file in files))
            for topic, stamp, packed in heapq.merge(*parts, key=lambda message: message[1]):
                yield topic, stamp, unpack(packed, "zstd", limit)
        elif whole is not None:
            yield from read_mcap(whole, topics)
        else:
            yield from _raw_messages(target, topics)

    return BagSource(target, types, counts, messages, _cdr_reader, True, whole_mcap=whole)


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


def _contents(connections: Iterable[Any]) -> tuple[dict[str, str], Counter[str]]:
    """Return type and number of messages by topic."""
    types: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for c in connections:
        if not (isinstance(c.topic, str) and isinstance(c.msgtype, str) and isinstance(c.msgcount, int)):
            raise ValueError(f"topic {c.topic!r} of type {c.msgtype!r} with {c.msgcount!r} messages")
        types[c.topic] = c.msgtype
        counts[c.topic] += c.msgcount
    return types, counts


def _raw_messages(target: Path, topics: Collection[str]) -> Iterator[RawMessage]:
    with Ros2Reader(target) as opened:
        chosen = [c for c in opened.connections if c.topic in topics]
        if chosen:
            for connection, stamp, raw in opened.messages(connections=chosen):
                yield connection.topic, stamp, bytes(raw)


def _compression_mode(target: Path) -> str:
    """Return ``message``, ``file`` or nothing: what ``metadata.yaml`` says of a folder."""
    metadata = target / "metadata.yaml"
    if not target.is_dir() or not metadata.exists():
        return ""
    said = metadata.read_text(encoding="utf-8", errors="replace").lower()
    found = re.search(r"compression_mode:\s*['\"]?(message|file)", said)
    return found.group(1) if found else ""


def _open_ros1(target: Path) -> BagSource:
    check_unpacked_size(target)
    with Ros1Reader(target) as reader:
        types, counts = _contents(reader.connections)

    def messages(topics: Collection[str]) -> Iterator[RawMessage]:
        with Ros1Reader(target) as opened:
            chosen = [c for c in opened.connections if c.topic in topics]
            if chosen:
                for connection, stamp, raw in opened.messages(connections=chosen):
                    yield connection.topic, stamp, bytes(raw)

    store = type_store(Stores.ROS1_NOETIC)
    return BagSource(target, types, counts, messages, store.deserialize_ros1, False)


def salvaged(path: Path, file: Path, allowed: bool, reason: str) -> BagSource:
    """Return what can be recovered of a broken MCAP file.

    Parameters
    ----------
    path, file
        The run as named by the user, and its file.
    allowed
        Whether the user wants it.
    reason
        What is wrong with the file.

    Raises
    ------
    InputDataError
        Nothing can be recovered, or it is not wanted (the message says how much there is).
    """
    found = salvage_mcap(file)
    if not found.messages:
        raise InputDataError(f"{path}: the file cannot be read ({reason}) and no message could be recovered")
    span = (max(m[1] for m in found.messages) - min(m[1] for m in found.messages)) * 1e-9
    what = f"{len(found.messages)} messages over {span:.1f} s"
    if not allowed:
        raise InputDataError(
            f"{path}: the file is truncated or corrupt ({reason}); {what} before the damage can be recovered with --salvage"
        )
    counts = Counter(topic for topic, _, _ in found.messages)

    def messages(topics: Collection[str]) -> Iterator[RawMessage]:
        yield from (m for m in found.messages if m[0] in topics)

    warning = f"the file is truncated or corrupt ({reason}); used are the {what} before the damage"
    return BagSource(path, found.types, counts, messages, _cdr_reader, True, (warning,))
