# Copyright 2026 ride_estimation contributors
"""Compiled exact rigid-body kinematics: finite rotations, centripetal terms, gyroscopic moment, tilting brackets.

State of a body, 13 numbers: displacement of its reference point (world), quaternion wxyz, velocity (world), angular
velocity (body axes). The reference point is the CG of the vehicle file; a payload moves the actual CG away from it:

``M (a_P + alpha x s + w x (w x s)) = F``, ``J_P alpha + w x J_P w + M s x a_P = tau_P`` in body axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.terms import network_commit, network_force
from ride_estimation.jit import compile_kernel, compile_lean_kernel

Array = NDArray[np.float64]
Codes = NDArray[np.int64]

STATE = 13


class RotationModel(NamedTuple):
    """The constant part. B bodies, M mounts, C components, L mass levels.

    Attributes
    ----------
    mount_body, mount_base
        Body numbers per mount, base -1 where prescribed, shape (M,).
    arm_body, arm_base
        Mount position from the reference points of body and base, shape (M, 3).
    static_force
        Force on the body at rest, base axes, shape (M, 3).
    component_mount, component_axis
        Shape (C,), axis 0 to 5.
    mass, offset, inertia, inverse
        Per level and body: mass (L, B), CG from the reference (L, B, 3), inertia about the reference (L, B, 3, 3),
        inverse of the generalised inertia (L, B, 6, 6).
    level
        Mass level of each sample, shape (N,).
    codes, channel
        Terms and the component each acts on, shape (T,).
    gravity
        [m/s^2].
    """

    mount_body: Codes
    mount_base: Codes
    arm_body: Array
    arm_base: Array
    static_force: Array
    component_mount: Codes
    component_axis: Codes
    mass: Array
    offset: Array
    inertia: Array
    inverse: Array
    level: Codes
    codes: Codes
    channel: Codes
    gravity: float


@compile_lean_kernel
def rotation_of(w: float, x: float, y: float, z: float, out: Array) -> None:
    """Write the rotation matrix of a unit quaternion into ``out``, shape (3, 3), body to world."""
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compile_lean_kernel
def bracket_rotation(angle: Array, rate: Array, matrix: Array, omega: Array) -> None:
    """Write rotation matrix and angular velocity (bracket axes) of roll, pitch, yaw and their rates."""
    cr, sr = np.cos(angle[0]), np.sin(angle[0])
    cp, sp = np.cos(angle[1]), np.sin(angle[1])
    cy, sy = np.cos(angle[2]), np.sin(angle[2])
    matrix[0, 0] = cy * cp
    matrix[0, 1] = cy * sp * sr - sy * cr
    matrix[0, 2] = cy * sp * cr + sy * sr
    matrix[1, 0] = sy * cp
    matrix[1, 1] = sy * sp * sr + cy * cr
    matrix[1, 2] = sy * sp * cr - cy * sr
    matrix[2, 0] = -sp
    matrix[2, 1] = cp * sr
    matrix[2, 2] = cp * cr
    omega[0] = rate[0] - rate[2] * sp
    omega[1] = rate[1] * cr + rate[2] * sr * cp
    omega[2] = -rate[1] * sr + rate[2] * cr * cp


@compile_lean_kernel
def turned(matrix: Array, vector: Array, out: Array) -> None:
    """Write ``matrix @ vector``."""
    for i in range(3):
        out[i] = matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2]


@compile_lean_kernel
def turned_back(matrix: Array, vector: Array, out: Array) -> None:
    """Write ``matrix.T @ vector``."""
    for i in range(3):
        out[i] = matrix[0, i] * vector[0] + matrix[1, i] * vector[1] + matrix[2, i] * vector[2]


@compile_lean_kernel
def add_cross(a: Array, b: Array, scale: float, out: Array) -> None:
    """Add ``scale * a x b`` to ``out``."""
    out[0] += scale * (a[1] * b[2] - a[2] * b[1])
    out[1] += scale * (a[2] * b[0] - a[0] * b[2])
    out[2] += scale * (a[0] * b[1] - a[1] * b[0])


@compile_kernel
def set_points(
    model: RotationModel, state: Array, base: Array, base_rate: Array, rotation: Array, bracket: Array, gap: Array,
    x: Array, v: Array,
) -> None:
    """Set body rotations, bracket rotations, mount gaps (world) and the deflection and rate of every component.

    Parameters
    ----------
    base, base_rate
        Displacement and roll, pitch, yaw of each prescribed base and their rates, shape (M, 6).
    rotation, bracket
        Out: shapes (B, 3, 3) and (M, 3, 3).
    gap
        Out: body side minus base side, world axes, shape (M, 3).
    """
    arm, speed, base_speed, spin = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    omega, local, local_rate = np.zeros(3), np.zeros(3), np.zeros(3)
    motion = np.zeros((len(gap), 12))
    for b in range(state.shape[0]):
        rotation_of(state[b, 3], state[b, 4], state[b, 5], state[b, 6], rotation[b])
    for m in range(gap.shape[0]):
        body, other = model.mount_body[m], model.mount_base[m]
        local[:] = 0.0
        add_cross(state[body, 10:13], model.arm_body[m], 1.0, local)
        turned(rotation[body], local, speed)
        turned(rotation[body], model.arm_body[m], arm)
        for i in range(3):
            gap[m, i] = state[body, i] + arm[i] - model.arm_body[m, i]
            speed[i] += state[body, 7 + i]
        if other >= 0:
            bracket[m] = rotation[other]
            omega[:] = state[other, 10:13]
            local[:] = 0.0
            add_cross(omega, model.arm_base[m], 1.0, local)
            turned(rotation[other], local, base_speed)
            turned(rotation[other], model.arm_base[m], arm)
            for i in range(3):
                gap[m, i] -= state[other, i] + arm[i] - model.arm_base[m, i]
                base_speed[i] += state[other, 7 + i]
        else:
            bracket_rotation(base[m, 3:6], base_rate[m, 3:6], bracket[m], omega)
            for i in range(3):
                gap[m, i] -= base[m, i]
                base_speed[i] = base_rate[m, i]
        speed -= base_speed
        turned_back(bracket[m], gap[m], local)
        turned_back(bracket[m], speed, local_rate)
        add_cross(omega, local, -1.0, local_rate)
        turned(rotation[body], state[body, 10:13], arm)
        turned_back(bracket[m], arm, spin)
        motion[m, 0:3] = local
        motion[m, 6:9] = local_rate
        motion[m, 9:12] = spin - omega
        relative_rotation(bracket[m], rotation[body], motion[m, 3:6])
    for c in range(x.shape[0]):
        x[c] = motion[model.component_mount[c], model.component_axis[c]]
        v[c] = motion[model.component_mount[c], 6 + model.component_axis[c]]


@compile_lean_kernel
def relative_rotation(bracket: Array, body: Array, out: Array) -> None:
    """Write the rotation vector of ``bracket.T @ body``, to third order in the angle."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += bracket[j, i] * body[j, i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        low, high = 0.0, 0.0
        for n in range(3):
            low += bracket[n, k] * body[n, j]
            high += bracket[n, j] * body[n, k]
        out[i] = 0.5 * (low - high)
    # |out| = sin(angle), 1 + 2 cos(angle) = trace
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    if sine > 1e-8:
        factor = np.arctan2(sine, 0.5 * (trace - 1.0)) / sine
        for i in range(3):
            out[i] *= factor


