# Copyright 2026 ride_estimation contributors
"""The page of all force elements and their keys in a vehicle file, written from their declarations.

``python -m ride_estimation.io.element_page --write`` writes ``docs/elements.md`` of a source tree again.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.registry import kinds

PAGE = Path(__file__).resolve().parents[2] / "docs" / "elements.md"
HEAD = """\
# Force elements

What stands behind `kind:` at an axis of a mount in a vehicle file. Written from the declarations in `ride_estimation/elements` by
`python -m ride_estimation.io.element_page --write`. A single number is given plain or as
`{value, std | relative_std, range, source}`; another unit of the same dimension goes by its own ending (`stiffness_n_per_mm`).
Deflection is positive in extension, force in tension. At the axes roll, pitch and yaw the deflection is an angle and the force a
moment, so that keys end accordingly (`stiffness_n_m_per_rad`, `damping_n_m_s_per_rad`, `friction_n_m`).
"""


def page() -> str:
    """Return the page: one heading per kind, one row per key with unit, allowed values, default and meaning."""
    parts = [HEAD]
    for kind, element in kinds().items():
        summary = (inspect.getdoc(element) or "").split("\n\n")[0].replace("\n", " ")
        rows = list(_rows(element))
        parts.append(f"\n## `{kind}`\n\n{summary}\n")
        if rows:
            head = "| key | unit | allowed | default | meaning |\n|---|---|---|---|---|"
            parts.append("\n" + "\n".join([head, *rows]) + "\n")
    return "".join(parts)


def _rows(element: type[ForceElement]) -> Iterator[str]:
    """Yield the rows of a kind in the order of its declaration."""
    for field in dataclasses.fields(element):
        declared = field.metadata.get("series", field.metadata)
        if "key" not in declared:
            continue
        default = "needed" if field.default is dataclasses.MISSING else f"`{field.default}`"
        many = "list, each " if "series" in field.metadata else ""
        if "choices" in declared:
            unit, allowed = "", " or ".join(f"`{word}`" for word in declared["choices"])
        else:
            unit, allowed = declared["unit"], f"{many}{declared['lower']:g} to {declared['upper']:g}"
        meaning = declared["meaning"] + (f" ({declared['source']})" if declared.get("source") else "")
        yield f"| `{declared['key']}` | {unit} | {allowed} | {default} | {meaning.replace('|', '/')} |"


def main(arguments: Sequence[str]) -> int:
    """Print the page, or write it with ``--write``."""
    if list(arguments) == ["--write"]:
        PAGE.write_text(page(), encoding="utf-8")
        print(f"written: {PAGE}")
        return 0
    print(page())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
