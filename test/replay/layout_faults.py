# Copyright 2026 ride_estimation contributors
"""Faults of one sensor on other layouts, each on the body and at a mount base: what must be said, how soon, what may not happen.

Layouts: five sensors on the cab with one there and one at the bases turned by 90 degrees, vertical transducers at all mounts,
three mounts. Rows are judged as in :mod:`replay.fault_table`; harm is judged from the fault on to the end of the run.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from replay.fault_run import BEGIN, END, LENGTH, RATE, Message, Plant, World
from replay.fault_table import BASE, CAB, Fault

LAYOUTS = ("turned", "transducers", "three")
#: the sensor a victim is exchanged with
_PARTNER = {CAB: "cab_rear_left", BASE: "chassis_front_right"}
#: what docs/operation.md promises for errors that only the motion tells, of the body and at the bases [s]
WITHIN = 10.0
#: share of the force errors within two stated standard deviations, and error of a valid parameter in its standard deviations
LEAST_INSIDE, LARGEST_ERROR = 0.85, 3.0
#: frequency of the hum [Hz]: mains would be on the limit of what a hundred samples a second tell
_HUM_HZ = 47.0


def _changed(w: World, messages: list[Message], values: dict[str, np.ndarray], begin: float, end: float) -> list[Message]:
    """Return the messages with other values of some sensors within a time."""
    first = messages[0].stamp_ns
    counts, out = dict.fromkeys(values, 0), []
    for m in messages:
        if m.sensor not in values:
            out.append(m)
            continue
        there = begin <= (m.stamp_ns - first) * 1e-9 < end
        row, counts[m.sensor] = counts[m.sensor], counts[m.sensor] + 1
        out.append(dataclasses.replace(m, values=tuple(values[m.sensor][row].tolist())) if there else m)
    return out


def _signal(change: str, victim: str, begin: float = BEGIN, end: float = LENGTH) -> Plant:
    """Return a plant that changes the signal of one sensor, or exchanges it with its partner."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        values, time = w.measurement.data[victim], w.measurement.time
        up = int(np.argmax(np.abs(w.sensor(victim).rotation[2])))
        along = (up + 1) % 3
        mean, noise = values.mean(axis=0), w.sensor(victim).noise_std
        new = values.copy()
        partner: dict[str, np.ndarray] = {}
        if change in ("stuck z", "stuck x"):
            axis = up if change == "stuck z" else along
            new[:, axis] = values[round(begin * RATE), axis]
        elif change == "gain 1.3 of the motion":
            new = mean + 1.3 * (values - mean)
        elif change == "gain 1.3 of the vertical motion":
            new[:, up] += 0.3 * (values - mean)[:, up]
        elif change == "exchanged":
            new = w.measurement.data[_PARTNER[victim]]
            partner = {_PARTNER[victim]: values}
        elif change == "hum":
            new += np.sin(2.0 * np.pi * _HUM_HZ * time)[:, None]
        elif change == "inverted x":
            new[:, along] *= -1.0
        elif change == "vertical motion inverted":
            new[:, up] = (2.0 * mean - values)[:, up]
        elif change == "saturated":
            new = np.clip(values, mean - values.std(axis=0), mean + values.std(axis=0))
        elif change == "spikes":
            new += 50.0 * (rng.random(values.shape) < 0.01) * rng.choice([-1.0, 1.0], values.shape)
        elif change == "noise":
            new += 30.0 * noise * rng.standard_normal(values.shape)
        elif change in ("20 ms late", "clock drifts"):
            late = 0.02 if change == "20 ms late" else 5e-4 * time
            new = np.column_stack([np.interp(time - late, time, column) for column in values.T])
        return _changed(w, messages, {victim: new, **partner}, begin, end)

    return plant


def _zero(begin: float) -> Plant:
    """All accelerometers read nothing from a time on."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        nothing = {s.name: np.zeros_like(w.measurement.data[s.name]) for s in w.measurement.sensors if s.kind != "displacement"}
        return _changed(w, messages, nothing, begin, LENGTH)

    return plant


def _rows(layout: str, victim: str) -> list[Fault]:
    place = "cab" if victim == CAB else "base"
    partner = _PARTNER[victim]
    other = "|one of .*|no single sensor" if victim == CAB else ""

    def row(change: str, expected: str, begin: float = -1.0, end: float = LENGTH, within: float = WITHIN) -> Fault:
        constant = begin == 0.0
        plant = _signal(change, victim, max(begin, 0.0) if begin >= 0.0 else BEGIN, end)
        return Fault(
            f"{layout}, {place}: {change}{' from the start' if constant else ''}", plant, expected, constant,
            begin=-1.0, end=-1.0 if constant else end, kind=layout, within_s=within,
        )  # fmt: skip

    stuck = f"^{victim} was not used.*stuck"
    told = rf"^{victim}|rigid body.*{victim}{other}"
    return [
        row("stuck z", stuck, end=END, within=0.5),
        row("stuck x", stuck, end=END, within=0.5),
        row("gain 1.3 of the motion", told),
        row("gain 1.3 of the vertical motion", told),
        row("gain 1.3 of the vertical motion", told, begin=0.0),
        row("exchanged", rf"{victim}|{partner}{other}"),
        row("exchanged", rf"topics of .*({victim}|{partner})", begin=0.0),
        row("hum", rf"{victim}.*(line|was not used|explains){other}"),
        row("inverted x", told),
        row("vertical motion inverted", told),
        row("saturated", told),
        row("spikes", told),
        row("noise", told),
        row("20 ms late", told),
        row("clock drifts", told, begin=0.0, within=50.0),
    ]


LAYOUT_TABLE: tuple[Fault, ...] = tuple(
    fault for layout in LAYOUTS for victim in (CAB, BASE) for fault in _rows(layout, victim)
) + tuple(
    Fault(f"{layout}: all zero{' from the start' if begin == 0.0 else ''}", _zero(begin), "not used.*(dead|stuck)", begin == 0.0,
          end=-1.0 if begin == 0.0 else LENGTH, kind=layout, within_s=2.0)
    for layout in LAYOUTS for begin in (0.0, BEGIN)
)  # fmt: skip
