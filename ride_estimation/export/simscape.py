# Copyright 2026 ride_estimation contributors
"""A MATLAB script with the lookup tables of force elements, for Simscape and Simulink."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.export.elements import ExportedElement, identifier
from ride_estimation.export.tables import INTERVALS, equivalent_damping, knowledge_lines, static_curve, stiffness_table

Array = NDArray[np.float64]


def script_text(
    elements: Sequence[ExportedElement], head: Sequence[str], frequency: Sequence[float], amplitude: Sequence[float]
) -> str:
    """Return a script that defines the structure ``mount`` with one field per element; SI units, about an axis rad and N m.

    ``deflection`` and ``force`` are the static curve, as a translational or rotational spring with a lookup table takes
    it; ``damping`` is constant, of equal loss per cycle at ``damping_frequency`` and ``damping_amplitude``. ``stiffness`` and
    ``loss_angle`` have a row per entry of ``amplitude`` and a column per entry of ``frequency``.

    Parameters
    ----------
    elements
        One or more.
    head
        Lines of comment at the top.
    frequency, amplitude
        Of :func:`~ride_estimation.export.tables.stiffness_table`.
    """
    lines = [f"% {line}" for line in head]
    lines += [f"% {INTERVALS}", "mount = struct();"]
    for exported in elements:
        place = f"mount.{identifier(exported.name)}"
        lines += ["", *(f"% {line}" for line in knowledge_lines(exported))]
        x, force = static_curve(exported)
        damping, at_frequency, at_amplitude = equivalent_damping(exported)
        t = stiffness_table(exported, frequency, amplitude)
        fields: list[tuple[str, Array | float]] = [
            ("deflection", x), ("force", force), ("damping", damping), ("damping_frequency", at_frequency),
            ("damping_amplitude", at_amplitude), ("frequency", t.frequency), ("amplitude", t.amplitude),
            ("stiffness", t.stiffness), ("loss_angle", t.loss_angle),
        ]  # fmt: skip
        if t.stiffness_bounds is not None and t.loss_angle_bounds is not None:
            fields += [
                ("stiffness_low", t.stiffness_bounds[0]), ("stiffness_high", t.stiffness_bounds[1]),
                ("loss_angle_low", t.loss_angle_bounds[0]), ("loss_angle_high", t.loss_angle_bounds[1]),
            ]  # fmt: skip
        if t.inside is not None:
            fields.append(("seen_in_data", t.inside.astype(float)))
        for c in exported.constants:
            row = [c.value, *(math.nan if v is None else v for v in (c.std, c.lower, c.upper))]
            fields.append((f"parameters.{identifier(c.name.removeprefix(exported.prefix))}", np.array(row)))
        lines += [f"{place}.{name} = {_matrix(values)};" for name, values in fields]
    lines.append("% parameters: value, standard deviation, lowest, highest")
    return "\n".join([*lines, ""])


def _matrix(values: Array | float) -> str:
    if isinstance(values, float):
        return repr(values)
    rows = np.atleast_2d(values)
    return "[" + "; ".join(" ".join("NaN" if math.isnan(v) else repr(float(v)) for v in row) for row in rows) + "]"
