/* Copyright 2026 ride_estimation contributors
 *
 * The functions of FMI 3.0 (model exchange and co-simulation) on the model of model.h.
 * Compile with FMI3_STANDARD_HEADERS to use the headers of the standard instead of the declarations below.
 */
#include <stdbool.h>
#include <stdint.h>

#include "model.h"

#ifdef FMI3_STANDARD_HEADERS
#include "fmi3Functions.h"
#define EXPORT
#else
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8, fmi3Byte;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
/* linked statically, every name begins with the model identifier */
#ifdef FMI3_FUNCTION_PREFIX
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define F(name) JOIN(FMI3_FUNCTION_PREFIX, name)
#endif
#endif
#ifndef F
#define F(name) name
#endif

typedef struct {
    Model model;
    int exchange; /* model exchange, else co-simulation */
    int running;  /* initialised */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static fmi3Status fail(fmi3Instance c, const char *message)
{
    Instance *s = (Instance *)c;
    if (s->log != NULL) {
        s->log(s->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

typedef fmi3Instance Handle;
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3Float64 Real;
typedef fmi3Boolean Bool;
typedef fmi3Byte Byte;
typedef fmi3FMUState State;
#define OK fmi3OK
#define ERROR fmi3Error
#define NAME_FREE_INSTANCE F(fmi3FreeInstance)
#define NAME_EXIT_INITIALIZATION F(fmi3ExitInitializationMode)
#define NAME_RESET F(fmi3Reset)
#define NAME_COMPLETED_STEP F(fmi3CompletedIntegratorStep)
#define NAME_SET_TIME F(fmi3SetTime)
#define NAME_SET_STATES F(fmi3SetContinuousStates)
#define NAME_GET_STATES F(fmi3GetContinuousStates)
#define NAME_GET_NOMINALS F(fmi3GetNominalsOfContinuousStates)
#define NAME_GET_EVENT_INDICATORS F(fmi3GetEventIndicators)
#define NAME_GET_STATE F(fmi3GetFMUState)
#define NAME_SET_STATE F(fmi3SetFMUState)
#define NAME_FREE_STATE F(fmi3FreeFMUState)
#define NAME_STATE_SIZE F(fmi3SerializedFMUStateSize)
#define NAME_STATE_TO_BYTES F(fmi3SerializeFMUState)
#define NAME_STATE_OF_BYTES F(fmi3DeserializeFMUState)
#define NAME_GET_DERIVATIVES F(fmi3GetContinuousStateDerivatives)
#include "both.h"

static fmi3Instance make(fmi3String token, int exchange, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Instance *s;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError",
                "The instantiation token is not that of this model: modelDescription.xml and binary do not belong together.");
        }
        return NULL;
    }
    s = (Instance *)calloc(1, sizeof *s);
    if (s != NULL) {
        s->exchange = exchange;
        s->environment = environment;
        s->log = log;
        model_reset(&s->model);
    }
    return s;
}

EXPORT const char *F(fmi3GetVersion)(void)
{
    return "3.0";
}

EXPORT fmi3Status F(fmi3SetDebugLogging)(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)c; (void)on; (void)n; (void)categories;
    return fmi3OK;
}

EXPORT fmi3Instance F(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                    fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                    fmi3LogMessageCallback log)
{
    (void)name; (void)resources; (void)visible; (void)logging;
    return make(token, 1, environment, log);
}

EXPORT fmi3Instance F(fmi3InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                   fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                                   const fmi3ValueReference required[], size_t n,
                                                   fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                   fmi3IntermediateUpdateCallback update)
{
    (void)name; (void)resources; (void)visible; (void)logging; (void)events; (void)early; (void)required; (void)n; (void)update;
    return make(token, 0, environment, log);
}

EXPORT fmi3Instance F(fmi3InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                         fmi3Boolean visible, fmi3Boolean logging,
                                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                         fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                         fmi3UnlockPreemptionCallback unlock)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)update; (void)lock; (void)unlock;
    if (log != NULL) {
        log(environment, fmi3Error, "logStatusError", "Scheduled execution is not provided.");
    }
    return NULL;
}

EXPORT fmi3Status F(fmi3EnterInitializationMode)(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                                 fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    Instance *s = (Instance *)c;
    (void)tolerance_defined; (void)tolerance; (void)stop_defined; (void)stop;
    s->model.time = s->model.committed = start;
    return fmi3OK;
}

#define NOTHING_TO_DO(name)                     \
    EXPORT fmi3Status F(name)(fmi3Instance c)   \
    {                                           \
        (void)c;                                \
        return fmi3OK;                          \
    }

NOTHING_TO_DO(fmi3EnterEventMode)
NOTHING_TO_DO(fmi3EnterContinuousTimeMode)
NOTHING_TO_DO(fmi3EnterStepMode)
NOTHING_TO_DO(fmi3Terminate)
NOTHING_TO_DO(fmi3EvaluateDiscreteStates)
NOTHING_TO_DO(fmi3EnterConfigurationMode)
NOTHING_TO_DO(fmi3ExitConfigurationMode)

EXPORT fmi3Status F(fmi3GetFloat64)(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t count)
{
    (void)count;
    return get_values(c, vr, n, values);
}

EXPORT fmi3Status F(fmi3SetFloat64)(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                                    size_t count)
{
    (void)count;
    return set_values(c, vr, n, values);
}

