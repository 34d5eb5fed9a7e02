/* A host that drives many instances of one FMU, one after the other and then in threads at once.

       threads <library> <guid> <instances> <threads> <value references of seeds, with commas> <reference:start> ...

   Each instance has its own seeds and inputs, which move about their start values. Prints how many of the states in
   which they end are not the same both times, and how many are not the state of the instance before. */

#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { MOST_INSTANCES = 256, MOST_THREADS = 32, MOST_INPUTS = 64, STEPS = 200 };

typedef struct {
    fmi2Byte *bytes;
    size_t size;
} State;

static void *library;
static const char *guid;
static int instances, threads;
static fmi2ValueReference seeds[MOST_INPUTS], inputs[MOST_INPUTS];
static fmi2Real starts[MOST_INPUTS];
static size_t seed_count, input_count;
static State alone[MOST_INSTANCES], together[MOST_INSTANCES];
static pthread_barrier_t start_line;

static void *find(const char *name)
{
    void *symbol = dlsym(library, name);
    if (!symbol)
        exit(2);
    return symbol;
}

#define FMI(name) ((name##TYPE *)find(#name))

static void require(fmi2Status status)
{
    if (status != fmi2OK)
        exit(3);
}

static void run(int number, State *end)
{
    fmi2FMUstate state = NULL;
    fmi2Integer own_seeds[MOST_INPUTS];
    fmi2Real values[MOST_INPUTS];
    const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    fmi2Component unit = FMI(fmi2Instantiate)("unit", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (!unit)
        exit(4);
    for (size_t i = 0; i < seed_count; i++)
        own_seeds[i] = 1000 + number;
    require(FMI(fmi2SetInteger)(unit, seeds, seed_count, own_seeds));
    require(FMI(fmi2SetupExperiment)(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    require(FMI(fmi2EnterInitializationMode)(unit));
    require(FMI(fmi2ExitInitializationMode)(unit));
    for (int step = 0; step < STEPS; step++) {
        for (size_t i = 0; i < input_count; i++)
            values[i] = starts[i] + 0.01 * sin(number + step + (double)inputs[i]);
        require(FMI(fmi2SetReal)(unit, inputs, input_count, values));
        require(FMI(fmi2DoStep)(unit, step * 7.3e-3, 7.3e-3, fmi2True));
    }
    require(FMI(fmi2GetFMUstate)(unit, &state));
    require(FMI(fmi2SerializedFMUstateSize)(unit, state, &end->size));
    end->bytes = malloc(end->size);
    require(FMI(fmi2SerializeFMUstate)(unit, state, end->bytes, end->size));
    require(FMI(fmi2FreeFMUstate)(unit, &state));
    FMI(fmi2FreeInstance)(unit);
}

static void *work(void *first)
{
    pthread_barrier_wait(&start_line);
    for (int number = *(int *)first; number < instances; number += threads)
        run(number, &together[number]);
    return NULL;
}

static int are_same(const State *a, const State *b) { return a->size == b->size && !memcmp(a->bytes, b->bytes, a->size); }

int main(int count, char **arguments)
{
    pthread_t thread[MOST_THREADS];
    int number[MOST_THREADS], others = 0, distinct = 0;
    if (count < 6 || !(library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL)))
        return 1;
    guid = arguments[2];
    instances = atoi(arguments[3]);
    threads = atoi(arguments[4]);
    for (char *word = strtok(arguments[5], ","); word; word = strtok(NULL, ","))
        seeds[seed_count++] = (fmi2ValueReference)strtoul(word, NULL, 10);
    for (int i = 6; i < count; i++) {
        char *value;
        inputs[input_count] = (fmi2ValueReference)strtoul(arguments[i], &value, 10);
        starts[input_count++] = strtod(value + 1, NULL);
    }
    for (int i = 0; i < instances; i++)
        run(i, &alone[i]);
    pthread_barrier_init(&start_line, NULL, (unsigned)threads);
    for (int i = 0; i < threads; i++) {
        number[i] = i;
        pthread_create(&thread[i], NULL, work, &number[i]);
    }
    for (int i = 0; i < threads; i++)
        pthread_join(thread[i], NULL);
    for (int i = 0; i < instances; i++) {
        others += !are_same(&alone[i], &together[i]);
        distinct += i == 0 || !are_same(&alone[i], &alone[i - 1]);
    }
    printf("%d %d\n", others, distinct);
    return 0;
}
