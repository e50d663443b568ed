# Copyright 2026 ride_estimation contributors
"""Hide one effect after the other in the independent worlds and count what the diagnosis says.

Every case (cause x form x road x seed) is one line of a JSON lines file; a second call skips the lines that exist, so a long
matrix can be stopped, resumed and subsampled. Cases are ordered seed by seed: a short run covers all causes.

    python benchmarks/confusion_matrix.py --per-cause 5 --residual 0.05 --noise 0.02 --clean 20 --out matrix.jsonl
    python benchmarks/confusion_matrix.py --summary-only --out matrix.jsonl
    python benchmarks/confusion_matrix.py --per-cause 2 --leave-one-out --out without.jsonl
    python benchmarks/confusion_matrix.py --per-cause 2 --gain-coverage --out coverage.jsonl
    python benchmarks/confusion_matrix.py --per-cause 1 --copies --out copies.jsonl
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import dataclasses
import itertools
import json
import math
import multiprocessing
import pathlib
import sys
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.stats import beta, norm

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "test"))

from worlds.adapters import stretch, with_gaps
from worlds.effects import CAUSES, OUTSIDE
from worlds.hiding import FORMS
from worlds.scenario import make_scenario
from worlds.store import StoredCase, load_case, save_case

#: where gaps begin, as a share of the run, and how long they are [s]
GAPS = ((0.22, 0.6), (0.41, 1.5), (0.65, 1.0))
QUIET = ("no_discrepancy", "insufficient_data")
ANGLE = {"roll": "x", "pitch": "y", "yaw": "z"}
#: magnitude that a good installation has too -> its tolerance and the factor to the unit that is stated
TOLERATED = {
    "gain error": ("gain", 1.0), "delay": ("delay", 1.0), "offset": ("bias", 1.0), "CG offset": ("cg", 1.0),
    "angle": ("misalignment", math.degrees(1.0)), "position error": ("position", 1.0),
}  # fmt: skip
#: pairs of effects that leave different traces; drawn from by ``--pairs``
PAIR_POOL = (
    "coulomb_friction", "viscoelasticity", "stiffness_nonlinearity", "damping_nonlinearity", "bump_stop",
    "harmonic_disturbance", "sensor_delay", "sensor_gain", "sensor_misalignment", "wrong_sensor_position", "mass_change",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Case:
    """One case: its causes (empty: clean), seed and difficulty."""

    causes: tuple[str, ...]
    seed: int
    residual: float
    noise: float
    duration: float
    form: str | None = None
    without: bool = False  #: the library does not know the planted causes
    installation: float = 0.0  #: errors of all sensors, in standard deviations of a good installation

    @property
    def key(self) -> str:
        """Return what identifies the case in the file of results."""
        name = "+".join(self.causes) or "none"
        installed = f"/{self.installation:g}" if self.installation > 0.0 else ""
        return f"{name}/{self.form or ''}/{self.seed}/{self.residual:g}/{self.noise:g}/{self.duration:g}{installed}"

    @property
    def record_key(self) -> str:
        """Return what identifies the record: one world is diagnosed with and without its cause in the library."""
        return self.key + ("/without" if self.without else "")


def stored_case(case: Case, folder: pathlib.Path) -> StoredCase:
    """Return a case from the folder, making it first where it is missing."""
    path = folder / (case.key.replace("/", "_").replace(":", "-") + ".npz")
    if not path.exists():
        causes = case.causes or ("none",)
        save_case(
            path,
            make_scenario(
                causes, case.seed, residual=case.residual, noise=case.noise, duration=case.duration, form=case.form,
                installation=case.installation, follow=tuple(np.random.default_rng([case.seed, 1]).uniform(0.0, 1.0, 2)),
            ),
        )
    return load_case(path)


def run_case(
    case: Case, folder: pathlib.Path, only_make: bool = False, halves: bool = False, copies: bool = False, late_s: float = 0.0,
    gaps: bool = False,
) -> dict[str, Any]:
    """Make or read the world, diagnose it, return one JSON-ready record."""
    record: dict[str, Any] = {"key": case.record_key, "causes": list(case.causes), "seed": case.seed, "without": case.without}
    record |= {"wanted_residual": case.residual, "noise": case.noise}
    stored = stored_case(case, folder)
    record |= {"planted": stored.facts["planted"], "road": stored.facts["road"]}
    if only_make:
        return record | {"verdict": "made", "found": []}
    from ride_estimation.diagnosis.causes import library
    from ride_estimation.diagnosis.common.settings import Settings
    from ride_estimation.diagnosis.diagnose import diagnose

    run, *validation = (stretch(r, round(late_s * r.rate_hz)) for r in (stored.run, *stored.validation))
    if gaps:
        run, *validation = (
            with_gaps(r, *((at * r.samples / r.rate_hz, at * r.samples / r.rate_hz + length) for at, length in GAPS))
            for r in (run, *validation)
        )
    if halves:
        validation += [half for other in validation for half in _halves(other)]
    known = set(library()) - set(case.causes) if case.without else None
    began, processor = time.perf_counter(), time.process_time()
    try:
        settings = Settings(stability=copies)
        diagnosis = diagnose(stored.vehicle, run, validation=validation, settings=settings, causes=known)
    except Exception as error:  # a crash is a result of the benchmark, and it is counted
        return record | {"verdict": "error", "found": [], "error": f"{type(error).__name__}: {error}"}
    record |= {"seconds": time.perf_counter() - began, "processor_seconds": time.process_time() - processor}
    record["verdict"] = str(getattr(diagnosis.verdict, "value", diagnosis.verdict))
    record["found"] = [
        {
            "id": c.id, "location": c.location, "axis": c.axis, "confidence": float(c.confidence),
            "parameters": [(p.name, float(p.value), float(p.std)) for p in c.parameters],
        }
        for c in diagnosis.causes
    ]  # fmt: skip
    record["sentence"] = str(getattr(diagnosis, "sentence", ""))
    record["gain"] = _jsonable(getattr(diagnosis, "gain", None))
    record["bias"] = _bias(diagnosis, stored)
    stated = {p.name: p for p in getattr(diagnosis, "parameters", ())}
    record["stated_std"] = {
        name: _jsonable(stated[long].std / stated[long].value)
        for name in record["bias"]
        if (long := name.replace(".k", ".stiffness").replace(".c", ".damping")) in stated and stated[long].value > 0.0
    }
    if copies:
        record["copies"] = diagnosis.stability.counts if diagnosis.stability is not None else (0, 0)
    record["warnings"] = [str(w) for w in getattr(diagnosis, "warnings", ())][:5]
    return record


def _halves(run: Any) -> list[Any]:
    """Return both halves of a run: two stretches of one road whose gains are estimated apart."""
    middle = run.samples // 2
    parts = ((0, middle), (middle, run.samples))
    return [stretch(run, *part, f"{run.name}_half_{number}") for number, part in enumerate(parts)]


def _jsonable(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _jsonable(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(k): _jsonable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_jsonable(v) for v in value]
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return str(value)


def _bias(diagnosis: Any, stored: StoredCase) -> dict[str, float]:
    """Return relative errors of the linear k and c of the extended vehicle on axes without a planted law."""
    extended = next((v for n in ("extended", "vehicle") if hasattr(v := getattr(diagnosis, n, None), "mounts")), None)
    if extended is None or stored.facts["drifts"]:
        return {}
    stiffness, damping = np.array(stored.facts["stiffness"]), np.array(stored.facts["damping"])
    hidden = {tuple(pair) for pair in stored.facts["laws"]}  # type: ignore[attr-defined]
    out = {}
    for i, mount in enumerate(stored.vehicle.mount_names):
        for a, axis in enumerate("xyz"):
            element = extended.mounts[mount].elements.get(axis)
            if (i, a) not in hidden and hasattr(element, "stiffness") and hasattr(element, "damping"):
                out[f"{mount}.{axis}.k"] = float(element.stiffness / stiffness[i, a] - 1.0)
                out[f"{mount}.{axis}.c"] = float(element.damping / damping[i, a] - 1.0)
    return out


# --------------------------------------------------------------------------------------------------------------- scoring


def same_place(planted: dict[str, Any], found: dict[str, Any]) -> bool:
    """Return whether location and axis agree; an axis the plant leaves empty is not judged."""
    if planted["location"] != found["location"]:
        return False
    axis = ANGLE.get(found["axis"], found["axis"])
    return not planted["axis"] or axis == planted["axis"]


def tolerated(record: dict[str, Any]) -> bool:
    """Return whether a single effect lies within three standard deviations of a good installation: calibration, not a cause."""
    from ride_estimation.diagnosis.common.settings import Tolerances

    if len(record["causes"]) != 1:
        return False
    sizes = [(TOLERATED[n], abs(v)) for n, v in (record["planted"][0].get("magnitudes") or {}).items() if n in TOLERATED]
    return any(size < 3.0 * factor * getattr(Tolerances(), name) for (name, factor), size in sizes)


def first(record: dict[str, Any]) -> str:
    """Return the cause named first, else the verdict."""
    return record["found"][0]["id"] if record["found"] else record["verdict"]


def _line(name: str, hits: Iterable[bool], target: str) -> str:
    values = list(hits)
    count = len(values)
    if not count:
        return f"{name:78s} no case   target {target}"
    low, high = exact_interval(sum(values), count)
    share = 100.0 * sum(values) / count
    return f"{name:78s} {share:6.1f} % of {count:4d} (95 %: {100 * low:.0f}-{100 * high:.0f})   target {target}"


def confusion(records: list[dict[str, Any]]) -> str:
    """Return the confusion matrix of single effects as text: rows planted, columns named first."""
    rows: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for r in records:
        if len(r["causes"]) <= 1:
            rows[r["causes"][0] if r["causes"] else "none"][first(r)] += 1
    lines = []
    for planted, counts in sorted(rows.items()):
        total = sum(counts.values())
        named = ", ".join(f"{name} {n}" for name, n in counts.most_common())
        lines.append(f"{planted:26s} {counts[planted]:3d}/{total:3d}   {named}")
    return "\n".join(lines)


def confidences(records: list[dict[str, Any]]) -> list[tuple[float, bool]]:
    """Return the stated probability of every named cause and whether it is right."""
    return [
        (f["confidence"], not r.get("without") and f["id"] in r["causes"]) for r in records for f in r["found"]
    ]


def reliability(records: list[dict[str, Any]]) -> list[str]:
    """Return, for bands of stated probability, how many named causes there are, what they promise and how many are right."""
    edges = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
    pairs = confidences(records)
    lines = []
    for low, high in itertools.pairwise(edges):
        inside = [(c, hit) for c, hit in pairs if low < c <= high]
        if inside:
            stated, hits = float(np.mean([c for c, _ in inside])), sum(hit for _, hit in inside)
            bounds = exact_interval(hits, len(inside))
            lines.append(
                f"  stated {100 * low:3.0f}-{100 * high:3.0f} %: {len(inside):4d} causes, on average {100 * stated:5.1f} % "
                f"promised, {100 * hits / len(inside):5.1f} % right (95 %: {100 * bounds[0]:.0f}-{100 * bounds[1]:.0f})"
            )
    return lines


def gains_agree(record: dict[str, Any]) -> bool | None:
    """Return whether the gains on two stretches of the other road differ by no more than their intervals say, None without.

    Both intervals are to hold 95 %; the difference of the two independent estimates then lies within the root of the sum of the
    squared half widths in 95 %, whatever the true gain is.
    """
    rows = (record.get("gain") or {}).get("validation") or []
    halves = [r for r in rows if "_half_" in r["run"]][:2]
    if len(halves) < 2 or not record["found"]:
        return None
    gains = []
    for row in halves:
        gain, (low, high) = row["baseline"] - row["extended"], row["ci95"]
        gains.append((gain, low, high))
    first, second = sorted(gains)
    return bool(second[0] - first[0] <= math.hypot(first[2] - first[0], second[0] - second[1]))


def calibration_error(records: list[dict[str, Any]], bins: int = 10) -> tuple[float, int]:
    """Return the expected calibration error of the confidence of the cause named first, and the number of cases."""
    pairs = [(r["found"][0]["confidence"], r["found"][0]["id"] in r["causes"]) for r in records if r["found"]]
    if not pairs:
        return math.nan, 0
    confidence, hit = np.array(pairs, float).T
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    error = sum(np.sum(index == b) * abs(confidence[index == b].mean() - hit[index == b].mean()) for b in set(index))
    return float(error / len(pairs)), len(pairs)


def removed_share(record: dict[str, Any]) -> float | None:
    """Return the share of the removable residual that the extension removed on the validation road, None where not stated."""
    gain = record.get("gain") or {}
    rows = gain.get("validation") or []
    if not rows:
        return None
    baseline, extended = rows[0].get("baseline"), rows[0].get("extended")
    floor = rows[0].get("noise_floor", gain.get("noise_floor"))
    if None in (baseline, extended, floor) or baseline**2 <= 1.2 * floor**2:
        return None
    return float((baseline**2 - extended**2) / (baseline**2 - floor**2))


def described_as_well(record: dict[str, Any], records: list[dict[str, Any]]) -> bool:
    """Return whether another cause describes the other road as well, to a tenth, as the one that was left out does.

    That is another description and not an unknown effect. Told where the same world was diagnosed with its cause in the library.
    """
    twin = next((r for r in records if f"{r['key']}/without" == record["key"]), None)
    pair = [r for r in (record, twin) if r is not None and r["found"] and (r.get("gain") or {}).get("validation")]
    extended = [r["gain"]["validation"][0]["extended"] for r in pair]
    return len(extended) == 2 and extended[0] <= 1.1 * extended[1]


def magnitudes(record: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """Return name, true size, stated size and its standard deviation of what the right causes of a record state."""
    out = []
    for planted in record.get("planted", ()):
        found = next((f for f in record["found"] if f["id"] == planted["cause"] and same_place(planted, f)), None)
        for part, true in (planted.get("magnitudes") or {}).items() if found is not None else ():
            stated = [(abs(value), std) for name, value, std in found.get("parameters", ()) if name.startswith(part)]
            if stated:
                value, std = min(stated, key=lambda s: abs(s[0] - abs(true)))
                out.append((f"{planted['cause']}: {part}", abs(true), value, std))
    return out


def _magnitude_lines(records: list[dict[str, Any]]) -> list[str]:
    """Return how many stated magnitudes lie within two of their standard deviations, all and by name."""
    found = [m for r in records for m in magnitudes(r)]
    inside = (abs(v - t) <= 2.0 * s for _, t, v, s in found)
    lines = [_line("magnitudes within two stated standard deviations", inside, ">= 90 %")]
    for name in sorted({m[0] for m in found}):
        own = [((v - t) / s, s / t) for n, t, v, s in found if n == name and s > 0.0 and t > 0.0]
        hits = sum(abs(z) <= 2.0 for z, _ in own)
        rms = math.sqrt(sum(z * z for z, _ in own) / max(len(own), 1))
        spread = float(np.median([r for _, r in own])) if own else math.nan
        lines.append(f"  {name:60s} {hits:3d}/{len(own):3d}, error over std rms {rms:5.2f}, std {100 * spread:5.1f} %")
    return lines


def _biases(records: list[dict[str, Any]], axes: str, kinds: str = "kc") -> list[float]:
    return [
        abs(v) for r in records for name, v in r.get("bias", {}).items() if name.split(".")[1] in axes and name[-1] in kinds
    ]


def _noise_limits(records: list[dict[str, Any]], axes: str, kind: str) -> list[float]:
    """Return absolute errors that normal errors of the stated standard deviations would show, nine quantiles of each."""
    quantiles = norm.ppf(0.5 + 0.5 * np.linspace(0.1, 0.9, 9))
    return [
        float(std * z)
        for r in records
        for name, std in r.get("stated_std", {}).items()
        if std is not None and name.split(".")[1] in axes and name[-1] == kind
        for z in quantiles
    ]


def _within(records: list[dict[str, Any]], axes: str) -> list[bool]:
    """Return for every stated standard deviation whether the truth lies within two of it."""
    return [
        abs(r["bias"][name]) <= 2.0 * std
        for r in records
        for name, std in r.get("stated_std", {}).items()
        if std is not None and name.split(".")[1] in axes
    ]


def exact_interval(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Return the exact binomial interval (Clopper, Pearson 1934) of a rate."""
    tail = 0.5 * (1.0 - level)
    low = float(beta.ppf(tail, hits, count - hits + 1)) if hits else 0.0
    return low, float(beta.ppf(1.0 - tail, hits + 1, count - hits)) if hits < count else 1.0


