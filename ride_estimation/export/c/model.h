/* Copyright 2026 ride_estimation contributors
 *
 * Equations of motion of bodies on force elements, or force elements alone, stepped in time. SI units.
 *
 * Elements alone (COORDINATES 0): an input pair is the deflection and rate of one element, the output its tension.
 * Bodies: M qdd = -G^T t(x, v) - K q + T u + f, x = G q - u; an input pair is the displacement u of a base and its velocity.
 * Memories of elements change on accepted points only; between them the force is a function of the trial point.
 */
#ifndef RIDE_MODEL_H
#define RIDE_MODEL_H

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "data.h"
#include "kernels.h"

#define SIZE(n) ((n) > 0 ? (n) : 1)

/* The part of an instance that changes with time; a copy of it is a complete state. */
typedef struct {
    double time;
    double committed;                    /* time of the point the memories stand at */
    double input[SIZE(INPUTS)];          /* pairs (displacement, velocity) of BASES, then a load per coordinate */
    double previous[SIZE(INPUTS)];       /* input at the start of the step */
    double q[SIZE(COORDINATES)];
    double qd[SIZE(COORDINATES)];
    double qdd[SIZE(COORDINATES)];
    double deflection[SIZE(COMPONENTS)];
    double rate[SIZE(COMPONENTS)];
    double tension[SIZE(COMPONENTS)];
    double memory[SIZE(TERMS * MEMORY)];
    int stale;                           /* the results belong to an earlier point */
} Model;

static void model_reset(Model *m)
{
    int i;
    memset(m, 0, sizeof *m);
    for (i = 0; i < TERMS; i++) {
        law_rest_at(code_of[i], parameters, m->memory, i, 0.0);
    }
    m->stale = 1;
}

static int model_is_finite(const Model *m)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < COORDINATES; i++) {
        sum += m->q[i] + m->qd[i] + m->qdd[i];
    }
    for (i = 0; i < COMPONENTS; i++) {
        sum += m->tension[i];
    }
    return isfinite(sum);
}

/* Results at the point (q, qd) with base motion and loads given, a time h after the memories; accept: update the memories. */
static void model_evaluate(Model *m, const double *q, const double *qd, const double *base, const double *load, double h, int accept)
{
    double force[SIZE(COORDINATES)];
    int c, i, k;
    for (c = 0; c < COMPONENTS; c++) {
        const int b = base_of[c];
        m->deflection[c] = b < 0 ? 0.0 : BASE_SIGN * base[2 * b];
        m->rate[c] = b < 0 ? 0.0 : BASE_SIGN * base[2 * b + 1];
        m->tension[c] = 0.0;
        for (k = 0; k < COORDINATES; k++) {
            m->deflection[c] += deflection_map[c * COORDINATES + k] * q[k];
            m->rate[c] += deflection_map[c * COORDINATES + k] * qd[k];
        }
    }
    for (i = 0; i < TERMS; i++) {
        c = channel_of[i];
        m->tension[c] += accept ? law_commit_at(code_of[i], parameters, m->memory, i, m->deflection[c], m->rate[c], h)
                                : law_force_at(code_of[i], parameters, m->memory, i, m->deflection[c], m->rate[c], h);
    }
    for (i = 0; i < COORDINATES; i++) {
        force[i] = load[i];
        for (c = 0; c < COMPONENTS; c++) {
            force[i] -= deflection_map[c * COORDINATES + i] * m->tension[c];
        }
        for (k = 0; k < COORDINATES; k++) {
            force[i] -= geometric_stiffness[i * COORDINATES + k] * q[k];
        }
    }
    for (i = 0; i < COORDINATES; i++) {
        m->qdd[i] = 0.0;
        for (k = 0; k < COORDINATES; k++) {
            m->qdd[i] += inverse_mass[i * COORDINATES + k] * force[k];
        }
    }
}

/* Load on every coordinate the share s of the way from the previous input to the present one: straight. */
static void model_load(const Model *m, double s, double *load)
{
    int b, i;
    for (i = 0; i < COORDINATES; i++) {
        const int k = 2 * BASES + i;
        load[i] = (1.0 - s) * m->previous[k] + s * m->input[k];
        for (b = 0; b < BASES; b++) {
            load[i] += tilt_map[i * BASES + b] * ((1.0 - s) * m->previous[2 * b] + s * m->input[2 * b]);
        }
    }
}

/* Base motion the share s of the way: cubic Hermite spline through displacements and velocities. */
static void model_base(const Model *m, double s, double step, double *base)
{
    int b;
    for (b = 0; b < BASES; b++) {
        const double u0 = m->previous[2 * b], v0 = m->previous[2 * b + 1];
        const double u1 = m->input[2 * b], v1 = m->input[2 * b + 1];
        base[2 * b] = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s) * u0 + s * (1.0 - s) * (1.0 - s) * step * v0
                      + s * s * (3.0 - 2.0 * s) * u1 + s * s * (s - 1.0) * step * v1;
        base[2 * b + 1] = 6.0 * s * (s - 1.0) / step * (u0 - u1) + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1;
    }
}

