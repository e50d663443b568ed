# Copyright 2026 ride_estimation contributors
"""Smoothed forces of a recorded run by the model, where it describes the run."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, signal

from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.model.bracket_shares import learn_shares
from ride_estimation.estimation.model.joint import LARGEST_NIS, JointEstimate, liveliest
from ride_estimation.estimation.model.run_parameters import load_in_words, mass_properties, run_parameters
from ride_estimation.estimation.model.run_readings import run_readings
from ride_estimation.estimation.model.smoother import SmoothedSegment, smooth
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: length of the part the slow states are estimated from, longest and shortest [s]; segments are smoothed in parts of the former
_LONGEST_S, _SHORTEST_S = 60.0, 10.0
#: distance from the end of a segment where its forces begin to count and count alone, where another segment goes on [s]: what
#: lies beyond the end is missing
_FROM_S, _FULLY_S = 2.0, 4.0
#: NIS in the octaves below 4 Hz up to which forces are those of the model. There an elastic mode leaves 1 to 5 (in its own octave
#: up to 1065), a mount that softens by 5 or 10 % 1 to 36: forces are nearer than live ones and inside. One that softens by 20 %
#: and is not found leaves 39 and 143: 60 and 78 % inside
_LARGEST_SLOW_NIS = 10.0
#: highest frequency in the forces of the model over its rate; forces beyond are left as they are
_HIGHEST = 0.33
_ORDER = 6


@dataclasses.dataclass(frozen=True)
class RunForces:
    """Forces of the segments of a run.

    Attributes
    ----------
    segments
        First stamp [ns] and forces of every segment.
    dt
        Sample [s], not a number where the run was not read.
    findings
        Sentences: how the vehicle differs from its file.
    faults
        Errors of sensors beyond their tolerances, which are in the estimate.
    parameters, mass_properties
        Stiffness and damping of the mounts; CG and inertia of the body.
    refused
        Why there are no segments.
    load
        Sentence on a load that the vehicle file does not contain, empty where there is none. It is in the segments.
    load_share
        Share of the mass that it may have, where there are no segments.
    """

    segments: tuple[tuple[int, SmoothedSegment], ...] = ()
    dt: float = math.nan
    findings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    parameters: tuple[Estimate, ...] = ()
    mass_properties: tuple[Estimate, ...] = ()
    refused: str = ""
    load: str = ""
    load_share: float = 0.0

    def fade_in(
        self, stamp_ns: NDArray[np.int64], trusted: Array, force: Array, std: Array, deflection: Array, axes: int = 3
    ) -> float:
        """Replace forces, standard deviations and deflections at stamps by those of the model, in place.

        What is faster than the model stays, but where a sensor is left out.

        Parameters
        ----------
        stamp_ns
            Shape (N,), equally spaced.
        trusted
            How far the run is one the model describes, 0 to 1, shape (2, N): with all sensors, and without one.
        force, std, deflection
            Shape (N, M, 3).
        axes
            How many axes are replaced: x and y, or all.

        Returns
        -------
        float
            Mean share of the model.
        """
        rate = 1e9 / float(np.median(np.diff(stamp_ns)))
        cut = 2.0 * _HIGHEST / (self.dt * rate)
        low_pass = None if cut >= 1.0 else signal.butter(_ORDER, cut, output="sos")
        share = np.zeros(len(stamp_ns))
        for start, segment in self.segments:
            time, own = (stamp_ns - start) * 1e-9, np.arange(len(segment.force)) * self.dt
            inside = np.ones(len(time))
            for end, distance in ((0.0, time), (own[-1], own[-1] - time)):
                if self._goes_on(start + 1e9 * end):
                    inside *= np.clip((distance - _FROM_S) / (_FULLY_S - _FROM_S), 0.0, 1.0)
            at = np.flatnonzero((time >= 0.0) & (time <= own[-1]))
            if len(at) < 2:
                continue
            weight = (trusted[int(segment.bridged)] * inside)[at, None, None]
            share[at] += weight[:, 0, 0] * (1.0 - share[at])
            for values, found in ((force, segment.force[..., :axes]), (deflection, segment.deflection[..., :axes])):
                before = slow = values[at, :, :axes]
                # where a sensor is left out what is faster than the model may be of that sensor's fault
                if low_pass is not None and not segment.bridged:
                    slow = signal.sosfiltfilt(low_pass, before, axis=0, padlen=min(len(at) - 1, 200))
                values[at, :, :axes] = before + weight * (interpolate.make_interp_spline(own, found, k=5)(time[at]) - slow)
            square = interpolate.make_interp_spline(own, segment.std[..., :axes] ** 2, k=1)(time[at])
            first = std[at, :, :axes] ** 2
            std[at, :, :axes] = np.sqrt(first + weight * (square - first))
        return float(share.mean())

    def _goes_on(self, stamp_ns: float) -> bool:
        """Return whether a segment reaches beyond a time, either way, by what another one fades over."""
        reach = 1e9 * _FULLY_S
        parts = ((start, start + 1e9 * (len(segment.force) - 1) * self.dt) for start, segment in self.segments)
        return any(first + reach <= stamp_ns <= last - reach for first, last in parts)


def run_forces(recording: Recording, vehicle: Vehicle) -> RunForces:
    """Return the forces of a run, or why the model has none (``refused``).

    Parameters
    ----------
    recording
        The run.
    vehicle
        Its sensors are taken to be installed as the file states; what the run tells of them is used.
    """
    silent = [n for n, s in vehicle.sensors.items() if n not in recording.channels or not len(recording.channels[n].stamp_ns)]
    heard = dataclasses.replace(vehicle, sensors={n: s for n, s in vehicle.sensors.items() if n not in silent})
    try:
        found = run_readings(recording, heard)
        if sum(len(s) for s in found.segments) * found.dt < _SHORTEST_S:
            return RunForces(refused=f"less than {_SHORTEST_S:g} s in which every sensor has data without a gap")
        part = liveliest(found.segments, round(_LONGEST_S / found.dt))
        joint = JointEstimate(found.plant, [part], found.dt, free_forces=True)
        joint.fit()
        learn_shares(joint)
    except RideEstimationError as error:
        return RunForces(refused=str(error))
    explains = joint.largest_nis <= LARGEST_NIS
    if joint.largest_slow_nis > _LARGEST_SLOW_NIS or (joint.plant.load.presence and not explains):
        words = f"the model does not explain the readings (NIS {joint.nis:.2f}, {joint.largest_nis:.1f} in one octave)"
        return RunForces(refused=words)
    conflicts = joint.conflicts()
    if conflicts:
        words = f"the model misses what {', '.join(conflicts[:3])} would explain"
        load = joint.plant.load
        return RunForces(refused=words, load=load_in_words(joint), load_share=math.hypot(load.share, load.std))
    smoothed = []
    # where there are both, what needs no bridge comes last and counts
    for bridge in found.bridges:
        if joint.plant.enough_without(bridge.sensor):
            smoothed += _smoothed(joint, bridge.start_ns, bridge.readings, bridge.silent)
    for start, readings in zip(found.start_ns, found.segments):
        smoothed += _smoothed(joint, start, readings)
    if not smoothed:
        return RunForces(refused="the model describes no part of the run")
    if not explains:
        # what it leaves widens its forces; of what the vehicle is it says nothing
        return RunForces(tuple(smoothed), found.dt)
    newest = max(int(channel.stamp_ns[-1]) for channel in recording.channels.values() if len(channel.stamp_ns))
    estimates = run_parameters(joint, newest), mass_properties(joint, newest)
    return RunForces(tuple(smoothed), found.dt, joint.plant.findings, joint.faults, *estimates, load=load_in_words(joint))


def _smoothed(
    joint: JointEstimate, start_ns: int, readings: Array, silent: NDArray[np.bool_] | None = None
) -> list[tuple[int, SmoothedSegment]]:
    """Return first stamps and forces of the parts of a segment that the model describes as well as the one it was fitted to."""
    out, dt = [], joint.dt
    for first, stop in _parts(len(readings), round(_LONGEST_S / dt), round(2.0 * _FULLY_S / dt)):
        try:
            segment = smooth(joint, readings[first:stop], silent)
        except np.linalg.LinAlgError:
            continue
        # what leaves clearly more than the part the slow states are from is not the same vehicle any more
        same = segment.nis <= LARGEST_NIS * max(joint.largest_nis, 1.0)
        if same and all(np.isfinite(x).all() for x in (segment.force, segment.std)):
            out.append((start_ns + round(1e9 * first * dt), segment))
    return out


def _parts(count: int, longest: int, overlap: int) -> list[tuple[int, int]]:
    """Return begin and end of equal parts of so many samples that overlap."""
    parts = max(1, math.ceil((count - overlap) / (longest - overlap)))
    length = math.ceil((count - overlap) / parts) + overlap
    return [(i * (length - overlap), min(i * (length - overlap) + length, count)) for i in range(parts)]