def summary(records: list[dict[str, Any]]) -> str:
    """Return all figures of the table of targets that the records allow."""
    without = [r for r in records if r.get("without")]
    every, records = records, [r for r in records if not r.get("without")]
    small = [r for r in records if tolerated(r)]
    records = [r for r in records if not tolerated(r)]
    single = [r for r in records if len(r["causes"]) == 1 and not r["causes"][0].startswith("outside:")]
    clean = [r for r in records if not r["causes"]]
    outside = [r for r in records if r["causes"] and r["causes"][0].startswith("outside:")]
    pairs = [r for r in records if len(r["causes"]) == 2]
    lines = [confusion(records), ""]
    levels = sorted({(r["wanted_residual"], r["noise"]) for r in single}, reverse=True)
    for residual, noise in levels:
        at = [r for r in single if (r["wanted_residual"], r["noise"]) == (residual, noise)]
        target = ">= 95 %" if residual >= 0.05 else ">= 85 %"
        lines.append(
            _line(f"right cause first, residual {residual:g}, noise {noise:g}", (first(r) == r["causes"][0] for r in at), target)
        )
    calibrated = (first(r) in (*QUIET, r["causes"][0]) for r in small)
    lines.append(_line("effects within three standard deviations of a good installation: calibrated or named", calibrated, "all"))
    right = [r for r in single if first(r) == r["causes"][0]]
    named = (f["id"] in r["causes"] for r in single for f in r["found"])
    lines.append(_line("single effects: named causes that are right", named, ">= 95 %"))
    lines.append(
        _line(
            "place and axis right, given the right cause", (same_place(r["planted"][0], r["found"][0]) for r in right), ">= 90 %"
        )
    )
    lines.append(_line("false alarms on clean runs", (r["verdict"] not in QUIET for r in clean), "<= 1 %"))
    lines.append(_line("clean runs called unexplained", (r["verdict"] == "unexplained" for r in clean), "<= 1 %"))
    lines.append(_line("outside the library called unexplained", (r["verdict"] == "unexplained" for r in outside), ">= 90 %"))
    if without:
        told = [r for r in without if not described_as_well(r, records)]
        for name, chosen in (("left out of the library", without), ("  those that no other cause describes as well", told)):
            lines.append(_line(f"{name}: called unexplained", (r["verdict"] == "unexplained" for r in chosen), ">= 90 %"))
        sure = (any(f["confidence"] > 0.9 for f in r["found"]) for r in without)
        lines.append(_line("left out of the library: another cause named at more than 90 %", sure, "few"))
    lines.append(_line("listed effects called unexplained", (r["verdict"] == "unexplained" for r in single), "<= 5 %"))
    sets = [({f["id"] for f in r["found"]}, set(r["causes"])) for r in pairs]
    lines.append(_line("two effects: exact set", (a == b for a, b in sets), ">= 85 %"))
    lines.append(_line("two effects: precision", (f in b for a, b in sets for f in a), ">= 95 %"))
    lines += _magnitude_lines(records)
    shares = [s for r in right if (s := removed_share(r)) is not None]
    rows = [("removable residual removed on the other road, median", shares, 0.5, ">= 80 %")]
    for name, axes in (("vertical", "z"), ("horizontal", "xy")):
        rows.append((f"k and c bias after extension, {name}, 90th percentile", _biases(right, axes), 0.9, "<= 2 %"))
        for quantity, letter in (("stiffness", "k"), ("damping", "c")):
            rows.append((f"  of it {quantity}", _biases(right, axes, letter), 0.9, "-"))
            rows.append((f"  what the noise alone makes of {quantity}", _noise_limits(right, axes, letter), 0.9, "-"))
    agree = [a for r in records if (a := gains_agree(r)) is not None]
    if agree:
        lines.append(_line("gains on two stretches of the other road agree within their 95 % intervals", agree, "92-98 %"))
    for name, values, pick, target in rows:
        if values:
            lines.append(f"{name:78s} {100 * np.quantile(values, pick):6.1f} % of {len(values):4d}   target {target}")
    for name, axes in (("vertical", "z"), ("horizontal", "xy")):
        lines.append(_line(f"k and c within two stated standard deviations, {name}", _within(right + clean, axes), "about 95 %"))
    copies = [n < r["copies"][0] for r in every if "copies" in r for n in range(r["copies"][1])]
    if copies:
        lines.append(_line("perturbed copies of a run that give the same answer", copies, ">= 98 %"))
    error, count = calibration_error(records)
    lines.append(f"{'expected calibration error of the stated confidence':78s} {error:8.3f} of {count:4d}   target <= 0.05")
    lines += reliability(every)
    seconds = [r["seconds"] for r in records if "seconds" in r]
    if seconds:
        lines.append(
            f"{'time per diagnosis, median and longest':78s} {np.median(seconds):6.1f} s, {max(seconds):.1f} s   target <= 60 s"
        )
    busy = [r["processor_seconds"] for r in records if "processor_seconds" in r]
    if busy:
        lines.append(f"{'processor time per diagnosis, median and longest':78s} {np.median(busy):6.1f} s, {max(busy):.1f} s")
    crashed = [r for r in every if r["verdict"] == "error"]
    for r in crashed[:5]:
        lines.append(f"ERROR {r['key']}: {r['error']}")
    return "\n".join(lines)


