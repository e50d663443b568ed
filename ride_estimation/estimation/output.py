# Copyright 2026 ride_estimation contributors
"""What the pipeline hands out: one block of ticks with motion, loads, forces and how sure each is."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.forces.mount_forces import ForceBlock
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.estimation.motion.motion_block import MotionBlock

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
#: when sensors were heard and not used: name -> first and last stamp [ns] of every time
LeftOut = dict[str, list[tuple[int, int]]]


#: usual data time between two reports of parameters and of diagnostics [s]
REPORT_PERIOD_S = 1.0


@dataclasses.dataclass(frozen=True)
class Ticks:
    """What is published of K ticks of M mounts, SI, cab axes; covariances hold for all of them.

    Attributes
    ----------
    stamp_ns
        Stamps of the ticks, shape (K,).
    valid
        Shape (K,), False where so many channels are missing that the motion is a guess.
    cg_accel
        Acceleration of the CG without gravity and angular acceleration, shape (K, 6) [m/s^2, rad/s^2].
    cg_accel_covariance
        Shape (6, 6), tilt uncertainty included.
    cg_specific_force
        Specific force at the CG (a virtual DC accelerometer) and angular acceleration, shape (K, 6).
    cg_specific_force_covariance
        Shape (6, 6).
    angular_rate
        Shape (K, 3) [rad/s].
    angular_rate_std
        Shape (3,) [rad/s], 0 for a rate that the suspension does not allow.
    inertial_load
        ``m a`` and ``J alpha + omega x J omega``, shape (K, 6) [N, N m].
    mount_force
        Force on the cab by each mount, static share included, shape (K, M, 3) [N].
    mount_force_std
        Shape (K, M, 3) [N].
    mount_deflection, mount_rate
        Body side minus base side, shape (K, M, 3) [m, m/s], slow drift removed.
    mount_deflection_std
        Shape (M, 3) [m].
    """

    stamp_ns: IntArray
    valid: BoolArray
    cg_accel: Array
    cg_accel_covariance: Array
    cg_specific_force: Array
    cg_specific_force_covariance: Array
    angular_rate: Array
    angular_rate_std: Array
    inertial_load: Array
    mount_force: Array
    mount_force_std: Array
    mount_deflection: Array
    mount_rate: Array
    mount_deflection_std: Array

    def publishable(self) -> BoolArray:
        """Return which ticks hold an estimate, all of its numbers finite, shape (K,)."""
        parts = (
            self.cg_accel, self.cg_specific_force, self.angular_rate, self.inertial_load,
            self.mount_force, self.mount_force_std, self.mount_deflection, self.mount_rate,
        )  # fmt: skip
        good = self.valid.copy()
        for part in parts:
            good &= np.isfinite(part).all(axis=tuple(range(1, part.ndim)))
        shared = (self.cg_accel_covariance, self.angular_rate_std, self.cg_specific_force_covariance, self.mount_deflection_std)
        return np.asarray(good & all(bool(np.isfinite(part).all()) for part in shared))


class ReportSchedule:
    """When parameters and diagnostics are due: once per period of data time, the diagnostics a block later.

    So no force waits for both.
    """

    def __init__(self) -> None:
        self._reported_ns: int | None = None
        self._diagnostics_due = False

    def due(self, now_ns: int, period_ns: int) -> str:
        """Return ``parameters``, ``diagnostics`` or nothing for a block that ends at ``now_ns``."""
        if self._diagnostics_due:
            self._diagnostics_due = False
            return "diagnostics"
        if self._reported_ns is None or not 0 <= now_ns - self._reported_ns < period_ns:
            self._reported_ns = now_ns
            self._diagnostics_due = True
            return "parameters"
        return ""


@dataclasses.dataclass(frozen=True)
class OutputBlock(Ticks):
    """Estimates at K ticks of M mounts: what is published of them and what else is found.

    Attributes
    ----------
    tilt
        Roll, pitch and yaw (yaw without its slow part), shape (K, 3) [rad].
    support_load
        ``m f`` and the same moment: what the mounts together carry, weight included, shape (K, 6).
    load_covariance
        Of the support load: measured motion and the stated uncertainty of mass and inertia, shape (6, 6), at the last tick.
    inertial_load_covariance
        Of the inertial load: that of ``cg_accel``, tilt included, in place of the specific force; shape (6, 6), at the last tick.
    mount_force_std_equilibrium
        Part of the standard deviation that rigid-body equilibrium leaves: measured motion, mass, inertia; (K, M, 3).
    mount_force_std_model
        Part that rests on the mount model: the split among the mounts, invisible to equilibrium; (K, M, 3).
    measured, predicted
        Specific force per accelerometer in sensor axes (K, 3) and what the estimated motion predicts there.
    incomplete
        Whether a sensor that the deflections rest on was lost or suspect.
    loaded
        Whether there was a load that the vehicle file does not contain.
    left_out
        Sensors that were heard and not used.
    """

    tilt: Array
    support_load: Array
    load_covariance: Array
    inertial_load_covariance: Array
    mount_force_std_equilibrium: Array
    mount_force_std_model: Array
    measured: Mapping[str, Array]
    predicted: Mapping[str, Array]
    incomplete: bool
    loaded: bool
    left_out: tuple[str, ...]

    @staticmethod
    def of(
        stamp_ns: IntArray, motion: MotionBlock, accel: tuple[Array, Array], support: Array, loads: InertialLoads,
        forces: ForceBlock, of_sensors: Sequence[Mapping[str, Array]], anomalies: tuple[bool, bool],
        left_out: tuple[str, ...],
    ) -> OutputBlock:  # fmt: skip
        """Return what the steps of the pipeline found for a block.

        Parameters
        ----------
        stamp_ns
            Of the ticks.
        motion, accel
            Of the CG; the second without gravity, with its covariance.
        support, loads
            Wrench the mounts carry (K, 6), and the mass properties behind it.
        forces
            Of the mounts.
        of_sensors
            Measured and predicted specific force of the accelerometers.
        anomalies
            Values of ``incomplete`` and ``loaded``.
        left_out
            Sensors.
        """
        free, free_covariance = accel
        return OutputBlock(
            stamp_ns=stamp_ns, valid=motion.valid, cg_accel=free, cg_accel_covariance=free_covariance,
            cg_specific_force=motion.motion, cg_specific_force_covariance=motion.covariance, angular_rate=motion.rate,
            angular_rate_std=np.sqrt(motion.rate_variance), tilt=motion.tilt,
            inertial_load=loads.load(free, motion.rate), support_load=support,
            load_covariance=loads.covariance(motion.covariance, motion.motion[-1]),
            inertial_load_covariance=loads.covariance(free_covariance, free[-1]),
            mount_force=forces.force, mount_force_std=forces.std, mount_force_std_equilibrium=forces.std_equilibrium,
            mount_force_std_model=forces.std_model, mount_deflection=forces.deflection, mount_rate=forces.rate,
            mount_deflection_std=forces.deflection_std, measured=of_sensors[0], predicted=of_sensors[1], incomplete=anomalies[0],
            loaded=anomalies[1], left_out=left_out,
        )  # fmt: skip

    @property
    def cg_accel_std(self) -> Array:
        """Return the standard deviation of ``cg_accel``, shape (K, 6)."""
        return np.tile(np.sqrt(np.diag(self.cg_accel_covariance)), (len(self.stamp_ns), 1))

    @property
    def inertial_load_std(self) -> Array:
        """Return the standard deviation of the inertial load, shape (6,)."""
        return np.asarray(np.sqrt(np.diag(self.inertial_load_covariance)))


def left_out_of(blocks: Sequence[OutputBlock]) -> LeftOut:
    """Return when sensors were heard and not used."""
    found: LeftOut = {}
    last: tuple[str, ...] = ()
    for block in blocks:
        for name in block.left_out:
            times = found.setdefault(name, [])
            begin = times.pop()[0] if name in last else int(block.stamp_ns[0])
            times.append((begin, int(block.stamp_ns[-1])))
        last = block.left_out
    return found
