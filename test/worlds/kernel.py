# Copyright 2026 ride_estimation contributors
"""Compiled motion of one free body on n three-axis mounts with prescribed, rotating bases.

Newton-Euler in the body frame, attitude as a quaternion, classical fourth-order Runge-Kutta. No small-angle step anywhere.
"""

from __future__ import annotations

import numpy as np

from worlds.compiled import compiled
from worlds.laws import MEMORY, law_force

STATE = 17  # position 3, velocity 3, quaternion wxyz 4, body rate 3, elastic mode 2, suspended mass 2


@compiled
def rotation_of_vector(t, out):
    """Write the rotation matrix of the rotation vector t (Rodrigues)."""
    a2 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    a = np.sqrt(a2)
    if a < 1e-7:
        s, c = 1.0 - a2 / 6.0, 0.5 - a2 / 24.0
    else:
        s, c = np.sin(a) / a, (1.0 - np.cos(a)) / a2
    x, y, z = t[0], t[1], t[2]
    out[0, 0] = 1.0 - c * (y * y + z * z)
    out[0, 1] = c * x * y - s * z
    out[0, 2] = c * x * z + s * y
    out[1, 0] = c * x * y + s * z
    out[1, 1] = 1.0 - c * (x * x + z * z)
    out[1, 2] = c * y * z - s * x
    out[2, 0] = c * x * z - s * y
    out[2, 1] = c * y * z + s * x
    out[2, 2] = 1.0 - c * (x * x + y * y)


@compiled
def body_rate_of_vector(t, td, out):
    """Write the body-frame angular velocity of the rotation vector t with rate td (right Jacobian)."""
    a2 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    a = np.sqrt(a2)
    if a < 1e-4:
        c1, c2 = 0.5 - a2 / 24.0, 1.0 / 6.0 - a2 / 120.0
    else:
        c1, c2 = (1.0 - np.cos(a)) / a2, (a - np.sin(a)) / (a2 * a)
    u0 = t[1] * td[2] - t[2] * td[1]
    u1 = t[2] * td[0] - t[0] * td[2]
    u2 = t[0] * td[1] - t[1] * td[0]
    w0 = t[1] * u2 - t[2] * u1
    w1 = t[2] * u0 - t[0] * u2
    w2 = t[0] * u1 - t[1] * u0
    out[0] = td[0] - c1 * u0 + c2 * w0
    out[1] = td[1] - c1 * u1 + c2 * w1
    out[2] = td[2] - c1 * u2 + c2 * w2


@compiled
def rotation_of_quaternion(q, out):
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled
def place_brackets(c_row, b_row, seat, pos, vel, rot, rate):
    """Write position, velocity, attitude and body rate of every bracket from chassis and bracket coordinates.

    ``c_row``: chassis position, velocity, rotation vector and its rate. ``b_row[i]``: bracket displacement in chassis
    axes, its rate, bracket tilt vector in chassis axes, its rate. ``seat``: bracket positions in chassis axes.
    """
    rc = np.empty((3, 3))
    rb = np.empty((3, 3))
    wc = np.empty(3)
    wb = np.empty(3)
    rotation_of_vector(c_row[6:9], rc)
    body_rate_of_vector(c_row[6:9], c_row[9:12], wc)
    for i in range(seat.shape[0]):
        p0, p1, p2 = seat[i, 0] + b_row[i, 0], seat[i, 1] + b_row[i, 1], seat[i, 2] + b_row[i, 2]
        d0 = b_row[i, 3] + wc[1] * p2 - wc[2] * p1
        d1 = b_row[i, 4] + wc[2] * p0 - wc[0] * p2
        d2 = b_row[i, 5] + wc[0] * p1 - wc[1] * p0
        rotation_of_vector(b_row[i, 6:9], rb)
        body_rate_of_vector(b_row[i, 6:9], b_row[i, 9:12], wb)
        for a in range(3):
            pos[i, a] = c_row[a] + rc[a, 0] * p0 + rc[a, 1] * p1 + rc[a, 2] * p2
            vel[i, a] = c_row[3 + a] + rc[a, 0] * d0 + rc[a, 1] * d1 + rc[a, 2] * d2
            for b in range(3):
                rot[i, a, b] = rc[a, 0] * rb[0, b] + rc[a, 1] * rb[1, b] + rc[a, 2] * rb[2, b]
            rate[i, a] = rb[0, a] * wc[0] + rb[1, a] * wc[1] + rb[2, a] * wc[2] + wb[a]


