# Copyright 2026 ride_estimation contributors
"""Damping against frequency without a model, from the motion of body and base (document 000 section 3.4).

The document divides target by undamped spectra; that ratio notches at the bounce mode for any damper. Here the force over the
deflection is read from the motion itself, ``C = (-m A - k D) / V``, with the interval the coherence gives.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.uncertainty import std_from_jacobian
from ride_estimation.signals.spectra import transfer_function

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: fewest blocks whose scatter tells noise from response
_LEAST_BLOCKS = 4
#: coherence below which a line says nothing about the mount
_LEAST_COHERENCE = 0.5
#: parameters are searched between their start over and times this
_SPAN = 1.0e3
#: logarithm of a filter gain that is none
_NEVER = 50.0


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


@dataclasses.dataclass(frozen=True)
class MeasuredDamping:
    """Damping of a mount read from measured motion.

    Attributes
    ----------
    frequency_hz
        Lines whose coherence is enough [Hz], shape (F,).
    damping
        Complex damping [N s/m], shape (F,): the real part takes energy, the imaginary part is missing or added stiffness.
    std
        Standard deviation of either part [N s/m], shape (F,).
    transmissibility, transmissibility_std
        Complex body over base and the standard deviation of either part, shape (F,).
    resolution_hz
        Distance of independent lines [Hz].
    """

    frequency_hz: Array
    damping: ComplexArray
    std: Array
    transmissibility: ComplexArray
    transmissibility_std: Array
    resolution_hz: float


def measured_damping(
    body: ArrayLike, base: ArrayLike, rate_hz: float, block: int, mass: float, stiffness: float
) -> MeasuredDamping:
    """Return the damping against frequency of a mass on one mount from accelerations of body and base.

    Parameters
    ----------
    body, base
        Vertical accelerations [m/s^2], shape (N,).
    rate_hz, block
        Sample rate [Hz], samples a block.
    mass, stiffness
        Mass on the mount [kg] and its stiffness at rest [N/m].

    Raises
    ------
    InputDataError
        Fewer than four blocks, or body and base that have nothing to do with each other.

    Notes
    -----
    A line of a transfer function of coherence g^2 from n averages has ``var = |T|^2 (1 - g^2) / (2 g^2 n)`` in either part
    (Bendat and Piersol, Random Data, 4th ed., eq. (9.90)); it is carried through ``dC/dT = j omega m / (T - 1)^2``.
    """
    found = transfer_function(base, body, rate_hz, block)
    if found.averages < _LEAST_BLOCKS:
        raise InputDataError(f"{found.averages} blocks of {block} samples; at least {_LEAST_BLOCKS} are needed to separate noise")
    good = (found.frequency_hz > 0.0) & (found.coherence >= _LEAST_COHERENCE) & (np.abs(found.h1 - 1.0) > 0.0)
    if not np.any(good):
        raise InputDataError(f"body and base are nowhere coherent (at least {_LEAST_COHERENCE:g}): wrong columns?")
    frequency, ratio, coherence = found.frequency_hz[good], found.h1[good], found.coherence[good]
    # half-overlapping Hann blocks are worth 2/3 of as many independent ones
    independent = max(2.0 * found.averages / 3.0, 1.0)
    spread = np.abs(ratio) * np.sqrt((1.0 - coherence) / (2.0 * coherence * independent))
    omega = 2.0 * np.pi * frequency
    damping = damping_from_motion(omega, mass, stiffness, ratio, np.ones_like(ratio))
    std = mass * omega / np.abs(ratio - 1.0) ** 2 * spread
    return MeasuredDamping(frequency, damping, std, ratio, spread, 1.5 * rate_hz / block)


@dataclasses.dataclass(frozen=True)
class BandFit:
    """Fitted band damping with the standard deviation of each of its five numbers and the misfit.

    Attributes
    ----------
    band
        Fitted values.
    std
        Standard deviations in the order of the fields of :class:`BandDamping`; infinite where the data do not tell one.
    chi_square
        Squared misfit over its variance, a degree of freedom: one where the law is the right one.
    plain
        (stiffness [N/m], damping [N s/m]) of the best spring and damper without filter.
    filter_identifiable
        Whether the filter explains more than three further numbers would by chance (Schwarz' criterion).
    """

    band: BandDamping
    std: tuple[float, ...]
    chi_square: float
    plain: tuple[float, float]
    filter_identifiable: bool


def fit_band_damping(
    omega: ArrayLike, mass: float, transmissibility: ArrayLike, weight: ArrayLike, start: BandDamping
) -> BandFit:
    """Fit k, c, K, omega_0 and Q together to a measured transmissibility (output error in the frequency domain).

    ``T = Z / (Z + j omega m)`` with the impedance Z of the mount. Document 000 fits omega_0 and Q by correlation and K by RMSE
    one after the other (eq. (15), (16)); correlation is blind to gain, so all five are fitted jointly here, from several starts
    of omega_0 and Q. Where the misfit exceeds its variance the standard deviations are those of the misfit.

    Parameters
    ----------
    omega
        [rad/s], shape (F,), at least three.
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
    if w.size < 3:
        raise InputDataError(f"{w.size} frequencies are too few for the five numbers of a band damping; at least 3 are needed")

    def residual(log_parameters: Array) -> Array:
        z = BandDamping(*np.exp(log_parameters)).impedance(w)
        error = (z / (z + 1j * w * mass) - target) * wt
        return np.concatenate([error.real, error.imag])

    values = np.array([start.stiffness, start.damping, start.gain, start.omega_0, start.quality])
    if np.any(values <= 0.0):
        raise InputDataError("starting values of a band damping fit must be positive")
    span = np.log(_SPAN)
    low, high = np.log(values) - span, np.log(values) + span
    best = min(
        (
            scipy.optimize.least_squares(residual, np.log(values) + np.log([1, 1, gain, centre, quality]), bounds=(low, high))
            for gain in (0.5, 2.0)
            for centre in (0.5, 1.0, 2.0)
            for quality in (0.5, 2.0)
        ),
        key=lambda result: float(result.cost),
    )
    chi_square = 2.0 * float(best.cost) / max(2 * w.size - 5, 1)
    relative = std_from_jacobian(best.jac, max(chi_square, 1.0))
    found = np.exp(best.x)
    # what ran to its bound has left the range in which the data tell it
    relative[np.minimum(best.x - low, high - best.x) < 1e-3 * span] = np.inf
    without = scipy.optimize.least_squares(lambda two: residual(np.array([*two, -_NEVER, 0.0, 0.0])), np.log(values[:2]))
    # neighbouring lines of half-overlapping Hann blocks share 2/3 of their noise
    better = 2.0 * float(without.cost - best.cost) / max(chi_square, 1.0) / 1.5
    k, c = np.exp(without.x)
    return BandFit(
        BandDamping(*(float(v) for v in found)), tuple(float(v) for v in relative * found), chi_square,
        (float(k), float(c)), better > 3.0 * np.log(2 * w.size),
    )  # fmt: skip
