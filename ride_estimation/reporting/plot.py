# Copyright 2026 ride_estimation contributors
"""A matplotlib figure as a notebook shows it and as a file."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path

from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Plot:
    """A picture that a notebook shows.

    Attributes
    ----------
    figure
        ``matplotlib.figure.Figure``, to be changed at will.
    """

    figure: Figure

    def save(self, path: str | Path) -> Path:
        """Write the picture; the ending of the name chooses the format (svg, pdf, png). Return its path."""
        self.figure.savefig(path, bbox_inches="tight")
        return Path(path)

    def _repr_svg_(self) -> str:
        drawn = io.StringIO()
        self.figure.savefig(drawn, format="svg", bbox_inches="tight")
        return drawn.getvalue()