@compiled
def derivative(y, time, lag, pos, vel, rot, rate, push, body, mount, codes, lawp, mem, trial, extra, dy, force, defl, drate, acc):
    """Write the state derivative; also mount forces [body axes], deflections, rates and accelerations.

    ``body`` = (mass, inverse inertia, inertia, arms of the mounts, gravity, arm of the push, direction of the push);
    ``mount`` = (stiffness, damping, static force, cross stiffness, drift, on_body);
    ``extra`` = (elastic mode: omega^2, 2 zeta omega, shape at mounts; suspended: mass, k, c, arm).
    ``acc`` receives body-frame specific force of the CG (3), angular acceleration (3), elastic and suspended acceleration.
    """
    mass, inv_j, jt, arms, grav, push_arm, push_dir = body
    stiff, damp, static, cross, drift, on_body = mount
    w2, zw, shape, sm, sk, sc, s_arm = extra
    r = np.empty((3, 3))
    rotation_of_quaternion(y[6:10], r)
    om = y[10:13]
    f0, f1, f2 = 0.0, 0.0, 0.0
    m0, m1, m2 = 0.0, 0.0, 0.0
    modal = 0.0
    u = np.empty(3)
    ud = np.empty(3)
    f = np.empty(3)
    for i in range(arms.shape[0]):
        p0, p1, p2 = arms[i, 0] + shape[i, 0] * y[13], arms[i, 1] + shape[i, 1] * y[13], arms[i, 2] + shape[i, 2] * y[13]
        d0 = om[1] * p2 - om[2] * p1 + shape[i, 0] * y[14]
        d1 = om[2] * p0 - om[0] * p2 + shape[i, 1] * y[14]
        d2 = om[0] * p1 - om[1] * p0 + shape[i, 2] * y[14]
        e0 = y[0] + r[0, 0] * p0 + r[0, 1] * p1 + r[0, 2] * p2 - pos[i, 0]
        e1 = y[1] + r[1, 0] * p0 + r[1, 1] * p1 + r[1, 2] * p2 - pos[i, 1]
        e2 = y[2] + r[2, 0] * p0 + r[2, 1] * p1 + r[2, 2] * p2 - pos[i, 2]
        g0 = y[3] + r[0, 0] * d0 + r[0, 1] * d1 + r[0, 2] * d2 - vel[i, 0]
        g1 = y[4] + r[1, 0] * d0 + r[1, 1] * d1 + r[1, 2] * d2 - vel[i, 1]
        g2 = y[5] + r[2, 0] * d0 + r[2, 1] * d1 + r[2, 2] * d2 - vel[i, 2]
        q = r if on_body else rot[i]
        wq = om if on_body else rate[i]
        for a in range(3):
            u[a] = q[0, a] * e0 + q[1, a] * e1 + q[2, a] * e2
            ud[a] = q[0, a] * g0 + q[1, a] * g1 + q[2, a] * g2
        t0 = ud[0] - (wq[1] * u[2] - wq[2] * u[1])
        t1 = ud[1] - (wq[2] * u[0] - wq[0] * u[2])
        t2 = ud[2] - (wq[0] * u[1] - wq[1] * u[0])
        ud[0], ud[1], ud[2] = t0, t1, t2
        for a in range(3):
            mult = 1.0
            if drift[i, a, 0] != 0.0:
                part = (time - drift[i, a, 1]) / (drift[i, a, 2] - drift[i, a, 1])
                part = min(max(part, 0.0), 1.0)
                mult = 1.0 + drift[i, a, 0] * 0.5 * (1.0 - np.cos(np.pi * part))
            tension = mult * stiff[i, a] * u[a] + (1.0 + (mult - 1.0) * drift[i, a, 3]) * damp[i, a] * ud[a]
            for b in range(3):
                tension += cross[i, a, b] * u[b]
            for n in range(codes.shape[2]):
                if codes[i, a, n] != 0:
                    tension += law_force(codes[i, a, n], lawp[i, a, n], mem[i, a, n], u[a], ud[a], lag, trial[i, a, n])
            f[a] = static[i, a] - tension
            defl[i, a] = u[a]
            drate[i, a] = ud[a]
        # world components of the force on the body, then body components
        h0 = q[0, 0] * f[0] + q[0, 1] * f[1] + q[0, 2] * f[2]
        h1 = q[1, 0] * f[0] + q[1, 1] * f[1] + q[1, 2] * f[2]
        h2 = q[2, 0] * f[0] + q[2, 1] * f[1] + q[2, 2] * f[2]
        b0 = r[0, 0] * h0 + r[1, 0] * h1 + r[2, 0] * h2
        b1 = r[0, 1] * h0 + r[1, 1] * h1 + r[2, 1] * h2
        b2 = r[0, 2] * h0 + r[1, 2] * h1 + r[2, 2] * h2
        force[i, 0], force[i, 1], force[i, 2] = b0, b1, b2
        f0, f1, f2 = f0 + b0, f1 + b1, f2 + b2
        m0 += p1 * b2 - p2 * b1
        m1 += p2 * b0 - p0 * b2
        m2 += p0 * b1 - p1 * b0
        modal += shape[i, 0] * (b0 - static[i, 0]) + shape[i, 1] * (b1 - static[i, 1]) + shape[i, 2] * (b2 - static[i, 2])
    if push != 0.0:
        b0, b1, b2 = push * push_dir[0], push * push_dir[1], push * push_dir[2]
        f0, f1, f2 = f0 + b0, f1 + b1, f2 + b2
        m0 += push_arm[1] * b2 - push_arm[2] * b1
        m1 += push_arm[2] * b0 - push_arm[0] * b2
        m2 += push_arm[0] * b1 - push_arm[1] * b0
    j0 = jt[0, 0] * om[0] + jt[0, 1] * om[1] + jt[0, 2] * om[2]
    j1 = jt[1, 0] * om[0] + jt[1, 1] * om[1] + jt[1, 2] * om[2]
    j2 = jt[2, 0] * om[0] + jt[2, 1] * om[1] + jt[2, 2] * om[2]
    m0 -= om[1] * j2 - om[2] * j1
    m1 -= om[2] * j0 - om[0] * j2
    m2 -= om[0] * j1 - om[1] * j0
    sdd = 0.0
    if sm > 0.0:
        # mass sm slides along body z at s_arm; its static part belongs to the body, so only sm s'' reacts
        c0, c1 = s_arm[1], -s_arm[0]  # s_arm x e_z
        w0 = inv_j[0, 0] * c0 + inv_j[0, 1] * c1
        w1 = inv_j[1, 0] * c0 + inv_j[1, 1] * c1
        beta = 1.0 / mass + w0 * s_arm[1] - w1 * s_arm[0]
        a0 = inv_j[0, 0] * m0 + inv_j[0, 1] * m1 + inv_j[0, 2] * m2
        a1 = inv_j[1, 0] * m0 + inv_j[1, 1] * m1 + inv_j[1, 2] * m2
        carry = f2 / mass + a0 * s_arm[1] - a1 * s_arm[0]
        carry += om[2] * (om[0] * s_arm[0] + om[1] * s_arm[1] + om[2] * s_arm[2]) - s_arm[2] * (
            om[0] ** 2 + om[1] ** 2 + om[2] ** 2
        )
        sdd = (-(carry - grav) - (sk * y[15] + sc * y[16]) / sm) / (1.0 - sm * beta)
        f2 -= sm * sdd
        m0 -= sm * sdd * c0
        m1 -= sm * sdd * c1
    acc[0], acc[1], acc[2] = f0 / mass, f1 / mass, f2 / mass
    for a in range(3):
        acc[3 + a] = inv_j[a, 0] * m0 + inv_j[a, 1] * m1 + inv_j[a, 2] * m2
        dy[a] = y[3 + a]
        dy[3 + a] = r[a, 0] * acc[0] + r[a, 1] * acc[1] + r[a, 2] * acc[2]
        dy[10 + a] = acc[3 + a]
    dy[5] -= grav
    dy[6] = 0.5 * (-y[7] * om[0] - y[8] * om[1] - y[9] * om[2])
    dy[7] = 0.5 * (y[6] * om[0] + y[8] * om[2] - y[9] * om[1])
    dy[8] = 0.5 * (y[6] * om[1] + y[9] * om[0] - y[7] * om[2])
    dy[9] = 0.5 * (y[6] * om[2] + y[7] * om[1] - y[8] * om[0])
    dy[13] = y[14]
    dy[14] = modal - w2 * y[13] - zw * y[14] if w2 > 0.0 else 0.0
    dy[15] = y[16]
    dy[16] = sdd
    acc[6] = dy[14]
    acc[7] = sdd


