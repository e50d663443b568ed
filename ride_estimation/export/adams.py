# Copyright 2026 ride_estimation contributors
"""A bushing property file (TeimOrbit text, ``.bus``) with the static curves and equivalent dampings of a mount."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ride_estimation.export.elements import ExportedElement
from ride_estimation.export.tables import equivalent_damping, knowledge_lines, static_curve
from ride_estimation.frames import COORDINATES

#: axis of the vehicle -> name of the curve
_CURVES = dict(zip(COORDINATES, ("FX", "FY", "FZ", "TX", "TY", "TZ"), strict=True))
#: reach of the curve of an axis without element [mm] and [degrees]: zero everywhere
_FREE = 10.0


def bushing_text(elements: Sequence[ExportedElement], head: Sequence[str]) -> str:
    """Return a bushing property file: millimetre, newton, degree.

    A curve holds force over deflection, a damping is constant: hysteresis, and stiffness that depends on frequency or
    amplitude, cannot be in such a file. The comments say at which frequency and amplitude the damping holds.

    Parameters
    ----------
    elements
        Of one mount, one per axis.
    head
        Lines of comment at the top.
    """
    by_axis = {e.axis: e for e in elements}
    comments, damping, curves = list(head), [], []
    for axis, curve in _CURVES.items():
        turned = curve.startswith("T")
        points, value = [(-_FREE, 0.0), (0.0, 0.0), (_FREE, 0.0)], 0.0
        if axis in by_axis:
            exported = by_axis[axis]
            x, force = static_curve(exported)
            c, frequency, amplitude = equivalent_damping(exported)
            # N s/m -> N s/mm; N m s/rad -> N mm s/degree
            value = c * 1e3 * math.pi / 180.0 if turned else c * 1e-3
            scale = (180.0 / math.pi, 1e3) if turned else (1e3, 1.0)
            points = [(scale[0] * float(a), scale[1] * float(b)) for a, b in zip(x, force, strict=True)]
            comments += knowledge_lines(exported)
            where = f"{math.degrees(amplitude):.4g} degrees" if turned else f"{1e3 * amplitude:.4g} mm"
            comments.append(f"  {curve}_DAMPING: equal loss per cycle at {frequency:.4g} Hz and {where}")
        damping.append(f" {curve}_DAMPING = {value:.9e}")
        curves += _block(f"{curve}_CURVE", [f"{{ {'angle' if turned else curve[-1].lower()}  {curve.lower()} }}"])
        curves += [f" {a: .9e}  {b: .9e}" for a, b in points]
    lines = _block("MDI_HEADER", [" FILE_TYPE = 'bus'", " FILE_VERSION = 4.0", " FILE_FORMAT = 'ASCII'"])
    lines += [f"$ {line}" for line in comments]
    lines += _block(
        "UNITS",
        [" LENGTH = 'mm'", " ANGLE = 'degrees'", " FORCE = 'newton'", " MASS = 'kg'", " TIME = 'second'"],
    )
    lines += _block("DAMPING", damping)
    return "\n".join([*lines, *curves, ""])


def _block(name: str, lines: Sequence[str]) -> list[str]:
    return [f"${name:->79}", f"[{name}]", *lines]
