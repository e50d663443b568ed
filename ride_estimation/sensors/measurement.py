# Copyright 2026 ride_estimation contributors
"""From what an ideal sensor would read to what a real one delivers: errors of a good sensor, and faults."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, rotation_from_rpy
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel

Array = NDArray[np.float64]

#: faults a scenario may plant -> what ``size`` means
FAULT_KINDS: dict[str, str] = {
    "stuck": "no size: the last value is repeated",
    "dead": "no size: the sensor reads zero",
    "nan": "no size: not a number",
    "spikes": "amplitude of single wrong samples, about one in fifty [unit of the sensor]",
    "swapped_axes": "no size: two axes change places",
    "inverted_axis": "no size: one axis changes sign",
    "gap": "no size: nothing is sent",
    "delay": "time by which the values are late behind their stamps [s]",
    "gain": "factor on the values",
    "bias": "added to one axis [unit of the sensor]",
    "noise": "standard deviation of extra noise [unit of the sensor]",
    "clipping": "magnitude at which the values are cut [unit of the sensor]",
    "misalignment": "rotation about one axis [rad]",
    "stamp_jump": "time the stamps jump by [s]",
    "stamp_zero": "no size: the stamps are zero",
    "duplicates": "no size: every message is sent twice",
}


@dataclasses.dataclass(frozen=True)
class SensorErrors:
    """Errors every real sensor has; the values are those of the unit at hand, not of its data sheet.

    Attributes
    ----------
    rate
        Samples per second [Hz].
    noise_scale
        Factor on the noise of the vehicle file.
    bias_std, gain_std, misalignment_std
        Spread from which each sensor draws its own bias [unit], relative gain error and rotation [rad].
    quantisation
        Step of the converter of the first three channels [unit], 0 for none.
    anti_alias
        Corner of the zero-phase low-pass before sampling [Hz], 0 for none (a logger that compensates its filter delay).
    jitter_std
        Scatter of the sampling instants, which the stamps tell truly [s].
    stamp_error_std
        Scatter of the stamps about the true instants [s].
    drop_share
        Share of samples that never arrive.
    latency
        Mean time between stamp and arrival [s].
    synchronous
        All sensors sample at the same instants; otherwise each has its own phase.
    """

    rate: float = 200.0
    noise_scale: float = 1.0
    bias_std: float = 0.0
    gain_std: float = 0.0
    misalignment_std: float = 0.0
    quantisation: float = 0.0
    anti_alias: float = 80.0
    jitter_std: float = 0.0
    stamp_error_std: float = 0.0
    drop_share: float = 0.0
    latency: float = 0.002
    synchronous: bool = False

    def __post_init__(self) -> None:
        problems = [
            f"{f.name}: {getattr(self, f.name)}; allowed: 0 or more"
            for f in dataclasses.fields(self)
            if not isinstance(getattr(self, f.name), bool) and not 0.0 <= getattr(self, f.name) < math.inf
        ]
        if not self.rate > 0.0:
            problems.append(f"rate: {self.rate:g} Hz; allowed: greater than zero")
        if self.drop_share >= 1.0:
            problems.append(f"drop_share: {self.drop_share:g}; allowed: 0 to less than 1")
        if problems:
            raise ConfigurationError(problems, where="sensor errors")


@dataclasses.dataclass(frozen=True)
class Fault:
    """One fault of one sensor during a time window.

    Attributes
    ----------
    sensor
        Name of the vehicle file.
    kind
        One of :data:`FAULT_KINDS`.
    begin, end
        [s]; to the end of the run where infinite.
    size
        Meaning by kind.
    axis, other_axis
        ``x y z``; which channel, and for swapped axes the second one.
    """

    sensor: str
    kind: str
    begin: float = 0.0
    end: float = math.inf
    size: float = 0.0
    axis: str = "z"
    other_axis: str = "y"

    def __post_init__(self) -> None:
        problems = []
        if self.kind not in FAULT_KINDS:
            problems.append(f"kind: {self.kind!r}; allowed: {', '.join(FAULT_KINDS)}")
        if not self.begin < self.end:
            problems.append(f"from {self.begin:g} s to {self.end:g} s; allowed: from before to")
        for name in (self.axis, self.other_axis):
            if name not in AXES:
                problems.append(f"axis: {name!r}; allowed: x, y, z")
        if problems:
            raise ConfigurationError(problems, where=f"fault of {self.sensor}")


@dataclasses.dataclass(frozen=True)
class UnitErrors:
    """What one sensor drew: bias (C,), gain, rotation error (3, 3); part of the truth of a run."""

    bias: Array
    gain: float
    rotation: Array


def draw_unit(sensor: Sensor, errors: SensorErrors, generator: np.random.Generator) -> UnitErrors:
    """Draw bias, gain and misalignment of one sensor."""
    vector = sensor.channels in (3, 6)
    angles = errors.misalignment_std * generator.standard_normal(3)
    bias = errors.bias_std * generator.standard_normal(sensor.channels)
    if sensor.kind == "imu":
        bias[3:] *= sensor.gyro_noise_std / max(sensor.noise_std, 1e-12)
    gain = 1.0 + errors.gain_std * float(generator.standard_normal())
    return UnitErrors(bias, gain, rotation_from_rpy(*angles) if vector else np.eye(3))


def sample_times(duration: float, errors: SensorErrors, generator: np.random.Generator) -> Array:
    """Return the true sampling instants of one device [s], with its own phase and jitter.

    Parameters
    ----------
    duration
        Of the run [s].
    """
    period = 1.0 / errors.rate
    phase = 0.0 if errors.synchronous else float(generator.uniform(0.0, period))
    time = np.arange(phase, duration, period)
    time = time + np.clip(errors.jitter_std * generator.standard_normal(len(time)), -0.45 * period, 0.45 * period)
    return np.asarray(np.clip(time, 0.0, duration), dtype=float)


def measure(
    sensor: Sensor,
    ideal: Array,
    rate_hz: float,
    time: Array,
    errors: SensorErrors,
    unit: UnitErrors,
    faults: Sequence[Fault],
    generator: np.random.Generator,
    start_ns: int = 0,
) -> Channel:
    """Return the samples a sensor delivers, in order of arrival.

    Known errors of the sensor (its correction) are built in, those the unit drew come on top.

    Parameters
    ----------
    ideal
        Errorless readings on the simulation's time base, shape (N, C).
    rate_hz
        Of ``ideal`` [Hz], several times the sensor's own rate.
    time
        Sampling instants [s], from :func:`sample_times`; sensors of one message share them.
    unit
        From :func:`draw_unit`.
    faults
        Those of this sensor.
    start_ns
        Stamp of the first ideal sample [ns].
    """
    # own draws for the faults, so that planting one changes nothing else
    fault_generator = np.random.default_rng(generator.integers(2**63))
    late = np.full(len(time), sensor.correction.delay)
    for fault in faults:
        if fault.kind == "delay":
            late[_window(fault, time)] += fault.size
    signal = low_pass(ideal, rate_hz, errors.anti_alias) if errors.anti_alias > 0.0 else ideal
    if sensor.coupling == "ac":
        signal = signal - signal.mean(axis=0)
    values = scipy.interpolate.CubicSpline(np.arange(len(signal)) / rate_hz, signal, axis=0)(np.maximum(time - late, 0.0))
    values = sensor.correction.reading(_unit_errors(sensor, values, errors, unit, generator))
    values = _value_faults(values, time, faults, fault_generator)
    values = np.clip(values, -sensor.full_scale, sensor.full_scale) if math.isfinite(sensor.full_scale) else values
    if errors.quantisation > 0.0:
        values[:, :3] = np.round(values[:, :3] / errors.quantisation) * errors.quantisation
    values = sensor.only_measured(values)
    stamps = time if errors.stamp_error_std == 0.0 else time + errors.stamp_error_std * generator.standard_normal(len(time))
    stamp_ns = start_ns + np.round(stamps * 1e9).astype(np.int64)
    way = errors.latency * (0.5 + generator.exponential(0.5, len(time)))
    # one device sends its samples in order
    arrival_ns = start_ns + np.round(np.maximum.accumulate(time + way) * 1e9).astype(np.int64)
    return _transport_faults(sensor, time, stamp_ns, arrival_ns, values, errors, faults, generator)


def low_pass(signal: Array, rate_hz: float, corner_hz: float, order: int = 4) -> Array:
    """Return the signal through a zero-phase Butterworth magnitude ``1 / sqrt(1 + (f / fc)^(2 order))``, axis 0.

    Parameters
    ----------
    signal
        Shape (N, C).
    corner_hz
        -3 dB [Hz].
    """
    pad = min(len(signal) - 1, math.ceil(4.0 * rate_hz / corner_hz))
    # odd extension keeps value and slope at the ends
    head, tail = 2.0 * signal[0] - signal[pad:0:-1], 2.0 * signal[-1] - signal[-2 : -pad - 2 : -1]
    extended = np.concatenate([head, signal, tail])
    frequency = np.fft.rfftfreq(len(extended), 1.0 / rate_hz)
    gain = 1.0 / np.sqrt(1.0 + (frequency / corner_hz) ** (2 * order))
    spectrum = np.fft.rfft(extended, axis=0) * gain[:, None]
    return np.asarray(np.fft.irfft(spectrum, n=len(extended), axis=0)[pad : pad + len(signal)], dtype=float)


def _unit_errors(
    sensor: Sensor, values: Array, errors: SensorErrors, unit: UnitErrors, generator: np.random.Generator
) -> Array:
    noise = np.full(values.shape[1], sensor.noise_std)
    if sensor.kind == "imu":
        noise[3:] = sensor.gyro_noise_std
    for first in range(0, 3 * (values.shape[1] // 3), 3):
        values[:, first : first + 3] = values[:, first : first + 3] @ unit.rotation
    drawn = errors.noise_scale * noise * generator.standard_normal(values.shape)
    return np.asarray(unit.gain * values + unit.bias + drawn, dtype=float)


def _window(fault: Fault, time: Array) -> NDArray[np.bool_]:
    return np.asarray((time >= fault.begin) & (time < fault.end))


def _value_faults(values: Array, time: Array, faults: Sequence[Fault], generator: np.random.Generator) -> Array:
    values = values.copy()
    for fault in faults:
        inside = _window(fault, time)
        if not np.any(inside):
            continue
        axis = min(AXES.index(fault.axis), values.shape[1] - 1)
        other = min(AXES.index(fault.other_axis), values.shape[1] - 1)
        if fault.kind == "stuck":
            values[inside] = values[np.flatnonzero(inside)[0]]
        elif fault.kind == "dead":
            values[inside] = 0.0
        elif fault.kind == "nan":
            values[inside] = np.nan
        elif fault.kind == "spikes":
            hit = inside & (generator.random(len(time)) < 0.02)
            values[hit, axis] += fault.size * np.where(generator.random(np.count_nonzero(hit)) < 0.5, -1.0, 1.0)
        elif fault.kind == "swapped_axes":
            values[np.ix_(inside, [axis, other])] = values[np.ix_(inside, [other, axis])]
        elif fault.kind == "inverted_axis":
            values[inside, axis] *= -1.0
        elif fault.kind == "gain":
            values[inside] *= fault.size
        elif fault.kind == "bias":
            values[inside, axis] += fault.size
        elif fault.kind == "noise":
            values[inside] += fault.size * generator.standard_normal((np.count_nonzero(inside), values.shape[1]))
        elif fault.kind == "clipping":
            values[inside] = np.clip(values[inside], -fault.size, fault.size)
        elif fault.kind == "misalignment" and values.shape[1] >= 3:
            angles = [fault.size if a == fault.axis else 0.0 for a in AXES]
            values[inside, :3] = values[inside, :3] @ rotation_from_rpy(*angles)
    return values


def _transport_faults(
    sensor: Sensor,
    time: Array,
    stamp_ns: NDArray[np.int64],
    arrival_ns: NDArray[np.int64],
    values: Array,
    errors: SensorErrors,
    faults: Sequence[Fault],
    generator: np.random.Generator,
) -> Channel:
    keep = generator.random(len(time)) >= errors.drop_share
    repeat = np.ones(len(time), dtype=np.int64)
    for fault in faults:
        inside = _window(fault, time)
        if fault.kind == "gap":
            keep &= ~inside
        elif fault.kind == "stamp_jump":
            stamp_ns = stamp_ns + np.where(inside, round(fault.size * 1e9), 0)
        elif fault.kind == "stamp_zero":
            stamp_ns = np.where(inside, 0, stamp_ns)
        elif fault.kind == "duplicates":
            repeat[inside] = 2
    index = np.repeat(np.arange(len(time)), repeat * keep)
    order = index[np.argsort(arrival_ns[index], kind="stable")]
    return Channel(
        name=sensor.name, stamp_ns=stamp_ns[order], values=values[order], arrival_ns=arrival_ns[order], frame_id=sensor.name,
        correction=sensor.correction,
    )
