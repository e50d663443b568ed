# Copyright 2026 ride_estimation contributors
"""Durability and comfort of one run: damage per mount and axis with its interval, exposure at every accelerometer."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.assessment.durability import DEFAULT_SLOPE, EQUIVALENT_RATE_HZ, Damage, DamageMeter
from ride_estimation.assessment.rainflow import Cycles
from ride_estimation.assessment.ride_comfort import LOWEST_RATE_HZ, ComfortMeter, Exposure
from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

EIGHT_HOURS_S = 8.0 * 3600.0


@dataclasses.dataclass(frozen=True)
class MountDamage:
    """Damage of the force of one mount along one axis.

    Attributes
    ----------
    mount, axis
        Which force.
    estimated
        Of the estimated force, with the interval its uncertainty leaves.
    cycles
        Rainflow cycles of the estimated force.
    measured
        Of the force a load cell measured there at the same ticks, None without one.
    """

    mount: str
    axis: str
    estimated: Damage
    cycles: Cycles
    measured: Damage | None

    @property
    def ratio(self) -> float | None:
        """Return estimated over measured damage, None where it was not measured or did none."""
        if self.measured is None or self.measured.value == 0.0:
            return None
        return self.estimated.value / self.measured.value


@dataclasses.dataclass(frozen=True)
class RunAssessment:
    """What :func:`assess_run` found.

    Attributes
    ----------
    damages
        Per mount and axis.
    exposures
        Per place.
    slope
        Of the damage line.
    daily_exposure_s
        Time a day the exposures are stated for [s].
    samples
        Valid ticks the damage was counted over.
    notes
        What was left out, and why.
    """

    damages: tuple[MountDamage, ...]
    exposures: tuple[Exposure, ...]
    slope: float
    daily_exposure_s: float
    samples: int
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """Return the numbers for ``result.json``."""
        return {
            "durability": {
                "slope": self.slope, "equivalent_rate_hz": EQUIVALENT_RATE_HZ, "unit": f"N^{self.slope:g}",
                "mounts": [_damage_entry(d) for d in self.damages],
            },
            "comfort": {"daily_exposure_s": self.daily_exposure_s, "places": [_exposure_entry(e) for e in self.exposures]},
        }  # fmt: skip


def assess_run(
    mount_names: Sequence[str],
    mount_force: Array,
    mount_force_std: Array,
    valid: NDArray[np.bool_],
    rate_hz: float,
    accelerations: Mapping[str, Array],
    measured_force: Mapping[str, Array] | None = None,
    slope: float = DEFAULT_SLOPE,
    daily_exposure_s: float = EIGHT_HOURS_S,
    mass_relative_std: float = 0.0,
) -> RunAssessment:
    """Assess one run.

    Parameters
    ----------
    mount_names
        M names.
    mount_force, mount_force_std
        Shape (N, M, 3) [N].
    valid
        Shape (N,); other ticks take no part in the damage.
    rate_hz
        Ticks per second.
    accelerations
        Place -> shape (N, 3) [m/s^2], body axes.
    measured_force
        Mount -> shape (N, 3) [N], body axes, of load cells.
    slope
        Of the damage line.
    daily_exposure_s
        [s].
    mass_relative_std
        Relative standard deviation of the mass that ``mount_force_std`` holds [-].
    """
    notes: list[str] = []
    meters = (rate_hz, mass_relative_std)
    damages = _damages(mount_names, mount_force, mount_force_std, valid, meters, measured_force or {}, slope, notes)
    exposures = _exposures(accelerations, rate_hz, daily_exposure_s, notes)
    return RunAssessment(damages, exposures, slope, daily_exposure_s, int(np.sum(valid)), tuple(notes))


def _damages(
    names: Sequence[str], force: Array, std: Array, valid: NDArray[np.bool_], meters: tuple[float, float],
    cells: Mapping[str, Array], slope: float, notes: list[str],
) -> tuple[MountDamage, ...]:  # fmt: skip
    samples = int(np.sum(valid))
    if not names:
        return ()
    if samples < 2:
        notes.append("no damage: fewer than two valid ticks")
        return ()
    if samples < len(valid):
        notes.append(f"invalid samples excluded from the damage: {len(valid) - samples} of {len(valid)}")
    found = []
    for m, mount in enumerate(names):
        for i, axis in enumerate(AXES):
            meter = DamageMeter(*meters)
            meter.feed(force[valid, m, i], std[valid, m, i])
            measured = None
            if mount in cells:
                cell = DamageMeter(meters[0])
                cell.feed(cells[mount][valid, i])
                measured = cell.damage(slope)
            found.append(MountDamage(mount, axis, meter.damage(slope), meter.cycles, measured))
    return tuple(found)


def _exposures(
    accelerations: Mapping[str, Array], rate_hz: float, daily_exposure_s: float, notes: list[str]
) -> tuple[Exposure, ...]:
    if rate_hz < LOWEST_RATE_HZ:
        notes.append(f"no comfort values: {rate_hz:.3g} Hz is too slow, {LOWEST_RATE_HZ:g} Hz are needed")
        return ()
    found = []
    for place, acceleration in accelerations.items():
        meter = ComfortMeter(rate_hz, place)
        try:
            meter.feed(acceleration)
            found.append(meter.exposure(daily_exposure_s))
        except InputDataError as error:
            notes.append(f"no comfort values for {place}: {error}")
    return tuple(found)


def _damage_entry(d: MountDamage) -> dict[str, Any]:
    e = d.estimated
    return {
        "mount": d.mount, "axis": d.axis, "damage": e.value, "damage_lower": e.lower, "damage_upper": e.upper,
        "equivalent_amplitude_n": e.equivalent_amplitude, "equivalent_lower_n": e.equivalent_lower,
        "equivalent_upper_n": e.equivalent_upper, "largest_range_n": e.largest_range,
        "measured_damage": None if d.measured is None else d.measured.value, "ratio_to_measured": d.ratio,
    }  # fmt: skip


def _exposure_entry(e: Exposure) -> dict[str, Any]:
    entry: dict[str, Any] = {"location": e.location}
    for axis, values in zip(AXES, e.axes):
        entry[axis] = {
            "a_w_m_per_s2": values.weighted_rms, "vdv_m_per_s1_75": values.vibration_dose,
            "mtvv_m_per_s2": values.maximum_transient, "crest_factor": values.crest_factor,
        }  # fmt: skip
    minutes = {
        "minutes_to_action": e.minutes_to_action, "minutes_to_limit": e.minutes_to_limit,
        "vdv_minutes_to_action": e.dose_minutes_to_action, "vdv_minutes_to_limit": e.dose_minutes_to_limit,
    }  # fmt: skip
    return entry | {
        "a_v_m_per_s2": e.vector_sum, "a8_m_per_s2": e.a8, "vdv_day_m_per_s1_75": e.dose,
        **{key: value if math.isfinite(value) else None for key, value in minutes.items()},
        "highest_hz": e.highest_hz, "notes": list(e.notes()),
    }  # fmt: skip
