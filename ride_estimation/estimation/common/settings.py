# Copyright 2026 ride_estimation contributors
"""Settings of the online estimators; every number with unit and range, none of them a property of one vehicle."""

from __future__ import annotations

import dataclasses
import math

from ride_estimation.errors import ConfigurationError
from ride_estimation.vehicles.prior import DAMPING_LOG_STD, STIFFNESS_LOG_STD


@dataclasses.dataclass(frozen=True)
class PipelineSettings:
    """How the estimators work.

    Attributes
    ----------
    rate_hz
        Ticks of the common time base per second; None takes the fastest accelerometer, found while aligning.
    block_ticks
        Ticks processed together. Ticks and blocks are defined by stamps, so live and offline agree bit by bit.
    latency_budget
        Longest time [s] for which samples may be held back, by a gateway for example, and come sensor by sensor without loss.
    tilt_acceleration_std
        Typical horizontal acceleration [m/s^2] that the tilt estimate must not mistake for tilt.
    tilt_correlation_time
        Time [s] over which that acceleration stays similar.
    parameter_corner_hz
        Corner of the high-pass every signal of the parameter estimators passes [Hz].
    parameter_interval
        Time between two updates of the parameters [s].
    parameter_memory
        Excited time after which what was learned counts a third [s]: the forgetting of the parameters.
    noise_scale
        Factor on the sensor noise of the vehicle file; noise that messages state is taken as it is.
    excitation_accel
        Cab acceleration [m/s^2 RMS over an interval, high-passed] below which nothing is learned.
    prior_stiffness_std, prior_damping_std
        Standard deviation of the logarithm where the vehicle file states none.
    largest_ratio
        Bound of every parameter as a multiple of its prior, both ways, where the vehicle file states no range.
    largest_step
        Bound of the change of a logarithm in one update after the start.
    estimate_parameters
        False keeps every parameter at the vehicle file's value.
    """

    rate_hz: float | None = None
    block_ticks: int = 10
    latency_budget: float = 3.0
    tilt_acceleration_std: float = 1.0
    tilt_correlation_time: float = 0.3
    parameter_corner_hz: float = 0.4
    parameter_interval: float = 0.5
    parameter_memory: float = 30.0
    noise_scale: float = 1.0
    excitation_accel: float = 0.05
    prior_stiffness_std: float = STIFFNESS_LOG_STD
    prior_damping_std: float = DAMPING_LOG_STD
    largest_ratio: float = 5.0
    largest_step: float = 0.2
    estimate_parameters: bool = True

    def __post_init__(self) -> None:
        problems = []
        ranges = {
            "block_ticks": (1, 1000), "latency_budget": (0.5, 60.0), "tilt_acceleration_std": (1e-3, 100.0),
            "tilt_correlation_time": (1e-3, 100.0), "parameter_corner_hz": (0.05, 5.0),
            "parameter_interval": (0.05, 10.0), "parameter_memory": (5.0, 3600.0), "noise_scale": (0.1, 100.0),
            "excitation_accel": (0.0, 10.0), "prior_stiffness_std": (1e-3, 3.0), "prior_damping_std": (1e-3, 3.0),
            "largest_ratio": (1.1, 100.0), "largest_step": (1e-3, 2.0),
        }  # fmt: skip
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not math.isfinite(value) or not low <= value <= high:
                problems.append(f"{name}: {value!r}; allowed: {low:g} to {high:g}")
        if self.rate_hz is not None and not (math.isfinite(self.rate_hz) and 20.0 <= self.rate_hz <= 20000.0):
            problems.append(f"rate_hz: {self.rate_hz!r}; allowed: 20 to 20000, or none")
        if problems:
            raise ConfigurationError(problems, where="estimator settings")
