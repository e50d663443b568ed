# Copyright 2026 ride_estimation contributors
"""Attachment forces of a recorded run: those of the model of the whole run where it describes it, else as estimated live."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.model.run_forces import RunForces
from ride_estimation.estimation.model.run_parameters import beside_online
from ride_estimation.estimation.output import OutputBlock

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: time over which forces go from those of the model to the live ones and back [s]
_FADE = 0.5
#: names of parameters of vertical laws
_VERTICAL = (".z.stiffness", ".z.damping")


@dataclasses.dataclass(frozen=True)
class SmoothedForces:
    """Smoothed forces.

    Attributes
    ----------
    force, std, deflection
        Shape (N, M, 3), as ``mount_force``, ``mount_force_std`` and ``mount_deflection`` of the online estimate.
    share
        Mean share of the model in them; the rest is the online estimate.
    not_modelled
        Why the vertical forces are not those of the model, empty where they are.
    findings
        Sentences: how the vehicle differs from its file.
    parameters, mass_properties
        Stiffness and damping of the mounts, CG and inertia of the body, none where the model has no share.
    load
        Sentence on a load that the vehicle file does not contain, empty where the model found none; it is in ``std``.
    """

    force: Array
    std: Array
    deflection: Array
    share: float
    not_modelled: str = ""
    findings: tuple[str, ...] = ()
    parameters: tuple[Estimate, ...] = ()
    mass_properties: tuple[Estimate, ...] = ()
    load: str = ""


@dataclasses.dataclass(frozen=True)
class Anomalies:
    """What the online estimator found unusual, per tick, shape (N,) each.

    Attributes
    ----------
    incomplete
        A sensor that the deflections rest on was lost or suspect.
    loaded
        There was a load that the vehicle file does not contain.
    """

    incomplete: BoolArray
    loaded: BoolArray

    @classmethod
    def of(cls, blocks: Sequence[OutputBlock]) -> Anomalies:
        """Return those of the blocks of a run."""
        ticks = [len(b.stamp_ns) for b in blocks]
        return cls(*np.repeat([(b.incomplete, b.loaded) for b in blocks], ticks, axis=0).T)

    def ordinary(self, model: RunForces) -> BoolArray:
        """Return per tick whether the vehicle was one that a model describes, shape (2, N): with all sensors, and without one.

        No load was found that the model has not, no sensor lost or suspect but the one it does without. Where the model has
        estimated a sensor's error beyond its tolerance, that is why sensors are suspect.
        """
        as_loaded = ~self.loaded | bool(model.load)
        return np.stack([as_loaded & (~self.incomplete | bool(model.faults)), as_loaded])


def smoothed_forces(
    signals: Mapping[str, NDArray[Any]], anomalies: Anomalies, model: RunForces, parameters: Sequence[Estimate],
    amplitude_std: Mapping[str, float],
) -> SmoothedForces | str:  # fmt: skip
    """Return the forces of a finished run, or why there are no better ones than live.

    Parameters
    ----------
    signals
        Online estimates of N ticks: ``stamp_ns``, ``mount_force``, ``mount_force_std`` and ``mount_deflection``.
    anomalies
        What the online estimator found unusual.
    model
        Forces by the model of the whole run.
    parameters, amplitude_std
        As estimated online in the end, and what dependence on the amplitude adds to them.
    """
    recognised = bool(anomalies.loaded.any())
    if model.refused and (recognised or not model.load):
        return model.refused
    force, std, deflection = (signals[n].copy() for n in ("mount_force", "mount_force_std", "mount_deflection"))
    if model.refused:
        std = np.hypot(std, model.load_share * np.abs(force))
        return SmoothedForces(force, std, deflection, 0.0, not_modelled=model.refused, load=model.load)
    # a force beside a law, a load and a sensor that is faulty or left out explain why laws are not valid
    left_out = any(segment.bridged for _, segment in model.segments)
    reason = "" if model.findings or model.load or model.faults or left_out else _not_linear(parameters)
    trusted = _faded(anomalies.ordinary(model), signals["stamp_ns"])
    share = model.fade_in(signals["stamp_ns"], trusted, force, std, deflection, 2 if reason else 3)
    if not all(np.isfinite(values).all() for values in (force, std, deflection)):
        return "the forces of the model are not finite: the sensors contradict each other beyond use for a time"
    beyond = tuple(f"{error} is beyond its tolerance" for error in model.faults)
    found = SmoothedForces(force, std, deflection, share, reason, (*model.findings, *beyond), load=model.load)
    if not share or (recognised and not model.load):
        return found
    known = beside_online(model.parameters, parameters, amplitude_std)
    return dataclasses.replace(found, parameters=known, mass_properties=model.mass_properties)


def _faded(ordinary: BoolArray, stamp_ns: NDArray[np.int64]) -> Array:
    """Return 1 where all is ordinary, 0 where it is not, and a ramp of :data:`_FADE` before and after, over the last axis."""
    width = 2 * round(0.5 * _FADE * 1e9 / float(np.median(np.diff(stamp_ns)))) + 1 if len(stamp_ns) > 1 else 1
    clear = ndimage.minimum_filter1d(ordinary.astype(float), width, axis=-1, mode="nearest")
    return np.asarray(ndimage.uniform_filter1d(clear, width, axis=-1, mode="nearest"))


def _not_linear(parameters: Sequence[Estimate]) -> str:
    """Return which vertical laws are not known as linear ones, empty where all are: they carry the weight.

    A damper with play that the residuals hide bent the stiffness of the mounts by 5 % and with it the static forces (cab_14 of
    the foreign runs: 55 instead of 100 % inside at the worst mount).
    """
    names = [e.name for e in parameters if e.name.endswith(_VERTICAL) and e.status is not Status.VALID]
    return f"vertical laws that are not valid: {', '.join(names[:3])}{' ...' if len(names) > 3 else ''}" if names else ""
