# Copyright 2026 ride_estimation contributors
"""``ride-estimation demo``: the bundled recordings through replay and diagnosis, compared with what is true."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.api import diagnosing as api
from ride_estimation.api.runs import read_run
from ride_estimation.assessment.truth import SignalScore, at_times, score
from ride_estimation.cli import main as command
from ride_estimation.cli.diagnose import STAGES
from ride_estimation.cli.progress import Progress
from ride_estimation.diagnosis.common.wording import title
from ride_estimation.errors import RideEstimationError
from ride_estimation.io.results import output_folder
from ride_estimation.io.run_metrics import best_parameters
from ride_estimation.reporting.demo_report import force_figure, write_demo_report
from ride_estimation.reporting.diagnosis_report import Truth
from ride_estimation.reporting.numbers import plain, reading_unit, with_std
from ride_estimation.reporting.page import Digits, is_number
from ride_estimation.resources import shared_path
from ride_estimation.units import split_suffix

Array = NDArray[np.float64]
Row = tuple[object, ...]

#: the estimator has this long to settle before forces are judged [s]
SETTLE_S = 10.0
WINDOW_S = (12.0, 17.0)
AXES = ("x", "y", "z")
_GAIN = "error on another road"


def run(options: argparse.Namespace) -> int:
    """Run the demonstration."""
    started = time.monotonic()
    out = output_folder(options.out)
    run_folder = recorded("nominal", out)
    vehicle = shared_path("config", "vehicles", "truck_cab.yaml")
    print("1. A recorded drive of 30 s goes through the estimator that also runs live.")
    print("   The mounts of the truck differ from the vehicle file by up to 20 %; the estimator has the file only.\n", flush=True)
    quietly(["replay", str(run_folder / "bag"), "--vehicle", str(vehicle), "--out", str(out / "replay")])
    found = Comparison.of(out / "replay", run_folder)
    # what the run determines first
    parameters = [as_read(row) for row in sorted(found.parameter_rows(), key=lambda row: row[-1] != "valid")]
    forces: list[Row] = [(*row[:2], *(Digits(f"{float(str(v)):.1f}") for v in row[2:])) for row in found.force_rows()]
    print(text_table(PARAMETER_HEAD, parameters), "\n")
    print(text_table(FORCE_HEAD, forces), "\n")
    print(found.verdict(), "\n", flush=True)
    links = {"replay in detail": "replay/report.html"}
    verdict = found.verdict()
    tables: dict[str, tuple[Sequence[str], Sequence[Row]]] = {
        "Mount parameters": (PARAMETER_HEAD, parameters),
        f"Mount forces after {SETTLE_S:g} s": (FORCE_HEAD, forces),
    }
    if "diagnose" in command.verb_helps() and not options.no_diagnosis:
        head, rows, sentence = diagnose(out, vehicle)
        print(text_table(head, rows), "\n")
        print(sentence, "\n")
        tables["Diagnosis of a run with a hidden effect"] = (head, rows)
        links["diagnosis in detail"] = "diagnosis/report.html"
        verdict = f"{verdict} {hidden_effect(rows)}"
    vertical = [signal[:, :, 2] for signal in (found.true, found.force, found.std)]
    figure = force_figure(found.time_s, found.mounts, vertical[0], vertical[1], vertical[2], WINDOW_S)
    write_demo_report(out / "report.html", verdict, tables, figure, NOTES, links)
    print(f"written: {out / 'report.html'} and beside it {', '.join(links.values())} ({time.monotonic() - started:.0f} s)")
    return 0


PARAMETER_HEAD = ("parameter", "vehicle file", "true", "found", "std", "error [%]", "error live [%]", "unit", "status")
FORCE_HEAD = ("mount", "axis", "NRMSE [%]", "error rms [N]", "within 2 std [%]", "NRMSE live [%]")
NOTES = (
    "NRMSE is the rms of the error over the standard deviation of the true force. The column 'within 2 std' says whether the "
    "stated uncertainty was honest: about 95 % is right.",
    "Forces of a recording are smoothed and parameters estimated from the whole run at once. The columns 'live' are what the "
    "node publishes.",
    "Run and truth are simulated: what is said about absolute forces rests on simulated runs, not on a truck with load cells.",
)


def recorded(name: str, out: Path) -> Path:
    """Return the folder of a bundled run; an installed package has only its recipe, from which the run is simulated."""
    folder = shared_path("bags", name)
    if (folder / "truth.json").is_file():
        return folder
    made = out / "recordings" / name
    if not (made / "truth.json").is_file():
        print(f"   (the recording {name} is simulated from its recipe first)\n", flush=True)
        quietly(["simulate", str(folder / "recipe.yaml"), "--out", str(made)])
    return made


def quietly(arguments: list[str]) -> str:
    """Run another verb without its text; return the text.

    Raises
    ------
    RideEstimationError
        The verb failed; it has printed why.
    """
    captured = io.StringIO()
    with contextlib.redirect_stdout(captured):
        code = command.main(arguments)
    if code != 0:
        raise RideEstimationError(f"the step {arguments[0]!r} ended with exit code {code}; its message is above")
    return captured.getvalue()


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Result of a replay beside the truth of the run.

    Attributes
    ----------
    result, truth
        ``result.json`` and ``truth.json``.
    time_s
        Shape (N,).
    mounts
        Names, M of them.
    force, std, true
        Shape (N, M, 3) [N]: the best estimate of the replay, smoothed where available.
    live
        The estimate as the node publishes it, shape (N, M, 3) [N].
    """

    result: Mapping[str, Any]
    truth: Mapping[str, Any]
    time_s: Array
    mounts: tuple[str, ...]
    force: Array
    std: Array
    true: Array
    live: Array

    @classmethod
    def of(cls, replayed: Path, run_folder: Path) -> Comparison:
        """Read both folders."""
        result = json.loads((replayed / "result.json").read_text(encoding="utf-8"))
        truth = json.loads((run_folder / "truth.json").read_text(encoding="utf-8"))
        with np.load(replayed / "signals.npz") as signals, np.load(run_folder / "truth.npz") as true:
            mounts = tuple(str(name) for name in signals["mount_names"])
            order = [list(true["mount_names"]).index(name) for name in mounts]
            stamps = truth["start_stamp_ns"] + np.round(true["time_s"] * 1e9).astype(np.int64)
            inside = (signals["stamp_ns"] >= stamps[0]) & (signals["stamp_ns"] <= stamps[-1])
            force = at_times(signals["stamp_ns"][inside], stamps, true["mount_force"][:, order])
            best = "mount_force_smoothed" if "mount_force_smoothed" in signals else "mount_force"
            return cls(
                result, truth, signals["time_s"][inside], mounts, signals[best][inside], signals[f"{best}_std"][inside], force,
                signals["mount_force"][inside],
            )  # fmt: skip

    def parameter_rows(self) -> list[Row]:
        """Return one row per estimated parameter that has a true value, the best there is of it."""
        true = true_parameters(self.truth)
        rows: list[Row] = []
        for p, live in zip(best_parameters(self.result), self.result["parameters"], strict=True):
            name = live["name"]
            if name in true and live["value"] is not None:
                errors = [round(100.0 * (e["value"] / true[name] - 1.0), 1) for e in (p, live)]
                value, std = (float(text) for text in with_std(p["value"], p["std"]))
                rows.append((name, p["prior"], true[name], value, std, *errors, p["unit"], p["status"]))
        return rows

    def scores(self, live: bool = False) -> dict[tuple[str, str], SignalScore]:
        """Return the score of every mount force after the settling time, the best there are or as live."""
        late = self.time_s >= SETTLE_S
        force = self.live if live else self.force
        return {
            (mount, axis): score(self.true[late, i, a], force[late, i, a], self.std[late, i, a])
            for i, mount in enumerate(self.mounts)
            for a, axis in enumerate(AXES)
        }

    def force_rows(self) -> list[Row]:
        """Return one row per mount and axis."""
        live = self.scores(live=True)
        return [
            (m, a, 100.0 * s.nrmse, s.rms_error, 100.0 * s.coverage, 100.0 * live[m, a].nrmse)
            for (m, a), s in self.scores().items()
        ]

    def verdict(self) -> str:
        """Return the result in one sentence."""
        both = self.scores(), self.scores(live=True)
        vertical, live_vertical = (max(s.nrmse for (_, axis), s in scores.items() if axis == "z") for scores in both)
        sideways, live_sideways = (max(s.nrmse for (_, axis), s in scores.items() if axis != "z") for scores in both)
        errors = [abs(float(str(row[5]))) for row in self.parameter_rows() if str(row[0]).endswith(".z.stiffness")]
        return (
            f"Smoothed mount forces are right within {100 * vertical:.1f} % (vertical) and {100 * sideways:.1f} % "
            f"(horizontal) NRMSE on the worst mount, live within {100 * live_vertical:.1f} % and {100 * live_sideways:.1f} %; "
            f"vertical stiffness within {max(errors):.1f} %."
        )


