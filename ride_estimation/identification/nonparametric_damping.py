# Copyright 2026 ride_estimation contributors
"""Damping against frequency without a model, and why ratios of spectra are not it (document 000 section 3.4)."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def damping_from_motion(
    omega: ArrayLike, mass: float, stiffness: float, body: ArrayLike, base: ArrayLike
) -> ComplexArray:
    """Return the complex damping ``C(j omega) = (-m A_s - k D) / V`` [N s/m] of a base-excited mass.

    Corrects document 000, which divides target by undamped spectra: that ratio notches at the bounce mode for any damper.

    Parameters
    ----------
    omega
        Angular frequencies [rad/s], shape (F,), positive.
    mass, stiffness
        m [kg], k [N/m].
    body, base
        Complex displacement spectra of body and base [m], shape (F,).
    """
    w = np.asarray(omega, dtype=float)
    xs, xu = np.asarray(body, dtype=complex), np.asarray(base, dtype=complex)
    deflection = xs - xu
    if np.any(w <= 0.0) or np.any(np.abs(deflection) == 0.0):
        raise InputDataError("frequencies must be positive and the mount must deflect at each of them")
    return np.asarray((mass * w**2 * xs - stiffness * deflection) / (1j * w * deflection))


def spectrum_ratio(damped: ArrayLike, undamped: ArrayLike) -> Array:
    """Return |target| / |undamped simulation|, the quantity document 000 reads as a damping transfer function.

    It shows a notch at the bounce mode for every damper and must not be used to choose one.
    """
    return np.asarray(np.abs(np.asarray(damped)) / np.abs(np.asarray(undamped)))


@dataclasses.dataclass(frozen=True)
class BandDamping:
    """Voigt mount plus band damping filter: stiffness k, damping c, gain K, omega_0, quality Q (document 000 eq. (13))."""

    stiffness: float
    damping: float
    gain: float
    omega_0: float
    quality: float

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Return force over velocity [N s/m] at ``omega`` [rad/s]."""
        s = 1j * np.asarray(omega, dtype=float)
        band = self.gain * (self.omega_0 / self.quality) * s / (s**2 + self.omega_0 / self.quality * s + self.omega_0**2)
        return np.asarray(self.stiffness / s + self.damping + band)


def fit_band_damping(
    omega: ArrayLike, mass: float, transmissibility: ArrayLike, weight: ArrayLike, start: BandDamping
) -> BandDamping:
    """Fit k, c, K, omega_0 and Q together to a measured transmissibility (output error in the frequency domain).

    ``T = Z / (Z + j omega m)`` with the impedance Z of the mount. Document 000 fits omega_0 and Q by correlation and K by RMSE
    one after the other (eq. (15), (16)); correlation is blind to gain, so all five are fitted jointly here.

    Parameters
    ----------
    omega
        [rad/s], shape (F,).
    mass
        [kg].
    transmissibility
        Complex body over base motion, shape (F,).
    weight
        One over the standard deviation of each value, shape (F,).
    start
        Positive starting values.
    """
    w, target, wt = np.asarray(omega, float), np.asarray(transmissibility, complex), np.asarray(weight, float)

    def residual(log_parameters: Array) -> Array:
        z = BandDamping(*np.exp(log_parameters)).impedance(w)
        error = (z / (z + 1j * w * mass) - target) * wt
        return np.concatenate([error.real, error.imag])

    values = np.array([start.stiffness, start.damping, start.gain, start.omega_0, start.quality])
    if np.any(values <= 0.0):
        raise InputDataError("starting values of a band damping fit must be positive")
    best = min(
        (optimize.least_squares(residual, np.log(values) + np.log(f) * np.array([0, 0, 1, 1, 0])) for f in (0.5, 1.0, 2.0)),
        key=lambda result: float(result.cost),
    )
    return BandDamping(*(float(v) for v in np.exp(best.x)))
