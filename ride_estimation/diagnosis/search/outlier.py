# Copyright 2026 ride_estimation contributors
"""Tells whether one calibrated mount is out of line with its vehicle file and with the other mounts."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.diagnosis.calibration.linear_model import Calibrated, file_parameters, stepped
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis

Array = NDArray[np.float64]

#: id of the cause
SOFT_MOUNT = "one_soft_mount"
#: a stiffness 15 % off its file is calibration; a cause must lie beyond that by three standard deviations of its estimate
CALIBRATION = 0.15
#: 15 % is taken as two standard deviations of the scatter among mounts whose files are merely off, worth so many observations
_USUAL_SCATTER = 0.5 * CALIBRATION
_USUAL_WEIGHT = 4
#: chance that a vehicle whose mounts only scatter has one that is called an outlier
_FALSE_ALARM = 0.01
#: an estimate of the logarithm less certain than that is no evidence
_LEAST_CERTAIN = 0.1


def soft_mount(
    calibrated: Calibrated, stiffness: Array, log_std: Array, nonlinear: Collection[int] = (), curved: Collection[int] = ()
) -> Fitted | None:
    """Return the mount axis that is an outlier towards soft, None where there is none.

    The logarithm of calibrated over stated stiffness of a mount is compared with the mean of the other mounts of the axis (a
    common error of the file is calibration), of those for which the file states the same stiffness where there are any: they
    are the same part, whose error is one. It must lie below that mean by more than 15 % (calibration) plus three standard
    deviations of the estimate, and beyond what the scatter of the other mounts about their means, pooled over the axes and with
    7.5 % (half of 15 %) as if seen four times, makes likely: Student's t at a chance of 1 % over all ports that are tested. Of
    two alike the one farther from the file is the outlier.

    Parameters
    ----------
    stiffness, log_std
        Calibrated stiffness of every port and the standard deviation of its logarithm, shape (P,).
    nonlinear
        Ports that carry a found force law. What is left as their spring rate depends on how the law is split from it, so
        they are as stiff as the larger of it and of their spring rate in the plain calibrated model.
    curved
        Ports whose found law bends the spring itself. A spring rate is then no number of its own: they are not judged.
    """
    ports = calibrated.view.plant.ports
    prior, _ = file_parameters(calibrated.view.plant)
    plain = stepped(calibrated.view.state, calibrated.view, calibrated.adjustables, calibrated.fit.coefficients).stiffness
    judged = np.array([max(k, plain[i]) if i in nonlinear else k for i, k in enumerate(stiffness)])
    ratio = np.log(judged / np.maximum(prior, 1e-12))
    axes = tuple(dict.fromkeys(p.axis for p in ports))
    known = {a: [i for i, p in enumerate(ports) if p.axis == a and log_std[i] < _LEAST_CERTAIN] for a in axes}
    tested = [i for a in axes for i in known[a] if len(known[a]) > 1 and i not in curved]
    best: tuple[float, Fitted] | None = None
    for i in tested:
        others = {a: [j for j in known[a] if ports[j].mount != ports[i].mount] for a in axes}
        around = [ratio[alike] - np.mean(ratio[alike]) for o in others.values() for alike in _same_parts(o, prior)]
        freedom = _USUAL_WEIGHT + sum(len(d) - 1 for d in around)
        squares = _USUAL_WEIGHT * _USUAL_SCATTER**2 + sum(float(d @ d) for d in around)
        peers = [j for j in others[ports[i].axis] if prior[j] == prior[i]] or others[ports[i].axis]
        scatter = float(np.sqrt(squares / freedom * (1.0 + 1.0 / len(peers))))
        deviation = float(ratio[i] - np.mean(ratio[peers]))
        likely = float(stats.t.isf(_FALSE_ALARM / len(tested), freedom)) * scatter
        margin = -deviation - max(-np.log1p(-CALIBRATION) + 3.0 * log_std[i], likely)
        farther = len(peers) > 1 or ratio[i] + ratio[peers[0]] < 0.0
        if margin > 0.0 and farther and (best is None or margin > best[0]):
            h = Hypothesis(SOFT_MOUNT, ports[i].mount, ports[i].axis, lambda view, shape: [])
            best = margin, Fitted(h, np.array([deviation]), np.array([[log_std[i] ** 2]]), {})
    return None if best is None else best[1]


def _same_parts(ports: list[int], stated: Array) -> list[list[int]]:
    """Return the ports in groups of one stated stiffness; those that are alone with theirs are one group."""
    groups = [[j for j in ports if stated[j] == value] for value in dict.fromkeys(stated[ports].tolist())]
    alone = [g[0] for g in groups if len(g) == 1]
    return [*(g for g in groups if len(g) > 1), *([alone] if alone else [])]