def diagnose(out: Path, vehicle: Path) -> tuple[Sequence[str], list[Row], str]:
    """Diagnose the bundled run with a hidden effect; return a table and the sentence that compares it with the truth."""
    hidden, second = recorded("hidden_friction", out), recorded("hidden_friction_validation", out)
    document = json.loads((hidden / "truth.json").read_text(encoding="utf-8"))
    known = true_parameters(document)
    # the diagnosis calls the level of a friction so, whatever its law
    known |= {f"{name} level": value for name, value in known.items() if name.endswith(".friction")}
    print("2. A second truck behaves differently from the linear simulation. What is it?\n", flush=True)
    with Progress("diagnose", shares=STAGES) as progress:
        progress.begin("reading")
        runs = [read_run(folder / "bag", vehicle) for folder in (hidden, second)]
        progress.begin("searching for causes")
        found = api.diagnose(runs[0], runs[1:], report=progress.reach)
        progress.begin("report")
        found.save(out / "diagnosis", truth=Truth(document["description"], known))
    answer = found.answer
    rows: list[Row] = [("verdict", answer.verdict, "", "")]
    for cause in answer.causes:
        for p in cause.parameters:
            true = known.get(f"{cause.location}.{cause.axis}.{p.name}")
            value = " ± ".join(with_std(p.value, p.std))
            what = f"{title(cause.id, cause.location, cause.axis)}: {p.name}"
            rows.append((what, f"{value} {p.unit}", "" if true is None else f"{plain(true)} {p.unit}", f"{cause.confidence:.0%}"))
    for gain in answer.gain.validation if answer.gain else ():
        floor = f"noise floor {100.0 * gain.noise_floor:.1f} %"
        rows.append((_GAIN, f"{100.0 * gain.baseline:.1f} % to {100.0 * gain.extended:.1f} %", "", floor))
    measure = f"\nError: {answer.gain.metric}." if answer.gain else ""
    return ("what", "found", "true", "how sure"), rows, f"The truth: {document['description']}.{measure}"


