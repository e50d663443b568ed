# Copyright 2026 ride_estimation contributors
"""Write what the test engineer believes of a world as a vehicle file (schema ride_estimation/vehicle/1), plain text."""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.cab import AXES, CabSensor, CabVehicle


@dataclasses.dataclass(frozen=True)
class Belief:
    """How far the file is from the truth and what it states.

    ``stiffness_off``, ``damping_off``: relative standard deviation of the (lognormal, shared per axis plus a tenth per mount)
    error of the priors; the file states ``stiffness_std``, ``damping_std``. ``mass_off`` relative error of the mass; ``cg_off``
    [m] added to the CG, ``cg_std`` [m] what the file states of it (nothing for 0); ``force_references`` lines of YAML flow maps.
    """

    stiffness_off: float = 0.15
    damping_off: float = 0.25
    stiffness_std: float = 0.3
    damping_std: float = 0.5
    mass_off: float = 0.0
    mass_std: float = 0.01
    cg_off: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cg_std: float = 0.0
    inertia_off: float = 0.0
    inertia_std: float = 0.03
    force_references: tuple[str, ...] = ("{kind: known_mass, body: cab}",)


def rpy_degrees(r: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw [deg] of R = Rz Ry Rx."""
    return np.degrees([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(np.clip(r[2, 0], -1, 1)), np.arctan2(r[1, 0], r[0, 0])])


def _list(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{v:.9g}" for v in values) + "]"


def believed_parameters(vehicle: CabVehicle, belief: Belief, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness and damping the file states, (M, 3) each, off the truth by the belief's errors."""
    rng = np.random.default_rng([seed, 77])
    out = []
    for true, off in ((vehicle.stiffness, belief.stiffness_off), (vehicle.damping, belief.damping_off)):
        shared = rng.normal(0.0, off, (1, 3))
        own = rng.normal(0.0, 0.3 * off, true.shape)
        out.append(true * np.exp(np.clip(shared + own, -2 * off, 2 * off)))
    return out[0], out[1]


def sensor_line(sensor: CabSensor) -> str:
    """Return one line of the ``sensors`` section."""
    where = "body: cab" if sensor.place == "cab" else f"body: chassis, mount: {sensor.place}"
    if sensor.kind == "displacement":
        # one JointState carries all transducers; its names are <mount>_<axis>
        return (
            f"  {sensor.name}: {{kind: displacement, topic: /mounts/displacement, mount: {sensor.place}, axis: {sensor.axis}, "
            f"element: {sensor.place}_{sensor.axis}, noise_m: {max(sensor.noise_std, 1e-9):.6g}}}"
        )
    gyro = f", gyro_noise_rad_per_s: {sensor.gyro_noise_std:.6g}" if sensor.kind == "imu" else ""
    return (
        f"  {sensor.name}: {{kind: {sensor.kind}, topic: /{sensor.name}/accel, {where}, position_m: {_list(sensor.position)}, "
        f"rotation_deg: {_list(rpy_degrees(sensor.rotation))}, noise_m_per_s2: {max(sensor.noise_std, 1e-9):.6g}{gyro}, "
        f"full_scale_m_per_s2: {sensor.full_scale:.6g}, coupling: dc}}"
    )


def vehicle_yaml(
    vehicle: CabVehicle, sensors: tuple[CabSensor, ...], belief: Belief | None = None, seed: int = 0, name: str = "world_cab"
) -> str:
    """Return the text of the vehicle file: priors off by ``belief``, declared sensor positions and rotations."""
    belief = belief or Belief()
    rng = np.random.default_rng([seed, 78])
    k, c = believed_parameters(vehicle, belief, seed)
    j = vehicle.inertia * (1.0 + belief.inertia_off * rng.uniform(-1, 1))
    mass = vehicle.mass * (1.0 + belief.mass_off)
    lines = [
        "schema: ride_estimation/vehicle/1",
        f"name: {name}",
        "description: a cab of the independent worlds",
        "gravity_m_per_s2: 9.80665",
        "bodies:",
        "  cab:",
        f"    mass_kg: {{value: {mass:.9g}, relative_std: {belief.mass_std:.6g}, source: weighed}}",
        f"    cg_m: {{value: {_list(vehicle.cg + np.array(belief.cg_off))}, std: {belief.cg_std:g}}}"
        if belief.cg_std
        else f"    cg_m: {_list(vehicle.cg + np.array(belief.cg_off))}",
        f"    inertia_kg_m2: {{ixx: {j[0, 0]:.9g}, iyy: {j[1, 1]:.9g}, izz: {j[2, 2]:.9g}, ixy: {j[0, 1]:.9g}, "
        f"ixz: {j[0, 2]:.9g}, iyz: {j[1, 2]:.9g}, relative_std: {belief.inertia_std:.6g}}}",
        "    degrees_of_freedom: [x, y, z, roll, pitch, yaw]",
        "mounts:",
    ]
    for i, mount in enumerate(vehicle.mount_names):
        lines += [f"  {mount}:", f"    position_m: {_list(vehicle.mounts[i])}", "    body: cab", "    base: chassis", "    axes:"]
        for a, axis in enumerate(AXES):
            lines.append(
                f"      {axis}: {{kind: kelvin_voigt, stiffness_n_per_m: {{value: {k[i, a]:.6g}, relative_std: "
                f"{belief.stiffness_std:g}}}, damping_n_s_per_m: {{value: {c[i, a]:.6g}, relative_std: {belief.damping_std:g}}}}}"
            )
    lines.append("sensors:")
    lines += [sensor_line(sensor) for sensor in sensors]
    if belief.force_references:
        lines.append("force_references:")
        lines += [f"  - {line}" for line in belief.force_references]
    return "\n".join(lines) + "\n"
