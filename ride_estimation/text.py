# Copyright 2026 ride_estimation contributors
"""Text from outside (names in files, file names, error messages of libraries) made safe for a terminal, a report and a table."""

from __future__ import annotations

import unicodedata

#: longest single statement about a value from outside [characters]
_LONGEST = 400
#: beginnings of a cell that spreadsheets take for a formula
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def _escapes() -> dict[int, str]:
    """Return what is written for every character that has no business in a text."""
    # control characters, what changes the direction of reading, halves of surrogate pairs, separators that break a line
    places = [*range(0x3000), *range(0xD800, 0xE000), 0xFEFF]
    odd = [i for i in places if unicodedata.category(chr(i)) in ("Cc", "Cf", "Cs", "Zl", "Zp") and chr(i) not in "\n\t\u00ad"]
    return {i: _escape(i) for i in odd}


def _escape(code: int) -> str:
    if 0xDC80 <= code <= 0xDCFF:  # how Python keeps a byte of a file name that is not UTF-8
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


_ESCAPES = _escapes()


def printable(text: str, encoding: str = "utf-8") -> str:
    r"""Return a text with everything escaped that a terminal or a page would obey instead of show.

    Control characters (but line feed and tab), marks that turn the direction of reading, zero-width marks and bytes of file names
    that are not UTF-8 are written as Python writes them: ``\x1b``, ``\u202e``, ``\xfc``.

    Parameters
    ----------
    text
        Any text.
    encoding
        Of the place it is written to; what that cannot express is escaped too.
    """
    clean = text.translate(_ESCAPES)
    try:
        return clean.encode(encoding, "backslashreplace").decode(encoding)
    except (LookupError, UnicodeError):
        return clean.encode("ascii", "backslashreplace").decode("ascii")


def shortened(text: str, longest: int = _LONGEST) -> str:
    """Return a text of at most ``longest`` characters, its middle replaced by its length where it has more."""
    if len(text) <= longest:
        return text
    gap = f" ... ({len(text)} characters) ... "
    left = max(longest - len(gap), 2)
    return text[: left - left // 3] + gap + text[-(left // 3) :]


def table_cell(value: str | float | int | None) -> str | float | int:
    """Return a cell of a CSV table that no spreadsheet takes for a formula; numbers stay numbers.

    A text that begins as a formula does gets an apostrophe before it, unless it is a number.

    Parameters
    ----------
    value
        Text, number, or None for an empty cell.
    """
    if value is None:
        return ""
    if not isinstance(value, str):
        return value
    if value.startswith(_FORMULA) and not _is_number(value):
        value = f"'{value}"
    return printable(value)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
