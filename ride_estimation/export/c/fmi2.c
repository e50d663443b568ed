/* Copyright 2026 ride_estimation contributors
 *
 * The functions of FMI 2.0 (model exchange and co-simulation) on the model of model.h.
 * Compile with FMI2_STANDARD_HEADERS to use the headers of the standard instead of the declarations below.
 */
#include <stdarg.h>

#include "model.h"

#ifdef FMI2_STANDARD_HEADERS
#include "fmi2Functions.h"
#define EXPORT
#else
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Byte;
typedef const char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
/* linked statically, every name begins with the model identifier */
#ifdef FMI2_FUNCTION_PREFIX
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define F(name) JOIN(FMI2_FUNCTION_PREFIX, name)
#endif
#endif
#ifndef F
#define F(name) name
#endif

typedef struct {
    Model model;
    fmi2Type type;
    int running; /* initialised */
    fmi2CallbackFunctions functions;
    char name[128];
} Instance;

static fmi2Status fail(Instance *s, const char *message)
{
    if (s->functions.logger) {
        s->functions.logger(s->functions.componentEnvironment, s->name, fmi2Error, "logStatusError", message);
    }
    return fmi2Error;
}

EXPORT const char *F(fmi2GetTypesPlatform)(void)
{
    return "default";
}

EXPORT const char *F(fmi2GetVersion)(void)
{
    return "2.0";
}

