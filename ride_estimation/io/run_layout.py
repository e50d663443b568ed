# Copyright 2026 ride_estimation contributors
"""The layout of ``run.mcap`` for Foxglove and Lichtblick: forces with their bounds, motion, arrows, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ride_estimation.io.force_arrows import ARROWS_TOPIC
from ride_estimation.io.run_mcap import BOUNDS, NODE

#: keys under which Foxglove and Lichtblick keep the title of a panel
_TITLE = ("foxglovePanelTitle", "lichtblickPanelTitle")
_COLOURS = {"value": "#0969da", "bound": "#9ec5fe"}


def run_layout(mount_names: Sequence[str]) -> dict[str, Any]:
    """Return the layout.

    Parameters
    ----------
    mount_names
        Mounts whose forces are in the recording.
    """
    panels: dict[str, Any] = {"3D!arrows": _scene()}
    force = "wrench.force.z"
    for mount in mount_names:
        name = f"mounts/{mount}/force"
        curves = [(f"{BOUNDS}/{name}_{end}.{force}", end, "bound") for end in ("lower", "upper")]
        panels[f"Plot!{mount}"] = _plot(f"{mount}: force z [N]", [*curves, (f"{NODE}/{name}.{force}", "z", "value")])
    curves = [(f"{BOUNDS}/cg_accel_{end}.accel.linear.z", end, "bound") for end in ("lower", "upper")]
    curves.append((f"{NODE}/cg_accel.accel.accel.linear.z", "z", "value"))
    panels["Plot!cg_accel"] = _plot("CG acceleration z [m/s^2]", curves)
    panels["DiagnosticSummary!parameters"] = {
        "topicToRender": f"{NODE}/parameters", "minLevel": 0, "pinnedIds": [], "hardwareIdFilter": "", "sortByLevel": False,
    }  # fmt: skip
    plots = [name for name in panels if name.startswith("Plot!")]
    others = [name for name in panels if name not in plots]
    return {
        "configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": _stacked(plots), "second": _stacked(others), "splitPercentage": 65},
    }  # fmt: skip


def _stacked(names: Sequence[str]) -> Any:
    if len(names) == 1:
        return names[0]
    share = 100.0 / len(names)
    return {"direction": "column", "first": names[0], "second": _stacked(names[1:]), "splitPercentage": share}


def _plot(title: str, curves: Sequence[tuple[str, str, str]]) -> dict[str, Any]:
    paths = [
        {"value": path, "enabled": True, "timestampMethod": "headerStamp", "label": label, "color": _COLOURS[kind]}
        for path, label, kind in curves
    ]
    return {
        **dict.fromkeys(_TITLE, title), "paths": paths, "showLegend": True, "legendDisplay": "left",
        "sidebarDimension": 90, "showXAxisLabels": True, "showYAxisLabels": True, "isSynced": True, "xAxisVal": "timestamp",
    }  # fmt: skip


def _scene() -> dict[str, Any]:
    shown = {"visible": True}
    camera = {"perspective": True, "distance": 5.0, "phi": 65.0, "thetaOffset": 35.0}
    return {
        "followTf": "cab_link", "cameraState": camera, "topics": {f"{NODE}/{ARROWS_TOPIC}": shown}, "layers": {},
        "scene": {"transforms": {"labelSize": 0.06}}, "transforms": {},
    }  # fmt: skip
