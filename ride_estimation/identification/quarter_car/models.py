# Copyright 2026 ride_estimation contributors
"""The six models of document 002 section 4.1 as one model with parameters switched on.

``m_s a_s = -F_s(x_s - x_u) + F_body``, ``m_u a_u = F_s(x_s - x_u) - F_t(x_u - u)`` with
``F = k x_ref sign(x) |x / x_ref|^n + c v_ref sign(v) |v / v_ref|^n`` (eq. (2)-(5); eq. (3) with the axle velocity in the tyre
damping, which the print has wrong). The coefficients are stated at a reference stroke of 5 cm and 0.3 m/s, because N/m^n
of different exponents cannot be compared.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.power_law import PowerDamper, PowerSpring
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import CompiledModel
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]

REFERENCE_STROKE = 0.05  # m
REFERENCE_SPEED = 0.3  # m/s
#: internal steps per second: at the upper bounds of tyre rate and damping one step is 0.18 rad and 0.73 time constants
_INTERNAL_HZ = 1000.0
_MOST_INTERNAL_HZ = 10_000.0
#: the vertical tangent of ``|v|^n`` at rest, n < 1, is rounded over this rate [m/s]; without it every integrator chatters
_ROUNDING = 0.01


@dataclasses.dataclass(frozen=True)
class QuarterCarParameter:
    """One parameter: value from the literature (document 002 Table I), bounds, unit, value where it is switched off."""

    name: str
    literature: float
    lower: float
    upper: float
    unit: str
    off: float


PARAMETERS: dict[str, QuarterCarParameter] = {
    p.name: p
    for p in (
        QuarterCarParameter("spring_rate", 300_000.0, 10_000.0, 3_000_000.0, "N/m at 5 cm", 300_000.0),
        QuarterCarParameter("tyre_rate", 1_000_000.0, 10_000.0, 10_000_000.0, "N/m at 5 cm", 1_000_000.0),
        QuarterCarParameter("damping", 20_000.0, 100.0, 200_000.0, "N s/m at 0.3 m/s", 20_000.0),
        QuarterCarParameter("tyre_damping", 500.0, 0.0, 50_000.0, "N s/m", 0.0),
        QuarterCarParameter("spring_exponent", 1.0, 0.4, 2.5, "", 1.0),
        QuarterCarParameter("tyre_exponent", 1.0, 0.4, 2.5, "", 1.0),
        QuarterCarParameter("damping_exponent", 1.0, 0.3, 2.5, "", 1.0),
        QuarterCarParameter("sine_in_phase", 0.0, -np.inf, np.inf, "m or N", 0.0),
        QuarterCarParameter("sine_quadrature", 0.0, -np.inf, np.inf, "m or N", 0.0),
        QuarterCarParameter("sine_frequency", 3.0, 0.2, 40.0, "Hz", 3.0),
    )
}

_LINEAR = ("spring_rate", "tyre_rate", "damping")
_EXPONENTS = ("spring_exponent", "tyre_exponent", "damping_exponent")
_SINE = ("sine_in_phase", "sine_quadrature", "sine_frequency")


@dataclasses.dataclass(frozen=True)
class QuarterCarModel:
    """One of the six models.

    Attributes
    ----------
    number
        1 to 6 as in document 002.
    title
        As the document calls it.
    free
        Parameters that are fitted.
    sine
        ``road``, ``vehicle`` or empty.
    contains
        Numbers of the models nested in this one.
    """

    number: int
    title: str
    free: tuple[str, ...]
    sine: str = ""
    contains: tuple[int, ...] = ()


MODELS: tuple[QuarterCarModel, ...] = (
    QuarterCarModel(1, "linear without tyre damping", _LINEAR),
    QuarterCarModel(2, "linear", (*_LINEAR, "tyre_damping"), contains=(1,)),
    QuarterCarModel(3, "nonlinear", (*_LINEAR, "tyre_damping", *_EXPONENTS), contains=(1, 2)),
    QuarterCarModel(4, "linear, sinusoid on the road", (*_LINEAR, "tyre_damping", *_SINE), "road", (1, 2)),
    QuarterCarModel(5, "linear, sinusoid on the vehicle", (*_LINEAR, "tyre_damping", *_SINE), "vehicle", (1, 2)),
    QuarterCarModel(
        6, "nonlinear, sinusoid on the vehicle", (*_LINEAR, "tyre_damping", *_EXPONENTS, *_SINE), "vehicle", (1, 2, 3, 5)
    ),
)


def quarter_car(sprung_mass: float, unsprung_mass: float, values: dict[str, float]) -> Vehicle:
    """Return the quarter car as a vehicle; deflections count from static equilibrium, so gravity is left out."""
    bodies = {
        name: Body(name, Prior(mass), np.zeros(3), np.eye(3), coordinates=("z",))
        for name, mass in (("sprung", sprung_mass), ("unsprung", unsprung_mass))
    }
    mounts = {
        "suspension": Mount("suspension", np.zeros(3), "sprung", "unsprung", {"z": suspension_element(values)}),
        "tyre": Mount("tyre", np.zeros(3), "unsprung", "road", {"z": tyre_element(values)}),
    }
    return Vehicle("quarter_car", bodies, mounts, {}, gravity=0.0)


def suspension_element(values: dict[str, float]) -> ForceElement:
    """Return leaf spring and shock absorber (eq. (4), (5))."""
    return SumOfElements(
        (
            PowerSpring(values["spring_rate"], values["spring_exponent"], REFERENCE_STROKE),
            PowerDamper(
                values["damping"], values["damping_exponent"], REFERENCE_SPEED,
                _ROUNDING if values["damping_exponent"] < 1.0 else 0.0,
            ),
        )
    )


def tyre_element(values: dict[str, float]) -> ForceElement:
    """Return tyre spring and linear tyre damping."""
    return SumOfElements(
        (
            PowerSpring(values["tyre_rate"], values["tyre_exponent"], REFERENCE_STROKE),
            PowerDamper(values["tyre_damping"], 1.0, REFERENCE_SPEED),
        )
    )


class QuarterCarSimulation:
    """Accelerations of body and axle for parameters of any of the six models.

    Parameters
    ----------
    sprung_mass, unsprung_mass
        [kg].
    road
        Road under the wheel centre after the wheel envelope [m], shape (N,).
    rate_hz
        Sample rate [Hz].
    """

    def __init__(self, sprung_mass: float, unsprung_mass: float, road: Array, rate_hz: float) -> None:
        self._masses = (sprung_mass, unsprung_mass)
        self._road = np.asarray(road, dtype=float)
        self._rate = rate_hz
        stiff = {name: p.off for name, p in PARAMETERS.items()} | {"tyre_rate": 2e6, "damping": 5e4}
        self._assembly = assemble(quarter_car(*self._masses, stiff))

    def run(self, values: dict[str, float], sine: str) -> Array:
        """Return accelerations [m/s^2] of body and axle, shape (N, 2)."""
        displacement = np.zeros((self._road.size, 2, 3))
        displacement[:, 1, 2] = self._road
        load = None
        if sine:
            phase = 2.0 * np.pi * values["sine_frequency"] * np.arange(self._road.size) / self._rate
            wave = values["sine_in_phase"] * np.sin(phase) + values["sine_quadrature"] * np.cos(phase)
            if sine == "road":
                displacement[:, 1, 2] += wave
            else:
                load = np.column_stack([wave, np.zeros_like(wave)])
        base = BaseMotion.from_displacement(displacement, self._rate)
        model = CompiledModel(self._assembly, base, load=load, substeps=self._substeps(values))
        changes = {("suspension", "z"): suspension_element(values), ("tyre", "z"): tyre_element(values)}
        return np.asarray(model.run_raw(changes).qdd)

    def _substeps(self, values: dict[str, float]) -> int:
        """Return the internal steps per sample: at most one time constant of the damper at rest per step."""
        at_rest = values["damping"] * (_ROUNDING / REFERENCE_SPEED) ** min(values["damping_exponent"] - 1.0, 0.0)
        fastest = at_rest * sum(1.0 / mass for mass in self._masses)
        return max(1, int(np.ceil(min(max(_INTERNAL_HZ, fastest), _MOST_INTERNAL_HZ) / self._rate)))
