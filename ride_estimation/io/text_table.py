# Copyright 2026 ride_estimation contributors
"""Tables in text files as loggers and spreadsheets write them: separator, decimal sign, encoding and lines above the header."""

from __future__ import annotations

import codecs
import csv
import dataclasses
from collections import Counter
from pathlib import Path

from ride_estimation.errors import InputDataError

_SEPARATORS = (";", "\t", ",")  # the comma last: beside another separator it is a decimal sign


@dataclasses.dataclass(frozen=True)
class TextTable:
    """The cells of a table.

    Attributes
    ----------
    path
        Where it was read, for messages.
    rows
        Cells as they stand, header first.
    lines
        Number of the line of every row in the file, counted from one.
    decimal_comma
        Numbers have a comma where others have a point.
    """

    path: Path
    rows: list[list[str]]
    lines: list[int]
    decimal_comma: bool

    def number(self, cell: str) -> float:
        """Return the number in a cell.

        Raises
        ------
        ValueError
            It is none.
        """
        return float(cell.replace(",", ".") if self.decimal_comma else cell)


def read_text_table(path: Path) -> TextTable:
    """Read a table separated by commas, semicolons or tabs.

    Empty lines and lines that begin with ``#`` are passed over, and so are lines above the header that are not as wide as
    the table or mostly empty. Beside semicolons and tabs a comma is a decimal sign. Text is UTF-8, UTF-16 with its mark, or
    Windows-1252.

    Raises
    ------
    InputDataError
        Not readable, no text, or rows of unequal width (the line is named).
    """
    text = decoded(path)
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip() and line[0] != "#"]
    if not numbered:
        return TextTable(path, [], [], False)
    body = numbered[len(numbered) // 2 :]
    separator = next((s for s in _SEPARATORS if s in body[0][1]), ",")
    try:
        rows = list(csv.reader((line for _, line in numbered), delimiter=separator))
    except csv.Error as error:
        raise InputDataError(f"{path}: cannot be read as a table: {error}") from error
    if len(rows) != len(numbered):
        raise InputDataError(f"{path}: cannot be read as a table: a quoted cell goes over the end of its line")
    width = Counter(map(len, rows)).most_common(1)[0][0]
    first = next((i for i, row in enumerate(rows) if len(row) == width and 2 * sum(map(bool, row)) >= width), 0)
    rows, lines = rows[first:], [number for number, _ in numbered[first:]]
    for number, row in zip(lines, rows):
        if len(row) != width:
            raise InputDataError(f"{path}: row {number} has {len(row)} cells, the header has {width}")
    if width > 1 and all(row[-1].strip() == "" for row in rows):  # a separator at the end of every line
        rows = [row[:-1] for row in rows]
    comma = separator != "," and any("," in cell for row in rows[1:] for cell in row)
    return TextTable(path, rows, lines, comma)


def decoded(path: Path) -> str:
    """Return the text of a file: UTF-8, UTF-16 with its mark, or Windows-1252.

    Raises
    ------
    InputDataError
        Not readable, or no text.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputDataError(f"{path}: cannot be read: {error.strerror or error}") from error
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings: tuple[str, ...] = ("utf-16",)
    else:
        encodings = ("utf-8-sig",) if b"\0" in raw else ("utf-8-sig", "cp1252")
    for encoding in encodings:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
    raise InputDataError(f"{path}: cannot be read as text")
