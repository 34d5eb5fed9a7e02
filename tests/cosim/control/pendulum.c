/* A pendulum as somebody else's co-simulation FMU: damped, driven by a torque; states and derivatives are
 * listed, directional derivatives are exact, states are saved and serialised. `load` follows the torque at once. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { ANGLE, RATE, TORQUE, DAMPING, ANGLE_DERIVATIVE, RATE_DERIVATIVE, LOAD, COUNT, SWITCH, SIZE };

typedef struct {
    double v[SIZE];
} Pendulum;

static const double STIFFNESS = 9.0;

static void derive(double *v)
{
    v[ANGLE_DERIVATIVE] = v[RATE];
    v[RATE_DERIVATIVE] = v[TORQUE] - v[DAMPING] * v[RATE] - STIFFNESS * sin(v[ANGLE]);
    v[LOAD] = v[RATE_DERIVATIVE] + v[TORQUE];
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)c, (void)on, (void)n, (void)names;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Pendulum *p = calloc(1, sizeof *p);
    (void)name, (void)type, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
    p->v[DAMPING] = 0.4;
    return p;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return derive(((Pendulum *)c)->v), fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return derive(((Pendulum *)c)->v), fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return (void)c, fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[])
{
    Pendulum *p = c;
    derive(p->v);
    for (size_t i = 0; i < n; i++)
        values[i] = p->v[r[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[])
{
    for (size_t i = 0; i < n; i++)
        ((Pendulum *)c)->v[r[i]] = values[i];
    return fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer values[])
{
    for (size_t i = 0; i < n; i++)
        values[i] = (int)((Pendulum *)c)->v[r[i]];
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer values[])
{
    for (size_t i = 0; i < n; i++)
        ((Pendulum *)c)->v[r[i]] = values[i];
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean values[])
{
    return fmi2GetInteger(c, r, n, values);
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean values[])
{
    return fmi2SetInteger(c, r, n, values);
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String values[])
{
    return (void)c, (void)r, (void)n, (void)values, fmi2Error;
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String values[])
{
    return (void)c, (void)r, (void)n, (void)values, fmi2Error;
}

static void shifted(const double *v, double by, const double *slope, double *out)
{
    memcpy(out, v, SIZE * sizeof *v);
    out[ANGLE] += by * slope[ANGLE_DERIVATIVE];
    out[RATE] += by * slope[RATE_DERIVATIVE];
    derive(out);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_before)
{
    double *v = ((Pendulum *)c)->v, b[SIZE], d[SIZE], e[SIZE];
    const int parts = 20;
    const double h = step / parts;
    (void)time, (void)no_set_before;
    for (int i = 0; i < parts; i++) {
        derive(v);
        shifted(v, 0.5 * h, v, b);
        shifted(v, 0.5 * h, b, d);
        shifted(v, h, d, e);
        for (int s = ANGLE; s <= RATE; s++) {
            const int k = ANGLE_DERIVATIVE + s;
            v[s] += h / 6.0 * (v[k] + 2.0 * b[k] + 2.0 * d[k] + e[k]);
        }
    }
    v[COUNT] += v[SWITCH] != 0.0 ? 2.0 : 1.0;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (!*state)
        *state = malloc(sizeof(Pendulum));
    return memcpy(*state, c, sizeof(Pendulum)), fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return memcpy(c, state, sizeof(Pendulum)), fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return (void)c, free(*state), *state = NULL, fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return (void)c, (void)state, *size = sizeof(Pendulum), fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return (void)c, memcpy(bytes, state, size), fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return (void)c, *state = malloc(sizeof(Pendulum)), memcpy(*state, bytes, size), fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t rows,
                                        const fmi2ValueReference knowns[], size_t columns, const fmi2Real seed[],
                                        fmi2Real found[])
{
    const double *v = ((Pendulum *)c)->v;
    double d[SIZE] = {0};
    for (size_t i = 0; i < columns; i++)
        d[knowns[i]] += seed[i];
    d[ANGLE_DERIVATIVE] = d[RATE];
    d[RATE_DERIVATIVE] = d[TORQUE] - v[DAMPING] * d[RATE] - STIFFNESS * cos(v[ANGLE]) * d[ANGLE];
    d[LOAD] = d[RATE_DERIVATIVE] + d[TORQUE];
    for (size_t i = 0; i < rows; i++)
        found[i] = d[unknowns[i]];
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return (void)c, fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *s) { return (void)c, (void)k, (void)s, fmi2Error; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *s) { return (void)c, (void)k, (void)s, fmi2Error; }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *s) { return (void)c, (void)k, (void)s, fmi2Error; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *s) { return (void)c, (void)k, (void)s, fmi2Error; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *s) { return (void)c, (void)k, (void)s, fmi2Error; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { return (void)c, (void)r, (void)n, (void)o, (void)v, fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], fmi2Real v[]) { return (void)c, (void)r, (void)n, (void)o, (void)v, fmi2Error; }
