# Copyright 2026 ride_estimation contributors
"""Settings of the diagnosis: analysis band, what counts as within tolerance, and how sure a verdict must be."""

from __future__ import annotations

import dataclasses

import numpy as np

from ride_estimation.sensors.installation import USUAL, Installation
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.prior import CG_STD, DAMPING_LOG_STD, INERTIA_STD, STIFFNESS_LOG_STD
from ride_estimation.vehicles.vehicle import Body


@dataclasses.dataclass(frozen=True)
class Tolerances:
    """One-sigma tolerances of a good installation; what stays within them is calibration, not a cause.

    Every tolerance is a sensitivity column of the calibrated model with this prior standard deviation. Those of sensors are
    :data:`ride_estimation.sensors.installation.USUAL`, those of the vehicle :mod:`ride_estimation.vehicles.prior`. An
    installation that is worse is found as a cause; who knows it beforehand states it as ``installation`` of the sensor in the
    vehicle file.

    Attributes
    ----------
    gain
        Relative gain error of one axis of an accelerometer, or of a transducer [-].
    misalignment
        Rotation error of one sensor [rad].
    position
        Position error of one sensor [m].
    delay
        Timing error of one sensor [s].
    gyro_gain
        Relative gain error of one angular rate [-]: data sheets of micromechanical gyros state 1 to 3 % at most.
    bandwidth
        Error of the squared time constant of the anti-alias and interpolation low-pass [s^2], as a share of dt^2.
    bias
        Offset of one accelerometer axis [m/s^2], zero-g error left after zeroing on a level floor.
    travel_zero
        Zero of one displacement transducer at static equilibrium [m].
    cg
        Position of the CG where the vehicle file states none [m].
    inertia
        Relative error of the inertia where the vehicle file states none [-].
    stiffness, damping
        Standard deviation of the natural logarithm where the vehicle file states no prior [-].
    """

    gain: float = USUAL.gain
    misalignment: float = USUAL.misalignment
    position: float = USUAL.position
    delay: float = USUAL.delay
    gyro_gain: float = 0.01
    bandwidth: float = 0.15
    bias: float = USUAL.bias
    travel_zero: float = USUAL.travel_zero
    cg: float = CG_STD
    inertia: float = INERTIA_STD
    stiffness: float = STIFFNESS_LOG_STD
    damping: float = DAMPING_LOG_STD

    def of(self, sensor: Sensor) -> Installation:
        """Return the standard deviations of the errors of one sensor, larger ones where its file states such.

        A file that states smaller ones, as after a calibration, makes no fault of what every good installation has.
        """
        usual = Installation(**{f.name: getattr(self, f.name) for f in dataclasses.fields(Installation)})
        return usual if sensor.installation is None else usual.at_least(sensor.installation)

    def of_cg(self, body: Body) -> list[float]:
        """Return the standard deviations of the CG of a body, those of its file where it states some [m]."""
        return [self.cg] * 3 if body.cg_std is None else np.maximum(body.cg_std, 1e-4).tolist()


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of one diagnosis.

    Attributes
    ----------
    band_hz
        Lower and upper edge of the analysis band [Hz]; the upper edge is cut at 0.42 of the sample rate.
    block_s
        Length of the blocks that are dealt to fit, select and judge [s].
    trim_s
        Stretch left out at both ends and around gaps, where the recording fades and the model has not forgotten most of its
        start [s]; what is left of the start is estimated (:mod:`ride_estimation.diagnosis.calibration.initial_state`).
    adequacy
        Relative error of a model that still counts as right, share of each channel's amplitude [-].
    over_band
        That error refers to the power of a channel in the whole band, not to its power at each frequency: where one signal is
        measured and driven narrowly (a bench), what a rig does at frequencies that hardly carry a force is no evidence.
    minimum_duration_s
        Shorter runs are ``insufficient_data`` [s].
    minimum_signal_to_noise
        Response rms over noise rms below which there is no excitation [-].
    significance
        Smallest gain in penalised log-likelihood a cause must bring [nat].
    relevance
        Smallest share of the residual energy above the noise floor that a cause must remove [-].
    unexplained
        Share of the residual energy above the floor above which causes are taken for wrong ones while others are tried [-].
    unknown_probability
        Prior probability that the true cause is not in the library and something in the library fits all the same [-].
    further_cause
        Prior probability that a vehicle with one cause has a further one [-].
    candidates
        Number of causes that are fitted fully.
    maximum_causes
        Largest number of simultaneous causes.
    most_fits
        Full fits after which the search for causes and rivals ends with what it has; a budget in work and not in time gives the
        same answer on every machine.
    bootstrap
        Resamplings of blocks for intervals.
    seed
        Seed of the resampling.
    stability
        Ask perturbed copies of the run whether they give the same answer; half as much work again.
    plan_next
        Where a rival of a named cause is alive, simulate with both which run would tell them apart.
    threads
        Number of threads that fit and score candidates; 0: one per core, four at most. The answer does not depend on it.
    """

    band_hz: tuple[float, float] = (0.4, 40.0)
    block_s: float = 2.0
    trim_s: float = 3.0
    adequacy: float = 0.004
    over_band: bool = False
    minimum_duration_s: float = 12.0
    minimum_signal_to_noise: float = 5.0
    significance: float = 15.0
    relevance: float = 0.1
    unexplained: float = 0.25
    unknown_probability: float = 0.1
    further_cause: float = 0.15
    candidates: int = 6
    maximum_causes: int = 3
    most_fits: int = 40
    bootstrap: int = 400
    seed: int = 1
    stability: bool = False
    plan_next: bool = False
    threads: int = 0
    tolerances: Tolerances = dataclasses.field(default_factory=Tolerances)
