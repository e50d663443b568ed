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
    """Slices of the vector v of one sample or frequency: states of the motion, then what drives them.

    Attributes
    ----------
    relative, relative_rate
        Rigid motion of the body against the base at the CG: translation [m], rotation [rad]; its rate [m/s, rad/s].
    carried, carried_rate
        Motion of carried bodies against the body, per coordinate they have; its rate.
    deformation, deformation_rate
        What the base leaves of its rigid shape at the mounts, per pattern, counted as deflection of the mounts [m, m/s].
    base_accel
        Specific force and angular acceleration of the rigid base at the CG, without gravity [m/s^2, rad/s^2].
    deformation_accel
        Acceleration of the deformation [m/s^2].
    free_force
        Force of mounts beside their linear law, over the mass of the body [m/s^2].
    accelerated
        ``relative_rate`` and ``carried_rate``: what a force on the body changes.
    motion, drive
        The states, the inputs.
    size
        Number of all.
    """

    relative: slice
    carried: slice
    relative_rate: slice
    carried_rate: slice
    deformation: slice
    deformation_rate: slice
    base_accel: slice
    deformation_accel: slice
    free_force: slice
    accelerated: slice
    motion: slice
    drive: slice
    size: int

    @classmethod
    def of(cls, patterns: int, carried: int, free_forces: int = 0) -> FastStates:
        """Return the slices for a base of so many patterns, carried bodies of so many coordinates and so many free forces."""
        lengths = [6, carried, 6, carried, patterns, patterns, 6, patterns, free_forces]
        q, seat, rate, seat_rate, z, z_rate, base, deforming, force = slices_of(lengths)
        accelerated, motion, drive = slice(rate.start, seat_rate.stop), slice(0, base.start), slice(base.start, force.stop)
        return cls(q, seat, rate, seat_rate, z, z_rate, base, deforming, force, accelerated, motion, drive, force.stop)

    @property
    def deforming(self) -> slice:
        """Return the place of ``deformation_accel`` among the inputs."""
        return slice(self.deformation_accel.start - self.drive.start, self.deformation_accel.stop - self.drive.start)


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
    log_mass, cg, log_inertia, inertia_products
        Logarithm of the mass [kg], CG [m], logarithms of the scale of the inertia along three axes, and what its elements xy, xz
        and yz have beyond those of the file, over the root of the product of both moments.
    log_carried
        Logarithms of masses, then of stiffness and damping, of carried bodies over those of the vehicle file.
    mean_accel
        Mean specific force of base and body beyond gravity: slope of the road, correlation of motion and attitude [m/s^2].
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
    inertia_products: slice
    log_carried: slice
    mean_accel: slice
    sensors: dict[str, dict[str, slice]]
    mean: Array
    std: Array

    def names(self, sensor: str, kind: str) -> list[str]:
        """Return ``sensor.kind[.axis]`` of every value of one kind of error of a sensor."""
        part = self.sensors[sensor][kind]
        return [f"{sensor}.{kind}{axis}" for axis in ([".x", ".y", ".z"] if part.stop - part.start == 3 else [""])]

    def errors(self, found: NDArray[np.bool_]) -> tuple[str, ...]:
        """Return the names of the errors of sensors among chosen slow states, shape (P,)."""
        return tuple(
            error for name, parts in self.sensors.items() for kind, part in parts.items()
            for error, chosen in zip(self.names(name, kind), found[part]) if chosen
        )  # fmt: skip

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


def reading_width(sensor: Sensor) -> int:
    """Return how many values of a sample the model reads: those of accelerometers and transducers, no rates."""
    return min(sensor.channels, 3)


def slices_of(lengths: Sequence[int]) -> tuple[slice, ...]:
    """Return slices of so many values one after the other."""
    edges = np.cumsum([0, *lengths]).tolist()
    return tuple(slice(a, b) for a, b in itertools.pairwise(edges))


def error_std(installation: Installation, kind: str, travel: bool) -> float:
    """Return the prior standard deviation of one kind of error of a sensor."""
    return float(installation.travel_zero if travel and kind == "bias" else getattr(installation, kind))
