/* A host for one FMU: loads a library, does the calls that standard input lists, and prints what comes back.

       host <library> <guid>

       setup                          and: enter, exit, terminate, reset
       real 3 3ff0000000000000        sets; any number of pairs of a value reference and a value
       integer 7 2                    and: boolean
       step <time> <size>
       get-real 12 13                 prints "get-real <values>"; also get-integer and get-boolean
       save                           and: restore; the state goes through bytes on its way

   Doubles are written as their bits, because not every C library reads decimals to the last one. A call that does not
   return fmi2OK is printed as "<command> <status>"; the last line is "done". */

#include <inttypes.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#ifdef _WIN32
#include <windows.h>
#define OPEN(name) ((void *)LoadLibraryA(name))
#define SYMBOL(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#define CLOSE(library) FreeLibrary((HMODULE)(library))
#else
#include <dlfcn.h>
#define OPEN(name) dlopen(name, RTLD_NOW | RTLD_LOCAL)
#define SYMBOL(library, name) dlsym(library, name)
#define CLOSE(library) dlclose(library)
#endif

enum { LONGEST_LINE = 1 << 16, MOST_VALUES = 1024 };

static void *library;

static void *find(const char *name)
{
    void *symbol = SYMBOL(library, name);
    if (!symbol) {
        fprintf(stderr, "%s is missing\n", name);
        exit(1);
    }
    return symbol;
}

#define FMI(name) ((name##TYPE *)find(#name))

static void log_text(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                     fmi2String format, ...)
{
    va_list values;
    (void)environment;
    fprintf(stderr, "%s %d %s: ", instance, (int)status, category);
    va_start(values, format);
    vfprintf(stderr, format, values);
    va_end(values);
    fputc('\n', stderr);
}

