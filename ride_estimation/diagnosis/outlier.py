# Copyright 2026 ride_estimation contributors
"""Tells whether one calibrated mount is out of line with its vehicle file and with the other mounts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration import Calibrated, file_parameters
from ride_estimation.diagnosis.hypothesis import Fitted, Hypothesis

Array = NDArray[np.float64]

#: a stiffness 15 % off its file is calibration; a cause must lie beyond that by its own uncertainty and by the usual
#: scatter among mounts
_CALIBRATION = 0.15
_SCATTER = 3.0


def soft_mount(calibrated: Calibrated, stiffness: Array, log_std: Array) -> Fitted | None:
    """Return the mount axis that is an outlier towards soft, None where there is none.

    The logarithm of calibrated over stated stiffness of each mount is compared with the median of the other mounts of the
    axis (a common error of the file is calibration). It must lie below that median by more than 15 % (calibration) plus
    three standard deviations of the estimate, and by three times the scatter of the others.

    Parameters
    ----------
    stiffness, log_std
        Calibrated stiffness of every port and the standard deviation of its logarithm, shape (P,).
    """
    ports = calibrated.scene.plant.ports
    prior, _ = file_parameters(calibrated.scene.plant)
    ratio = np.log(stiffness / np.maximum(prior, 1e-12))
    best: tuple[float, Fitted] | None = None
    for axis in dict.fromkeys(p.axis for p in ports):
        group = [i for i, p in enumerate(ports) if p.axis == axis]
        if len(group) < 2:
            continue
        for i in group:
            others = [j for j in group if j != i and log_std[j] < 0.1]
            if not others or log_std[i] > 0.1:
                continue
            middle = float(np.median(ratio[others]))
            scatter = float(np.max(np.abs(ratio[others] - middle))) if len(others) > 1 else 0.0
            deviation = float(ratio[i]) - middle
            limit = max(-np.log1p(-_CALIBRATION) + 3.0 * log_std[i], _SCATTER * scatter if scatter < 0.12 else 2.0 * scatter)
            margin = -deviation - limit
            if margin > 0.0 and (best is None or margin > best[0]):
                h = Hypothesis("one_soft_mount", ports[i].mount, axis, lambda scene, shape: [])
                best = margin, Fitted(h, np.array([deviation]), np.array([[log_std[i] ** 2]]), {})
    return None if best is None else best[1]
