# Copyright 2026 ride_estimation contributors
"""A two-axle truck as far as it is needed to shake a cab: flexible frame, axles, suspension, tyres; values assumed.

Axes and origin are those of the cab's vehicle file (origin at the cab CG). The frame is two rigid halves joined in the
middle: soft in roll (torsion of a ladder frame), stiffer in pitch and yaw (bending), nearly rigid in translation.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import ConfigurationError
from ride_estimation.vehicles.vehicle import STANDARD_GRAVITY, Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]

#: wheels in the order of every (.., 4) array
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
FRAME_HALVES = ("frame_front", "frame_rear")


@dataclasses.dataclass(frozen=True)
class TruckData:
    """Numbers of the truck, SI; every one an assumption in the range of 18 t distribution trucks.

    Attributes
    ----------
    front_axle_x, rear_axle_x
        [m] from the cab CG, forward positive.
    frame_z, wheel_z
        Height of the frame and of the wheel centres, from the cab CG [m].
    frame_mass
        Sprung mass without cab and load per half plus what rides on it: front half (engine, cab) and rear half (body) [kg].
    axle_mass, track, spring_half_width
        Front and rear [kg], [m], [m].
    spring_stiffness, spring_damping, roll_bar
        Per wheel [N/m], [N s/m] and per axle [N m/rad], front and rear.
    tyre_stiffness, tyre_damping
        Vertical, per wheel, front and rear [N/m], [N s/m].
    tyre_side_stiffness, tyre_side_damping
        Per wheel, fore-aft and lateral [N/m], [N s/m]; hold the truck on its path.
    torsion_stiffness, torsion_damping
        Of the frame [N m/rad], [N m s/rad].
    bending_stiffness, bending_damping
        Of the frame in pitch and yaw [N m/rad], [N m s/rad].
    contact_length
        Of the tyre patch [m].
    wheel_radius
        [m].
    """

    front_axle_x: float = -0.10
    rear_axle_x: float = -4.10
    frame_z: float = -0.75
    wheel_z: float = -1.25
    frame_mass: tuple[float, float] = (3600.0, 6400.0)
    axle_mass: tuple[float, float] = (650.0, 1050.0)
    track: tuple[float, float] = (2.05, 1.85)
    spring_half_width: tuple[float, float] = (0.42, 0.50)
    spring_stiffness: tuple[float, float] = (2.2e5, 3.2e5)
    spring_damping: tuple[float, float] = (1.1e4, 1.6e4)
    roll_bar: tuple[float, float] = (1.2e5, 1.5e5)
    tyre_stiffness: tuple[float, float] = (9.0e5, 1.8e6)
    tyre_damping: tuple[float, float] = (1.5e3, 2.5e3)
    tyre_side_stiffness: float = 1.0e5
    tyre_side_damping: float = 1.2e4
    torsion_stiffness: float = 9.0e4
    torsion_damping: float = 2.5e3
    bending_stiffness: float = 6.0e6
    bending_damping: float = 2.0e4
    contact_length: float = 0.25
    wheel_radius: float = 0.5

    def __post_init__(self) -> None:
        problems = []
        for field in dataclasses.fields(self):
            value = np.atleast_1d(getattr(self, field.name))
            signed = field.name in ("front_axle_x", "rear_axle_x", "frame_z", "wheel_z")
            if not np.all(np.isfinite(value)) or (not signed and np.any(value <= 0.0)):
                problems.append(f"{field.name}: {getattr(self, field.name)}; allowed: finite" + ("" if signed else ", > 0"))
        if self.rear_axle_x >= self.front_axle_x:
            problems.append(f"rear_axle_x: {self.rear_axle_x:g}; allowed: less than front_axle_x {self.front_axle_x:g}")
        if problems:
            raise ConfigurationError(problems, where="truck")

    @property
    def wheelbase(self) -> float:
        """Return the wheelbase [m]."""
        return self.front_axle_x - self.rear_axle_x

    def share_of_front(self, x: float) -> float:
        """Return the weight of the front half in the frame motion at x: linear twist, not beyond 1.2 and -0.2."""
        return float(np.clip((x - self.rear_axle_x) / self.wheelbase, -0.2, 1.2))


def two_axle_truck(data: TruckData) -> Vehicle:
    """Build the truck; base ``road`` of the four tyre mounts is prescribed."""
    middle = 0.5 * (data.front_axle_x + data.rear_axle_x)
    bodies: dict[str, Body] = {}
    mounts: dict[str, Mount] = {}
    for i, end in enumerate(("front", "rear")):
        axle_x = (data.front_axle_x, data.rear_axle_x)[i]
        bodies[f"frame_{end}"] = _frame_half(data, i, axle_x, middle)
        bodies[f"axle_{end}"] = _axle(data, i, axle_x)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            spring = np.array([axle_x, sign * data.spring_half_width[i], data.frame_z])
            vertical = KelvinVoigt(data.spring_stiffness[i], data.spring_damping[i])
            # leaf springs and links guide the axle: stiff fore-aft and sideways
            guide = KelvinVoigt(4.0e6, 1.5e4)
            elements = {"x": guide, "y": guide, "z": vertical}
            mounts[f"spring_{end}_{side}"] = Mount(f"spring_{end}_{side}", spring, f"frame_{end}", f"axle_{end}", elements)
            wheel = np.array([axle_x, sign * 0.5 * data.track[i], data.wheel_z])
            ground = KelvinVoigt(data.tyre_side_stiffness, data.tyre_side_damping)
            tyre = {"x": ground, "y": ground, "z": KelvinVoigt(data.tyre_stiffness[i], data.tyre_damping[i])}
            mounts[f"tyre_{end}_{side}"] = Mount(f"tyre_{end}_{side}", wheel, f"axle_{end}", "road", tyre)
        bar = {"roll": KelvinVoigt(data.roll_bar[i], 0.0)}
        centre = np.array([axle_x, 0.0, data.frame_z])
        mounts[f"roll_bar_{end}"] = Mount(f"roll_bar_{end}", centre, f"frame_{end}", f"axle_{end}", bar)
    rigid = KelvinVoigt(5.0e7, 1.0e5)
    bend = KelvinVoigt(data.bending_stiffness, data.bending_damping)
    twist = KelvinVoigt(data.torsion_stiffness, data.torsion_damping)
    joint = {"x": rigid, "y": rigid, "z": rigid, "roll": twist, "pitch": bend, "yaw": bend}
    position = np.array([middle, 0.0, data.frame_z])
    mounts["frame_joint"] = Mount("frame_joint", position, "frame_front", "frame_rear", joint)
    return Vehicle("two_axle_truck", bodies, mounts, {}, gravity=STANDARD_GRAVITY, description="assumed values")


def _frame_half(data: TruckData, index: int, axle_x: float, middle: float) -> Body:
    mass = data.frame_mass[index]
    length = abs(axle_x - middle) + 1.0
    cg = np.array([axle_x, 0.0, data.frame_z + 0.35])
    inertia = mass * np.diag([0.55, length**2 / 6.0 + 0.2, length**2 / 6.0 + 0.4])
    return Body(("frame_front", "frame_rear")[index], Prior(mass), cg, inertia, source="assumed")


def _axle(data: TruckData, index: int, axle_x: float) -> Body:
    mass = data.axle_mass[index]
    inertia = np.diag([mass * 0.55, 0.05 * mass, mass * 0.55])
    cg = np.array([axle_x, 0.0, data.wheel_z])
    coordinates = ("x", "y", "z", "roll", "yaw")
    return Body(("axle_front", "axle_rear")[index], Prior(mass), cg, inertia, coordinates=coordinates, source="assumed")
