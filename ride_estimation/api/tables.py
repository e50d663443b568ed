# Copyright 2026 ride_estimation contributors
"""Results as tables: text, HTML for notebooks, pandas and xarray where they are installed."""

from __future__ import annotations

import html
import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from ride_estimation.errors import ConfigurationError

#: rows a notebook or a terminal shows of one result
SHOWN_ROWS = 30


def dataframe(columns: Mapping[str, Any], index: str = "") -> Any:
    """Return columns as a ``pandas.DataFrame``.

    Parameters
    ----------
    columns
        Values by column name, all of one length.
    index
        Column that becomes the index; a plain range where empty.

    Raises
    ------
    ConfigurationError
        pandas is not installed.
    """
    frame = _module("pandas").DataFrame(dict(columns))
    return frame.set_index(index) if index else frame


def dataset(variables: Mapping[str, Any], coordinates: Mapping[str, Any]) -> Any:
    """Return arrays with named dimensions as an ``xarray.Dataset``.

    Parameters
    ----------
    variables
        Dimensions and values by name.
    coordinates
        Values along the dimensions by name.

    Raises
    ------
    ConfigurationError
        xarray is not installed.
    """
    return _module("xarray").Dataset(dict(variables), dict(coordinates))


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ConfigurationError(f"this table needs {name}, which is not installed: pip install {name}") from error


def html_table(heads: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    """Return a table for a notebook, the first rows of it where there are many."""
    def cells(words: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(word)}</{tag}>" for word in words) + "</tr>"

    body = "".join(cells(row, "td") for row in rows[:SHOWN_ROWS])
    more = f"<p>... {len(rows) - SHOWN_ROWS} more rows</p>" if len(rows) > SHOWN_ROWS else ""
    return f"<p>{html.escape(caption)}</p><table><thead>{cells(heads, 'th')}</thead><tbody>{body}</tbody></table>{more}"