def misses(records: list[dict[str, Any]]) -> str:
    """Return one line per wrong answer, for those who improve the diagnosis."""
    lines = []
    for r in records:
        named = [(f["id"], f["location"], f["axis"], round(f["confidence"], 3)) for f in r["found"]]
        planted = [
            (p["cause"], p["location"], p["axis"], p["form"], f"{p['size']:.3g}", f"{p['residual']:.3f}")
            for p in r.get("planted", [])
        ]
        if not r["causes"]:
            wrong = bool(named) or r["verdict"] != "no_discrepancy"
        elif r["causes"][0].startswith("outside:") or r.get("without"):
            wrong = r["verdict"] != "unexplained"
        elif len(r["causes"]) == 1:
            wrong = first(r) != r["causes"][0] or not same_place(r["planted"][0], r["found"][0])
        else:
            wrong = {f["id"] for f in r["found"]} != set(r["causes"])
        if wrong:
            lines.append(f"seed {r['seed']} road {r.get('road')} planted {planted} -> {r['verdict']} {named}")
    return "\n".join(lines)


# ----------------------------------------------------------------------------------------------------------------- running


def cases(arguments: argparse.Namespace) -> list[Case]:
    """Return the cases of a call, seed by seed."""
    causes = arguments.causes.split(",") if arguments.causes else list(CAUSES)
    common, installed = (arguments.residual, arguments.noise, arguments.duration), arguments.installation
    out = []
    most = max(arguments.per_cause, arguments.clean, arguments.pairs, arguments.outside)
    for n in range(most):
        seed = arguments.first_seed + n
        if n < arguments.per_cause:
            for cause in causes:
                forms = FORMS.get(cause, (None,))
                # a soft mount is told from the other mounts and not by a hypothesis of the library
                if not (arguments.leave_one_out and cause == "one_soft_mount"):
                    form, without = forms[n % len(forms)], arguments.leave_one_out
                    out.append(Case((cause,), seed, *common, form=form, without=without, installation=installed))
        if n < arguments.clean:
            out.append(Case((), seed, *common, installation=installed))
        if n < arguments.outside:
            out += [Case((f"outside:{name}",), seed, *common, installation=installed) for name in OUTSIDE]
        if n < arguments.pairs:
            rng = np.random.default_rng([seed, 5])
            pair = tuple(str(c) for c in rng.choice(PAIR_POOL, 2, replace=False))
            out.append(Case(pair, seed, *common, installation=installed))
    return out


