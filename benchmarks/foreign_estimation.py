# Copyright 2026 ride_estimation contributors
"""Judge the estimator on runs of vehicles that another program simulated.

    python benchmarks/foreign_estimation.py FOLDER [--only cab_05 cab_24]

FOLDER holds one folder per case: ``run`` (rosbag2), ``vehicle.yaml``, ``truth.json`` and ``truth.npz`` (``t``, ``epoch_ns``,
``force``: N x 3 M, on the body by the mount, body axes, static share included). Printed per case: error of the live and smoothed
forces over the standard deviation of the true force (median over the mounts), share within two standard deviations (median and
lowest over the mounts), squared error of the CG acceleration over its variance, and how many ``valid`` stiffness and damping
values lie within two standard deviations, at mounts without and with an effect: as the node states them in the end, and of the
whole run.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bags import read_recording
from ride_estimation.io.vehicle_file import load_vehicle

#: the first seconds, in which nothing is learned yet, are not judged [s]
FROM_S = 8.0
#: where the truth is uncertain by its own band limit, nothing is judged: both ends of the run [s]
END_S = 0.5
AXES = "xyz"


def _coverage(error: np.ndarray, std: np.ndarray) -> np.ndarray:
    return np.asarray((np.abs(error) <= 2.0 * std).mean(axis=0))


def _affected(truth: dict, mounts: tuple[str, ...]) -> set[str]:
    """Return the mounts at which an effect of the run sits."""
    found: set[str] = set()
    for effect in truth["effects"]:
        place = effect.get("location") or ""
        if place.startswith("/"):
            continue
        axle = {"rear": "r", "front": "f"}.get(place)
        names = [m for m in mounts if m.startswith(axle)] if axle else [place]
        found |= set(names) & set(mounts)
    return found


def _elements(truth: dict, mounts: tuple[str, ...]) -> dict[tuple[str, str], str]:
    """Return which element of the truth is a mount and axis; one without an axis is vertical."""
    found = {}
    for name in truth["true_parameters"]["elements"]:
        place, _, axis = name.partition(".")
        for mount in mounts:
            if mount == place or (not axis and mount.startswith(place)):
                found[mount, axis or "z"] = name
    return found


def judge(case: Path) -> dict[str, object]:
    """Return the figures of one case."""
    truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
    known = np.load(case / "truth.npz")
    vehicle = load_vehicle(case / "vehicle.yaml")
    began = time.process_time()
    run: OfflineRun = run_offline(read_recording(case / "run", vehicle), Pipeline(vehicle))
    spent = time.process_time() - began
    seconds = (run.stamp_ns - int(known["epoch_ns"])) * 1e-9
    keep = run.valid & (seconds > FROM_S) & (seconds < known["t"][-1] - END_S)
    elements = _elements(truth, run.mount_names)
    order = list(truth["true_parameters"]["elements"])
    columns = [(run.mount_names.index(mount), AXES.index(axis), order.index(e)) for (mount, axis), e in elements.items()]
    effects = "+".join(e["name"] for e in truth["effects"])
    figures: dict[str, object] = {"case": case.name, "effect": effects, "seconds": spent}
    live = ("live", run.signals["mount_force"], run.signals["mount_force_std"])
    for path, force, std in (live, ("smoothed", run.force, run.force_std)):
        for kind, axes in (("vertical", (2,)), ("sideways", (0, 1))):
            errors, inside, ratio = [], [], []
            for m, a, column in columns:
                if a not in axes:
                    continue
                right = np.interp(seconds[keep], known["t"], known["force"][:, column].astype(float))
                error = force[keep, m, a] - right
                errors.append(np.sqrt(np.mean(error**2)) / right.std())
                inside.append(float(_coverage(error, std[keep, m, a])))
                ratio.append(np.sqrt(np.mean(std[keep, m, a] ** 2) / np.mean(error**2)))
            if errors:
                figures[f"{path} {kind}"] = (np.median(errors), np.median(inside), min(inside), np.median(ratio))
    accel = np.column_stack([np.interp(seconds[keep], known["t"], known["cg_acceleration"][:, i]) for i in range(3)])
    covariance = np.stack([run.signals["cg_accel_std"][keep, i] for i in range(3)], axis=1)
    error = run.signals["cg_accel"][keep, :3] - accel
    with np.errstate(divide="ignore", invalid="ignore"):
        figures["cg"] = np.where(covariance > 0, error**2 / covariance**2, np.nan).mean(axis=0)
    figures["parameters"] = _parameters(run.parameters, run.mount_names, truth)
    whole = () if isinstance(run.smoothed, str) else run.smoothed.parameters
    figures["parameters of the whole run"] = _parameters(whole, run.mount_names, truth)
    return figures


def _parameters(
    estimates: Sequence[Estimate], mounts: tuple[str, ...], truth: dict
) -> dict[str, tuple[int, int, list[str], list[float]]]:
    """Return by kind of mount: valid values inside two standard deviations, valid values, those outside in words, errors."""
    elements = _elements(truth, mounts)
    affected = _affected(truth, mounts)
    sums: dict[str, tuple[int, int, list[str], list[float]]] = {}
    for estimate in estimates:
        parts = estimate.name.split(".")
        element = elements.get((parts[0], parts[1])) if len(parts) == 3 else None
        if element is None or estimate.status is not Status.VALID:
            continue
        right = float(truth["true_parameters"]["elements"][element]["k" if parts[2] == "stiffness" else "c"])
        score = (estimate.value - right) / estimate.std
        kind = "affected" if parts[0] in affected else "healthy"
        inside, count, words, errors = sums.get(kind, (0, 0, [], []))
        if abs(score) > 2.0:
            words = [*words, f"{estimate.name} {estimate.value / right - 1:+.1%} = {score:+.1f} std"]
        sums[kind] = (inside + (abs(score) <= 2.0), count + 1, words, [*errors, abs(estimate.value / right - 1.0)])
    return sums


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--words", action="store_true", help="also print every valid parameter outside two standard deviations")
    given = parser.parse_args()
    chosen = [c for c in sorted(given.folder.iterdir()) if not given.only or c.name in given.only]
    cases = [c for c in chosen if (c / "vehicle.yaml").exists()]
    total: dict[tuple[str, str], list[Any]] = {}
    for case in cases:
        figures = judge(case)
        print(f"{figures['case']} ({figures['effect']}), {figures['seconds']:.0f} s")
        for key in ("live vertical", "live sideways", "smoothed vertical", "smoothed sideways"):
            if key in figures:
                error, middle, low, ratio = figures[key]  # type: ignore[misc]
                inside = f"inside 2 std {middle:4.0%} (lowest {low:4.0%})"
                print(f"  {key:18s} error {error:6.1%}, {inside}, std over error {ratio:.1f}")
        ratios = ", ".join(f"{x:.1f}" for x in figures["cg"])  # type: ignore[attr-defined]
        print(f"  CG acceleration, squared error over variance: {ratios}")
        for path in ("parameters", "parameters of the whole run"):
            for kind, (inside, count, words, errors) in figures[path].items():  # type: ignore[attr-defined]
                print(f"  {path}, valid at {kind} mounts: {inside} of {count} inside 2 std, median error {np.median(errors):.1%}")
                totals = total.setdefault((path, kind), [0, 0, []])
                totals[0], totals[1], totals[2] = totals[0] + inside, totals[1] + count, totals[2] + errors
                if given.words:
                    print("".join(f"    {w}\n" for w in words), end="")
    for (path, kind), (inside, count, errors) in total.items():
        print(f"all {path}, valid at {kind} mounts: {inside} of {count} inside 2 std, median error {np.median(errors):.1%}")


if __name__ == "__main__":
    main()
