# Copyright 2026 ride_estimation contributors
"""Before and after: what changed between two replays, or between two diagnoses, in standard deviations."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from scipy import special

from ride_estimation.io.run_metrics import Metric, run_metrics
from ride_estimation.reporting.numbers import plain, with_std
from ride_estimation.reporting.page import Page

#: probability that chance alone calls anything in a comparison changed
FALSE_ALARM = 0.01
_NO_CHANGE = ("duration", "warnings", "valid ticks")
_NAMED = 6


@dataclasses.dataclass(frozen=True)
class Difference:
    """One number of two runs.

    Attributes
    ----------
    before, after
        The number in both.
    deviations
        ``(after - before) / sqrt(std_before^2 + std_after^2)``; None where it is not sure in both, or has no standard deviation.
        What both share (gain errors of the same sensors) cancels in the difference, so that this is cautious.
    changed
        Whether that is more than chance makes of any of the numbers compared.
    """

    before: Metric
    after: Metric
    deviations: float | None
    changed: bool = False

    @property
    def share(self) -> float:
        """Return the relative difference, not finite where the number was zero."""
        return (self.after.value - self.before.value) / abs(self.before.value) if self.before.value else math.inf

    @property
    def in_std(self) -> str:
        """Return the difference in standard deviations as it is read, without a sign where it is none."""
        tenths = 0.0 if self.deviations is None else round(self.deviations, 1)
        return f"{tenths:+.1f}" if tenths else "0.0"

    def words(self) -> str:
        """Return it in words."""
        share = f" ({100 * self.share:+.3g} %)" if math.isfinite(self.share) else ""
        far = "" if self.deviations is None else f", {self.in_std} std"
        return f"{self.before.name} {plain(self.before.value)} -> {plain(self.after.value)} {self.before.unit}{share}{far}"


def differences(before: Mapping[str, Metric], after: Mapping[str, Metric]) -> list[Difference]:
    """Return the difference of every number that both runs have, the surest change first.

    Changed is what exceeds the two-sided limit of ``FALSE_ALARM`` shared among all numbers that can be judged (Bonferroni).

    Parameters
    ----------
    before, after
        Numbers by name.
    """
    found = []
    for name in (name for name in before if name in after and name not in _NO_CHANGE):
        old, new = before[name], after[name]
        spread = math.hypot(old.std or 0.0, new.std or 0.0)
        judged = old.sure and new.sure and old.std is not None and new.std is not None and spread > 0.0
        found.append(Difference(old, new, (new.value - old.value) / spread if judged else None))
    tests = sum(d.deviations is not None for d in found)
    limit = -float(special.ndtri(0.5 * FALSE_ALARM / max(tests, 1)))
    marked = [dataclasses.replace(d, changed=d.deviations is not None and abs(d.deviations) > limit) for d in found]
    return sorted(marked, key=lambda d: -abs(d.deviations or 0.0))


def verdict(found: Sequence[Difference], names: Sequence[str]) -> str:
    """Return what changed in one sentence; ``names`` are those of the parameters of the vehicle, the rest are loads."""
    parts = []
    for what, own in (
        ("parameters", [d for d in found if d.before.name in names]), ("loads", [d for d in found if d.before.name not in names])
    ):  # fmt: skip
        judged, changed = [d for d in own if d.deviations is not None], [d for d in own if d.changed]
        if changed:
            more = f"; and {len(changed) - _NAMED} more" if len(changed) > _NAMED else ""
            listed = "; ".join(d.words() for d in changed[:_NAMED])
            parts.append(f"{len(changed)} of {len(judged)} {what} changed: {listed}{more}")
        elif judged:
            parts.append(f"none of {len(judged)} {what} changed beyond chance (largest: {judged[0].words()})")
        elif own:
            parts.append(f"no {what} are sure enough in both runs to be compared")
    return ". ".join(parts) + "."


def add_differences(page: Page, found: Sequence[Difference], names: tuple[str, str]) -> None:
    """Add the table of differences to a page; ``names`` are those of the two runs."""
    page.text(
        "Differences in standard deviations of both together; "
        f"changed: beyond what chance makes of any number with {100 * FALSE_ALARM:g} % probability."
    )
    rows = [
        [d.before.name, d.before.unit, _value(d.before), _value(d.after),
         f"{100 * d.share:+.3g}" if math.isfinite(d.share) else "", "" if d.deviations is None else d.in_std,
         "changed" if d.changed else "" if d.deviations is not None else "not judged"]
        for d in found
    ]  # fmt: skip
    page.table(["quantity", "unit", *names, "difference [%]", "in std [-]", ""], rows)


def _value(metric: Metric) -> str:
    text = plain(metric.value) if metric.std is None else " ± ".join(with_std(metric.value, metric.std))
    return text if metric.sure else f"({text})"


def replay_differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[list[Difference], str]:
    """Return the differences of two replays, contents of ``result.json``, and the sentence."""
    found = differences(run_metrics(before), run_metrics(after))
    names = [str(p["name"]) for result in (before, after) for p in result.get("parameters", ())]
    return found, verdict(found, names)


def diagnoses_page(names: tuple[str, str], before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[Page, list[str]]:
    """Return the page that compares two diagnoses, and what it says in sentences.

    Parameters
    ----------
    names
        Of the two.
    before, after
        Contents of ``diagnosis.json``.
    """
    page = Page(f"{names[0]} against {names[1]}")
    causes = [{_place(cause): cause for cause in document.get("causes", ())} for document in (before, after)]
    gone, new = [c for c in causes[0] if c not in causes[1]], [c for c in causes[1] if c not in causes[0]]
    kept = [c for c in causes[0] if c in causes[1]]
    said = [f"{words}: {', '.join(own)}" for words, own in (("gone", gone), ("new", new), ("in both", kept)) if own]
    numbers = [_metrics(document, kept, own) for document, own in zip((before, after), causes)]
    found = differences(*numbers)
    sentences = [f"Causes {'; '.join(said)}." if said else "No cause is named in either.", verdict(found, list(numbers[0]))]
    page.verdict(" ".join(sentences))
    page.heading("Verdicts")
    page.table(["diagnosis", "recording", "verdict", "statement"], [
        [name, str(d.get("run", {}).get("path", "")), str(d.get("verdict", "")), str(d.get("sentence", ""))]
        for name, d in zip(names, (before, after))
    ])  # fmt: skip
    vehicles = {str(d.get("vehicle", {}).get("checksum", "")) for d in (before, after)}
    if len(vehicles) > 1:
        page.warning("The vehicle files differ: a cause may be gone because the file has it by now.")
    gains = [[name, *(_percent((d.get("gain") or {}).get(key)) for key in ("baseline", "extended", "noise_floor"))]
             for name, d in zip(names, (before, after))]  # fmt: skip
    page.heading("Error of the model")
    page.table(["diagnosis", "calibrated model [%]", "with its causes [%]", "noise floor [%]"], gains)
    page.heading("Numbers")
    add_differences(page, found, names)
    return page, sentences


def _place(cause: Mapping[str, Any]) -> str:
    where = " ".join(str(cause.get(key) or "") for key in ("location", "axis")).strip()
    return f"{str(cause.get('id', '')).replace('_', ' ')}{f' at {where}' if where else ''}"


def _metrics(document: Mapping[str, Any], kept: Sequence[str], causes: Mapping[str, Mapping[str, Any]]) -> dict[str, Metric]:
    """Return the parameters of the model and of the causes that both name."""
    listed = [("", p) for p in document.get("parameters", ())]
    listed += [(f"{place}: ", p) for place in kept for p in causes[place].get("parameters", ())]
    return {
        f"{where}{p['name']}": Metric(
            f"{where}{p['name']}", float(p["value"]), None if p.get("std") is None else float(p["std"]), str(p["unit"]),
            p.get("status", "valid") == "valid",
        )
        for where, p in listed if p.get("value") is not None
    }  # fmt: skip


def _percent(value: Any) -> str:
    return "" if value is None else f"{100 * float(value):.3g}"
