# Copyright 2026 ride_estimation contributors
"""Diagnose recorded runs of vehicles that another program simulated, and compare the answers with the truth beside them.

A folder holds one folder per vehicle with ``run``, ``run2``, ``vehicle.yaml`` (none for bench records) and ``truth.json``. Every
answer is one line of a JSON lines file; a second call skips the lines that exist.

    python benchmarks/foreign_diagnosis.py FOLDER --out foreign.jsonl
    python benchmarks/foreign_diagnosis.py FOLDER --out foreign.jsonl --only cab_03 planar_23
    python benchmarks/foreign_diagnosis.py FOLDER --out foreign.jsonl --summary-only
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

import yaml

from ride_estimation.frames import COORDINATES

QUIET = ("no_discrepancy", "insufficient_data")
#: cause -> (key of the true magnitude, part of the name of the parameter that states it, factor to the unit stated)
MAGNITUDES = {
    "coulomb_friction": ("force_N", "friction level", 1.0),
    "bump_stop": ("gap_m", "gap", 1.0),
    "mass_change": ("added_kg", "mass", 1.0),
    "sensor_misalignment": ("rotation_deg", "rotation", 1.0),
    "sensor_delay": ("delay_s", "delay", 1.0),
    "sensor_gain": ("gain_error", "gain", 1.0),
    "sensor_bias": ("bias_m_s2", "offset", 1.0),
    "sensor_clipping": ("range_m_s2", "clipping level", 1.0),
    "backlash": ("play_m", "clearance", 1.0),
    "cab_flexible_mode": ("frequency_Hz", "frequency", 1.0),
}
#: what the runs call an effect -> cause id, where they differ
NAMES = {"cab_flexible_mode": "flexible_mode"}
ANGLES = dict(zip(COORDINATES[:3], COORDINATES[3:]))
_NEAR_M = 0.15  # distance at which a load still is at the seat where it was put [m]
AXLES = {"front": ("fl", "fr"), "rear": ("rl", "rr"), "left": ("fl", "rl"), "right": ("fr", "rr")}


def diagnosed(folder: pathlib.Path) -> dict[str, Any]:
    """Return the record of one vehicle, from the command line as a user would call it."""
    vehicle = folder / "vehicle.yaml"
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "ride_estimation.cli.main", "diagnose", str(folder / "run"), "--validate"]
        command += [str(folder / "run2"), "--out", out, "--no-report"]
        command += ["--vehicle", str(vehicle)] if vehicle.exists() else []
        began = time.perf_counter()
        errors = pathlib.Path(out) / "stderr.txt"
        with errors.open("w") as stderr, subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr) as child:
            _, status, spent = os.wait4(child.pid, 0)  # the resources of this child alone, its peak of memory among them
            child.returncode = os.waitstatus_to_exitcode(status)
        record: dict[str, Any] = {
            "run": folder.name, "seconds": time.perf_counter() - began, "code": child.returncode,
            "processor_seconds": spent.ru_utime + spent.ru_stime, "peak_mb": spent.ru_maxrss / 1024.0,
        }  # fmt: skip
        written = pathlib.Path(out) / "diagnosis.json"
        if child.returncode or not written.exists():
            last = errors.read_text().strip().splitlines()[-1:] or [""]
            return record | {"verdict": "crashed" if child.returncode == 1 else "refused", "causes": [], "error": last[0]}
        document = json.loads(written.read_text())
    record |= {k: document.get(k) for k in ("verdict", "sentence", "causes", "gain", "warnings", "remarks")}
    return record


def truth_of(folder: pathlib.Path) -> dict[str, Any]:
    """Return what the vehicle hides, sensors by the names of the vehicle file."""
    truth = json.loads((folder / "truth.json").read_text())
    vehicle = folder / "vehicle.yaml"
    sensors = yaml.safe_load(vehicle.read_text()).get("sensors", {}) if vehicle.exists() else {}
    names = {s["topic"]: name for name, s in sensors.items() if "topic" in s}
    effects = [e for e in truth["effects"] if e["name"] != "none"]
    for e in effects:
        e["location"] = names.get(e.get("location"), e.get("location"))
    return {"effects": effects, "seen": truth["visibility"].get("seen_in", [])}


def right_cause(effect: dict[str, Any], cause: dict[str, Any]) -> bool:
    """Return whether a named cause is an honest answer to an effect."""
    return cause["id"] in {NAMES.get(a, a) for a in (*effect["honest_answers"], effect["name"])}


def right_place(effect: dict[str, Any], causes: list[dict[str, Any]]) -> bool:
    """Return whether the causes of the right name sit where the effect does; an axle may be named mount by mount."""
    true = effect["location"] or ""
    point = (effect.get("magnitude") or {}).get("point_from_cg_m")
    if point is not None:  # a load by the point it lies at
        parameters = [p for c in causes if right_cause(effect, c) for p in c["parameters"]]
        stated = [(p, point["xyz".index(p["name"][-1])]) for p in parameters if "place from the CG" in p["name"]]
        return bool(stated) and all(abs(p["value"] - x) < max(2.0 * p["std"], _NEAR_M) for p, x in stated)
    found = {c["location"] for c in causes if right_cause(effect, c)}
    return any(true == f or f.startswith(true) for f in found) or (bool(found) and found == set(AXLES.get(true, ())))


def magnitudes(effect: dict[str, Any], causes: list[dict[str, Any]]) -> tuple[float, float, float] | None:
    """Return true size, stated size nearest to it and its standard deviation; None where none is stated."""
    key, name, factor = MAGNITUDES.get(effect["name"], ("", "", 1.0))
    true = (effect.get("magnitude") or {}).get(key)
    stated = [
        (factor * p["value"], factor * p["std"]) for c in causes if right_cause(effect, c)
        for p in c["parameters"] if name in p["name"] and p["value"]
    ]  # fmt: skip
    if true is None or not stated:
        return None
    value, std = min(stated, key=lambda s: abs(abs(s[0]) - abs(true)))
    return float(true), float(value), float(std)


def judged(record: dict[str, Any], truth: dict[str, Any]) -> dict[str, Any]:
    """Return what of one answer is right."""
    causes, effects = record["causes"] or [], truth["effects"]
    out: dict[str, Any] = {"clean": not effects, "pair": len(effects) > 1, "alarm": not effects and bool(causes)}
    first = causes[0] if causes else None
    hit = next((e for e in effects if first is not None and right_cause(e, first)), None)
    out["first"] = hit is not None
    out["explained"] = out["first"] and record["verdict"] == "explained"
    out["exact"] = len(causes) == len(effects) and all(any(right_cause(e, c) for c in causes) for e in effects)
    if hit is not None:
        out["place"] = right_place(hit, causes)
        # a shape (torsion) is no axis, and a rotation about z is a yaw
        axis = hit.get("axis")
        out["axis"] = first is not None and (axis not in ANGLES or first["axis"] in (axis, ANGLES[axis]))
        out["magnitude"] = magnitudes(hit, causes)
    return out


def _line(record: dict[str, Any], truth: dict[str, Any]) -> str:
    verdict = judged(record, truth)
    true = "; ".join(
        f"{e['name']} {e['kind']} {e['level']} {e['location']} {e.get('axis') or ''}" for e in truth["effects"]
    ) or "clean"
    said = "; ".join(f"{c['id']} {c['location']} {c['axis']} {c['confidence']:.2f}" for c in record["causes"] or []) or "-"
    gain = ((record.get("gain") or {}).get("validation") or [{}])[0]
    errors = "/".join(f"{100 * gain[k]:.1f}" for k in ("baseline", "extended", "noise_floor") if k in gain)
    size = verdict.get("magnitude")
    numbers = f"{size[0]:.4g} / {size[1]:.4g} +- {size[2]:.2g}" if size else ""
    mark = "ok" if (verdict["explained"] or (verdict["clean"] and not verdict["alarm"] and record["verdict"] in QUIET)) else "--"
    place = {True: "place", False: "wrong place"}.get(verdict.get("place", ""), "")
    return (
        f"{mark} {record['run']:11s} | {true} | {record['verdict']} | {said} | {place} | {errors} | {numbers} | "
        f"{record['processor_seconds']:.0f} s, {record['peak_mb']:.0f} MB"
    )


def summary(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> str:
    """Return the table of runs and the rates."""
    rows = [judged(r, t) for r, t in pairs]
    single = [r for r in rows if not r["clean"] and not r["pair"]]
    clean, double = [r for r in rows if r["clean"]], [r for r in rows if r["pair"]]
    placed = [r for r in rows if "place" in r]
    sized = [r["magnitude"] for r in rows if r.get("magnitude")]
    times, peak = [r["processor_seconds"] for r, _ in pairs], max(r["peak_mb"] for r, _ in pairs)

    def rate(name: str, hits: list[bool]) -> str:
        return f"{name}: {sum(hits)} of {len(hits)}"

    return "\n".join([
        *(_line(r, t) for r, t in pairs),
        rate("single effect, right first", [r["first"] for r in single]),
        rate("single effect, right first and explained", [r["explained"] for r in single]),
        rate("place; given the cause", [r["place"] for r in placed]) + "; " + rate("axis", [r["axis"] for r in placed]),
        rate("clean with a cause named", [r["alarm"] for r in clean]),
        rate("two effects exact", [r["exact"] for r in double]) + "; " + rate("first right", [r["first"] for r in double]),
        rate("magnitude inside 2 std", [abs(abs(v) - abs(t)) <= 2.0 * s for t, v, s in sized]),
        f"processor time: median {statistics.median(times):.0f} s, longest {max(times):.0f} s; largest memory {peak:.0f} MB",
    ])  # fmt: skip


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/foreign_diagnosis.jsonl"))
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--summary-only", action="store_true")
    options = parser.parse_args()
    folders = [p.parent for p in sorted(options.folder.glob("*/truth.json")) if not options.only or p.parent.name in options.only]
    if not folders:
        print(f"{options.folder}: no run with a truth.json; nothing to do")
        return
    options.out.parent.mkdir(parents=True, exist_ok=True)
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    records = {r["run"]: r for r in map(json.loads, lines)}
    for folder in folders:
        if folder.name not in records and not options.summary_only:
            records[folder.name] = record = diagnosed(folder)
            with options.out.open("a") as out:
                out.write(json.dumps(record) + "\n")
            print(_line(record, truth_of(folder)), flush=True)
    print(summary([(records[f.name], truth_of(f)) for f in folders if f.name in records]))


if __name__ == "__main__":
    main()
