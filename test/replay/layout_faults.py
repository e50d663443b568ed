# Copyright 2026 ride_estimation contributors
"""Faults of one sensor on other layouts, each on the body and at a mount base: what must be said, how soon, what may not happen.

Layouts: five sensors on the cab with one there and one at the bases turned by 90 degrees, vertical transducers at all mounts,
three mounts. Rows are judged as in :mod:`replay.fault_table`; harm is judged from the fault on to the end of the run.
"""

from __future__ import annotations

import numpy as np
from replay.fault_run import BEGIN, END, LENGTH, Message, Plant, World
from replay.fault_table import BASE, CAB, Fault
from replay.signal_faults import SignalFault, with_values

LAYOUTS = ("turned", "transducers", "three")
#: the sensor a victim is exchanged with
_PARTNER = {CAB: "cab_rear_left", BASE: "chassis_front_right"}
#: what docs/operation.md promises for errors that only the motion tells, of the body and at the bases [s]
WITHIN = 10.0
#: share of the force errors within two stated standard deviations, and error of a valid parameter in its standard deviations
LEAST_INSIDE, LARGEST_ERROR = 0.85, 3.0


def _signal(change: str, victim: str, begin: float = BEGIN, end: float = LENGTH) -> Plant:
    """Return a plant that changes the signal of one sensor, or exchanges it with its partner."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        up = int(np.argmax(np.abs(w.sensor(victim).rotation[2])))
        along = (up + 1) % 3
        kind, size, axes = {
            "stuck z": ("stuck", 0.0, (up,)),
            "stuck x": ("stuck", 0.0, (along,)),
            "gain 1.3 of the motion": ("gain", 1.3, (0, 1, 2)),
            "gain 1.3 of the vertical motion": ("gain", 1.3, (up,)),
            "gain 1.3 of the motion along one axis": ("gain", 1.3, (along,)),
            "exchanged": ("exchanged", 0.0, (0, 1, 2)),
            "hum": ("hum", 1.0, (0, 1, 2)),
            "inverted x": ("inverted", 0.0, (along,)),
            "vertical motion inverted": ("gain", -1.0, (up,)),
            "saturated": ("saturated", 1.0, (0, 1, 2)),
            "spikes": ("spikes", 50.0, (0, 1, 2)),
            "noise": ("noise", 30.0, (0, 1, 2)),
            "20 ms late": ("late", 0.02, (0, 1, 2)),
            "clock drifts": ("drifts", 5e-4, (0, 1, 2)),
        }[change]
        partner = _PARTNER[victim] if kind == "exchanged" else ""
        return SignalFault(kind, victim, axes, size, partner).plant(begin, end)(w, messages, rng)

    return plant


def _zero(begin: float) -> Plant:
    """All accelerometers read nothing from a time on."""

    def plant(w: World, messages: list[Message], rng: np.random.Generator) -> list[Message]:
        nothing = {s.name: np.zeros_like(w.measurement.data[s.name]) for s in w.measurement.sensors if s.kind != "displacement"}
        return with_values(messages, nothing, begin, LENGTH)

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
        # mounts side by side have the same lever: either may be named first
        row("gain 1.3 of the motion along one axis", f"{told}|or {victim}"),
        row("gain 1.3 of the motion along one axis", f"{told}|or {victim}", begin=0.0),
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
