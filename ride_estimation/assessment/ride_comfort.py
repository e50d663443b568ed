# Copyright 2026 ride_estimation contributors
"""Whole-body vibration: frequency weightings of ISO 2631-1 / ISO 8041-1 and the values derived from them.

The weightings are the analogue filters of ISO 8041-1 made digital by the bilinear transform, each second-order section
pre-warped at its own corner. Above about a tenth of the sample rate the bilinear transform is too steep, so rates below
400 Hz are refused.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

MINIMUM_RATE_HZ = 400.0
BAND_LIMIT_Q = 1.0 / math.sqrt(2.0)

ACTION_VALUE_A8, LIMIT_VALUE_A8 = 0.5, 1.15  # m/s^2, Directive 2002/44/EC
ACTION_VALUE_VDV, LIMIT_VALUE_VDV = 9.1, 21.0  # m/s^1.75, Directive 2002/44/EC
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
            b, a = signal.bilinear(numerator, denominator, fs=equivalent_rate)
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
        self._sos = WEIGHTINGS[weighting].digital(rate_hz)
        self._state = np.zeros((self._sos.shape[0], 2))

    def feed(self, values: ArrayLike) -> Array:
        """Return the weighted samples of the next chunk, shape (N,)."""
        chunk = np.asarray(values, dtype=float).ravel()
        if not np.all(np.isfinite(chunk)):
            raise InputDataError("the signal to be weighted contains values that are not finite")
        weighted, self._state = signal.sosfilt(self._sos, chunk, zi=self._state)
        return np.asarray(weighted)


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
        Time until A(8) reaches 0.5 and 1.15 m/s^2.
    location
        Where the sensor sits; a cab floor value is not a seat value.
    """

    axes: tuple[AxisExposure, AxisExposure, AxisExposure]
    vector_sum: float
    a8: float
    minutes_to_action: float
    minutes_to_limit: float
    location: str


def assess(acceleration: ArrayLike, rate_hz: float, daily_exposure_s: float, location: str) -> Exposure:
    """Assess a triaxial acceleration after ISO 2631-1 with Wd on x, y and Wk on z.

    Parameters
    ----------
    acceleration
        Gravity removed [m/s^2], shape (N, 3), at least one second.
    rate_hz
        At least 400 Hz.
    daily_exposure_s
        Duration of this exposure a day [s].
    location
        ``seat``, ``cab floor``, ...; printed with the result.
    """
    a = np.asarray(acceleration, dtype=float)
    if a.ndim != 2 or a.shape[1] != 3 or a.shape[0] < rate_hz:
        raise InputDataError(f"a triaxial record of at least one second is needed; given shape {a.shape} at {rate_hz:g} Hz")
    axes = tuple(_axis(a[:, i] - a[:, i].mean(), rate_hz, "Wk" if i == 2 else "Wd") for i in range(3))
    rms = np.array([axis.weighted_rms for axis in axes])
    dominant = float(np.max(np.array(HEALTH_FACTORS) * rms))
    minutes = [
        math.inf if dominant == 0.0 else EXPOSURE_REFERENCE_S / 60.0 * (value / dominant) ** 2
        for value in (ACTION_VALUE_A8, LIMIT_VALUE_A8)
    ]
    return Exposure(
        axes=(axes[0], axes[1], axes[2]),
        vector_sum=float(np.sqrt(np.sum(rms**2))),
        a8=dominant * math.sqrt(daily_exposure_s / EXPOSURE_REFERENCE_S),
        minutes_to_action=minutes[0],
        minutes_to_limit=minutes[1],
        location=location,
    )


def _axis(values: Array, rate_hz: float, weighting: str) -> AxisExposure:
    w = WeightedSignal(weighting, rate_hz).feed(values)
    rms = float(np.sqrt(np.mean(w**2)))
    dose = float(np.sum(w**4) / rate_hz) ** 0.25
    total = np.concatenate([[0.0], np.cumsum(w**2)])
    window = round(rate_hz)
    running = float(np.sqrt(np.max(total[window:] - total[:-window]) / window))
    return AxisExposure(rms, dose, running, float(np.max(np.abs(w))) / rms if rms > 0.0 else 0.0)
