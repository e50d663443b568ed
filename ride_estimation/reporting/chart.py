# Copyright 2026 ride_estimation contributors
"""A matplotlib figure as data, for the plots of a page that a reader can zoom, read off and export.

One description of a figure serves both: matplotlib draws it into PDF and PNG, the script of the page draws it on the screen.
What the figures of this package use is carried over: lines, bands between two curves, bars, points, horizontal and vertical
lines, images with their colour bar.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator
from numpy.typing import ArrayLike, NDArray

from ride_estimation.text import printable

Array = NDArray[np.float64]

#: steps a value on a linear axis is stored in: 1.5e-5 of the range, far below what a screen shows
_STEPS = 65534
_GAP = -32768
#: dash patterns by matplotlib's name of the style [pixels]
_NONE = ("None", "none", " ", "")
_DASHES = {"--": (6, 3), ":": (2, 3), "-.": (6, 3, 2, 3)}


def chart_of(figure: Figure) -> dict[str, Any]:
    """Return a figure as what the script of the page draws, ready for JSON.

    Parameters
    ----------
    figure
        Any figure of this package; logarithmic axes without a positive value become linear.

    Returns
    -------
    dict
        ``size`` [inch], ``panels`` with axes and items, ``arrays`` the items refer to by number.
    """
    settle_scales(figure)
    arrays = _Arrays()
    shown = [axes for axes in figure.axes if axes.get_label() != "<colorbar>" and axes.axison]
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    groups: list[set[Axes]] = []
    panels = []
    for axes in shown:
        siblings = set(axes.get_shared_x_axes().get_siblings(axes))
        if siblings not in groups:
            groups.append(siblings)
        panels.append(_panel(axes, groups.index(siblings), [other for other in siblings if other in shown], arrays))
    for panel, bar in zip([p for p in panels if any(i["k"] == "image" for i in p["items"])], bars, strict=False):
        panel["bar"] = printable(bar.get_ylabel())
    return {"size": [round(float(v), 3) for v in figure.get_size_inches()], "panels": panels, "arrays": arrays.stored}


def settle_scales(figure: Figure) -> None:
    """Make a logarithmic axis linear where nothing on it is positive: a signal of zeros has no logarithm."""
    for axes in figure.axes:
        if axes.get_xscale() == "log" and not math.isfinite(axes.dataLim.minposx):
            axes.set_xscale("linear")
        if axes.get_yscale() == "log" and not math.isfinite(axes.dataLim.minposy):
            axes.set_yscale("linear")


class _Arrays:
    """Arrays of one figure, each stored once."""

    def __init__(self) -> None:
        self.stored: list[dict[str, Any]] = []
        self._known: dict[bytes, int] = {}

    def add(self, values: ArrayLike, log: bool) -> int:
        """Store an array and return its number; values of a logarithmic axis keep their relative precision."""
        given = np.asarray(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan), dtype=float)
        key = hashlib.blake2b(given.tobytes() + bytes([log]), digest_size=16).digest()
        if key not in self._known:
            self._known[key] = len(self.stored)
            self.stored.append(_stored(given, log))
        return self._known[key]


def _stored(values: Array, log: bool) -> dict[str, Any]:
    count = len(values)
    if count > 2 and np.all(np.isfinite(values)):
        step = (values[-1] - values[0]) / (count - 1)
        # stamps are rounded to nanoseconds
        if step != 0.0 and np.max(np.abs(values - values[0] - step * np.arange(count))) <= 1e-6 * abs(step):
            return {"t": "u", "a": _short(values[0]), "s": _short(step), "n": count}
    finite = values[np.isfinite(values)]
    if log or not len(finite):
        return {"t": "f", "b": _text(values.astype("<f4"))}
    low, high = float(finite.min()), float(finite.max())
    codes = np.full(count, _GAP, dtype="<i2")
    share = (values[np.isfinite(values)] - low) / (high - low) if high > low else np.zeros(len(finite))
    codes[np.isfinite(values)] = np.round(share * _STEPS - _STEPS // 2)
    return {"t": "i", "a": low, "b": _text(codes), "z": high}


def _short(value: float) -> float:
    return float(f"{value:.12g}")


def _text(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _panel(axes: Axes, group: int, sharing: Iterable[Axes], arrays: _Arrays) -> dict[str, Any]:
    box = axes.get_position()
    # of panels that share their x axis the lowest of a column has its numbers
    below = any(other.get_position().y1 <= box.y0 + 1e-6 and other.get_position().x0 < box.x1 for other in sharing)
    logs = (axes.get_xscale() == "log", axes.get_yscale() == "log")
    title = " ".join(filter(None, (axes.get_title(), axes.get_title(loc="left"))))
    return {
        "box": [round(float(v), 4) for v in (box.x0, 1.0 - box.y1, box.width, box.height)],
        "title": printable(title),
        "group": group,
        "legend": axes.get_legend() is not None,
        "x": {**_axis(axes.get_xlabel(), logs[0], axes.get_xlim(), axes.xaxis.get_major_locator()), "numbers": not below},
        "y": _axis(axes.get_ylabel(), logs[1], axes.get_ylim(), axes.yaxis.get_major_locator()),
        "items": [item for artist in _drawn(axes) if (item := _item(axes, artist, logs, arrays))],
    }


def _drawn(axes: Axes) -> list[Any]:
    artists = [*axes.images, *axes.collections, *axes.patches, *axes.lines]
    rectangles = [a for a in artists if isinstance(a, Rectangle)]
    rest = [a for a in artists if a.get_visible() and not isinstance(a, Rectangle)]
    return sorted([*rest, *([rectangles] if rectangles else [])], key=lambda a: 1.0 if isinstance(a, list) else a.get_zorder())


def _axis(label: str, log: bool, limits: tuple[float, float], locator: Any) -> dict[str, Any]:
    fixed = [float(v) for v in locator.tick_values(*limits)] if isinstance(locator, FixedLocator) else None
    return {"label": printable(" ".join(label.split())), "log": log, "lim": [_short(v) for v in limits], "ticks": fixed}


def _item(axes: Axes, artist: Any, logs: tuple[bool, bool], arrays: _Arrays) -> dict[str, Any] | None:
    if isinstance(artist, Line2D):
        return _line(axes, artist, logs, arrays)
    if isinstance(artist, AxesImage):
        return _image(artist)
    if isinstance(artist, list):
        first = artist[0]
        return {
            "k": "bars", "c": to_hex(first.get_facecolor()), "n": "", "w": _short(first.get_width()),
            "x": arrays.add([r.get_x() for r in artist], False), "y": arrays.add([r.get_height() for r in artist], logs[1]),
        }  # fmt: skip
    if isinstance(artist, PathCollection):
        places = np.asarray(artist.get_offsets(), dtype=float)
        colours = [to_hex(tuple(c)) for c in np.asarray(artist.get_facecolor(), dtype=float).reshape(-1, 4)]
        return {
            "k": "points", "c": colours[0] if colours else "#0969da", "n": _name(artist),
            "m": 3.0, "cs": colours if len(colours) == len(places) else [],
            "x": arrays.add(places[:, 0], logs[0]), "y": arrays.add(places[:, 1], logs[1]),
        }  # fmt: skip
    if isinstance(artist, PolyCollection):
        return _band(artist, logs, arrays)
    return None


def _name(artist: Any) -> str:
    label = str(artist.get_label())
    return "" if label.startswith("_") else printable(label)


def _line(axes: Axes, line: Line2D, logs: tuple[bool, bool], arrays: _Arrays) -> dict[str, Any] | None:
    x, y = (np.asarray(values, dtype=float) for values in line.get_data(orig=False))
    colour = to_hex(line.get_color(), keep_alpha=False)
    look: dict[str, Any] = {"c": colour, "w": float(line.get_linewidth()), "d": _DASHES.get(str(line.get_linestyle()), ())}
    transform = line.get_transform()
    if transform in (axes.get_yaxis_transform(), axes.get_xaxis_transform()):
        level = transform == axes.get_yaxis_transform()
        return {"k": "level" if level else "mark", "v": _short(float((y if level else x)[0])), **look}
    if not len(x):
        return None
    marked = 0.5 * float(line.get_markersize()) if str(line.get_marker()) not in _NONE else 0.0
    if str(line.get_linestyle()) in _NONE:
        places = {"x": arrays.add(x, logs[0]), "y": arrays.add(y, logs[1])}
        return {"k": "points", "c": colour, "n": _name(line), "m": marked, "cs": [], **places}
    look |= {"m": marked, "o": 1.0 if (alpha := line.get_alpha()) is None else float(alpha)}
    return {"k": "line", "n": _name(line), "x": arrays.add(x, logs[0]), "y": arrays.add(y, logs[1]), **look}


def _band(band: PolyCollection, logs: tuple[bool, bool], arrays: _Arrays) -> dict[str, Any] | None:
    """Return the two curves of a filled band; matplotlib keeps its outline: out along one curve and back along the other."""
    x, low, high = [], [], []
    for path in band.get_paths():
        corners = np.asarray(path.vertices, dtype=float)
        count = (len(corners) - 3) // 2
        first, second = corners[1 : count + 1], corners[count + 2 : 2 * count + 2][::-1]
        if count < 1 or not np.array_equal(first[:, 0], second[:, 0]):
            return None
        x.append([*first[:, 0], np.nan])
        low.append([*np.minimum(first[:, 1], second[:, 1]), np.nan])
        high.append([*np.maximum(first[:, 1], second[:, 1]), np.nan])
    if not x:
        return None
    curves = [np.concatenate(part)[:-1] for part in (x, low, high)]
    face = np.asarray(band.get_facecolor(), dtype=float).reshape(-1, 4)[0]
    return {
        "k": "band", "n": _name(band), "c": to_hex(tuple(face[:3])), "o": float(face[3]), "x": arrays.add(curves[0], logs[0]),
        "lo": arrays.add(curves[1], logs[1]), "hi": arrays.add(curves[2], logs[1]),
    }  # fmt: skip


def _image(image: AxesImage) -> dict[str, Any]:
    """Return the levels of an image; level 0 is left out of the picture (masked)."""
    values: Any = np.ma.asarray(image.get_array(), dtype=float)
    image.autoscale_None()
    low, high = (float(v) for v in image.get_clim())
    log = isinstance(image.norm, LogNorm)
    share: Array = np.ma.filled(np.ma.asarray(image.norm(values), dtype=float), np.nan)
    levels = np.where(np.isfinite(share), 1 + np.round(np.clip(np.nan_to_num(share), 0.0, 1.0) * 254), 0).astype(np.uint8)
    palette = np.round(255 * np.asarray(image.get_cmap()(np.arange(255) / 254))[:, :3]).astype(np.uint8)
    return {
        "k": "image", "n": "", "rows": values.shape[0], "cols": values.shape[1], "lim": [low, high], "log": log,
        "box": [float(v) for v in image.get_extent()], "b": _text(levels), "p": _text(palette),
    }  # fmt: skip
