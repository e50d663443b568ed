# Copyright 2026 ride_estimation contributors
"""Which run stands out among several, in which number."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ride_estimation.io.run_metrics import Metric
from ride_estimation.reporting.numbers import plain

#: distance from the median of the runs, in robust standard deviations and at least in own ones, that is pointed out
OUTLIER = 4.0
#: least relative distance that matters to anybody
SMALLEST_SHARE = 0.02
LEAST_RUNS = 3
#: how long a run is and how many warnings it has is read from the list of runs: neither is a number of the vehicle
_NO_FINDING = ("duration", "warnings")


@dataclasses.dataclass(frozen=True)
class Outlier:
    """One number of one run far from those of the others."""

    run: str
    metric: Metric
    median: float
    runs: int

    def sentence(self) -> str:
        """Return it in words."""
        unit = "" if self.metric.unit == "-" else f" {self.metric.unit}"
        name, value, median = self.metric.name, plain(self.metric.value), plain(self.median)
        return f"{self.run}: {name} is {value}{unit}, the median of {self.runs} runs is {median}{unit}"


def run_sentence(run: str, outliers: Sequence[Outlier], shown: int) -> str:
    """Return what stands out in one run, the numbers farthest from the median first, at most ``shown`` of them."""
    far = sorted(outliers, key=lambda o: -abs(o.metric.value - o.median) / max(abs(o.median), abs(o.metric.value), 1e-300))
    parts = [f"{o.metric.name} {plain(o.metric.value)} instead of {plain(o.median)} {o.metric.unit}" for o in far[:shown]]
    more = f"; and {len(far) - shown} more" if len(far) > shown else ""
    return f"{run}: {'; '.join(parts)}{more} (instead of: median of the runs)"


def find_outliers(runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> list[Outlier]:
    """Return every metric of a run that is far from the median of all runs, given its own and their spread.

    The spread is robust (1.4826 times the median distance from the median), so that the outlier does not hide itself;
    numbers that are not sure take no part. Length of a run and number of its warnings are no findings.

    Parameters
    ----------
    runs
        Name and metrics of each run.
    """
    found = []
    for name in dict.fromkeys(name for _, metrics in runs for name in metrics if name not in _NO_FINDING):
        known = [(run, metrics[name]) for run, metrics in runs if name in metrics and metrics[name].sure]
        if len(known) < LEAST_RUNS:
            continue
        values = np.array([metric.value for _, metric in known])
        middle = float(np.median(values))
        spread = 1.4826 * float(np.median(np.abs(values - middle)))
        for run, metric in known:
            distance = abs(metric.value - middle)
            if distance > OUTLIER * max(spread, metric.std or 0.0) and distance > SMALLEST_SHARE * abs(middle):
                found.append(Outlier(run, metric, middle, len(known)))
    return found
