/* Copyright 2026 ride_estimation contributors
 *
 * The functions that FMI 2.0 and 3.0 name differently and mean alike. The file that includes this one has before it: the types
 * Handle, Status, Reference, Real, Bool, Byte and State and the values OK and ERROR of its version; EXPORT; a struct Instance
 * with model, exchange and running; fail(); and the exported names as macros NAME_...
 */
#ifndef RIDE_BOTH_H
#define RIDE_BOTH_H

#define NOT_FINITE "The motion is not finite any more; take a smaller step."

EXPORT void NAME_FREE_INSTANCE(Handle c)
{
    free(c);
}

EXPORT Status NAME_EXIT_INITIALIZATION(Handle c)
{
    Instance *s = (Instance *)c;
    model_update(&s->model, 1);
    s->running = 1;
    return OK;
}

EXPORT Status NAME_RESET(Handle c)
{
    Instance *s = (Instance *)c;
    model_reset(&s->model);
    s->running = 0;
    return OK;
}

static Status get_values(Handle c, const Reference vr[], size_t n, Real values[])
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (!model_get(&((Instance *)c)->model, vr[i], &values[i])) {
            return fail(c, "There is no variable with this value reference.");
        }
    }
    return OK;
}

static Status set_values(Handle c, const Reference vr[], size_t n, const Real values[])
{
    Instance *s = (Instance *)c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (!model_set(&s->model, vr[i], values[i])) {
            return fail(c, "Only inputs and initial states can be set, and only to finite numbers.");
        }
    }
    if (s->exchange || !s->running) {
        s->model.stale = 1;
    }
    return OK;
}

/* One communication step from a time on. */
static Status step_from(Handle c, Real time, Real step)
{
    Instance *s = (Instance *)c;
    if (!(step > 0.0) || !isfinite(step)) {
        return fail(c, "The communication step must be greater than zero.");
    }
    s->model.time = time;
    return model_step(&s->model, step) ? OK : fail(c, NOT_FINITE);
}

EXPORT Status NAME_GET_STATE(Handle c, State *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(Model));
    }
    if (*state == NULL) {
        return fail(c, "No memory for a copy of the state.");
    }
    memcpy(*state, &((Instance *)c)->model, sizeof(Model));
    return OK;
}

EXPORT Status NAME_SET_STATE(Handle c, State state)
{
    memcpy(&((Instance *)c)->model, state, sizeof(Model));
    return OK;
}

EXPORT Status NAME_FREE_STATE(Handle c, State *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT Status NAME_STATE_SIZE(Handle c, State state, size_t *size)
{
    (void)c; (void)state;
    *size = sizeof(Model);
    return OK;
}

EXPORT Status NAME_STATE_TO_BYTES(Handle c, State state, Byte bytes[], size_t size)
{
    if (size < sizeof(Model)) {
        return fail(c, "The buffer is smaller than the state.");
    }
    memcpy(bytes, state, sizeof(Model));
    return OK;
}

EXPORT Status NAME_STATE_OF_BYTES(Handle c, const Byte bytes[], size_t size, State *state)
{
    if (size != sizeof(Model)) {
        return fail(c, "These bytes are no state of this model.");
    }
    if (NAME_GET_STATE(c, state) != OK) {
        return ERROR;
    }
    memcpy(*state, bytes, size);
    return OK;
}

EXPORT Status NAME_COMPLETED_STEP(Handle c, Bool final, Bool *event, Bool *terminate)
{
    Instance *s = (Instance *)c;
    (void)final;
    *event = *terminate = 0;
    model_update(&s->model, 1);
    return model_is_finite(&s->model) ? OK : fail(c, NOT_FINITE);
}

EXPORT Status NAME_SET_TIME(Handle c, Real time)
{
    Instance *s = (Instance *)c;
    s->model.time = time;
    s->model.stale = 1;
    return OK;
}

EXPORT Status NAME_SET_STATES(Handle c, const Real x[], size_t n)
{
    (void)n;
    model_set_states(&((Instance *)c)->model, x);
    return OK;
}

EXPORT Status NAME_GET_STATES(Handle c, Real x[], size_t n)
{
    (void)n;
    model_get_states(&((Instance *)c)->model, x);
    return OK;
}

EXPORT Status NAME_GET_DERIVATIVES(Handle c, Real derivatives[], size_t n)
{
    (void)n;
    model_get_derivatives(&((Instance *)c)->model, derivatives);
    return OK;
}

EXPORT Status NAME_GET_NOMINALS(Handle c, Real nominals[], size_t n)
{
    size_t i;
    (void)c;
    for (i = 0; i < n; i++) {
        nominals[i] = i < COORDINATES ? 1e-3 : 1e-1;
    }
    return OK;
}

EXPORT Status NAME_GET_EVENT_INDICATORS(Handle c, Real indicators[], size_t n)
{
    (void)c; (void)indicators; (void)n;
    return OK;
}

#endif
