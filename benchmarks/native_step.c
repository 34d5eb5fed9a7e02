/* Times the calls of one FMU from C.

       native_step <library> <guid>

   Standard input: first six lines "<count> <value reference> <value> ...", the Real, Integer and Boolean inputs and
   then the outputs; then commands, each answered with microseconds per call:

       step <n>             fmi2DoStep of 1 ms
       communicate <n>      sets all inputs, steps, gets all outputs
       instantiate <n>      fmi2Instantiate */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

#define STEP 1e-3

enum { MOST = 1000 };

typedef struct {
    size_t count;
    fmi2ValueReference references[MOST];
    fmi2Real reals[MOST];
    fmi2Integer integers[MOST];
} Group;

static fmi2InstantiateTYPE *instantiate;
static fmi2FreeInstanceTYPE *free_instance;
static fmi2DoStepTYPE *do_step;
static fmi2SetRealTYPE *set_real;
static fmi2SetIntegerTYPE *set_integer;
static fmi2SetBooleanTYPE *set_boolean;
static fmi2GetRealTYPE *get_real;
static fmi2GetIntegerTYPE *get_integer;
static fmi2GetBooleanTYPE *get_boolean;

static Group inputs[3], outputs[3];
static const fmi2CallbackFunctions HOST = {0};
static long steps;

static void stop(const char *what)
{
    fprintf(stderr, "%s failed\n", what);
    exit(1);
}

static void check(int is_good, const char *what)
{
    if (!is_good)
        stop(what);
}

static void *find(void *library, const char *name)
{
    void *symbol = dlsym(library, name);
    check(symbol != NULL, name);
    return symbol;
}

static void read_group(Group *group)
{
    check(scanf("%zu", &group->count) == 1 && group->count <= MOST, "reading a group");
    for (size_t i = 0; i < group->count; i++) {
        check(scanf("%u %lf", &group->references[i], &group->reals[i]) == 2, "reading a variable");
        group->integers[i] = (fmi2Integer)group->reals[i];
    }
}

static void set_inputs(fmi2Component unit)
{
    check(set_real(unit, inputs[0].references, inputs[0].count, inputs[0].reals) == fmi2OK, "fmi2SetReal");
    check(set_integer(unit, inputs[1].references, inputs[1].count, inputs[1].integers) == fmi2OK, "fmi2SetInteger");
    check(set_boolean(unit, inputs[2].references, inputs[2].count, inputs[2].integers) == fmi2OK, "fmi2SetBoolean");
}

static void get_outputs(fmi2Component unit)
{
    check(get_real(unit, outputs[0].references, outputs[0].count, outputs[0].reals) == fmi2OK, "fmi2GetReal");
    check(get_integer(unit, outputs[1].references, outputs[1].count, outputs[1].integers) == fmi2OK, "fmi2GetInteger");
    check(get_boolean(unit, outputs[2].references, outputs[2].count, outputs[2].integers) == fmi2OK, "fmi2GetBoolean");
}

static void step_once(fmi2Component unit)
{
    check(do_step(unit, (double)steps * STEP, STEP, fmi2True) == fmi2OK, "fmi2DoStep");
    steps++;
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec * 1e6 + (double)time.tv_nsec * 1e-3;
}

static double time_steps(fmi2Component unit, long count, int communicates)
{
    const double begin = now();
    for (long i = 0; i < count; i++) {
        if (communicates)
            set_inputs(unit);
        step_once(unit);
        if (communicates)
            get_outputs(unit);
    }
    return (now() - begin) / (double)count;
}

static double time_instances(const char *guid, long count)
{
    double end, begin;
    fmi2Component *units = calloc((size_t)count, sizeof *units);
    check(units != NULL, "calloc");
    begin = now();
    for (long i = 0; i < count; i++)
        units[i] = instantiate("unit", fmi2CoSimulation, guid, "", &HOST, fmi2False, fmi2False);
    end = now();
    for (long i = 0; i < count; i++) {
        check(units[i] != NULL, "fmi2Instantiate");
        free_instance(units[i]);
    }
    free(units);
    return (end - begin) / (double)count;
}

static fmi2Component initialised(void *library, const char *guid)
{
    fmi2Component unit = instantiate("unit", fmi2CoSimulation, guid, "", &HOST, fmi2False, fmi2False);
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)find(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)find(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave =
        (fmi2ExitInitializationModeTYPE *)find(library, "fmi2ExitInitializationMode");
    check(unit != NULL, "fmi2Instantiate");
    check(setup(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "fmi2SetupExperiment");
    check(enter(unit) == fmi2OK, "fmi2EnterInitializationMode");
    set_inputs(unit);
    check(leave(unit) == fmi2OK, "fmi2ExitInitializationMode");
    return unit;
}

static void answer(fmi2Component unit, const char *guid)
{
    char command[32];
    long count;
    while (scanf("%31s %ld", command, &count) == 2) {
        if (!strcmp(command, "instantiate"))
            printf("%.6f\n", time_instances(guid, count));
        else
            printf("%.6f\n", time_steps(unit, count, !strcmp(command, "communicate")));
        fflush(stdout);
    }
}

int main(int count, char **arguments)
{
    void *library = count == 3 ? dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    fmi2Component unit;
    check(library != NULL, "loading the library");
    instantiate = (fmi2InstantiateTYPE *)find(library, "fmi2Instantiate");
    free_instance = (fmi2FreeInstanceTYPE *)find(library, "fmi2FreeInstance");
    do_step = (fmi2DoStepTYPE *)find(library, "fmi2DoStep");
    set_real = (fmi2SetRealTYPE *)find(library, "fmi2SetReal");
    set_integer = (fmi2SetIntegerTYPE *)find(library, "fmi2SetInteger");
    set_boolean = (fmi2SetBooleanTYPE *)find(library, "fmi2SetBoolean");
    get_real = (fmi2GetRealTYPE *)find(library, "fmi2GetReal");
    get_integer = (fmi2GetIntegerTYPE *)find(library, "fmi2GetInteger");
    get_boolean = (fmi2GetBooleanTYPE *)find(library, "fmi2GetBoolean");
    for (int i = 0; i < 3; i++)
        read_group(&inputs[i]);
    for (int i = 0; i < 3; i++)
        read_group(&outputs[i]);
    unit = initialised(library, arguments[2]);
    answer(unit, arguments[2]);
    check(((fmi2TerminateTYPE *)find(library, "fmi2Terminate"))(unit) == fmi2OK, "fmi2Terminate");
    free_instance(unit);
    dlclose(library);
    return 0;
}
