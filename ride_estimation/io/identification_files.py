# Copyright 2026 ride_estimation contributors
"""Files an identification writes: identification.json and element.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.json_file import written_last


def write_identification(directory: Path, document: Mapping[str, Any], element: Mapping[str, Any] | None) -> None:
    """Write ``identification.json`` and, where there is an element, ``element.yaml``; one of an earlier call is removed.

    Parameters
    ----------
    directory
        Created where it does not exist.
    document
        Content of the JSON file.
    element
        YAML form of the element; it goes as is under an axis of a mount in a vehicle file.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with written_last(directory / "identification.json", document):
        (directory / "element.yaml").unlink(missing_ok=True)  # of an earlier call, beside new results
        if element is not None:
            head = "# Identified force element: put this mapping under an axis of a mount in the vehicle file.\n"
            write_atomically(directory / "element.yaml", head + yaml.safe_dump(dict(element), sort_keys=False))
