# Copyright 2026 ride_estimation contributors
"""Compiled exact rigid-body kinematics: finite rotations, centripetal terms, gyroscopic moment, tilting brackets.

State of a body, five rows of three: displacement of its reference point (world), velocity (world), angular velocity (body
axes), quaternion x y z, quaternion (w, 0, 0). The reference point is the CG of the vehicle file; a payload moves the actual
CG away from it:

``M (a_P + alpha x s + w x (w x s)) = F``, ``J_P alpha + w x J_P w + M s x a_P = tau_P`` in body axes.

A body without rotation of its own is a point mass on guides of the body that carries it: it slides along its own translations,
which turn with the carrier, and what the guides push it sideways with acts back on the carrier.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.terms import network_commit, network_force
from ride_estimation.jit import compile_kernel, compile_lean_kernel

Array = NDArray[np.float64]
Codes = NDArray[np.int64]

#: rows of a body's state
ROWS = 5
PLACE, VELOCITY, OMEGA, QUATERNION, SCALAR = 0, 1, 2, 3, 4


class RotationModel(NamedTuple):
    """The constant part. B bodies, M mounts, C components, L mass levels.

    Attributes
    ----------
    mount_body, mount_base
        Body numbers per mount, base -1 where prescribed, shape (M,).
    arm_body, arm_base
        Mount position from the reference points of body and base, shape (M, 3).
    static_force, static_moment
        Force and moment on the body at rest, base axes, shape (M, 3).
    component_mount, component_axis
        Shape (C,), axis 0 to 5.
    mass, offset, inertia, inverse
        Per level and body: mass (L, B), CG from the reference (L, B, 3), inertia about the reference (L, B, 3, 3),
        inverse of the generalised inertia (L, B, 2, 2, 3, 3): blocks force/moment to acceleration/angular acceleration.
    level
        Mass level of each sample, shape (N,).
    carrier
        Number of the body that guides a body, -1 where it is free, shape (B,).
    slides
        One along the own translations of a guided body, else zero, shape (B, 3).
    place
        Reference points of the bodies in vehicle-file axes, shape (B, 3).
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
    static_moment: Array
    component_mount: Codes
    component_axis: Codes
    mass: Array
    offset: Array
    inertia: Array
    inverse: Array
    level: Codes
    carrier: Codes
    slides: Array
    place: Array
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


@compile_lean_kernel
def copy(vector: Array, out: Array) -> None:
    """Write the vector."""
    for i in range(3):
        out[i] = vector[i]


@compile_lean_kernel
def add(vector: Array, scale: float, out: Array) -> None:
    """Add ``scale * vector``."""
    for i in range(3):
        out[i] += scale * vector[i]


@compile_lean_kernel
def clear(out: Array) -> None:
    """Write zeros."""
    for i in range(3):
        out[i] = 0.0


@compile_lean_kernel
def add_point_motion(state: Array, rotation: Array, arm: Array, sign: float, gap: Array, speed: Array, work: Array) -> None:
    """Add ``sign`` times displacement and velocity (world) of a point fixed to a body.

    Parameters
    ----------
    work
        Scratch, shape (2, 3).
    """
    turned(rotation, arm, work[0])
    add(work[0], sign, gap)
    add(arm, -sign, gap)
    add(state[PLACE], sign, gap)
    clear(work[0])
    add_cross(state[OMEGA], arm, 1.0, work[0])
    turned(rotation, work[0], work[1])
    add(work[1], sign, speed)
    add(state[VELOCITY], sign, speed)


