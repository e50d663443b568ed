# Copyright 2026 ride_estimation contributors
"""One report: headings, text, tables, figures; written as one HTML file that opens without network, as PDF or as PNG files."""

from __future__ import annotations

import base64
import dataclasses
import html
import io
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ride_estimation.io.atomic import replacing, write_atomically
from ride_estimation.reporting.numbers import plain
from ride_estimation.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: resolution of the pictures in HTML and PNG files [dots per inch]
SCREEN_DPI = 88
PRINT_DPI = 150

_STYLE = """
body{font:15px/1.45 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#1b1f24;background:#fff}
h1{font-size:1.6em;margin-bottom:.2em;overflow-wrap:anywhere}h2{font-size:1.25em;margin-top:1.8em;border-bottom:1px solid #d0d7de}
p{overflow-wrap:anywhere}td{overflow-wrap:break-word}
nav{font-size:.92em;margin:1em 0}nav a{display:inline-block;margin:0 .9em .3em 0;color:#0969da;text-decoration:none}
.wide{overflow-x:auto;margin:.8em 0}
table{border-collapse:collapse;font-size:.92em}th,td{border:1px solid #d0d7de;padding:.25em .6em;text-align:left}
th{background:#f3f5f7}td.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
img{max-width:100%;height:auto}figure{margin:1em 0;overflow-x:auto}figcaption{color:#57606a;font-size:.9em}
.verdict{font-size:1.15em;background:#eef6ff;border-left:5px solid #0969da;padding:.7em 1em}
.warning{background:#fff8e5;border-left:5px solid #bf8700;padding:.4em 1em;margin:.3em 0}
@media (max-width:700px){body{margin:.6em auto;padding:0 .6em}figure img{min-width:660px}td,th{padding:.2em .4em;max-width:22em}
.wide table{width:max-content}}
@media print{body{max-width:none;margin:0;font-size:10pt}nav{display:none}h2{break-after:avoid}
figure,tr{break-inside:avoid}.wide,figure{overflow:visible}table{font-size:8pt}img{max-height:23cm}
.verdict,.warning,th{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
"""


class Digits(str):
    """A number that is written already, with the digits it deserves."""

    __slots__ = ()


@dataclasses.dataclass(frozen=True)
class Text:
    """A heading (``kind`` h2), a paragraph (p), the verdict or a warning."""

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


Block = Text | Table | Picture


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
        text = (
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            f"<title>{_escaped(self.title)}</title><style>{_STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
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

    for axes in picture.figure.axes:  # a signal that is zero throughout has no logarithm
        if axes.get_xscale() == "log" and not math.isfinite(axes.dataLim.minposx):
            axes.set_xscale("linear")
        if axes.get_yscale() == "log" and not math.isfinite(axes.dataLim.minposy):
            axes.set_yscale("linear")
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
    return html.escape(printable(text))


def _html(block: Block) -> str:
    if isinstance(block, Picture):
        data = base64.b64encode(png(block, SCREEN_DPI)).decode("ascii")
        caption = _escaped(block.caption)
        return f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>'
    if isinstance(block, Table):
        heads = "".join(f"<th>{_escaped(h)}</th>" for h in block.headers)
        head = f"<thead><tr>{heads}</tr></thead>" if any(block.headers) else ""
        body = "".join("<tr>" + "".join(_cell(value) for value in row) + "</tr>" for row in block.rows)
        return f'<div class="wide"><table>{head}<tbody>{body}</tbody></table></div>'
    text = _escaped(block.text)
    return f"<p>{text}</p>" if block.kind == "p" else f'<p class="{block.kind}">{text}</p>'


def _cell(value: object) -> str:
    text = _escaped(cell_text(value))
    return f'<td class="number">{text}</td>' if is_number(value) else f"<td>{text}</td>"