/* Results at the present time, states and input, a trial or an accepted point. */
static void model_update(Model *m, int accept)
{
    double load[SIZE(COORDINATES)];
    const double h = m->time > m->committed ? m->time - m->committed : 0.0;
    memcpy(m->previous, m->input, sizeof m->input);
    model_load(m, 1.0, load);
    model_evaluate(m, m->q, m->qd, m->input, load, h, accept);
    if (accept) {
        m->committed = m->time;
    }
    m->stale = 0;
}

/* Runge-Kutta of order four over a step at whose end the present input holds. */
static void model_integrate(Model *m, double step)
{
    const int substeps = (int)fmin(fmax(ceil(step / INTERNAL_STEP - 1e-6), 1.0), 1e6);
    const double h = step / substeps;
    double base[SIZE(2 * BASES)], load[SIZE(COORDINATES)];
    double q0[SIZE(COORDINATES)], v0[SIZE(COORDINATES)], q_sum[SIZE(COORDINATES)], v_sum[SIZE(COORDINATES)];
    int sub, stage, i;
    for (sub = 0; sub < substeps; sub++) {
        memcpy(q0, m->q, sizeof q0);
        memcpy(v0, m->qd, sizeof v0);
        memcpy(q_sum, m->q, sizeof q_sum);
        memcpy(v_sum, m->qd, sizeof v_sum);
        for (stage = 0; stage < 4; stage++) {
            const double weight = stage == 1 || stage == 2 ? h / 3.0 : h / 6.0;
            const double reach = stage < 2 ? 0.5 * h : h;
            const double share = (sub + reach / h) / substeps;
            for (i = 0; i < COORDINATES; i++) {
                q_sum[i] += weight * m->qd[i];
                v_sum[i] += weight * m->qdd[i];
                if (stage < 3) {
                    const double slope = m->qd[i];
                    m->qd[i] = v0[i] + reach * m->qdd[i];
                    m->q[i] = q0[i] + reach * slope;
                } else {
                    m->q[i] = q_sum[i];
                    m->qd[i] = v_sum[i];
                }
            }
            model_base(m, share, step, base);
            model_load(m, share, load);
            model_evaluate(m, m->q, m->qd, base, load, reach, stage == 3);
        }
    }
}

/* One communication step; returns 0 where the motion is no longer finite. */
static int model_step(Model *m, double step)
{
    if (COORDINATES == 0) {
        double load[1];
        model_evaluate(m, m->q, m->qd, m->input, load, step, 1);
    } else {
        model_integrate(m, step);
    }
    memcpy(m->previous, m->input, sizeof m->input);
    m->time += step;
    m->committed = m->time;
    m->stale = 0;
    return model_is_finite(m);
}

/* Values by value reference: time, inputs, q, qd, qdd, deflections, forces, constants. */
static int model_get(Model *m, unsigned int reference, double *value)
{
    size_t k = reference;
    if (k == 0) {
        *value = m->time;
        return 1;
    }
    k -= 1;
    if (k < INPUTS) {
        *value = m->input[k];
        return 1;
    }
    k -= INPUTS;
    if (m->stale) {
        model_update(m, 0);
    }
    if (k < 3 * COORDINATES) {
        *value = k < COORDINATES ? m->q[k] : k < 2 * COORDINATES ? m->qd[k - COORDINATES] : m->qdd[k - 2 * COORDINATES];
        return 1;
    }
    k -= 3 * COORDINATES;
    if (k < COMPONENTS) {
        *value = m->deflection[k];
        return 1;
    }
    k -= COMPONENTS;
    if (k < COMPONENTS) {
        *value = static_force[k] + BASE_SIGN * m->tension[k];
        return 1;
    }
    k -= COMPONENTS;
    if (k < CONSTANTS) {
        *value = constants[k];
        return 1;
    }
    return 0;
}

/* Only inputs and, for their initial values, q and qd can be set; what is not finite is refused. */
static int model_set(Model *m, unsigned int reference, double value)
{
    size_t k = reference;
    if (k == 0 || !isfinite(value)) {
        return 0;
    }
    k -= 1;
    if (k < INPUTS) {
        m->input[k] = value;
        return 1;
    }
    k -= INPUTS;
    if (k < COORDINATES) {
        m->q[k] = value;
        return 1;
    }
    k -= COORDINATES;
    if (k < COORDINATES) {
        m->qd[k] = value;
        return 1;
    }
    return 0;
}

static void model_get_states(const Model *m, double *states)
{
    int i;
    for (i = 0; i < COORDINATES; i++) {
        states[i] = m->q[i];
        states[COORDINATES + i] = m->qd[i];
    }
}

static void model_set_states(Model *m, const double *states)
{
    int i;
    for (i = 0; i < COORDINATES; i++) {
        m->q[i] = states[i];
        m->qd[i] = states[COORDINATES + i];
    }
    m->stale = 1;
}

static void model_get_derivatives(Model *m, double *derivatives)
{
    int i;
    if (m->stale) {
        model_update(m, 0);
    }
    for (i = 0; i < COORDINATES; i++) {
        derivatives[i] = m->qd[i];
        derivatives[COORDINATES + i] = m->qdd[i];
    }
}

#endif
