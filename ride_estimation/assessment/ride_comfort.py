# Copyright 2026 ride_estimation contributors
"""Whole-body vibration: frequency weightings of ISO 2631-1 / ISO 8041-1 and the values derived from them.

The weightings are the analogue filters of ISO 8041-1 made digital by the bilinear transform, each second-order section
pre-warped at its own corner. Above about a tenth of the sample rate the bilinear transform is too steep, so slower signals
are interpolated to at least 1 kHz first; what lies above 0.4 of their own rate they do not hold, and the result says so.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

MINIMUM_RATE_HZ = 400.0  # of the digital weighting
FINE_RATE_HZ = 1000.0  # of the weighting of an assessment: 0.04 dB at 50 Hz, 0.12 dB at 80 Hz
LOWEST_RATE_HZ = 60.0  # of a record; below, not even wheel hop at 10 to 15 Hz is in it
USABLE_SHARE = 0.4  # of the sample rate that a record holds, anti-alias filter and interpolation allowed for
CREST_FACTOR_LIMIT = 9.0  # above it a_w understates the exposure, ISO 2631-1 clause 6.2
BAND_LIMIT_Q = 1.0 / math.sqrt(2.0)

ACTION_VALUE_A8, LIMIT_VALUE_A8 = 0.5, 1.15  # m/s^2, Directive 2002/44/EC
ACTION_VALUE_VDV, LIMIT_VALUE_VDV = 9.1, 21.0  # m/s^1.75, Directive 2002/44/EC
A8_VALUES, VDV_VALUES = (ACTION_VALUE_A8, LIMIT_VALUE_A8), (ACTION_VALUE_VDV, LIMIT_VALUE_VDV)
HEALTH_FACTORS = (1.4, 1.4, 1.0)  # k of x, y, z for health, ISO 2631-1 clause 7
EXPOSURE_REFERENCE_S = 8.0 * 3600.0


@dataclasses.dataclass(frozen=True)
class Weighting:
    """Parameters of one weighting (ISO 8041-1 Table 3); infinite corners switch a stage off.

    Attributes
    ----------
    f1, f2
        Band limits [Hz].
    f3, f4, q4
        Acceleration to velocity transition.
    f5, q5, f6, q6
        Upward step.
    """

    f1: float
    f2: float
    f3: float
    f4: float
    q4: float
    f5: float = math.inf
    q5: float = 1.0
    f6: float = math.inf
    q6: float = 1.0

    def sections(self) -> list[tuple[Array, Array, float]]:
        """Return the analogue sections (numerator, denominator, corner [Hz]), highest power of s first."""
        w1, w2 = 2 * math.pi * self.f1, 2 * math.pi * self.f2
        found = [
            (np.array([1.0, 0.0, 0.0]), np.array([1.0, w1 / BAND_LIMIT_Q, w1**2]), self.f1),
            (np.array([0.0, 0.0, w2**2]), np.array([1.0, w2 / BAND_LIMIT_Q, w2**2]), self.f2),
        ]
        if math.isfinite(self.f4):
            w3, w4 = 2 * math.pi * self.f3, 2 * math.pi * self.f4
            found.append((np.array([0.0, w4**2 / w3, w4**2]), np.array([1.0, w4 / self.q4, w4**2]), self.f4))
        if math.isfinite(self.f5):
            w5, w6 = 2 * math.pi * self.f5, 2 * math.pi * self.f6
            found.append((np.array([1.0, w5 / self.q5, w5**2]), np.array([1.0, w6 / self.q6, w6**2]), self.f5))
        return found

    def gain(self, frequency_hz: ArrayLike) -> Array:
        """Return the exact analogue magnitude at ``frequency_hz``, any shape."""
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=float)
        response = np.ones_like(s)
        for numerator, denominator, _ in self.sections():
            response = response * np.polyval(numerator, s) / np.polyval(denominator, s)
        return np.asarray(np.abs(response))

    def digital(self, rate_hz: float) -> Array:
        """Return second-order sections for ``rate_hz``, shape (S, 6).

        Raises
        ------
        InputDataError
            Sample rate below 400 Hz.
        """
        if rate_hz < MINIMUM_RATE_HZ:
            raise InputDataError(
                f"weighting at {rate_hz:g} Hz would be wrong above {rate_hz / 10:g} Hz; at least {MINIMUM_RATE_HZ:g} Hz is "
                "needed: resample the signal first"
            )
        rows = []
        for numerator, denominator, corner in self.sections():
            warped = min(corner, 0.45 * rate_hz)
            equivalent_rate = math.pi * warped / math.tan(math.pi * warped / rate_hz)
            b, a = scipy.signal.bilinear(numerator, denominator, fs=equivalent_rate)
            rows.append(np.concatenate([np.pad(b, (3 - len(b), 0)), a]))
        return np.array(rows)


#: weightings by name: Wk (vertical), Wd (horizontal), Wc (seat back), We (rotation), Wj (head)
WEIGHTINGS: dict[str, Weighting] = {
    "Wk": Weighting(0.4, 100.0, 12.5, 12.5, 0.63, 2.37, 0.91, 3.35, 0.91),
    "Wd": Weighting(0.4, 100.0, 2.0, 2.0, 0.63),
    "Wc": Weighting(0.4, 100.0, 8.0, 8.0, 0.63),
    "We": Weighting(0.4, 100.0, 1.0, 1.0, 0.63),
    "Wj": Weighting(0.4, 100.0, math.inf, math.inf, 1.0, 3.75, 0.91, 5.32, 0.91),
}


@functools.lru_cache(maxsize=len(WEIGHTINGS))
def _digital(weighting: str, rate_hz: float) -> Array:
    """Return the sections of a weighting, made once for all places and axes of a run."""
    return WEIGHTINGS[weighting].digital(rate_hz)


class WeightedSignal:
    """A streaming weighting filter: chunks give exactly what one pass gives.

    Parameters
    ----------
    weighting
        Name in :data:`WEIGHTINGS`.
    rate_hz
        Sample rate [Hz].
    """

    def __init__(self, weighting: str, rate_hz: float) -> None:
        if weighting not in WEIGHTINGS:
            raise InputDataError(f"weighting {weighting!r} is unknown; allowed: {', '.join(WEIGHTINGS)}")
        self._sos = _digital(weighting, rate_hz)
        self._state: Array | None = None

    def feed(self, values: ArrayLike) -> Array:
        """Return the weighted samples of the next chunk, shape (N,)."""
        chunk = np.asarray(values, dtype=float).ravel()
        if not np.all(np.isfinite(chunk)):
            raise InputDataError("the signal to be weighted contains values that are not finite")
        if not chunk.size:
            return chunk
        if self._state is None:
            # as if the first value had lasted for ever: gravity or an offset starts no transient
            self._state = scipy.signal.sosfilt_zi(self._sos) * chunk[0]
        weighted, self._state = scipy.signal.sosfilt(self._sos, chunk, zi=self._state)
        return np.asarray(weighted)


class Interpolator:
    """Raises the rate of a stream by a whole factor through a linear-phase filter; chunks give what one pass gives.

    Parameters
    ----------
    factor
        Output samples per input sample; 1 passes everything on.
    """

    def __init__(self, factor: int) -> None:
        self._factor = factor
        self._state: Array | None = None
        # pass band to 0.4 of the input rate, images from 0.6 of it down by 60 dB
        width, attenuation = 0.4 / factor, 60.0
        count, beta = scipy.signal.kaiserord(attenuation, width)
        self._taps = factor * scipy.signal.firwin(count | 1, 1.0 / factor, window=("kaiser", beta)) if factor > 1 else np.ones(1)

    def feed(self, values: ArrayLike) -> Array:
        """Return the interpolated samples of the next chunk, late by the filter's delay."""
        chunk = np.asarray(values, dtype=float).ravel()
        if self._factor == 1 or not chunk.size:
            return chunk
        stuffed = np.zeros(self._factor * chunk.size)
        stuffed[:: self._factor] = chunk
        # a second denominator coefficient keeps scipy on its recursive path, whose rounding does not depend on the chunks
        b, a = self._taps, np.array([1.0, 0.0])
        if self._state is None:
            memory = np.zeros(self._factor * (len(b) // self._factor + 1))
            memory[:: self._factor] = chunk[0]
            self._state = scipy.signal.lfilter(b, a, memory, zi=np.zeros(len(b) - 1))[1]
        raised, self._state = scipy.signal.lfilter(b, a, stuffed, zi=self._state)
        return np.asarray(raised)


@dataclasses.dataclass(frozen=True)
class AxisExposure:
    """Weighted values of one axis.

    Attributes
    ----------
    weighted_rms
        a_w [m/s^2], ISO 2631-1 eq. (1).
    vibration_dose
        VDV of the record [m/s^1.75], eq. (5).
    maximum_transient
        MTVV [m/s^2], running rms over 1 s, eq. (4).
    crest_factor
        Peak over a_w; above 9 a_w alone understates the exposure.
    """

    weighted_rms: float
    vibration_dose: float
    maximum_transient: float
    crest_factor: float


@dataclasses.dataclass(frozen=True)
class Exposure:
    """Exposure of one record, axes x y z.

    Attributes
    ----------
    axes
        Values per axis.
    vector_sum
        a_v with k = 1 [m/s^2], for comfort.
    a8
        Daily exposure on the dominant axis for the stated duration [m/s^2], max of 1.4 a_wx, 1.4 a_wy, a_wz.
    minutes_to_action, minutes_to_limit
        Time until A(8) reaches 0.5 and 1.15 m/s^2; infinite without vibration.
    dose
        Daily VDV on the dominant axis for the stated duration [m/s^1.75], k as above.
    dose_minutes_to_action, dose_minutes_to_limit
        Time until the VDV reaches 9.1 and 21 m/s^1.75.
    duration_s
        Length of the record [s].
    highest_hz
        Frequency above which the record holds nothing [Hz]; the weightings reach to 100 Hz.
    location
        Where the sensor sits; a cab floor value is not a seat value.
    """

    axes: tuple[AxisExposure, AxisExposure, AxisExposure]
    vector_sum: float
    a8: float
    minutes_to_action: float
    minutes_to_limit: float
    dose: float
    dose_minutes_to_action: float
    dose_minutes_to_limit: float
    duration_s: float
    highest_hz: float
    location: str

    def notes(self) -> tuple[str, ...]:
        """Return what a reader must know beside the numbers."""
        found = []
        if "seat" not in self.location:
            found.append(
                "measured on the floor, not seat (a sensor high up moves more than the floor): exposure and limits are defined "
                "where the vibration enters the body, and the seat may lower or raise these values"
            )
        crest, name = max((axis.crest_factor, name) for axis, name in zip(self.axes, AXES))
        if crest > CREST_FACTOR_LIMIT:
            found.append(
                f"crest factor {crest:.1f} of {name} above {CREST_FACTOR_LIMIT:g}: a_w understates the shocks, read VDV and MTVV"
            )
        if self.highest_hz < 80.0:
            found.append(f"the record has no content above {self.highest_hz:.3g} Hz; the assessment reaches to 80 Hz")
        if self.duration_s < 180.0:
            found.append(f"{self.duration_s:.3g} s are extrapolated to the working day; at least three minutes are recommended")
        return tuple(found)


class ComfortMeter:
    """Exposure of a triaxial acceleration that arrives in chunks; chunks give exactly what one pass gives.

    Wd weights x and y, Wk weights z (ISO 2631-1, seated or standing person).

    Parameters
    ----------
    rate_hz
        Sample rate [Hz], at least 60; below 1000 the signal is interpolated.
    location
        ``seat``, ``cab floor``, ...; printed with the result.
    """

    def __init__(self, rate_hz: float, location: str) -> None:
        if not rate_hz >= LOWEST_RATE_HZ:
            raise InputDataError(
                f"ride comfort at {rate_hz:g} Hz would miss most of the vibration; at least {LOWEST_RATE_HZ:g} Hz is needed"
            )
        self._rate = rate_hz
        self._location = location
        factor = math.ceil(FINE_RATE_HZ / rate_hz)
        self._axes = tuple(_AxisMeter(name, rate_hz * factor, factor) for name in ("Wd", "Wd", "Wk"))
        self._samples = 0

    def feed(self, acceleration: ArrayLike) -> None:
        """Take in the next samples.

        Parameters
        ----------
        acceleration
            Shape (N, 3) [m/s^2], x forward, z up; a constant part (gravity) does no harm.

        Raises
        ------
        InputDataError
            Not three columns, or values that are not finite.
        """
        a = np.asarray(acceleration, dtype=float)
        if a.ndim != 2 or a.shape[1] != 3:
            raise InputDataError(f"a triaxial acceleration of shape (N, 3) is needed; given {a.shape}")
        if not np.all(np.isfinite(a)):
            raise InputDataError("the acceleration contains values that are not finite")
        for axis, column in zip(self._axes, a.T):
            axis.feed(column)
        self._samples += len(a)

    def exposure(self, daily_exposure_s: float = EXPOSURE_REFERENCE_S) -> Exposure:
        """Return the exposure so far.

        Parameters
        ----------
        daily_exposure_s
            How long a day this vibration lasts [s], up to 24 h.

        Raises
        ------
        InputDataError
            Less than a second of data, or no possible duration.
        """
        if self._samples < self._rate:
            raise InputDataError(
                f"a triaxial record of at least one second is needed; given {self._samples} samples at {self._rate:g} Hz"
            )
        if not 0.0 < daily_exposure_s <= 86400.0:
            raise InputDataError(f"daily exposure of {daily_exposure_s!r} s; allowed: more than 0, at most 86400")
        axes = tuple(axis.result() for axis in self._axes)
        rms = np.array([axis.weighted_rms for axis in axes])
        factors = np.array(HEALTH_FACTORS)
        dominant = float(np.max(factors * rms))
        dose = float(np.max(factors * np.array([axis.vibration_dose for axis in axes])))
        duration = self._samples / self._rate
        minutes = [_minutes(value / dominant, 2, EXPOSURE_REFERENCE_S) if dominant else math.inf for value in A8_VALUES]
        doses = [_minutes(value / dose, 4, duration) if dose else math.inf for value in VDV_VALUES]
        return Exposure(
            axes=(axes[0], axes[1], axes[2]),
            vector_sum=float(np.sqrt(np.sum(rms**2))),
            a8=dominant * math.sqrt(daily_exposure_s / EXPOSURE_REFERENCE_S),
            minutes_to_action=minutes[0],
            minutes_to_limit=minutes[1],
            dose=dose * (daily_exposure_s / duration) ** 0.25,
            dose_minutes_to_action=doses[0],
            dose_minutes_to_limit=doses[1],
            duration_s=duration,
            highest_hz=USABLE_SHARE * self._rate,
            location=self._location,
        )


def assess(acceleration: ArrayLike, rate_hz: float, daily_exposure_s: float, location: str) -> Exposure:
    """Assess a triaxial acceleration after ISO 2631-1 with Wd on x, y and Wk on z.

    Parameters
    ----------
    acceleration
        [m/s^2], shape (N, 3), at least one second.
    rate_hz
        At least 60 Hz.
    daily_exposure_s
        Duration of this exposure a day [s].
    location
        ``seat``, ``cab floor``, ...; printed with the result.
    """
    meter = ComfortMeter(rate_hz, location)
    meter.feed(acceleration)
    return meter.exposure(daily_exposure_s)


def _minutes(ratio: float, power: int, reference_s: float) -> float:
    """Return the minutes after which a value that grows with the ``power``-th root of time has grown by a ratio."""
    return reference_s / 60.0 * ratio**power


class _AxisMeter:
    """One axis: interpolation, weighting, running sums that do not depend on the chunks."""

    def __init__(self, weighting: str, rate_hz: float, factor: int) -> None:
        self._raise = Interpolator(factor)
        self._weight = WeightedSignal(weighting, rate_hz)
        self._rate = rate_hz
        self._window = round(rate_hz)
        self._totals = np.zeros(1)  # cumulated squares, the last second of them
        self._fourth = 0.0
        self._peak = 0.0
        self._running = 0.0
        self._count = 0

    def feed(self, values: Array) -> None:
        """Take in the next samples."""
        w = self._weight.feed(self._raise.feed(values))
        if not w.size:
            return
        # cumulated one by one from the last total on, so that rounding does not depend on the chunks
        grown = np.cumsum(np.concatenate([self._totals[-1:], w**2]))
        totals = np.concatenate([self._totals, grown[1:]])
        self._fourth = float(np.cumsum(np.concatenate([[self._fourth], w**4]))[-1])
        self._count += len(w)
        if len(totals) > self._window:
            largest = float(np.max(totals[self._window :] - totals[: -self._window]))
            self._running = max(self._running, math.sqrt(max(largest, 0.0) / self._window))
        self._totals = totals[-self._window - 1 :]
        self._peak = max(self._peak, float(np.max(np.abs(w))))

    def result(self) -> AxisExposure:
        """Return the values so far."""
        rms = math.sqrt(float(self._totals[-1]) / self._count)
        dose = (self._fourth / self._rate) ** 0.25
        return AxisExposure(rms, dose, self._running, self._peak / rms if rms > 0.0 else 0.0)