EXPORT fmi2Status F(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c; (void)on; (void)n; (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component F(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                        const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *s;
    (void)resources; (void)visible; (void)logging;
    if (guid == NULL || strcmp(guid, TOKEN) != 0) {
        if (functions != NULL && functions->logger != NULL) {
            functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError",
                              "The GUID is not that of this model: modelDescription.xml and binary do not belong together.");
        }
        return NULL;
    }
    s = (Instance *)calloc(1, sizeof *s);
    if (s == NULL) {
        return NULL;
    }
    if (functions != NULL) {
        s->functions = *functions;
    }
    if (name != NULL) {
        strncpy(s->name, name, sizeof s->name - 1);
    }
    s->type = type;
    model_reset(&s->model);
    return s;
}

EXPORT void F(fmi2FreeInstance)(fmi2Component c)
{
    free(c);
}

EXPORT fmi2Status F(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                                         fmi2Boolean stop_defined, fmi2Real stop)
{
    Instance *s = (Instance *)c;
    (void)tolerance_defined; (void)tolerance; (void)stop_defined; (void)stop;
    s->model.time = s->model.committed = start;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2EnterInitializationMode)(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2ExitInitializationMode)(fmi2Component c)
{
    Instance *s = (Instance *)c;
    model_update(&s->model, 1);
    s->running = 1;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2Terminate)(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2Reset)(fmi2Component c)
{
    Instance *s = (Instance *)c;
    model_reset(&s->model);
    s->running = 0;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    Instance *s = (Instance *)c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (!model_get(&s->model, vr[i], &value[i])) {
            return fail(s, "There is no variable with this value reference.");
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    Instance *s = (Instance *)c;
    size_t i;
    for (i = 0; i < n; i++) {
        if (!model_set(&s->model, vr[i], value[i])) {
            return fail(s, "Only inputs and initial states can be set, and only to finite numbers.");
        }
    }
    if (s->type == fmi2ModelExchange || !s->running) {
        s->model.stale = 1;
    }
    return fmi2OK;
}

#define NO_VARIABLES(TypeName, type)                                                                                     \
    EXPORT fmi2Status F(fmi2Get##TypeName)(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[])       \
    {                                                                                                                    \
        (void)vr; (void)value;                                                                                           \
        return n == 0 ? fmi2OK : fail((Instance *)c, "All variables of this model are of type Real.");                   \
    }                                                                                                                    \
    EXPORT fmi2Status F(fmi2Set##TypeName)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]) \
    {                                                                                                                    \
        (void)vr; (void)value;                                                                                           \
        return n == 0 ? fmi2OK : fail((Instance *)c, "All variables of this model are of type Real.");                   \
    }

NO_VARIABLES(Integer, fmi2Integer)
NO_VARIABLES(Boolean, fmi2Boolean)
NO_VARIABLES(String, fmi2String)

EXPORT fmi2Status F(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(Model));
    }
    if (*state == NULL) {
        return fail((Instance *)c, "No memory for a copy of the state.");
    }
    memcpy(*state, &((Instance *)c)->model, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&((Instance *)c)->model, state, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c; (void)state;
    *size = sizeof(Model);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(Model)) {
        return fail((Instance *)c, "The buffer is smaller than the state.");
    }
    memcpy(bytes, state, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(Model)) {
        return fail((Instance *)c, "These bytes are no state of this model.");
    }
    if (F(fmi2GetFMUstate)(c, state) != fmi2OK) {
        return fmi2Error;
    }
    memcpy(*state, bytes, size);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                                  const fmi2ValueReference known[], size_t m, const fmi2Real seed[],
                                                  fmi2Real sensitivity[])
{
    (void)unknown; (void)n; (void)known; (void)m; (void)seed; (void)sensitivity;
    return fail((Instance *)c, "Directional derivatives are not provided.");
}

EXPORT fmi2Status F(fmi2EnterEventMode)(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2NewDiscreteStates)(fmi2Component c, fmi2EventInfo *info)
{
    (void)c;
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2EnterContinuousTimeMode)(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2CompletedIntegratorStep)(fmi2Component c, fmi2Boolean final, fmi2Boolean *event, fmi2Boolean *terminate)
{
    Instance *s = (Instance *)c;
    (void)final;
    *event = *terminate = 0;
    model_update(&s->model, 1);
    return model_is_finite(&s->model) ? fmi2OK : fail(s, "The motion is not finite any more; take a smaller step.");
}

EXPORT fmi2Status F(fmi2SetTime)(fmi2Component c, fmi2Real time)
{
    Instance *s = (Instance *)c;
    s->model.time = time;
    s->model.stale = 1;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetContinuousStates)(fmi2Component c, const fmi2Real x[], size_t n)
{
    (void)n;
    model_set_states(&((Instance *)c)->model, x);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetDerivatives)(fmi2Component c, fmi2Real derivatives[], size_t n)
{
    (void)n;
    model_get_derivatives(&((Instance *)c)->model, derivatives);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetEventIndicators)(fmi2Component c, fmi2Real indicators[], size_t n)
{
    (void)c; (void)indicators; (void)n;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetContinuousStates)(fmi2Component c, fmi2Real x[], size_t n)
{
    (void)n;
    model_get_states(&((Instance *)c)->model, x);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetNominalsOfContinuousStates)(fmi2Component c, fmi2Real nominals[], size_t n)
{
    size_t i;
    (void)c;
    for (i = 0; i < n; i++) {
        nominals[i] = i < COORDINATES ? 1e-3 : 1e-1;
    }
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                 const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return fail((Instance *)c, "Input derivatives are not used; velocities are inputs of their own.");
}

EXPORT fmi2Status F(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                  const fmi2Integer order[], fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return fail((Instance *)c, "Output derivatives are not provided.");
}

EXPORT fmi2Status F(fmi2DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean final)
{
    Instance *s = (Instance *)c;
    (void)final;
    if (!(step > 0.0) || !isfinite(step)) {
        return fail(s, "The communication step must be greater than zero.");
    }
    s->model.time = time;
    return model_step(&s->model, step) ? fmi2OK : fail(s, "The motion is not finite any more; take a smaller step.");
}

EXPORT fmi2Status F(fmi2CancelStep)(fmi2Component c)
{
    return fail((Instance *)c, "Steps do not run in the background.");
}

#define NO_STATUS(TypeName, type)                                                                        \
    EXPORT fmi2Status F(fmi2Get##TypeName)(fmi2Component c, const fmi2StatusKind kind, type *value)      \
    {                                                                                                    \
        (void)c; (void)kind; (void)value;                                                                \
        return fmi2Discard;                                                                              \
    }

NO_STATUS(Status, fmi2Status)
NO_STATUS(RealStatus, fmi2Real)
NO_STATUS(IntegerStatus, fmi2Integer)
NO_STATUS(BooleanStatus, fmi2Boolean)
NO_STATUS(StringStatus, fmi2String)
