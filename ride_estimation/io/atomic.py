# Copyright 2026 ride_estimation contributors
"""Files that are written completely or not at all, whatever ends the program or fills the disk meanwhile."""

from __future__ import annotations

import contextlib
import fcntl
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

#: longest part of the name of a file that is in the name of its unfinished version [characters]
_LONGEST_PART = 40


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the path of a new file or folder that takes the place of ``path`` when the block ends.

    A reader finds the old or the new one, never a part, also after a power failure: the new one is made under the same name in a
    hidden folder beside it and goes to the disk; then the name changes. When the block raises, the old one stays as it was.
    Hidden folders of writers that were killed are removed: the lock on the folder ends with its process (``flock``).

    Parameters
    ----------
    path
        File to write, or folder to create; an existing folder is not replaced.

    Raises
    ------
    OSError
        The disk is full, no permission...; its ``filename`` is ``path``.
    """
    _remove_leftovers(path)
    with _named(path):
        hidden, lock = _locked_folder(path)
        try:
            new = hidden / path.name
            yield new
            for written in sorted(new.rglob("*")) if new.is_dir() else [new]:
                _to_disk(written)
            os.replace(new, path)
        finally:
            shutil.rmtree(hidden, ignore_errors=True)
            os.close(lock)
    with contextlib.suppress(OSError):  # some file systems cannot open folders
        _to_disk(path.parent)


def write_atomically(path: Path, text: str) -> None:
    """Replace a text file completely or not at all.

    Parameters
    ----------
    path
        File to write.
    text
        Written as UTF-8; what cannot be written so (bytes of file names that are not UTF-8) is written as ``?``.
    """
    with replacing(path) as new:
        new.write_bytes(text.encode("utf-8", "replace"))


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Put the name of the file into errors that have none (a full disk) or that of the unfinished version."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def _to_disk(path: Path) -> None:
    """Wait until a file or the names in a folder are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _prefix(path: Path) -> str:
    return f".{path.name[:_LONGEST_PART]}."


def _locked_folder(path: Path) -> tuple[Path, int]:
    """Return a new hidden folder beside a file and the descriptor that holds its lock."""
    while True:
        hidden = Path(tempfile.mkdtemp(prefix=_prefix(path), suffix=".tmp", dir=path.parent))
        lock = None
        # another writer may lock the folder first, take it for a leftover and remove it: then the next one
        with contextlib.suppress(FileNotFoundError):
            lock = os.open(hidden, os.O_RDONLY)
            with contextlib.suppress(OSError):  # a file system without locks: nobody removes leftovers there
                fcntl.flock(lock, fcntl.LOCK_EX)
            if os.path.samestat(os.fstat(lock), hidden.stat()):
                return hidden, lock
        if lock is not None:
            os.close(lock)


def _remove_leftovers(path: Path) -> None:
    """Remove what writers that were killed left beside the file."""
    for left in path.parent.glob(f"{glob.escape(_prefix(path))}*.tmp"):
        with contextlib.suppress(OSError):
            lock = os.open(left, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left)
            finally:
                os.close(lock)