@compile_kernel
def set_slopes(
    model: RotationModel, state: Array, load: Array, level: int, rotation: Array, bracket: Array, gap: Array,
    tension: Array, force: Array, slope: Array,
) -> None:
    """Set the force by each mount (world axes, shape (M, 3)) and the time derivative of the state, shape (B, 13)."""
    local, arm, couple = np.zeros(3), np.zeros(3), np.zeros(3)
    pull = np.zeros((gap.shape[0], 6))
    wrench = np.zeros((state.shape[0], 6))
    for c in range(tension.shape[0]):
        pull[model.component_mount[c], model.component_axis[c]] = tension[c]
    for b in range(state.shape[0]):
        for i in range(3):
            local[i] = load[6 * b + i] - (model.mass[level, b] * model.gravity if i == 2 else 0.0)
        turned_back(rotation[b], local, wrench[b, 0:3])
        wrench[b, 3:6] = load[6 * b + 3 : 6 * b + 6]
        # gravity acts at the actual CG
        local[:] = 0.0
        local[2] = -model.mass[level, b] * model.gravity
        turned_back(rotation[b], local, arm)
        add_cross(model.offset[level, b], arm, 1.0, wrench[b, 3:6])
    for m in range(gap.shape[0]):
        body, other = model.mount_body[m], model.mount_base[m]
        for i in range(3):
            local[i] = model.static_force[m, i] - pull[m, i]
        turned(bracket[m], local, force[m])
        turned(bracket[m], pull[m, 3:6], couple)
        turned_back(rotation[body], force[m], local)
        wrench[body, 0:3] += local
        add_cross(model.arm_body[m], local, 1.0, wrench[body, 3:6])
        turned_back(rotation[body], couple, local)
        wrench[body, 3:6] -= local
        if other >= 0:
            turned_back(rotation[other], force[m], local)
            wrench[other, 0:3] -= local
            turned_back(rotation[other], gap[m], arm)
            arm += model.arm_base[m]
            add_cross(arm, local, -1.0, wrench[other, 3:6])
            turned_back(rotation[other], couple, local)
            wrench[other, 3:6] += local
    for b in range(state.shape[0]):
        omega = state[b, 10:13]
        local[:] = 0.0
        add_cross(omega, model.offset[level, b], 1.0, local)
        arm[:] = 0.0
        add_cross(omega, local, 1.0, arm)
        for i in range(3):
            wrench[b, i] -= model.mass[level, b] * arm[i]
        turned(model.inertia[level, b], omega, local)
        add_cross(omega, local, -1.0, wrench[b, 3:6])
        motion = model.inverse[level, b] @ wrench[b]
        turned(rotation[b], motion[0:3], slope[b, 7:10])
        slope[b, 10:13] = motion[3:6]
        slope[b, 0:3] = state[b, 7:10]
        w, x, y, z = state[b, 3], state[b, 4], state[b, 5], state[b, 6]
        slope[b, 3] = -0.5 * (x * omega[0] + y * omega[1] + z * omega[2])
        slope[b, 4] = 0.5 * (w * omega[0] + y * omega[2] - z * omega[1])
        slope[b, 5] = 0.5 * (w * omega[1] + z * omega[0] - x * omega[2])
        slope[b, 6] = 0.5 * (w * omega[2] + x * omega[1] - y * omega[0])


