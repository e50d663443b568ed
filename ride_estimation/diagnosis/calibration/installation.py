# Copyright 2026 ride_estimation contributors
"""What calibration found of the installation: errors of sensors and bodies that are large, but no fault."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.common.wording import quantity

Array = NDArray[np.float64]

#: kind -> name, factor and unit of what is reported
_TOLD: dict[str, tuple[str, float, str]] = {
    "gain": ("gain error", 1.0, "-"),
    "misalignment": ("turned", float(np.degrees(1.0)), "deg"),
    "position": ("position error", 1.0, "m"),
    "delay": ("delay", 1.0, "s"),
    "cg": ("CG error", 1.0, "m"),
}
_LARGE = 2.5  # standard deviations of a good installation from which an error is worth a look
_CERTAIN = 4.0  # times its own standard deviation
_MOST = 3  # lines


def installation_remarks(
    adjustables: Sequence[Adjustable], coefficients: Array, covariance: Array, named: Collection[str]
) -> tuple[str, ...]:
    """Return words on errors at the edge of what an installation tolerates, the largest first.

    They are calibrated away and no cause: with a hundred tolerances one beyond two and a half standard deviations is usual. An
    engineer who wants to know which sensor to look at first finds it here.

    Parameters
    ----------
    adjustables, coefficients, covariance
        Of the final fit; only the first ``len(adjustables)`` coefficients are used.
    named
        Sensors and bodies of the named causes, which need no remark.
    """
    found: list[tuple[float, str]] = []
    for i, a in enumerate(adjustables):
        if a.kind not in _TOLD or a.place in named:
            continue
        # a coefficient comes on top of the part that the plant already holds, its offset with the sign turned
        value, std = float(coefficients[i]) - a.offset, float(np.sqrt(max(covariance[i, i], 0.0)))
        size = abs(value) / a.prior_std
        if size > _LARGE and abs(value) > _CERTAIN * std:
            name, factor, unit = _TOLD[a.kind]
            about = f"{'about ' if a.kind == 'misalignment' else ''}{a.axis}"
            size_text = quantity(name, factor * value, factor * std, unit)
            words = f"{a.place} {about}".strip()
            edge = f"{size:.1f} standard deviations of a good installation; counted as calibration"
            found.append((size, f"{words}: {size_text}, {edge}"))
    return tuple(words for _, words in sorted(found, reverse=True)[:_MOST])
