# Copyright 2026 ride_estimation contributors
"""Dynamic stiffness and loss angle of a force element over frequency and amplitude, with intervals, and its static curve."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.harmonic import complex_stiffness, steady_loop
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.export.elements import ExportedElement

Array = NDArray[np.float64]

#: grid where the data that the element was identified from are not known: ride frequencies [Hz] and strokes of mounts [m]
_FREQUENCY, _LARGEST = (0.1, 50.0), 0.01
#: points of the grid; amplitudes begin at this share of the largest
_FREQUENCIES, _AMPLITUDES, _SMALLEST_SHARE = 15, 8, 0.01
#: two-sided 95 % of a normal distribution
_DEVIATIONS = 1.959963984540054
#: frequency at which the static curve is taken [Hz], points of it
STATIC_FREQUENCY, _STATIC_POINTS = 1e-3, 41


@dataclasses.dataclass(frozen=True)
class StiffnessTable:
    """Stiffness and loss angle of one element; A amplitudes, F frequencies.

    Attributes
    ----------
    element
        The element.
    frequency, amplitude
        [Hz], shape (F,); [m] or [rad], shape (A,).
    stiffness, loss_angle
        First-harmonic ``|K|`` [N/m] or [N m/rad] and ``arg K`` [rad], shape (A, F).
    stiffness_bounds, loss_angle_bounds
        95 % intervals from the standard deviations and the correlation of the parameters, shape (2, A, F); None where no
        parameter has a standard deviation. The error of the law itself is not in them.
    inside
        Whether the data showed such a motion, shape (A, F); None where that is not known.
    """

    element: ExportedElement
    frequency: Array
    amplitude: Array
    stiffness: Array
    loss_angle: Array
    stiffness_bounds: Array | None
    loss_angle_bounds: Array | None
    inside: NDArray[np.bool_] | None


def stiffness_table(
    exported: ExportedElement, frequency: Sequence[float] = (), amplitude: Sequence[float] = ()
) -> StiffnessTable:
    """Return stiffness and loss angle over a grid.

    The interval is that of the linear propagation ``d ln K = sum (d ln K / d p) dp``: real part for the stiffness, imaginary
    part for the loss angle, with steps of one standard deviation of each parameter.

    Parameters
    ----------
    exported
        The element.
    frequency
        [Hz]; empty: what the data showed, or 0.1 to 50 Hz.
    amplitude
        [m] or [rad]; empty: up to what the data showed, or up to 0.01.

    Raises
    ------
    ConfigurationError
        An element that has no steady motion at some point of the grid.
    """
    f, a = grid(exported, frequency, amplitude)
    centre = _over_grid(exported.element, f, a, exported.name)
    addresses = list(exported.element.addressed().items())
    slopes: list[NDArray[np.complex128]] = []
    for constant, (address, (declared, value)) in zip(exported.constants, addresses, strict=True):
        if constant.std is None or constant.std <= 0.0:
            slopes.append(np.zeros(centre.shape, dtype=complex))
            continue
        low, high = max(value - constant.std, declared.lower), min(value + constant.std, declared.upper)
        ends = [_over_grid(exported.element.with_values({address: v}), f, a, exported.name) for v in (low, high)]
        # one standard deviation of the parameter, in logarithms of the stiffness
        slopes.append(np.asarray((np.log(ends[1]) - np.log(ends[0])) * (constant.std / (high - low)), dtype=complex))
    bounds = loss_bounds = None
    modulus, angle = np.abs(centre), np.angle(centre)
    if exported.known:
        stacked = np.stack(slopes)
        spread = [np.sqrt(_variance(part, exported.correlation)) for part in (stacked.real, stacked.imag)]
        sides = np.array([-_DEVIATIONS, _DEVIATIONS])[:, None, None]
        bounds, loss_bounds = modulus * np.exp(sides * spread[0]), angle + sides * spread[1]
    inside = None
    if exported.seen is not None:
        low, high = exported.seen.frequency
        inside = (a[:, None] <= exported.seen.deflection * (1 + 1e-9)) & ((low <= f) & (f <= high))[None]
    return StiffnessTable(exported, f, a, modulus, angle, bounds, loss_bounds, inside)


def grid(exported: ExportedElement, frequency: Sequence[float] = (), amplitude: Sequence[float] = ()) -> tuple[Array, Array]:
    """Return frequencies [Hz] and amplitudes [m] of the tables of an element, those given or those the data showed."""
    seen = exported.seen
    low, high = (max(v, STATIC_FREQUENCY) for v in (_FREQUENCY if seen is None else seen.frequency))
    # a record of one sine shows one frequency
    spread = np.geomspace(low, high, _FREQUENCIES if high > 1.01 * low else 1)
    f = np.asarray(frequency, dtype=float) if len(frequency) else spread
    largest = _LARGEST if seen is None else seen.deflection
    a = np.asarray(amplitude, dtype=float) if len(amplitude) else np.geomspace(_SMALLEST_SHARE * largest, largest, _AMPLITUDES)
    return f, a


def _over_grid(element: ForceElement, frequency: Array, amplitude: Array, name: str) -> NDArray[np.complex128]:
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # judged below
            found = np.array([[complex_stiffness(element, 2.0 * math.pi * f, a) for f in frequency] for a in amplitude])
    except (InputDataError, OverflowError) as error:
        raise ConfigurationError(f"{name}: {error}") from error
    if not np.all(np.isfinite(found)):
        raise ConfigurationError(f"{name}: the law gives no finite stiffness at up to {amplitude[-1]:g} and {frequency[-1]:g} Hz")
    # behind free play there is no force and no angle: the smallest number keeps the logarithm finite
    return np.where(found == 0.0, np.finfo(float).tiny, found)


def _variance(slopes: Array, correlation: Array) -> Array:
    return np.asarray(np.maximum(np.einsum("iaf,ij,jaf->af", slopes, correlation, slopes), 0.0))


def static_curve(exported: ExportedElement) -> tuple[Array, Array]:
    """Return deflection [m] and force [N] of a slow cycle, the mean of its way out and its way back, shape (41,) each.

    The cycle reaches what the data showed, or 10 mm.
    """
    largest = float(grid(exported)[1][-1])
    try:
        x, force = steady_loop(exported.element, 2.0 * math.pi * STATIC_FREQUENCY, largest)
    except InputDataError as error:
        raise ConfigurationError(f"{exported.name}: {error}") from error
    quarter = x.size // 4
    # one period of a sine begins at zero going up: it turns after a quarter and after three
    down, up = slice(quarter - 1, 3 * quarter), [*range(3 * quarter - 1, x.size), *range(quarter)]
    points = np.linspace(-largest, largest, _STATIC_POINTS)
    both = (np.interp(points, x[down][::-1], force[down][::-1]), np.interp(points, x[up], force[up]))
    return points, 0.5 * (both[0] + both[1])


def equivalent_damping(exported: ExportedElement) -> tuple[float, float, float]:
    """Return the damping [N s/m] of an equal loss per cycle, and the frequency [Hz] and amplitude [m] it holds at.

    They are the geometric middle of what the data showed and half of its largest deflection.
    """
    f, a = grid(exported)
    frequency, amplitude = float(np.sqrt(f[0] * f[-1])), 0.5 * float(a[-1])
    omega = 2.0 * math.pi * frequency
    return complex_stiffness(exported.element, omega, amplitude).imag / omega, frequency, amplitude


def knowledge_lines(exported: ExportedElement) -> list[str]:
    """Return what is known of an element in words, one line per parameter, for the comments of a file."""
    lines = [f"{exported.name}: {exported.element.KIND}"]
    if exported.seen is not None:
        lines[0] += f"; {exported.seen.sentence(exported.axis)}"
    for c in exported.constants:
        known = "" if c.std is None else f" +- {c.std:.4g}"
        bounds = "" if c.lower is None or c.upper is None else f", range {c.lower:.6g} to {c.upper:.6g}"
        lines.append(f"  {c.name} = {c.value:.9g}{known} {c.unit} ({c.meaning}{bounds})")
    return lines


def table_text(
    elements: Sequence[ExportedElement], head: Sequence[str], frequency: Sequence[float], amplitude: Sequence[float]
) -> str:
    """Return stiffness and loss angle of elements as CSV; lines of comment begin with ``#``.

    Parameters
    ----------
    elements
        One or more.
    head
        Lines of comment at the top.
    frequency, amplitude
        Of :func:`stiffness_table`.
    """
    lines = [f"# {line}" for line in head]
    lines += [f"# {line}" for e in elements for line in knowledge_lines(e)]
    lines.append(f"# {INTERVALS}")
    lines.append(
        "element,frequency_hz,amplitude,amplitude_unit,stiffness,stiffness_low,stiffness_high,stiffness_unit,"
        "loss_angle_deg,loss_angle_low_deg,loss_angle_high_deg,seen_in_data"
    )
    for element in elements:
        t = stiffness_table(element, frequency, amplitude)
        units = ("rad", "N m/rad") if element.turned else ("m", "N/m")
        for i, a in enumerate(t.amplitude):
            for j, f in enumerate(t.frequency):
                k = ["", ""] if t.stiffness_bounds is None else [f"{v:.9g}" for v in t.stiffness_bounds[:, i, j]]
                loss = ["", ""] if t.loss_angle_bounds is None else [f"{v:.6g}" for v in np.degrees(t.loss_angle_bounds[:, i, j])]
                seen = "" if t.inside is None else "yes" if t.inside[i, j] else "no"
                lines.append(",".join([
                    element.name, f"{f:.9g}", f"{a:.9g}", units[0], f"{t.stiffness[i, j]:.9g}", *k, units[1],
                    f"{math.degrees(t.loss_angle[i, j]):.6g}", *loss, seen,
                ]))  # fmt: skip
    return "\n".join([*lines, ""])


INTERVALS = (
    "Intervals: 95 %, from the standard deviations and, where it is known, the correlation of the parameters; "
    "the error of the law itself is not in them."
)
