# Copyright 2026 ride_estimation contributors
"""A bench record: displacement and force of one element on one uniform time base, checked before use."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.signals.streams import NANOSECONDS

Array = NDArray[np.float64]

#: fewest samples a record may have; below it no dynamic parameter has a meaning
MIN_SAMPLES = 200
#: largest departure of one time step from the mean step that still counts as uniform
MAX_STEP_JITTER = 0.02
#: distance from a whole number of units within which a stamp was written with that unit
_WHOLE = 1.0e-3
#: plausible secant stiffness of mounts, bushings, jounce bumpers and dampers on a bench [N/m]
PLAUSIBLE_STIFFNESS = (5.0e2, 5.0e8)
#: plausible stroke of a bench record [m]
PLAUSIBLE_STROKE = (1.0e-6, 1.0)
#: correlation of force with displacement beyond which an element is a spring, with the right or the wrong sign
SPRING_CORRELATION = 0.5
#: work over the work moved to and fro below which the sign of a damper is wrong, and below which channels may be skewed in time
OPPOSED_WORK, SKEWED_WORK = -0.3, -0.02
#: share of samples at exactly the extreme value from which a channel counts as clipped
CLIPPED_SHARE = 0.005


@dataclasses.dataclass(frozen=True)
class BenchRecord:
    """Displacement and force of one element.

    Attributes
    ----------
    name
        Where the record comes from.
    time_s
        Uniform sample times [s], shape (N,).
    displacement
        Deflection [m], positive in extension, shape (N,).
    force
        Tension [N], shape (N,).
    warnings
        What was noticed while reading and checking.
    """

    name: str
    time_s: Array
    displacement: Array
    force: Array
    warnings: tuple[str, ...] = ()

    @property
    def step_s(self) -> float:
        """Return the sample time [s]."""
        return float((self.time_s[-1] - self.time_s[0]) / (self.time_s.size - 1))

    @property
    def samples(self) -> int:
        """Return N."""
        return int(self.time_s.size)

    def shifted(self, offset: float) -> BenchRecord:
        """Return the record with ``offset`` [m] subtracted from the displacement."""
        return dataclasses.replace(self, displacement=self.displacement - offset)


def check_record(record: BenchRecord, *, allow_stiffness_outside: bool = False) -> BenchRecord:
    """Check a record; return it with warnings added and on a uniform time base.

    Parameters
    ----------
    record
        Record in SI.
    allow_stiffness_outside
        Accept a secant stiffness outside the plausible range (then a warning, not an error).

    Raises
    ------
    InputDataError
        Lengths that differ, too few samples, values that are not finite, time that runs backwards,
        displacement or force that does not move, a secant stiffness that betrays a wrong unit, a force of the wrong sign.
    """
    t, x, f = record.time_s, record.displacement, record.force
    where = record.name
    if not (t.shape == x.shape == f.shape) or t.ndim != 1:
        raise InputDataError(f"{where}: time, displacement and force differ in length: {t.size}, {x.size}, {f.size}")
    if t.size < MIN_SAMPLES:
        raise InputDataError(f"{where}: too short: {t.size} samples, at least {MIN_SAMPLES} are needed")
    _require_finite(where, time=t, displacement=x, force=f)
    record = _uniform(record)
    x, f = record.displacement, record.force
    if x.size < MIN_SAMPLES:
        raise InputDataError(f"{where}: too short: {x.size} samples without a gap, at least {MIN_SAMPLES} are needed")
    warnings = list(record.warnings)
    if np.ptp(x) == 0.0:
        raise InputDataError(f"{where}: displacement is constant ({x[0]:g} m): nothing can be identified from it")
    if np.ptp(f) == 0.0:
        raise InputDataError(f"{where}: force is constant ({f[0]:g} N): wrong column, or the load cell was not connected")
    warnings += _clipping(where, "force", f)
    warnings += _clipping(where, "displacement", x)
    warnings += _stiffness_range(where, x, f, allow_stiffness_outside)
    warnings += _direction(where, x, f, allow_stiffness_outside)
    return dataclasses.replace(record, warnings=tuple(warnings))


def _require_finite(where: str, **signals: Array) -> None:
    for name, values in signals.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputDataError(
                f"{where}: {name} has {bad.size} values that are not finite, the first at sample {bad[0]}; "
                "repair or cut the record (nothing is filled in silently)"
            )


def _uniform(record: BenchRecord) -> BenchRecord:
    """Return the record on a uniform time base: as it is, resampled where its stamps jitter, its longest part beside a gap."""
    t, where = record.time_s, record.name
    steps = np.diff(t)
    back = np.flatnonzero(steps <= 0.0)
    if back.size:
        raise InputDataError(
            f"{where}: time does not increase at {back.size} places, the first between sample {back[0]} "
            f"({t[back[0]]:g} s) and {back[0] + 1} ({t[back[0] + 1]:g} s); sort the record and remove duplicates"
        )
    even = np.linspace(t[0], t[-1], t.size)
    mean = float(np.mean(steps))
    worst = int(np.argmax(np.abs(steps - mean)))
    rounding = 2.0 * float(np.spacing(np.abs(t).max()))
    if abs(steps[worst] - mean) <= MAX_STEP_JITTER * mean + rounding or _only_rounded(t, even):
        return dataclasses.replace(record, time_s=even)
    stamps = np.round((t - t[0]) * NANOSECONDS).astype(np.int64)
    values = np.column_stack([record.displacement, record.force])
    even_record = from_channels(
        where, {"displacement": (stamps, values[:, :1]), "force": (stamps, values[:, 1:])}, record.warnings
    )
    return dataclasses.replace(even_record, time_s=even_record.time_s + t[0])


def from_channels(
    name: str, channels: Mapping[str, tuple[NDArray[np.int64], Array]], warnings: tuple[str, ...] = ()
) -> BenchRecord:
    """Return a record from displacement and force with stamps of their own, aligned as a replay aligns its sensors.

    Time counts from the first stamp of both.

    Parameters
    ----------
    name
        Where the record comes from.
    channels
        ``displacement`` [m] and ``force`` [N]: stamps [ns], shape (N,), and values, shape (N, 1).
    warnings
        What was noticed before.

    Raises
    ------
    InputDataError
        No part of both without a gap.
    """
    recording = Recording(
        name, {key: Channel(key, stamps, values, arrival_ns=stamps) for key, (stamps, values) in channels.items()}
    )
    run = align(recording)
    valid = run.valid["displacement"] & run.valid["force"]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], valid, [False]]).astype(int)))
    if edges.size == 0:
        raise InputDataError(f"{name}: displacement and force are never there at the same time")
    parts = edges.reshape(-1, 2)
    first, last = parts[int(np.argmax(parts[:, 1] - parts[:, 0]))]
    said = [f"{name}: the stamps are irregular: resampled to {run.rate_hz:g} Hz"]
    lost = int(np.sum(valid)) - int(last - first)
    if lost:
        said.append(f"{name}: gaps split the record; its longest part is used, {lost / run.rate_hz:.3g} s are left out")
    part = slice(int(first), int(last))
    x, f = (np.ascontiguousarray(run.data[key][part, 0]) for key in ("displacement", "force"))
    begin = (run.start_ns - min(int(stamps[0]) for stamps, _ in channels.values())) / NANOSECONDS
    return BenchRecord(name, begin + (first + np.arange(x.size)) / run.rate_hz, x, f, (*warnings, *said))


def _only_rounded(t: Array, even: Array) -> bool:
    """Return whether equal steps explain the stamps but for the decimals they were written with."""
    for decimals in range(1, 7):
        unit = 10.0**-decimals
        if np.all(np.abs(t / unit - np.round(t / unit)) < _WHOLE):
            return bool(np.max(np.abs(t - even)) <= unit)
    return False


def _clipping(where: str, name: str, values: Array) -> list[str]:
    """Return a warning where a signal runs into an extreme and stays on it, again and again.

    Rest is not clipping: an extreme at zero, a stay at the start or end of the record, and an extreme that is reached
    gently do not count.
    """
    found = []
    for label, extreme in (("largest", values.max()), ("smallest", values.min())):
        at = values == extreme
        if np.count_nonzero(at) <= CLIPPED_SHARE * at.size or extreme == 0.0:
            continue
        speed = float(np.median(np.abs(np.diff(values))))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
        firsts, lasts = edges[::2], edges[1::2]
        inner = (firsts > 0) & (lasts < values.size) & (lasts - firsts >= 3)
        arrivals = np.abs(values[firsts[inner]] - values[firsts[inner] - 1])
        if inner.sum() >= 3 and np.mean(arrivals > 0.3 * speed) > 0.5:
            consequence = (
                "these samples are left out of the fit" if name == "force" else "the true stroke is larger than recorded"
            )
            found.append(
                f"{where}: {name} looks clipped: {100 * float(np.mean(at)):.2g} % of the samples sit on its {label} value "
                f"{extreme:g}; {consequence}"
            )
    return found


def clipped_samples(record: BenchRecord) -> NDArray[np.bool_]:
    """Return which samples of the force sit on a clipped extreme, shape (N,)."""
    mask = np.zeros(record.samples, dtype=bool)
    for warning in _clipping(record.name, "force", record.force):
        extreme = record.force.max() if "largest" in warning else record.force.min()
        mask |= record.force == extreme
    return mask


def _direction(where: str, x: Array, f: Array, allow: bool) -> list[str]:
    """Refuse a force that falls with the displacement or drives the motion; warn where a little energy comes out."""
    correlation = float(np.corrcoef(x, f)[0, 1])
    work = _work_share(x, f)
    if correlation > SPRING_CORRELATION or (correlation >= -SPRING_CORRELATION and work >= OPPOSED_WORK):
        if work >= SKEWED_WORK:
            return []
        return [
            f"{where}: over the record the element gives out {-100 * work:.2g} % of the energy moved to and fro: the force is "
            "late against the displacement (skew of the channels), or a mass between them moves; dampings come out too low"
        ]
    text = (
        f"{where}: force and displacement have opposite signs (correlation {correlation:.2f}, work {100 * work:.0f} % of the "
        "energy moved to and fro; a passive element takes energy up): pass --sign opposed, or swap the columns"
    )
    if allow:
        return [text]
    raise InputDataError(text + "; pass --accept-stiffness if the element really pushes away from rest")


def _work_share(x: Array, f: Array) -> float:
    """Return the work taken up until the displacement is last back at its start, over the work moved to and fro; else 0."""
    back = np.flatnonzero(np.abs(x - x[0]) <= 0.02 * np.ptp(x))
    last = int(back[-1])
    if last < x.size // 2:
        return 0.0
    steps = np.diff(x[: last + 1])
    power = 0.5 * (f[1 : last + 1] + f[:last]) - float(np.mean(f))
    moved = float(np.sum(np.abs(power * steps)))
    return float(np.sum(power * steps)) / moved if moved > 0.0 else 0.0


def _stiffness_range(where: str, x: Array, f: Array, allow: bool) -> list[str]:
    stroke = float(np.ptp(x))
    secant = float(np.ptp(f)) / stroke
    low, high = PLAUSIBLE_STIFFNESS
    if low <= secant <= high and PLAUSIBLE_STROKE[0] <= stroke <= PLAUSIBLE_STROKE[1]:
        return []
    soft = secant < low or stroke > PLAUSIBLE_STROKE[1]
    # three decades off in the direction of a forgotten mm -> m conversion
    hint = (
        "a displacement in millimetres given as metres, or a force in kN given as N, makes a mount look 1000 times softer"
        if soft
        else "a displacement in metres given as millimetres, or a force in N given as kN, makes a mount look 1000 times stiffer"
    )
    text = (
        f"{where}: force range {np.ptp(f):g} N over displacement range {np.ptp(x):g} m is a stiffness of {secant:g} N/m, "
        f"expected are {low:g} to {high:g} N/m and strokes of {PLAUSIBLE_STROKE[0]:g} to {PLAUSIBLE_STROKE[1]:g} m; {hint}. "
        "State the units (--displacement-unit, --force-unit)"
    )
    if allow:
        return [text]
    raise InputDataError(text + ", or pass --accept-stiffness if the value is right")
