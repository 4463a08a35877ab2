/* A torque that follows its final value with a time constant, for FMI 3, co-simulation and model exchange:
   dx/dt = (friction + rise exp(-speed / 20) + (switched ? 0.5 : 0) - x) / 0.5, x(0) = 0. */
#include <math.h>
#include <stdlib.h>
#include "fmi3Functions.h"

enum { TIME, SPEED, FRICTION, RISE, SWITCHED, TORQUE, SLOPE };
#define TAU 0.5
#define STEP 1e-3

typedef struct { double time, speed, friction, rise, torque; fmi3Boolean switched; } Model;

static void start(Model *m) {
    m->time = 0; m->speed = 100; m->friction = 1; m->rise = 0; m->torque = 0; m->switched = fmi3False;
}
static double slope(const Model *m) {
    return (m->friction + m->rise * exp(-m->speed / 20) + (m->switched ? 0.5 : 0.0) - m->torque) / TAU;
}
static fmi3Instance make(void) { Model *m = malloc(sizeof(Model)); start(m); return m; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) { return make(); }
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) { return make(); }
void fmi3FreeInstance(fmi3Instance i) { free(i); }
fmi3Status fmi3Reset(fmi3Instance i) { start(i); return fmi3OK; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean td, fmi3Float64 t, fmi3Float64 begin, fmi3Boolean sd,
    fmi3Float64 stop) { ((Model *)i)->time = begin; return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t nv) {
    Model *m = i;
    for (size_t k = 0; k < n; k++) switch (r[k]) {
        case SPEED: if (v[k] < 0) abort(); m->speed = v[k]; break;
        case FRICTION: m->friction = v[k]; break;
        case RISE: m->rise = v[k]; break;
        case TORQUE: m->torque = v[k]; break;
        default: return fmi3Error;
    }
    return fmi3OK;
}
fmi3Status fmi3SetBoolean(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Boolean v[], size_t nv) {
    for (size_t k = 0; k < n; k++) ((Model *)i)->switched = v[k];
    return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t nv) {
    Model *m = i;
    for (size_t k = 0; k < n; k++) switch (r[k]) {
        case TIME: v[k] = m->time; break;
        case SPEED: v[k] = m->speed; break;
        case FRICTION: v[k] = m->friction; break;
        case RISE: v[k] = m->rise; break;
        case TORQUE: v[k] = m->torque; break;
        case SLOPE: v[k] = slope(m); break;
        default: return fmi3Error;
    }
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean *event,
    fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    Model *m = i;
    for (long k = 0, n = lround(h / STEP); k < n; k++) { /* midpoint rule: second order */
        Model half = *m;
        half.torque += STEP / 2 * slope(m);
        m->torque += STEP * slope(&half);
    }
    m->time = t + h;
    *event = *end = *early = fmi3False;
    *last = t + h;
    return fmi3OK;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    *again = *end = *nominals = *states = *defined = fmi3False;
    return fmi3OK;
}
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return fmi3OK; }
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance i, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *end) {
    *event = *end = fmi3False;
    return fmi3OK;
}
fmi3Status fmi3SetTime(fmi3Instance i, fmi3Float64 t) { ((Model *)i)->time = t; return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance i, const fmi3Float64 x[], size_t n) { ((Model *)i)->torque = x[0]; return fmi3OK; }
fmi3Status fmi3GetContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t n) { x[0] = ((Model *)i)->torque; return fmi3OK; }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance i, fmi3Float64 x[], size_t n) { x[0] = slope(i); return fmi3OK; }
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance i, fmi3Float64 x[], size_t n) { x[0] = 1; return fmi3OK; }
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance i, size_t *n) { *n = 1; return fmi3OK; }
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance i, size_t *n) { *n = 0; return fmi3OK; }
fmi3Status fmi3GetEventIndicators(fmi3Instance i, fmi3Float64 z[], size_t n) { return fmi3OK; }
