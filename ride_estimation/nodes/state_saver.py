# Copyright 2026 ride_estimation contributors
"""Saves what was learned without holding up messages: a snapshot between two messages, encoding and writing in a thread."""

from __future__ import annotations

import threading
from pathlib import Path

from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.state_file import Snapshot

#: what a save may fail with; it never ends the node
SAVE_ERRORS = (OSError, RideEstimationError)


class StateSaver:
    """Writes the state of one estimator to one file, one save at a time.

    Attributes
    ----------
    problem
        Why the newest save failed, empty where it did not.
    """

    def __init__(self) -> None:
        self.problem = ""
        self._thread: threading.Thread | None = None

    @property
    def writing(self) -> bool:
        """Return whether a save is under way."""
        return self._thread is not None and self._thread.is_alive()

    def begin(self, path: Path, pipeline: Pipeline) -> None:
        """Take a snapshot now and write it in the background; a save that is still under way is said and left to end."""
        if self.writing:
            self.problem = f"not saved: {path} is still being written since the last time"
            return
        snapshot = Snapshot.of(pipeline)
        self._thread = threading.Thread(target=self._write, args=(path, snapshot), name="save state", daemon=True)
        self._thread.start()

    def complete(self, path: Path, pipeline: Pipeline) -> None:
        """Write the state as it is now and return when it is on the disk."""
        self.wait()
        self._write(path, Snapshot.of(pipeline))

    def wait(self) -> None:
        """Return when no save is under way."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _write(self, path: Path, snapshot: Snapshot) -> None:
        try:
            snapshot.write(path)
        except SAVE_ERRORS as error:
            self.problem = f"not saved: {error}"
        else:
            self.problem = ""