@compile_lean_kernel
def hermite(value: Array, rate: Array, sample: int, s: float, sample_time: float, out: Array, out_rate: Array) -> None:
    """Write value and rate the share s of a sample after ``sample`` by the cubic Hermite spline, shapes (M, 6)."""
    following = min(sample + 1, value.shape[0] - 1)
    for m in range(out.shape[0]):
        for i in range(out.shape[1]):
            u0, u1 = value[sample, m, i], value[following, m, i]
            v0, v1 = rate[sample, m, i], rate[following, m, i]
            out[m, i] = (
                (1.0 + 2.0 * s) * (1.0 - s) ** 2 * u0 + s * (1.0 - s) ** 2 * sample_time * v0
                + s * s * (3.0 - 2.0 * s) * u1 + s * s * (s - 1.0) * sample_time * v1
            )
            out_rate[m, i] = (
                6.0 * s * (s - 1.0) * (u0 - u1) / sample_time + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
            )


@compile_kernel
def integrate_rotation(
    model: RotationModel, parameters: Array, memory: Array, base_value: Array, base_rate_value: Array, load: Array,
    state: Array, sample_time: float, substeps: int, out_state: Array, out_slope: Array, out_force: Array,
    out_x: Array, out_v: Array, out_tension: Array,
) -> int:
    """Step through all samples with classical Runge-Kutta; returns the number of samples reached.

    Parameters
    ----------
    base_value, base_rate_value
        Displacement and roll, pitch, yaw of the bases and their rates, shape (N, M, 6).
    load
        External force (world) and moment (body axes) per body, shape (N, 6 B) or (1, 6 B).
    state
        Shape (B, 13), advanced in place.
    """
    samples, mounts = base_value.shape[0], base_value.shape[1]
    bodies, components = state.shape[0], out_x.shape[1]
    h = sample_time / substeps
    base, base_rate = np.zeros((mounts, 6)), np.zeros((mounts, 6))
    rotation, bracket = np.zeros((bodies, 3, 3)), np.zeros((mounts, 3, 3))
    gap, force = np.zeros((mounts, 3)), np.zeros((mounts, 3))
    x, v, tension = np.zeros(components), np.zeros(components), np.zeros(components)
    point, slope, total = state.copy(), np.zeros((bodies, STATE)), np.zeros((bodies, STATE))
    hermite(base_value, base_rate_value, 0, 0.0, sample_time, base, base_rate)
    set_points(model, point, base, base_rate, rotation, bracket, gap, x, v)
    network_commit(model.codes, parameters, memory, model.channel, x, v, 0.0, tension)
    set_slopes(model, point, load[0], model.level[0], rotation, bracket, gap, tension, force, slope)
    for sample in range(samples):
        now = load[min(sample, load.shape[0] - 1)]
        following = load[min(sample + 1, load.shape[0] - 1)]
        level = model.level[sample]
        out_state[sample] = point
        out_slope[sample] = slope
        out_force[sample] = force
        out_x[sample], out_v[sample], out_tension[sample] = x, v, tension
        if not np.isfinite(point.sum()):
            return sample
        if sample == samples - 1:
            break
        for sub in range(substeps):
            for stage in range(4):
                weight = h / 3.0 if stage in (1, 2) else h / 6.0
                reach = 0.5 * h if stage < 2 else h
                if stage == 0:
                    total[:] = state
                total += weight * slope
                if stage < 3:
                    point[:] = state + reach * slope
                else:
                    state[:] = total
                    for b in range(bodies):
                        state[b, 3:7] /= np.sqrt(np.sum(state[b, 3:7] ** 2))
                    point[:] = state
                share = (sub + reach / h) / substeps
                if stage in (0, 2):
                    hermite(base_value, base_rate_value, sample, share, sample_time, base, base_rate)
                set_points(model, point, base, base_rate, rotation, bracket, gap, x, v)
                if stage < 3:
                    network_force(model.codes, parameters, memory, model.channel, x, v, reach, tension)
                else:
                    network_commit(model.codes, parameters, memory, model.channel, x, v, h, tension)
                acting = now + share * (following - now)
                set_slopes(model, point, acting, level, rotation, bracket, gap, tension, force, slope)
    return samples
