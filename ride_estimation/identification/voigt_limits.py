# Copyright 2026 ride_estimation contributors
"""How far a spring and damper tuned at one frequency can stand for mounts whose stiffness depends on frequency."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import InputDataError
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.modes import Mode, frequency_response, linearise, undamped_modes
from ride_estimation.vehicles.tangent import equivalent
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: a peak is looked for between the mode divided and multiplied by this
_REACH = 1.2
_POINTS = 121
#: a coordinate that heave of the bases moves less than this [m/m, rad/m] is not excited by it
_EXCITED = 0.01


@dataclasses.dataclass(frozen=True)
class PeakError:
    """One resonance: mode, frequency of the peak [Hz], height with the mounts as they are and as Voigt [m/m], error [%]."""

    label: str
    frequency_hz: float
    height: float
    voigt_height: float

    @property
    def error_percent(self) -> float:
        """Return the error of the Voigt peak."""
        return 100.0 * (self.voigt_height / self.height - 1.0)


def voigt_limits(vehicle: Vehicle, tuned_hz: float, amplitude: float = 1.0e-3) -> tuple[PeakError, ...]:
    """Replace every mount by the spring and damper that equal it at one frequency and compare the resonance peaks.

    ``k = Re K*(w_t, A)``, ``c = Im K*(w_t, A) / w_t``: right at the tuned frequency, wrong elsewhere as far as the mount is
    not viscous. Heights are those of the coordinate that moves most in the mode, for all bases heaving together.

    Source: document 000, Figure 2 (limits of a single damping value).

    Parameters
    ----------
    tuned_hz
        Frequency at which spring and damper are taken [Hz].
    amplitude
        Deflection amplitude of the comparison [m].

    Raises
    ------
    InputDataError
        Frequency or amplitude not positive, no resonance to compare.
    """
    if not (tuned_hz > 0.0 and amplitude > 0.0):
        raise InputDataError(f"tuned frequency {tuned_hz:g} Hz and amplitude {amplitude:g} m must be positive")
    assembly = assemble(vehicle)
    tuned = tuple(KelvinVoigt(*equivalent(element, tuned_hz, amplitude)) for element in assembly.elements)
    first = undamped_modes(linearise(assembly, tuned_hz, amplitude))
    # stiffness depends on frequency: each mode is taken again with the stiffness at its own frequency
    found = [undamped_modes(linearise(assembly, mode.frequency_hz, amplitude))[i] for i, mode in enumerate(first)]
    rows = [row for mode in found if (row := _peak(assembly, tuned, mode, amplitude)) is not None]
    if not rows:
        raise InputDataError("the vehicle has no resonance that heave of its bases excites")
    return tuple(rows)


def _peak(assembly: Assembly, tuned: tuple[KelvinVoigt, ...], mode: Mode, amplitude: float) -> PeakError | None:
    """Return the comparison at one mode, None where heave of the bases does not excite it."""
    frequency = mode.frequency_hz * np.geomspace(1.0 / _REACH, _REACH, _POINTS)
    heave = np.array([axis == "z" for _, axis in assembly.components], dtype=float)
    coordinate = int(np.argmax(list(mode.energy_share.values())))
    curves = [np.abs(frequency_response(assembly, frequency, amplitude, used)[:, coordinate] @ heave) for used in (None, tuned)]
    if curves[0].max() < _EXCITED:
        return None
    top = int(np.argmax(curves[0]))
    return PeakError(mode.label, float(frequency[top]), float(curves[0][top]), float(curves[1].max()))
