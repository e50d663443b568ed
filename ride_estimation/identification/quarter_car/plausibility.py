# Copyright 2026 ride_estimation contributors
"""Would a vehicle with these parameters stand, ride and stay on the road? (document 002 row 2-10)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.quarter_car.models import REFERENCE_SPEED, REFERENCE_STROKE

Array = NDArray[np.float64]

GRAVITY = 9.80665
SPRING_DEFLECTION_LIMIT = 0.30  # m, static; heavy vehicles have 0.05 to 0.15
TYRE_DEFLECTION_LIMIT = 0.08  # m, static; truck tyres have 0.02 to 0.05
RIDE_FREQUENCY_RANGE = (0.8, 4.0)  # Hz
DAMPING_RATIO_RANGE = (0.03, 1.0)


@dataclasses.dataclass(frozen=True)
class Plausibility:
    """Numbers an engineer can check and what is wrong with them.

    Attributes
    ----------
    spring_deflection, tyre_deflection
        Static deflections under own weight [m].
    ride_frequency_hz, damping_ratio
        Body mode of the linearised quarter car; NaN never: a body mode that does not swing has frequency 0.
    objections
        Empty where everything is plausible.
    """

    spring_deflection: float
    tyre_deflection: float
    ride_frequency_hz: float
    damping_ratio: float
    objections: tuple[str, ...]


def static_deflection(load: float, rate: float, exponent: float) -> float:
    """Return x with ``rate x_ref (x / x_ref)^n = load`` [m]."""
    return float(REFERENCE_STROKE * (load / (rate * REFERENCE_STROKE)) ** (1.0 / exponent))


def check(
    sprung_mass: float, unsprung_mass: float, values: dict[str, float], tyre_force: Array | None = None
) -> Plausibility:
    """Judge the parameters of a quarter car.

    Parameters
    ----------
    sprung_mass, unsprung_mass
        [kg].
    values
        Parameter values by name.
    tyre_force
        Simulated dynamic tension of the tyre [N], shape (N,); a wheel that lifts off cannot pull on the road.
    """
    load = sprung_mass * GRAVITY
    spring = static_deflection(load, values["spring_rate"], values["spring_exponent"])
    wheel_load = load + unsprung_mass * GRAVITY
    tyre = static_deflection(wheel_load, values["tyre_rate"], values["tyre_exponent"])
    frequency, ratio = _body_mode(sprung_mass, unsprung_mass, values)
    objections = []
    if spring > SPRING_DEFLECTION_LIMIT:
        objections.append(f"the spring would sag {spring:.2f} m under own weight; at most {SPRING_DEFLECTION_LIMIT} m is built")
    if tyre > TYRE_DEFLECTION_LIMIT:
        objections.append(f"the tyre would sag {tyre:.2f} m under own weight; possible are {TYRE_DEFLECTION_LIMIT:.2f} m at most")
    if not RIDE_FREQUENCY_RANGE[0] <= frequency <= RIDE_FREQUENCY_RANGE[1]:
        low, high = RIDE_FREQUENCY_RANGE
        objections.append(f"ride frequency {frequency:.2f} Hz is outside {low} to {high} Hz")
    if not DAMPING_RATIO_RANGE[0] <= ratio <= DAMPING_RATIO_RANGE[1]:
        objections.append(f"damping ratio {ratio:.2f} is outside {DAMPING_RATIO_RANGE[0]} to {DAMPING_RATIO_RANGE[1]}")
    if tyre_force is not None:
        pull = float(np.max(tyre_force)) - wheel_load
        if pull > 0.0:
            objections.append(f"the tyre would pull on the road with {pull / 1000:.1f} kN: the wheel lifts off")
    return Plausibility(spring, tyre, frequency, ratio, tuple(objections))


def _body_mode(sprung_mass: float, unsprung_mass: float, values: dict[str, float]) -> tuple[float, float]:
    """Return frequency [Hz] and damping ratio of the body mode at the reference stroke and speed."""
    k, kt, c, ct = (values[n] for n in ("spring_rate", "tyre_rate", "damping", "tyre_damping"))
    mass = np.diag([sprung_mass, unsprung_mass])
    stiffness = np.array([[k, -k], [-k, k + kt]])
    damping = np.array([[c, -c], [-c, c + ct]])
    inverse = np.linalg.inv(mass)
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    poles = np.linalg.eigvals(system)
    swinging = poles[poles.imag > 1e-6]
    if swinging.size == 0:
        return 0.0, math.inf
    slow = swinging[np.argmin(np.abs(swinging))]
    return float(abs(slow) / (2.0 * math.pi)), float(-slow.real / abs(slow))


def from_power_law(coefficient: float, exponent: float, reference: float) -> float:
    """Convert a coefficient in N/m^n (or N (s/m)^n) to N/m (N s/m) at a reference stroke (speed): ``k r^(n-1)``."""
    return float(coefficient * reference ** (exponent - 1.0))


def published_values(row: dict[str, float]) -> dict[str, float]:
    """Convert one column of Table II or III of document 002 to the parameters used here."""
    n_ks, n_kt, n_cs = row.get("n_ks", 1.0), row.get("n_kt", 1.0), row.get("n_cs", 1.0)
    return {
        "spring_rate": from_power_law(row["k_s"], n_ks, REFERENCE_STROKE),
        "tyre_rate": from_power_law(row["k_t"], n_kt, REFERENCE_STROKE),
        "damping": from_power_law(row["c_s"], n_cs, REFERENCE_SPEED),
        "tyre_damping": row.get("c_t", 0.0),
        "spring_exponent": n_ks,
        "tyre_exponent": n_kt,
        "damping_exponent": n_cs,
    }