@compiled
def integrate(h, chassis, brackets, seat, push, y, bodies, switches, mount, codes, lawp, extra, points):
    """Integrate and return (states, acc, force, deflection, rate) at every full step.

    ``chassis`` (2N+1, 12) and ``brackets`` (2N+1, M, 12) are given at half steps. ``bodies`` are the sets of mass
    properties before, between and after the steps ``switches``; ``points`` (M, 3) the mounts in body-file axes.
    """
    n = (chassis.shape[0] - 1) // 2
    m = seat.shape[0]
    laws = codes.shape[2]
    states = np.empty((n + 1, STATE))
    accs = np.empty((n + 1, 8))
    forces = np.empty((n + 1, m, 3))
    defls = np.empty((n + 1, m, 3))
    rates = np.empty((n + 1, m, 3))
    mem = np.zeros((m, 3, laws, MEMORY))
    trial = np.zeros((m, 3, laws, MEMORY))
    pos = np.empty((2, m, 3))
    vel = np.empty((2, m, 3))
    rot = np.empty((2, m, 3, 3))
    rate = np.empty((2, m, 3))
    k1, k2, k3, k4 = np.zeros(STATE), np.zeros(STATE), np.zeros(STATE), np.zeros(STATE)
    force, defl, drate, acc = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3)), np.empty(8)
    masses, cgs, inertias, inverses, grav, push_point, push_dir, suspended_point = bodies
    stage = 0
    body = (masses[0], inverses[0], inertias[0], points - cgs[0], grav, push_point - cgs[0], push_dir)
    w2, zw, shape, sm, sk, sc = extra
    add = (w2, zw, shape, sm, sk, sc, suspended_point - cgs[0])
    place_brackets(chassis[0], brackets[0], seat, pos[0], vel[0], rot[0], rate[0])
    for i in range(n + 1):
        if stage < switches.shape[0] and i == switches[stage]:
            stage += 1
            shift = cgs[stage] - cgs[stage - 1]
            r = np.empty((3, 3))
            rotation_of_quaternion(y[6:10], r)
            om = y[10:13]
            turn = np.array(
                [om[1] * shift[2] - om[2] * shift[1], om[2] * shift[0] - om[0] * shift[2], om[0] * shift[1] - om[1] * shift[0]]
            )
            for a in range(3):
                y[a] += r[a, 0] * shift[0] + r[a, 1] * shift[1] + r[a, 2] * shift[2]
                y[3 + a] += r[a, 0] * turn[0] + r[a, 1] * turn[1] + r[a, 2] * turn[2]
            body = (masses[stage], inverses[stage], inertias[stage], points - cgs[stage], grav, push_point - cgs[stage], push_dir)
            add = (w2, zw, shape, sm, sk, sc, suspended_point - cgs[stage])
        t = i * h
        derivative(
            y,
            t,
            0.0,
            pos[0],
            vel[0],
            rot[0],
            rate[0],
            push[2 * i],
            body,
            mount,
            codes,
            lawp,
            mem,
            trial,
            add,
            k1,
            force,
            defl,
            drate,
            acc,
        )
        states[i] = y
        accs[i] = acc
        forces[i] = force
        defls[i] = defl
        rates[i] = drate
        if i == n:
            break
        place_brackets(chassis[2 * i + 1], brackets[2 * i + 1], seat, pos[1], vel[1], rot[1], rate[1])
        derivative(
            y + 0.5 * h * k1,
            t + 0.5 * h,
            0.5 * h,
            pos[1],
            vel[1],
            rot[1],
            rate[1],
            push[2 * i + 1],
            body,
            mount,
            codes,
            lawp,
            mem,
            trial,
            add,
            k2,
            force,
            defl,
            drate,
            acc,
        )
        derivative(
            y + 0.5 * h * k2,
            t + 0.5 * h,
            0.5 * h,
            pos[1],
            vel[1],
            rot[1],
            rate[1],
            push[2 * i + 1],
            body,
            mount,
            codes,
            lawp,
            mem,
            trial,
            add,
            k3,
            force,
            defl,
            drate,
            acc,
        )
        place_brackets(chassis[2 * i + 2], brackets[2 * i + 2], seat, pos[0], vel[0], rot[0], rate[0])
        derivative(
            y + h * k3,
            t + h,
            h,
            pos[0],
            vel[0],
            rot[0],
            rate[0],
            push[2 * i + 2],
            body,
            mount,
            codes,
            lawp,
            mem,
            trial,
            add,
            k4,
            force,
            defl,
            drate,
            acc,
        )
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        norm = np.sqrt(y[6] ** 2 + y[7] ** 2 + y[8] ** 2 + y[9] ** 2)
        y[6:10] /= norm
        derivative(
            y,
            t + h,
            h,
            pos[0],
            vel[0],
            rot[0],
            rate[0],
            push[2 * i + 2],
            body,
            mount,
            codes,
            lawp,
            mem,
            trial,
            add,
            k4,
            force,
            defl,
            drate,
            acc,
        )
        mem[:] = trial
    return states, accs, forces, defls, rates
