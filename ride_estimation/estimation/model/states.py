# Copyright 2026 ride_estimation contributors
"""Every number the model estimates: fast states (one value per sample) and slow states (one value per run).

Axes of the vehicle file. M mounts; n = 3 M - 6 patterns in which the base deforms between them.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.sensors.installation import Installation
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class FastStates:
    """Slices of the state vector x of one sample.

    Attributes
    ----------
    relative, relative_rate
        Rigid motion of the body against the base at the CG: translation [m], rotation [rad]; its rate [m/s, rad/s].
    deformation, deformation_rate
        What the base leaves of its rigid shape at the mounts, per pattern, counted as deflection of the mounts [m, m/s].
    shaping, shaping_rate
        High-pass filter that keeps the mean of the deformation at zero [m, m/s].
    deformation_drive, deformation_drive_rate
        Coloured acceleration that drives the deformation [m/s^2, m/s^3].
    base_accel, base_accel_rate
        Specific force and angular acceleration of the rigid base at the CG, without gravity [m/s^2, rad/s^2] and their rate.
    base_velocity
        Their integral, whose mean is zero [m/s, rad/s].
    size
        Number of states.
    """

    relative: slice
    relative_rate: slice
    deformation: slice
    deformation_rate: slice
    shaping: slice
    shaping_rate: slice
    deformation_drive: slice
    deformation_drive_rate: slice
    base_accel: slice
    base_accel_rate: slice
    base_velocity: slice
    size: int

    @classmethod
    def of(cls, patterns: int) -> FastStates:
        """Return the slices for a base that deforms in so many patterns."""
        parts = slices_of([6, 6, *[patterns] * 6, 6, 6, 6])
        names = [field.name for field in dataclasses.fields(cls)]
        return cls(size=parts[-1].stop, **dict(zip(names, parts)))


#: errors of an accelerometer and of a displacement transducer, in the order of their columns: name -> number of values
ACCELEROMETER_ERRORS = {"bias": 3, "gain": 3, "misalignment": 3, "position": 3, "delay": 1}
TRANSDUCER_ERRORS = {"bias": 1, "gain": 1, "delay": 1}


@dataclasses.dataclass(frozen=True)
class SlowStates:
    """Slices of the vector theta of constants and their prior.

    Attributes
    ----------
    log_stiffness, log_damping
        Logarithms of k [N/m] and c [N s/m], mount by mount, x y z.
    tilt_shares
        How brackets roll and pitch with the twist of the base: two shares [-] and two shifts [m].
    log_mass, cg, log_inertia
        Logarithm of the mass [kg], CG [m], logarithms of the scale of the inertia along three axes.
    coupling
        How far the base deforms along with its rigid acceleration: patterns (n) by directions (6), row by row [-, m].
    mean_accel
        Mean specific force of base and body beyond gravity: slope of the road, correlation of motion and attitude [m/s^2].
    log_rigid, log_deforming
        Logarithms of the rms of the accelerations that drive the rigid base, per direction, and its patterns [m/s^2, rad/s^2].
    log_corners
        Logarithms of the corners below which the base does not deform, horizontally and vertically [Hz].
    log_model
        Logarithm of the white error of every reading that no equation here describes, over the rms of the moving readings.
    sensors
        Per sensor and kind of error its slice: bias [unit], gain [-], misalignment [rad], position [m], delay [s].
    mean, std
        Prior, shape (P,); a state of std 0 is held.
    """

    log_stiffness: slice
    log_damping: slice
    tilt_shares: slice
    log_mass: slice
    cg: slice
    log_inertia: slice
    coupling: slice
    mean_accel: slice
    log_rigid: slice
    log_deforming: slice
    log_corners: slice
    log_model: slice
    sensors: dict[str, dict[str, slice]]
    mean: Array
    std: Array

    @property
    def system(self) -> int:
        """Return the number of states that are no error of a sensor; they come first."""
        return int(self.log_model.stop)

    @property
    def free(self) -> NDArray[np.int64]:
        """Return the indices of the states that are estimated."""
        return np.flatnonzero(self.std > 0.0)


def slow_states(mechanical: Sequence[tuple[Array, Array]], sensors: Sequence[Sensor]) -> SlowStates:
    """Return the layout of theta.

    Parameters
    ----------
    mechanical
        Mean and std of all slices before the sensors in the order of :class:`SlowStates`.
    sensors
        Accelerometers and transducers in the order of the readings; their installation is the prior of their errors.
    """
    parts = slices_of([len(mean) for mean, _ in mechanical])
    mean = np.concatenate([part for part, _ in mechanical])
    errors: dict[str, dict[str, slice]] = {}
    stds, at = [part for _, part in mechanical], len(mean)
    for sensor in sensors:
        travel = sensor.kind == "displacement"
        errors[sensor.name] = {}
        for kind, count in (TRANSDUCER_ERRORS if travel else ACCELEROMETER_ERRORS).items():
            errors[sensor.name][kind] = slice(at, at + count)
            at += count
            stds.append(np.full(count, error_std(sensor.stated_installation, kind, travel)))
    named = dict(zip([field.name for field in dataclasses.fields(SlowStates)], parts))
    mean = np.concatenate([mean, np.zeros(at - len(mean))])
    return SlowStates(sensors=errors, mean=mean, std=np.concatenate(stds), **named)


def slices_of(lengths: Sequence[int]) -> tuple[slice, ...]:
    """Return slices of so many values one after the other."""
    edges = np.cumsum([0, *lengths]).tolist()
    return tuple(slice(a, b) for a, b in itertools.pairwise(edges))


def error_std(installation: Installation, kind: str, travel: bool) -> float:
    """Return the prior standard deviation of one kind of error of a sensor."""
    return float(installation.travel_zero if travel and kind == "bias" else getattr(installation, kind))
