/* An FMU whose allocations are counted and can be made to fail. */

#include <stdlib.h>

#include "fmi2Functions.h"

FMI2_Export long outstanding_allocations = 0;
FMI2_Export int allocations_fail = 0;

static void *counted(void *place)
{
    outstanding_allocations += place != NULL;
    return place;
}

static void *counted_malloc(size_t size) { return allocations_fail ? NULL : counted(malloc(size)); }

static void *counted_calloc(size_t count, size_t size) { return allocations_fail ? NULL : counted(calloc(count, size)); }

static void counted_free(void *place)
{
    outstanding_allocations -= place != NULL;
    free(place);
}

#define malloc counted_malloc
#define calloc counted_calloc
#define free counted_free

#include "fmu.c"
