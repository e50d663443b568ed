# Copyright 2026 ride_estimation contributors
"""One report: headings, text, tables, figures; written as one HTML file that opens without network, as PDF or as PNG files.

The HTML file holds the numbers of its figures; ``web/report.js`` draws them, with cursor, zoom and export. The page
allows no other script and no address outside of itself.
"""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html
import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from ride_estimation.io.atomic import replacing, write_atomically
from ride_estimation.reporting.numbers import plain
from ride_estimation.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: resolution of the pictures in PDF and PNG files [dots per inch]
PRINT_DPI = 150
#: characters from which a cell of a table is prose, which needs room on a narrow screen
_PROSE = 40

class Digits(str):
    """A number that is written already, with the digits it deserves."""

    __slots__ = ()


@dataclasses.dataclass(frozen=True)
class Link:
    """A cell of a table that leads to a file beside the page; ``target`` is relative."""

    text: str
    target: str

    def __str__(self) -> str:
        return self.text


@dataclasses.dataclass(frozen=True)
class Text:
    """A heading (``kind`` h2, h3), a paragraph (p), the verdict or a warning."""

    kind: str
    text: str


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; ``headers`` carry the units."""

    headers: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]


@dataclasses.dataclass(frozen=True)
class Picture:
    """A figure with its caption; ``tight`` cuts the margins, at the price of drawing it twice."""

    figure: Figure
    caption: str
    tight: bool


@dataclasses.dataclass(frozen=True)
class Beside:
    """Short tables side by side where the screen has room, each below its title."""

    parts: tuple[tuple[str, Table], ...]


Block = Text | Table | Picture | Beside


class Page:
    """A report under construction. Every text is data: it is escaped where it is written.

    Parameters
    ----------
    title
        Title of the page and first heading.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.blocks: list[Block] = []

    def heading(self, text: str) -> None:
        """Start a section."""
        self.blocks.append(Text("h2", text))

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self.blocks.append(Text("p", text))

    def verdict(self, text: str) -> None:
        """Add the sentence the reader came for."""
        self.blocks.append(Text("verdict", text))

    def warning(self, text: str) -> None:
        """Add a warning."""
        self.blocks.append(Text("warning", text))

    def table(self, headers: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table; numbers are right-aligned and printed with four significant digits."""
        self.blocks.append(Table(tuple(headers), tuple(tuple(row) for row in rows)))

    def beside(self, parts: Mapping[str, tuple[Sequence[str], Iterable[Sequence[object]]]]) -> None:
        """Add tables side by side: title -> (headers, rows)."""
        tables = {title: Table(tuple(headers), tuple(tuple(row) for row in rows)) for title, (headers, rows) in parts.items()}
        self.blocks.append(Beside(tuple(tables.items())))

    def figure(self, figure: Figure, caption: str, tight: bool = True) -> None:
        """Add a matplotlib figure; ``tight`` cuts its margins."""
        self.blocks.append(Picture(figure, caption, tight))

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Return the pictures in order."""
        return tuple(block for block in self.blocks if isinstance(block, Picture))

    def write(self, path: Path) -> None:
        """Write the page to ``path`` as one HTML file."""
        headings = [b.text for b in self.blocks if isinstance(b, Text) and b.kind == "h2"]
        anchors = "".join(f'<a href="#s{i}">{_escaped(text)}</a>' for i, text in enumerate(headings))
        navigation = f"<nav>{anchors}</nav>" if len(headings) > 3 else ""
        parts, section, placed = [f"<h1>{_escaped(self.title)}</h1>"], 0, False
        for block in self.blocks:
            if isinstance(block, Text) and block.kind == "h2":
                if not placed:
                    parts.append(navigation)
                    placed = True
                parts.append(f'<h2 id="s{section}">{_escaped(block.text)}</h2>')
                section += 1
            else:
                parts.append(_html(block))
        script = f"{_web('report.js')}\n" if self.pictures else ""
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        text = (
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            # nothing is loaded from anywhere, and no script but the one of this page runs
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
            f"style-src 'unsafe-inline'; script-src 'sha256-{digest}'\">"
            f"<title>{_escaped(self.title)}</title><style>{_web('report.css')}{_foot(self.title)}</style></head>"
            f"<body>{''.join(parts)}{f'<script>{script}</script>' if script else ''}</body></html>\n"
        )
        write_atomically(path, text)

    def write_png(self, folder: Path) -> list[Path]:
        """Write every picture as a PNG file, numbered and named after its caption; return the files."""
        folder.mkdir(parents=True, exist_ok=True)
        files = []
        for number, picture in enumerate(self.pictures, start=1):
            name = re.sub(r"[^a-z0-9]+", "_", picture.caption.lower()).strip("_")[:60]
            files.append(folder / f"{number:02d}_{name}.png")
            with replacing(files[-1]) as new:
                new.write_bytes(png(picture, PRINT_DPI))
        return files


def png(picture: Picture, dpi: int) -> bytes:
    """Return a picture as PNG, the same bytes for the same figure."""
    from matplotlib.text import Text as Label

    from ride_estimation.reporting.chart import settle_scales

    settle_scales(picture.figure)
    for label in picture.figure.findobj(Label):
        if label.get_text() != printable(label.get_text()):
            label.set_text(printable(label.get_text()))
        if "$" in label.get_text() and not label.get_text().startswith("$\\mathdefault"):
            # a name from outside is no formula; matplotlib writes the powers of ten of its ticks as one
            label.set_parse_math(False)
    buffer = io.BytesIO()
    box = "tight" if picture.tight else None
    picture.figure.savefig(buffer, format="png", dpi=dpi, bbox_inches=box, metadata={"Software": None})
    return buffer.getvalue()


def cell_text(value: object) -> str:
    """Return the text of a cell of a table: numbers with four significant digits."""
    return plain(value) if isinstance(value, float) else printable(str(value))


def is_number(value: object) -> bool:
    """Return whether a cell is set as a number."""
    return isinstance(value, (int, float, Digits)) and not isinstance(value, bool)


def _escaped(text: str) -> str:
    # messages are written for a terminal too, which may have no such sign
    return html.escape(printable(text).replace(" +- ", " ± "))


def _html(block: Block) -> str:
    if isinstance(block, Picture):
        return _chart(block)
    if isinstance(block, Beside):
        parts = (f"<div><h3>{_escaped(title)}</h3>{_html(table)}</div>" for title, table in block.parts)
        return f'<div class="side">{"".join(parts)}</div>'
    if isinstance(block, Table):
        numeric = [bool(block.rows) and all(is_number(row[i]) for row in block.rows) for i in range(len(block.headers))]
        heads = "".join(f"<th{' class=number' * right}>{_escaped(h)}</th>" for h, right in zip(block.headers, numeric))
        head = f"<thead><tr>{heads}</tr></thead>" if any(block.headers) else ""
        body = "".join("<tr>" + "".join(_cell(value) for value in row) + "</tr>" for row in block.rows)
        fit = ' class="fit"' if len(block.headers) <= 2 else ""
        return f'<div class="wide"><table{fit}>{head}<tbody>{body}</tbody></table></div>'
    text = _escaped(block.text)
    return f"<p>{text}</p>" if block.kind == "p" else f'<p class="{block.kind}">{text}</p>'


def _chart(picture: Picture) -> str:
    """Return a figure as its numbers, drawn by the script of the page."""
    from ride_estimation.reporting.chart import chart_of

    # "<" would end the data early where a name from outside holds markup
    data = json.dumps(chart_of(picture.figure), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        '<figure class="chart"><div class="tools"></div><div class="plot"><noscript>The plots need JavaScript; --format pdf '
        f'draws them without.</noscript></div><figcaption>{_escaped(picture.caption)}</figcaption>'
        f'<script type="application/json">{data}</script></figure>'
    )


def _cell(value: object) -> str:
    text = _escaped(cell_text(value))
    if isinstance(value, Link):
        return f'<td><a href="{html.escape(value.target)}">{text}</a></td>'
    if is_number(value):
        return f'<td class="number">{text}</td>'
    return f'<td class="prose">{text}</td>' if len(text) > _PROSE else f"<td>{text}</td>"


def _web(name: str) -> str:
    """Return a file of the page's own script or style."""
    return (files("ride_estimation.reporting") / "web" / name).read_text(encoding="utf-8")


def _foot(title: str) -> str:
    """Return the rule that prints the title at the foot of every sheet."""
    plain_title = re.sub(r'[\\"<>\x00-\x1f]', " ", printable(title))
    return f'@page{{@bottom-left{{content:"{plain_title}"}}}}'