def hidden_effect(rows: Sequence[Row]) -> str:
    """Return what the diagnosis found beside what is true, in one sentence, from its table."""
    found = [f"{what}: {value} (true: {true})" for what, value, true, _ in rows if true]
    gains = [f"error on another road {value}" for what, value, _, _ in rows if what == _GAIN]
    words = "; ".join([*(found or ["not named"]), *gains])
    return f"Hidden effect of a second run: {words}."


def true_parameters(truth: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters a run was simulated with, by the names the estimator uses, SI."""
    found = {f"{name}.mass": float(body["mass_kg"]) for name, body in truth["parameters"]["bodies"].items()}
    for mount, axes in truth["parameters"]["mounts"].items():
        for axis, element in axes.items():
            for part in element.get("elements", [element]):
                for key, value in part.items():
                    if isinstance(value, (int, float)):
                        name, _, factor = split_suffix(key)
                        found[f"{mount}.{axis}.{name}"] = float(value) * factor
    return found


def as_read(row: Row) -> Row:
    """Return a row of :meth:`Comparison.parameter_rows` in the units people read, with the digits the std leaves."""
    name, prior, known, value, std, error, live, unit, status = row
    shown_unit, factor = reading_unit(str(unit))
    prior, known, value, std = (factor * float(str(v)) for v in (prior, known, value, std))
    errors = [Digits(f"{float(str(e)) + 0.0:.1f}") for e in (error, live)]
    return (name, prior, known, *map(Digits, with_std(value, std)), *errors, shown_unit, status)


def text_table(head: Sequence[str], rows: Sequence[Row]) -> str:
    """Return a table for a terminal: numbers without powers of ten, columns aligned."""
    cells = [list(head)] + [[plain(v, 5) if isinstance(v, float) else str(v) for v in row] for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    numeric = [bool(rows) and is_number(rows[0][i]) for i in range(len(head))]
    lines = []
    for row in cells:
        padded = (c.rjust(w) if n else c.ljust(w) for c, w, n in zip(row, widths, numeric, strict=True))
        lines.append("  ".join(padded).rstrip())
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])