@compile_lean_kernel
def set_points(
    model: RotationModel, state: Array, base: Array, base_rate: Array, rotation: Array, bracket: Array, gap: Array,
    motion: Array, work: Array, x: Array, v: Array,
) -> None:
    """Set body rotations, bracket rotations, mount gaps (world) and the deflection and rate of every component.

    Parameters
    ----------
    base, base_rate
        Displacement and roll, pitch, yaw of each prescribed base and their rates, shape (M, 2, 3).
    rotation, bracket
        Out: shapes (B, 3, 3) and (M, 3, 3).
    gap
        Out: body side minus base side, world axes, shape (M, 3).
    motion
        Out: deflection, rotation, their rates, bracket axes, shape (M, 4, 3).
    work
        Scratch, shape (6, 3).
    """
    for b in range(state.shape[0]):
        q = state[b, QUATERNION]
        rotation_of(state[b, SCALAR, 0], q[0], q[1], q[2], rotation[b])
    speed, omega, spin = work[2], work[3], work[4]
    for m in range(gap.shape[0]):
        body, other = model.mount_body[m], model.mount_base[m]
        clear(gap[m])
        clear(speed)
        add_point_motion(state[body], rotation[body], model.arm_body[m], 1.0, gap[m], speed, work)
        if other >= 0:
            for i in range(3):
                copy(rotation[other, i], bracket[m, i])
            copy(state[other, OMEGA], omega)
            add_point_motion(state[other], rotation[other], model.arm_base[m], -1.0, gap[m], speed, work)
        else:
            bracket_rotation(base[m, 1], base_rate[m, 1], bracket[m], omega)
            add(base[m, 0], -1.0, gap[m])
            add(base_rate[m, 0], -1.0, speed)
        turned_back(bracket[m], gap[m], motion[m, 0])
        turned_back(bracket[m], speed, motion[m, 2])
        add_cross(omega, motion[m, 0], -1.0, motion[m, 2])
        turned(rotation[body], state[body, OMEGA], spin)
        turned_back(bracket[m], spin, motion[m, 3])
        add(omega, -1.0, motion[m, 3])
        relative_rotation(bracket[m], rotation[body], motion[m, 1])
    for c in range(x.shape[0]):
        m, axis = model.component_mount[c], model.component_axis[c]
        x[c] = motion[m, axis // 3, axis % 3]
        v[c] = motion[m, 2 + axis // 3, axis % 3]


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


@compile_lean_kernel
def set_wrenches(
    model: RotationModel, load: Array, level: int, rotation: Array, bracket: Array, gap: Array, tension: Array,
    pull: Array, work: Array, force: Array, wrench: Array,
) -> None:
    """Set the force by each mount (world, shape (M, 3)) and force and moment on each body (body axes, shape (B, 2, 3)).

    Parameters
    ----------
    load
        External force (world) and moment (body axes), shape (6 B,).
    pull
        Scratch, shape (M, 2, 3).
    work
        Scratch, shape (6, 3).
    """
    local, arm, couple = work[0], work[1], work[2]
    for c in range(tension.shape[0]):
        axis = model.component_axis[c]
        pull[model.component_mount[c], axis // 3, axis % 3] = tension[c]
    for b in range(wrench.shape[0]):
        # gravity acts at the actual CG
        clear(local)
        local[2] = -model.mass[level, b] * model.gravity
        turned_back(rotation[b], local, wrench[b, 0])
        for i in range(3):
            local[i] = load[6 * b + i]
            wrench[b, 1, i] = load[6 * b + 3 + i]
        add_cross(model.offset[level, b], wrench[b, 0], 1.0, wrench[b, 1])
        turned_back(rotation[b], local, arm)
        add(arm, 1.0, wrench[b, 0])
    for m in range(gap.shape[0]):
        body, other = model.mount_body[m], model.mount_base[m]
        copy(model.static_force[m], local)
        add(pull[m, 0], -1.0, local)
        turned(bracket[m], local, force[m])
        copy(pull[m, 1], arm)
        add(model.static_moment[m], -1.0, arm)
        turned(bracket[m], arm, couple)
        turned_back(rotation[body], force[m], local)
        add(local, 1.0, wrench[body, 0])
        add_cross(model.arm_body[m], local, 1.0, wrench[body, 1])
        turned_back(rotation[body], couple, local)
        add(local, -1.0, wrench[body, 1])
        if other >= 0:
            turned_back(rotation[other], force[m], local)
            add(local, -1.0, wrench[other, 0])
            turned_back(rotation[other], gap[m], arm)
            add(model.arm_base[m], 1.0, arm)
            add_cross(arm, local, -1.0, wrench[other, 1])
            turned_back(rotation[other], couple, local)
            add(local, 1.0, wrench[other, 1])


@compile_lean_kernel
def set_slopes(
    model: RotationModel, state: Array, level: int, rotation: Array, work: Array, system: Array, wrench: Array, slope: Array
) -> None:
    """Set the time derivative of the state, shape (B, 5, 3); ``wrench`` is overwritten.

    Parameters
    ----------
    system
        Scratch, shape (6, 7).
    """
    local, arm = work[0], work[1]
    for b in range(state.shape[0]):
        omega, q, w = state[b, OMEGA], state[b, QUATERNION], state[b, SCALAR, 0]
        copy(state[b, VELOCITY], slope[b, PLACE])
        clear(slope[b, QUATERNION])
        add(omega, 0.5 * w, slope[b, QUATERNION])
        add_cross(q, omega, 0.5, slope[b, QUATERNION])
        slope[b, SCALAR, 0] = -0.5 * (q[0] * omega[0] + q[1] * omega[1] + q[2] * omega[2])
        if model.carrier[b] >= 0:
            continue
        clear(local)
        add_cross(omega, model.offset[level, b], 1.0, local)
        add_cross(omega, local, -model.mass[level, b], wrench[b, 0])
        turned(model.inertia[level, b], omega, local)
        add_cross(omega, local, -1.0, wrench[b, 1])
        guides = False
        for g in range(state.shape[0]):
            guides = guides or model.carrier[g] == b
        if guides:
            carry(model, state, level, b, rotation[b], work, system, wrench, slope)
        else:
            inverse = model.inverse[level, b]
            turned(inverse[0, 0], wrench[b, 0], local)
            turned(inverse[0, 1], wrench[b, 1], arm)
            add(arm, 1.0, local)
            turned(rotation[b], local, slope[b, VELOCITY])
            turned(inverse[1, 0], wrench[b, 0], slope[b, OMEGA])
            turned(inverse[1, 1], wrench[b, 1], arm)
            add(arm, 1.0, slope[b, OMEGA])


@compile_lean_kernel
def set_guided(
    model: RotationModel, state: Array, level: int, b: int, g: int, rotation: Array, lever: Array, centre: Array, spin: Array,
    work: Array,
) -> None:
    """Set where a guided body is and what it is accelerated by without slope of the state, axes of its carrier b.

    Parameters
    ----------
    lever, centre
        Out: from the reference point of the carrier to that of the body and to its actual CG.
    spin
        Out: centripetal and Coriolis acceleration of the CG.
    work
        Scratch, shape (2, 3).
    """
    omega, local, slide = state[b, OMEGA], work[0], work[1]
    for i in range(3):
        local[i] = model.place[g, i] + state[g, PLACE, i] - model.place[b, i] - state[b, PLACE, i]
        spin[i] = state[g, VELOCITY, i] - state[b, VELOCITY, i]
    turned_back(rotation, local, lever)
    copy(lever, centre)
    add(model.offset[level, g], 1.0, centre)
    turned_back(rotation, spin, slide)
    add_cross(omega, lever, -1.0, slide)
    clear(local)
    add_cross(omega, centre, 1.0, local)
    clear(spin)
    add_cross(omega, local, 1.0, spin)
    add_cross(omega, slide, 2.0, spin)


@compile_lean_kernel
def carry(
    model: RotationModel, state: Array, level: int, b: int, rotation: Array, work: Array, system: Array, wrench: Array,
    slope: Array,
) -> None:
    """Set velocity and angular velocity slopes of a body that guides others and of those.

    Sideways a guided point mass m at p is part of the carrier: ``m Q (a + alpha x p + w x (w x p) + 2 w x s') = Q F + N``, Q the
    directions it cannot slide along, N the push of the guides, which acts on the carrier with the opposite sign.

    Parameters
    ----------
    work
        Scratch, shape (6, 3).
    system
        Scratch, shape (6, 7): generalised inertia and wrench.
    """
    lever, centre, spin, pushed = work[0], work[1], work[2], work[3]
    mass, offset = model.mass[level, b], model.offset[level, b]
    for i in range(3):
        for j in range(3):
            system[i, j] = mass if i == j else 0.0
            system[3 + i, 3 + j] = model.inertia[level, b, i, j]
            system[i, 3 + j] = -mass * skew_entry(offset, i, j)
            system[3 + i, j] = mass * skew_entry(offset, i, j)
        system[i, 6], system[3 + i, 6] = wrench[b, 0, i], wrench[b, 1, i]
    for g in range(state.shape[0]):
        if model.carrier[g] != b:
            continue
        set_guided(model, state, level, b, g, rotation, lever, centre, spin, work[4:])
        mass = model.mass[level, g]
        for i in range(3):
            pushed[i] = wrench[g, 1, i]
        copy(wrench[g, 0], work[4])
        copy(wrench[g, 0], work[5])
        for i in range(3):
            work[4, i] *= 1.0 - model.slides[g, i]
            work[5, i] *= model.slides[g, i]
        add_cross(lever, work[4], 1.0, pushed)
        add_cross(model.offset[level, g], work[5], -1.0, pushed)
        for i in range(3):
            work[5, i] = mass * spin[i] * (1.0 - model.slides[g, i])
        add_cross(centre, work[5], -1.0, pushed)
        for i in range(3):
            held = mass * (1.0 - model.slides[g, i])
            system[i, i] += held
            system[i, 6] += work[4, i] - work[5, i]
            system[3 + i, 6] += pushed[i]
            for j in range(3):
                system[i, 3 + j] -= held * skew_entry(centre, i, j)
                system[3 + j, i] += held * skew_entry(centre, j, i)
                for k in range(3):
                    system[3 + j, 3 + k] -= held * skew_entry(centre, j, i) * skew_entry(centre, i, k)
    solve_six(system)
    turned(rotation, system[:3, 6], slope[b, VELOCITY])
    copy(system[3:, 6], slope[b, OMEGA])
    for g in range(state.shape[0]):
        if model.carrier[g] != b:
            continue
        set_guided(model, state, level, b, g, rotation, lever, centre, spin, work[4:])
        # along the guides it does as the force says, across them as its carrier does
        copy(system[:3, 6], pushed)
        add_cross(system[3:, 6], centre, 1.0, pushed)
        add(spin, 1.0, pushed)
        for i in range(3):
            if model.slides[g, i] > 0.0:
                pushed[i] = wrench[g, 0, i] / model.mass[level, g]
        # from the actual CG back to the reference point
        clear(work[4])
        add_cross(state[b, OMEGA], model.offset[level, g], 1.0, work[4])
        add_cross(state[b, OMEGA], work[4], -1.0, pushed)
        add_cross(system[3:, 6], model.offset[level, g], -1.0, pushed)
        turned(rotation, pushed, slope[g, VELOCITY])
        copy(system[3:, 6], slope[g, OMEGA])


@compile_lean_kernel
def skew_entry(vector: Array, i: int, j: int) -> float:
    """Return entry (i, j) of ``[vector]x``."""
    if i == j:
        return 0.0
    k = 3 - i - j
    return float(-vector[k] if (j - i) % 3 == 1 else vector[k])


@compile_lean_kernel
def solve_six(system: Array) -> None:
    """Solve six symmetric positive definite equations by elimination; the solution replaces the last column of (6, 7)."""
    for p in range(6):
        for i in range(p + 1, 6):
            factor = system[i, p] / system[p, p]
            for j in range(p, 7):
                system[i, j] -= factor * system[p, j]
    for p in range(5, -1, -1):
        for j in range(p + 1, 6):
            system[p, 6] -= system[p, j] * system[j, 6]
        system[p, 6] /= system[p, p]


@compile_lean_kernel
def hermite(value: Array, rate: Array, sample: int, s: float, sample_time: float, out: Array, out_rate: Array) -> None:
    """Write value and rate the share s of a sample after ``sample`` by the cubic Hermite spline, shapes (M, 2, 3)."""
    following = min(sample + 1, value.shape[0] - 1)
    for m in range(out.shape[0]):
        for j in range(2):
            for i in range(3):
                u0, u1 = value[sample, m, j, i], value[following, m, j, i]
                v0, v1 = rate[sample, m, j, i], rate[following, m, j, i]
                out[m, j, i] = (
                    (1.0 + 2.0 * s) * (1.0 - s) ** 2 * u0 + s * (1.0 - s) ** 2 * sample_time * v0
                    + s * s * (3.0 - 2.0 * s) * u1 + s * s * (s - 1.0) * sample_time * v1
                )
                out_rate[m, j, i] = (
                    6.0 * s * (s - 1.0) * (u0 - u1) / sample_time
                    + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
                )


@compile_lean_kernel
def advance(
    stage: int, h: float, state: Array, slope: Array, total: Array, point: Array
) -> None:
    """Add the slope of a Runge-Kutta stage to the sum and set the next point; the fourth stage accepts it, unit quaternion."""
    weight = h / 3.0 if stage in (1, 2) else h / 6.0
    reach = 0.5 * h if stage < 2 else h
    for b in range(state.shape[0]):
        for j in range(ROWS):
            for i in range(3):
                start = state[b, j, i] if stage == 0 else total[b, j, i]
                total[b, j, i] = start + weight * slope[b, j, i]
                point[b, j, i] = state[b, j, i] + reach * slope[b, j, i] if stage < 3 else total[b, j, i]
        if stage == 3:
            q = point[b, QUATERNION]
            length = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + point[b, SCALAR, 0] ** 2)
            for i in range(3):
                q[i] /= length
            point[b, SCALAR, 0] /= length
            for j in range(ROWS):
                copy(point[b, j], state[b, j])


@compile_lean_kernel
def record(state: Array, slope: Array, out_state: Array, out_slope: Array) -> bool:
    """Write state and slope to the output; return False where the state is not finite."""
    total = 0.0
    for b in range(state.shape[0]):
        for j in range(ROWS):
            copy(state[b, j], out_state[b, j])
            copy(slope[b, j], out_slope[b, j])
            total += state[b, j, 0] + state[b, j, 1] + state[b, j, 2]
    return bool(np.isfinite(total))


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
        Displacement and roll, pitch, yaw of the bases and their rates, shape (N, M, 2, 3).
    load
        External force (world) and moment (body axes) per body, shape (N, 6 B) or (1, 6 B).
    state
        Shape (B, 5, 3), advanced in place.
    """
    samples, mounts = base_value.shape[0], base_value.shape[1]
    bodies, components = state.shape[0], out_x.shape[1]
    h = sample_time / substeps
    base, base_rate = np.zeros((mounts, 2, 3)), np.zeros((mounts, 2, 3))
    rotation, bracket = np.zeros((bodies, 3, 3)), np.zeros((mounts, 3, 3))
    gap, force, motion = np.zeros((mounts, 3)), np.zeros((mounts, 3)), np.zeros((mounts, 4, 3))
    pull, wrench, work = np.zeros((mounts, 2, 3)), np.zeros((bodies, 2, 3)), np.zeros((6, 3))
    system = np.zeros((6, 7))
    x, v, tension = np.zeros(components), np.zeros(components), np.zeros(components)
    point, slope, total = state.copy(), np.zeros((bodies, ROWS, 3)), np.zeros((bodies, ROWS, 3))
    acting = np.zeros(load.shape[1])
    # the first pass only evaluates the start; each further pass is one step
    for step in range((samples - 1) * substeps + 1):
        sample = max(step - 1, 0) // substeps
        sub = max(step - 1, 0) % substeps
        now, following = min(sample, load.shape[0] - 1), min(sample + 1, load.shape[0] - 1)
        for stage in range(4):
            if step == 0 and stage < 3:
                continue
            reach = 0.0 if step == 0 else 0.5 * h if stage < 2 else h
            share = (sub + reach / h) / substeps
            if step > 0:
                advance(stage, h, state, slope, total, point)
            hermite(base_value, base_rate_value, sample, share, sample_time, base, base_rate)
            set_points(model, point, base, base_rate, rotation, bracket, gap, motion, work, x, v)
            if stage < 3:
                network_force(model.codes, parameters, memory, model.channel, x, v, reach, tension)
            else:
                network_commit(model.codes, parameters, memory, model.channel, x, v, reach, tension)
            for i in range(acting.shape[0]):
                acting[i] = load[now, i] + share * (load[following, i] - load[now, i])
            level = model.level[sample]
            set_wrenches(model, acting, level, rotation, bracket, gap, tension, pull, work, force, wrench)
            set_slopes(model, point, level, rotation, work, system, wrench, slope)
        if step % substeps == 0:
            done = step // substeps
            if not record(point, slope, out_state[done], out_slope[done]):
                return done
            for m in range(mounts):
                copy(force[m], out_force[done, m])
            for c in range(components):
                out_x[done, c], out_v[done, c], out_tension[done, c] = x[c], v[c], tension[c]
    return int(samples)