static double number(const char *text)
{
    const uint64_t bits = strtoull(text, NULL, 16);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static size_t references_in(fmi2ValueReference *references)
{
    size_t count = 0;
    for (const char *word; (word = strtok(NULL, " \r\n")) && count < MOST_VALUES;)
        references[count++] = (fmi2ValueReference)strtoul(word, NULL, 10);
    return count;
}

static fmi2Status set_reals(fmi2Component component)
{
    fmi2ValueReference references[MOST_VALUES];
    fmi2Real values[MOST_VALUES];
    size_t count = 0;
    for (const char *word; (word = strtok(NULL, " \r\n")) && count < MOST_VALUES; count++) {
        references[count] = (fmi2ValueReference)strtoul(word, NULL, 10);
        values[count] = number(strtok(NULL, " \r\n"));
    }
    return FMI(fmi2SetReal)(component, references, count, values);
}

static fmi2Status set_whole(fmi2Component component, int is_boolean)
{
    fmi2ValueReference references[MOST_VALUES];
    int values[MOST_VALUES];
    size_t count = 0;
    for (const char *word; (word = strtok(NULL, " \r\n")) && count < MOST_VALUES; count++) {
        references[count] = (fmi2ValueReference)strtoul(word, NULL, 10);
        values[count] = (int)strtol(strtok(NULL, " \r\n"), NULL, 10);
    }
    return is_boolean ? FMI(fmi2SetBoolean)(component, references, count, values)
                      : FMI(fmi2SetInteger)(component, references, count, values);
}

/* Whoever asked may wait for the answer. */
static void finish_line(void)
{
    putchar('\n');
    fflush(stdout);
}

static fmi2Status print_reals(fmi2Component component)
{
    fmi2ValueReference references[MOST_VALUES];
    fmi2Real values[MOST_VALUES];
    const size_t count = references_in(references);
    const fmi2Status status = FMI(fmi2GetReal)(component, references, count, values);
    printf("get-real");
    for (size_t i = 0; i < count && status == fmi2OK; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        printf(" %016" PRIx64, bits);
    }
    finish_line();
    return status;
}

static fmi2Status print_whole(fmi2Component component, const char *command, int is_boolean)
{
    fmi2ValueReference references[MOST_VALUES];
    int values[MOST_VALUES];
    const size_t count = references_in(references);
    const fmi2Status status = is_boolean ? FMI(fmi2GetBoolean)(component, references, count, values)
                                         : FMI(fmi2GetInteger)(component, references, count, values);
    printf("%s", command);
    for (size_t i = 0; i < count && status == fmi2OK; i++)
        printf(" %d", values[i]);
    finish_line();
    return status;
}

static fmi2Byte *saved;
static size_t saved_size;

static fmi2Status save(fmi2Component component)
{
    fmi2FMUstate state = NULL;
    fmi2Status status = FMI(fmi2GetFMUstate)(component, &state);
    if (status == fmi2OK)
        status = FMI(fmi2SerializedFMUstateSize)(component, state, &saved_size);
    if (status != fmi2OK)
        return status;
    free(saved);
    saved = malloc(saved_size);
    status = FMI(fmi2SerializeFMUstate)(component, state, saved, saved_size);
    FMI(fmi2FreeFMUstate)(component, &state);
    return state ? fmi2Error : status;
}

static fmi2Status restore(fmi2Component component)
{
    fmi2FMUstate state = NULL;
    fmi2Status status = FMI(fmi2DeSerializeFMUstate)(component, saved, saved_size, &state);
    if (status == fmi2OK)
        status = FMI(fmi2SetFMUstate)(component, state);
    FMI(fmi2FreeFMUstate)(component, &state);
    return status;
}

static fmi2Status call(fmi2Component component, const char *command)
{
    if (!strcmp(command, "setup"))
        return FMI(fmi2SetupExperiment)(component, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    if (!strcmp(command, "enter"))
        return FMI(fmi2EnterInitializationMode)(component);
    if (!strcmp(command, "exit"))
        return FMI(fmi2ExitInitializationMode)(component);
    if (!strcmp(command, "step")) {
        const double time = number(strtok(NULL, " \r\n"));
        return FMI(fmi2DoStep)(component, time, number(strtok(NULL, " \r\n")), fmi2True);
    }
    if (!strcmp(command, "real"))
        return set_reals(component);
    if (!strcmp(command, "integer") || !strcmp(command, "boolean"))
        return set_whole(component, *command == 'b');
    if (!strcmp(command, "get-real"))
        return print_reals(component);
    if (!strcmp(command, "get-integer") || !strcmp(command, "get-boolean"))
        return print_whole(component, command, command[4] == 'b');
    if (!strcmp(command, "save"))
        return save(component);
    if (!strcmp(command, "restore"))
        return restore(component);
    if (!strcmp(command, "reset"))
        return FMI(fmi2Reset)(component);
    if (!strcmp(command, "terminate"))
        return FMI(fmi2Terminate)(component);
    fprintf(stderr, "there is no command %s\n", command);
    exit(1);
}

int main(int count, char **arguments)
{
    static char line[LONGEST_LINE];
    const fmi2CallbackFunctions callbacks = {log_text, calloc, free, NULL, NULL};
    fmi2Component component;
    if (count != 3 || !(library = OPEN(arguments[1]))) {
        fprintf(stderr, "the library cannot be loaded\n");
        return 1;
    }
    printf("%s %s", FMI(fmi2GetVersion)(), FMI(fmi2GetTypesPlatform)());
    finish_line();
    component = FMI(fmi2Instantiate)("unit", fmi2CoSimulation, arguments[2], "file:///resources", &callbacks, fmi2False,
                                     fmi2False);
    if (!component)
        return 1;
    while (fgets(line, sizeof line, stdin)) {
        const char *command = strtok(line, " \r\n");
        const fmi2Status status = command ? call(component, command) : fmi2OK;
        if (status != fmi2OK)
            printf("%s %d\n", command, (int)status);
    }
    FMI(fmi2FreeInstance)(component);
    free(saved);
    CLOSE(library);
    printf("done\n");
    return 0;
}