#define NO_VARIABLES(TypeName, type)                                                                                         \
    EXPORT fmi3Status F(fmi3Get##TypeName)(fmi3Instance c, const fmi3ValueReference vr[], size_t n, type values[], size_t m)  \
    {                                                                                                                        \
        (void)vr; (void)values; (void)m;                                                                                     \
        return n == 0 ? fmi3OK : fail(c, "All variables of this model are of type Float64.");                                \
    }                                                                                                                        \
    EXPORT fmi3Status F(fmi3Set##TypeName)(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const type values[],     \
                                           size_t m)                                                                         \
    {                                                                                                                        \
        (void)vr; (void)values; (void)m;                                                                                     \
        return n == 0 ? fmi3OK : fail(c, "All variables of this model are of type Float64.");                                \
    }

NO_VARIABLES(Float32, fmi3Float32)
NO_VARIABLES(Int8, fmi3Int8)
NO_VARIABLES(UInt8, fmi3UInt8)
NO_VARIABLES(Int16, fmi3Int16)
NO_VARIABLES(UInt16, fmi3UInt16)
NO_VARIABLES(Int32, fmi3Int32)
NO_VARIABLES(UInt32, fmi3UInt32)
NO_VARIABLES(Int64, fmi3Int64)
NO_VARIABLES(UInt64, fmi3UInt64)
NO_VARIABLES(Boolean, fmi3Boolean)
NO_VARIABLES(String, fmi3String)

#define REFS const fmi3ValueReference vr[], size_t n
/* a function the model has no use for; allowed for no variable at all */
#define NOT_PROVIDED(name, ARGUMENTS, what) \
    EXPORT fmi3Status F(name) ARGUMENTS     \
    {                                       \
        return fail(c, what);               \
    }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NOT_PROVIDED(fmi3GetBinary, (fmi3Instance c, REFS, size_t sizes[], fmi3Binary values[], size_t m), "There are no binaries.")
NOT_PROVIDED(fmi3SetBinary, (fmi3Instance c, REFS, const size_t sizes[], const fmi3Binary values[], size_t m),
             "There are no binaries.")
NOT_PROVIDED(fmi3GetClock, (fmi3Instance c, REFS, fmi3Clock values[]), "There are no clocks.")
NOT_PROVIDED(fmi3SetClock, (fmi3Instance c, REFS, const fmi3Clock values[]), "There are no clocks.")
NOT_PROVIDED(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference vr, size_t *n),
             "Dependencies are not provided.")
NOT_PROVIDED(fmi3GetVariableDependencies,
             (fmi3Instance c, fmi3ValueReference vr, size_t dependent[], fmi3ValueReference independents[],
              size_t independent[], fmi3DependencyKind kinds[], size_t n),
             "Dependencies are not provided.")
NOT_PROVIDED(fmi3GetDirectionalDerivative,
             (fmi3Instance c, const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[], size_t m,
              const fmi3Float64 seed[], size_t k, fmi3Float64 sensitivity[], size_t l),
             "Directional derivatives are not provided.")
NOT_PROVIDED(fmi3GetAdjointDerivative,
             (fmi3Instance c, const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[], size_t m,
              const fmi3Float64 seed[], size_t k, fmi3Float64 sensitivity[], size_t l),
             "Adjoint derivatives are not provided.")
NOT_PROVIDED(fmi3GetIntervalDecimal, (fmi3Instance c, REFS, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]),
             "There are no clocks.")
NOT_PROVIDED(fmi3GetIntervalFraction,
             (fmi3Instance c, REFS, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
             "There are no clocks.")
NOT_PROVIDED(fmi3GetShiftDecimal, (fmi3Instance c, REFS, fmi3Float64 shifts[]), "There are no clocks.")
NOT_PROVIDED(fmi3GetShiftFraction, (fmi3Instance c, REFS, fmi3UInt64 counters[], fmi3UInt64 resolutions[]),
             "There are no clocks.")
NOT_PROVIDED(fmi3SetIntervalDecimal, (fmi3Instance c, REFS, const fmi3Float64 intervals[]), "There are no clocks.")
NOT_PROVIDED(fmi3SetIntervalFraction, (fmi3Instance c, REFS, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
             "There are no clocks.")
NOT_PROVIDED(fmi3SetShiftDecimal, (fmi3Instance c, REFS, const fmi3Float64 shifts[]), "There are no clocks.")
NOT_PROVIDED(fmi3SetShiftFraction, (fmi3Instance c, REFS, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
             "There are no clocks.")
NOT_PROVIDED(fmi3GetOutputDerivatives, (fmi3Instance c, REFS, const fmi3Int32 orders[], fmi3Float64 values[], size_t m),
             "Output derivatives are not provided.")
NOT_PROVIDED(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time), "There are no clocks.")
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

EXPORT fmi3Status F(fmi3UpdateDiscreteStates)(fmi3Instance c, fmi3Boolean *update, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                              fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next)
{
    (void)c; (void)next;
    *update = *terminate = *nominals = *values = *defined = false;
    return fmi3OK;
}

EXPORT fmi3Status F(fmi3GetNumberOfEventIndicators)(fmi3Instance c, size_t *n)
{
    (void)c;
    *n = 0;
    return fmi3OK;
}

EXPORT fmi3Status F(fmi3GetNumberOfContinuousStates)(fmi3Instance c, size_t *n)
{
    (void)c;
    *n = 2 * COORDINATES;
    return fmi3OK;
}

EXPORT fmi3Status F(fmi3DoStep)(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean final, fmi3Boolean *event,
                                fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    Status status;
    (void)final;
    *event = *terminate = *early = false;
    *last = time;
    status = step_from(c, time, step);
    if (status == OK) {
        *last = ((Instance *)c)->model.time;
    }
    return status;
}
