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
    int exchange; /* model exchange, else co-simulation */
    int running;  /* initialised */
    fmi2CallbackFunctions functions;
    char name[128];
} Instance;

static fmi2Status fail(fmi2Component c, const char *message)
{
    Instance *s = (Instance *)c;
    if (s->functions.logger) {
        s->functions.logger(s->functions.componentEnvironment, s->name, fmi2Error, "logStatusError", message);
    }
    return fmi2Error;
}

typedef fmi2Component Handle;
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2Real Real;
typedef fmi2Boolean Bool;
typedef fmi2Byte Byte;
typedef fmi2FMUstate State;
#define OK fmi2OK
#define ERROR fmi2Error
#define NAME_FREE_INSTANCE F(fmi2FreeInstance)
#define NAME_EXIT_INITIALIZATION F(fmi2ExitInitializationMode)
#define NAME_RESET F(fmi2Reset)
#define NAME_COMPLETED_STEP F(fmi2CompletedIntegratorStep)
#define NAME_SET_TIME F(fmi2SetTime)
#define NAME_SET_STATES F(fmi2SetContinuousStates)
#define NAME_GET_STATES F(fmi2GetContinuousStates)
#define NAME_GET_NOMINALS F(fmi2GetNominalsOfContinuousStates)
#define NAME_GET_EVENT_INDICATORS F(fmi2GetEventIndicators)
#define NAME_GET_STATE F(fmi2GetFMUstate)
#define NAME_SET_STATE F(fmi2SetFMUstate)
#define NAME_FREE_STATE F(fmi2FreeFMUstate)
#define NAME_STATE_SIZE F(fmi2SerializedFMUstateSize)
#define NAME_STATE_TO_BYTES F(fmi2SerializeFMUstate)
#define NAME_STATE_OF_BYTES F(fmi2DeSerializeFMUstate)
#define NAME_GET_DERIVATIVES F(fmi2GetDerivatives)
#include "both.h"

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
    s->exchange = type == fmi2ModelExchange;
    model_reset(&s->model);
    return s;
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

EXPORT fmi2Status F(fmi2Terminate)(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    return get_values(c, vr, n, value);
}

EXPORT fmi2Status F(fmi2SetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    return set_values(c, vr, n, value);
}

#define NO_VARIABLES(TypeName, type)                                                                                     \
    EXPORT fmi2Status F(fmi2Get##TypeName)(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[])       \
    {                                                                                                                    \
        (void)vr; (void)value;                                                                                           \
        return n == 0 ? fmi2OK : fail(c, "All variables of this model are of type Real.");                   \
    }                                                                                                                    \
    EXPORT fmi2Status F(fmi2Set##TypeName)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]) \
    {                                                                                                                    \
        (void)vr; (void)value;                                                                                           \
        return n == 0 ? fmi2OK : fail(c, "All variables of this model are of type Real.");                   \
    }

NO_VARIABLES(Integer, fmi2Integer)
NO_VARIABLES(Boolean, fmi2Boolean)
NO_VARIABLES(String, fmi2String)

EXPORT fmi2Status F(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                                  const fmi2ValueReference known[], size_t m, const fmi2Real seed[],
                                                  fmi2Real sensitivity[])
{
    (void)unknown; (void)n; (void)known; (void)m; (void)seed; (void)sensitivity;
    return fail(c, "Directional derivatives are not provided.");
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

EXPORT fmi2Status F(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                 const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return fail(c, "Input derivatives are not used; velocities are inputs of their own.");
}

EXPORT fmi2Status F(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                  const fmi2Integer order[], fmi2Real value[])
{
    (void)vr; (void)n; (void)order; (void)value;
    return fail(c, "Output derivatives are not provided.");
}

EXPORT fmi2Status F(fmi2DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean final)
{
    (void)final;
    return step_from(c, time, step);
}

EXPORT fmi2Status F(fmi2CancelStep)(fmi2Component c)
{
    return fail(c, "Steps do not run in the background.");
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
