# Copyright 2026 ride_estimation contributors
"""A report as PDF: the blocks of a page set one below the other on A4 sheets."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from ride_estimation.io.atomic import replacing
from ride_estimation.reporting.page import PRINT_DPI, Beside, Page, Picture, Table, Text, cell_text, is_number, png
from ride_estimation.text import printable

_WIDTH, _HEIGHT, _MARGIN = 8.27, 11.69, 0.6  # A4 [inch]
_POINTS = 72.0
_LINE = 1.25  # line height over font size
#: font size [points], text columns that fit the sheet, weight and colour by kind of text
_STYLES = {
    "h1": (15.0, 48, "bold", "#1b1f24"), "h2": (12.0, 60, "bold", "#1b1f24"), "h3": (9.5, 80, "bold", "#1b1f24"),
    "p": (8.5, 112, "normal", "#1b1f24"),
    "verdict": (10.0, 76, "bold", "#0969da"), "warning": (8.5, 112, "normal", "#9a6700"),
    "caption": (7.5, 126, "normal", "#57606a"),
}  # fmt: skip
#: share of the font size a character of the fixed-width font is wide
_FIXED_WIDTH = 0.602
#: characters from which a cell continues on the next line
_WIDEST_CELL = 48


def write_pdf(page: Page, path: Path) -> None:
    """Write a report as PDF.

    Parameters
    ----------
    page
        The report.
    path
        File to write.
    """
    with replacing(path) as new, PdfPages(new, metadata={"Title": printable(page.title), "CreationDate": None}) as document:
        sheets = _Sheets(document)
        sheets.text(page.title, "h1")
        for block in page.blocks:
            if isinstance(block, Picture):
                sheets.picture(block)
            elif isinstance(block, Table):
                sheets.table(block)
            elif isinstance(block, Beside):
                for title, table in block.parts:
                    sheets.text(title, "h3")
                    sheets.table(table)
            elif isinstance(block, Text):
                sheets.text(block.text, block.kind)
        sheets.finish()


class _Sheets:
    """Sheets that fill up from top to bottom."""

    def __init__(self, document: PdfPages) -> None:
        self._document = document
        self._figure: Figure | None = None
        self._top = 0.0

    def _room(self, height: float) -> Figure:
        """Return the sheet that has this much room [inch] left."""
        if self._figure is None or self._top + height > _HEIGHT - _MARGIN:
            self.finish()
            self._figure = Figure(figsize=(_WIDTH, _HEIGHT))
            self._top = _MARGIN
        return self._figure

    def finish(self) -> None:
        """Put the present sheet into the document."""
        if self._figure is not None:
            self._document.savefig(self._figure)  # type: ignore[no-untyped-call]
        self._figure = None

    def text(self, text: str, kind: str) -> None:
        """Set a text, line by line."""
        size, columns, weight, colour = _STYLES[kind]
        lines = textwrap.wrap(printable(" ".join(text.split())), columns) or [""]
        before = 0.12 if kind in ("h1", "h2", "h3") else 0.03
        # a heading stays with what follows
        self._room(before + len(lines[:40]) * size * _LINE / _POINTS + (0.8 if kind in ("h2", "h3") else 0.0))
        self._top += before
        self._lines(lines, size, {"weight": weight, "color": colour})
        self._top += 0.04

    def _lines(self, lines: list[str], size: float, style: dict[str, str]) -> None:
        step = size * _LINE / _POINTS
        for line in lines:
            sheet = self._room(step)
            height = 1.0 - (self._top + step) / _HEIGHT
            # a text from outside is no formula: dollars are taken literally
            sheet.text(_MARGIN / _WIDTH, height, line, fontsize=size, parse_math=False, **style)  # type: ignore[arg-type]
            self._top += step

    def table(self, table: Table) -> None:
        """Set a table in a fixed-width font as large as the sheet allows."""
        rows = [line for row in table.rows for line in _wrapped([cell_text(v) for v in row])]
        heads = _wrapped(table.headers) if any(table.headers) else []
        widths = [max(len(cell) for cell in column) for column in zip(*heads, *rows, strict=True)]
        numeric = [bool(table.rows) and all(is_number(row[i]) for row in table.rows) for i in range(len(table.headers))]
        lines = [
            "  ".join(cell.rjust(w) if right else cell.ljust(w) for cell, w, right in zip(row, widths, numeric, strict=True))
            for row in (*heads, *rows)
        ]
        columns = max(len(line) for line in lines)
        size = float(np.clip((_WIDTH - 2 * _MARGIN) * _POINTS / (_FIXED_WIDTH * columns), 3.0, 7.5))
        self._lines(lines[: len(heads)], size, {"family": "monospace", "weight": "bold"})
        self._lines(lines[len(heads) :], size, {"family": "monospace"})
        self._top += 0.08

    def picture(self, picture: Picture) -> None:
        """Set a picture as wide as the sheet, its caption below."""
        image = matplotlib.image.imread(io.BytesIO(png(picture, PRINT_DPI)))
        width = _WIDTH - 2 * _MARGIN
        height = min(width * image.shape[0] / image.shape[1], _HEIGHT - 2 * _MARGIN - 0.4)
        sheet = self._room(height + 0.35)
        axes = sheet.add_axes((_MARGIN / _WIDTH, 1.0 - (self._top + height) / _HEIGHT, width / _WIDTH, height / _HEIGHT))
        axes.imshow(image, interpolation="none")
        axes.set_axis_off()
        self._top += height
        size, columns, _, colour = _STYLES["caption"]
        self._lines(textwrap.wrap(picture.caption, columns), size, {"color": colour})
        self._top += 0.08


def _wrapped(row: Sequence[str]) -> list[list[str]]:
    """Return the lines a row of cells takes when long cells are continued below."""
    cells = [textwrap.wrap(" ".join(cell.split()), _WIDEST_CELL) or [""] for cell in row]
    height = max(len(cell) for cell in cells)
    return [[cell[i] if i < len(cell) else "" for cell in cells] for i in range(height)]