def main() -> None:
    """Run the cases that are missing and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--per-cause", type=int, default=0, help="cases per cause, forms in turn")
    parser.add_argument("--causes", default="", help="comma-separated ids; default: all nineteen")
    parser.add_argument("--clean", type=int, default=0)
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--outside", type=int, default=0, help="cases per effect outside the library")
    parser.add_argument("--residual", type=float, default=0.05)
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--installation", type=float, default=0.0, help="errors of all sensors, in standard deviations")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--limit-s", type=float, default=math.inf, help="start no new case after this many seconds")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/confusion_matrix.jsonl"))
    parser.add_argument("--cases", type=pathlib.Path, default=pathlib.Path("out/cases"), help="folder of made cases")
    parser.add_argument("--leave-one-out", action="store_true", help="single effects with their cause taken out of the library")
    parser.add_argument("--gain-coverage", action="store_true", help="measure the gain on both halves of the other road as well")
    parser.add_argument("--copies", action="store_true", help="repeat every answer on perturbed copies of its run")
    parser.add_argument("--late-s", type=float, default=0.0, help="leave out the first seconds of every run: the body moves then")
    parser.add_argument("--gaps", action="store_true", help="silence all sensors three times in every run, 0.6 to 1.5 s")
    parser.add_argument("--only-make", action="store_true", help="fill the folder of cases and stop")
    parser.add_argument("--summary-only", action="store_true")
    arguments = parser.parse_args()
    records = [json.loads(line) for line in arguments.out.read_text().splitlines()] if arguments.out.exists() else []
    if not arguments.summary_only:
        done = {r["key"] for r in records}
        todo = [c for c in cases(arguments) if c.record_key not in done]
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        began = time.perf_counter()
        context = multiprocessing.get_context("spawn")
        with (
            arguments.out.open("a", encoding="utf-8") as file,
            concurrent.futures.ProcessPoolExecutor(arguments.processes, mp_context=context) as pool,
        ):
            waiting: set[concurrent.futures.Future[dict[str, Any]]] = set()
            queue = iter(todo)
            finished = 0
            while True:
                while len(waiting) < arguments.processes and time.perf_counter() - began < arguments.limit_s:
                    case = next(queue, None)
                    if case is None:
                        break
                    asked = arguments.only_make, arguments.gain_coverage, arguments.copies, arguments.late_s, arguments.gaps
                    waiting.add(pool.submit(run_case, case, arguments.cases, *asked))
                if not waiting:
                    break
                ready, waiting = concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in ready:
                    record = future.result()
                    if not arguments.only_make:
                        records.append(record)
                        file.write(json.dumps(record) + "\n")
                        file.flush()
                    finished += 1
                    news = f"\r{finished}/{len(todo)} {record['key']} -> {first(record)}"
                    print(news.ljust(110), end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
    if arguments.only_make:
        return
    print(summary(records))
    print("\nWrong answers:")
    print(misses(records))


if __name__ == "__main__":
    main()
