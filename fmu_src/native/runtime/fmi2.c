/* The functions of FMI 2.0 for co-simulation.

   Which calls are allowed when (a row of the standard's state machine each; elsewhere fmi2Error, and nothing changes):

       call                       instantiated  initialising  stepping  stopped  terminated
       SetupExperiment                 x
       EnterInitializationMode         x
       ExitInitializationMode                        x
       DoStep                                                      x
       Set, SetRealInputDerivatives    x             x             x
       Get, GetDirectionalDerivative   x             x             x        x         x
       Terminate, Reset, states        x             x             x        x         x

   More lenient than the standard where it does no harm: values can be read before initialisation, as some hosts do;
   fmi2Terminate is taken at any time, as hosts call it that clean up after an error; fmi2SetupExperiment may be left
   out (the start time is 0) and a stop time passed (hosts overshoot by part of a step). After fmi2Error an instance goes
   on as if the call had not been made; only a step whose numbers ran away stops it. */

static const char NO_ARRAY[] = "%s: an array is missing (NULL)";

static fmi2Status require(Instance *instance, const char *call, Stage from, Stage to)
{
    const Stage stage = (Stage)instance->now.stage;
    if (from <= stage && stage <= to)
        return fmi2OK;
    return refuse(instance, "%s: %s refused: %s", instance->name, call, STAGE_TEXT[stage]);
}

/* --- life --------------------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static fmi2Component refuse_instance(fmi2String name, const fmi2CallbackFunctions *host, const char *why)
{
    if (host && host->logger)
        host->logger(host->componentEnvironment, name ? name : "", fmi2Error, "logStatusError", "%s", why);
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *instance;
    (void)resources;
    (void)visible;
    if (!name || !*name)
        return refuse_instance(name, host, "fmi2Instantiate refused: the instance has no name");
    if (type != fmi2CoSimulation)
        return refuse_instance(name, host, "fmi2Instantiate refused: this FMU is for co-simulation");
    if (!guid || strcmp(guid, GUID))
        return refuse_instance(name, host, "fmi2Instantiate refused: the GUID is that of another FMU or version");
    instance = calloc(1, sizeof *instance);
    if (instance)
        instance->name = malloc(strlen(name) + 1);
    if (!instance || !instance->name) {
        free(instance);
        return refuse_instance(name, host, "fmi2Instantiate failed: no memory");
    }
    strcpy(instance->name, name);
    instance->logger = host ? host->logger : NULL;
    instance->environment = host ? host->componentEnvironment : NULL;
    instance->logs_events = logging;
    instance->logs_errors = 1;
    begin_anew(instance);
    return instance;
}

void fmi2FreeInstance(fmi2Component component)
{
    Instance *instance = component;
    if (!instance)
        return;
    free(instance->name);
    free(instance);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    Instance *instance = component;
    int events = count == 0, errors = count == 0;
    if (!instance)
        return fmi2Error;
    if (count && !categories)
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < count; i++) {
        const char *category = categories[i] ? categories[i] : "(NULL)";
        if (!strcmp(category, "logAll"))
            events = errors = 1;
        else if (!strcmp(category, "logEvents"))
            events = 1;
        else if (!strcmp(category, "logStatusError"))
            errors = 1;
        else
            return refuse(instance, "%s: there is no log category %s", instance->name, category);
    }
    if (events)
        instance->logs_events = on;
    if (errors)
        instance->logs_errors = on;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean has_stop_time, fmi2Real stop_time)
{
    Instance *instance = component;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop_time; /* steps beyond it are taken: hosts overshoot by part of a step */
    (void)stop_time;
    if (!instance || require(instance, "fmi2SetupExperiment", INSTANTIATED, INSTANTIATED) != fmi2OK)
        return fmi2Error;
    if (!(fabs(start_time) <= LATEST_TIME))
        return refuse(instance, "%s: the start time is %s s (allowed: up to %s s)", instance->name,
                      written(start_time).digits, written(LATEST_TIME).digits);
    instance->now.start_time = instance->now.time = start_time;
    instance->now.stale = EVERYTHING_STALE; /* the clocks' ticks count from the start time */
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    Instance *instance = component;
    if (!instance || require(instance, "fmi2EnterInitializationMode", INSTANTIATED, INSTANTIATED) != fmi2OK)
        return fmi2Error;
    instance->now.stage = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    Instance *instance = component;
    if (!instance || require(instance, "fmi2ExitInitializationMode", INITIALISING, INITIALISING) != fmi2OK)
        return fmi2Error;
    if (refresh(instance, COEFFICIENTS_STALE | STATE_STALE) != fmi2OK)
        return fmi2Error;
    instance->now.stage = STEPPING;
    log_event(instance, "%s: initialised at t = %s s", instance->name, written(instance->now.time).digits);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    Instance *instance = component;
    if (!instance)
        return fmi2Error;
    instance->now.stage = TERMINATED;
    log_event(instance, "%s: terminated at t = %s s", instance->name, written(instance->now.time).digits);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    Instance *instance = component;
    if (!instance)
        return fmi2Error;
    begin_anew(instance);
    log_event(instance, "%s: reset", instance->name);
    return fmi2OK;
}

/* --- values ------------------------------------------------------------------------------------------------------- */

static const char *const TYPE_NAME[] = {"Real", "Integer", "Boolean", "Enumeration"};

static const char NO_VARIABLE[] = "%s: there is no variable with value reference %u";
static const char OTHER_TYPE[] = "%s: %s is of type %s, not %s";

static int exists(fmi2ValueReference reference)
{
    return reference < VARIABLES && VARIABLE[reference].type != HIDDEN;
}

/* The variable behind a reference, if it is of the type that the called function is for. */
static fmi2Status find(Instance *instance, fmi2ValueReference reference, Type wanted)
{
    if (!exists(reference))
        return refuse(instance, NO_VARIABLE, instance->name, reference);
    if (VARIABLE[reference].type == wanted || (VARIABLE[reference].type == ENUMERATION && wanted == INTEGER))
        return fmi2OK;
    return refuse(instance, OTHER_TYPE, instance->name, VARIABLE[reference].name,
                  TYPE_NAME[VARIABLE[reference].type], wanted == INTEGER ? "Integer or Enumeration" : TYPE_NAME[wanted]);
}

static int64_t group_of(fmi2ValueReference reference)
{
    if (reference < OUTPUTS_AT || reference == REFUSED_AT)
        return 0;
    if (reference < COEFFICIENTS_AT)
        return OUTPUTS_STALE;
    return reference < STATE_AT ? COEFFICIENTS_STALE : STATE_STALE;
}

/* Check that these can be read, and calculate what has to be. */
static fmi2Status ready(Instance *instance, const fmi2ValueReference references[], size_t count, const void *values,
                        Type type)
{
    int64_t needs = 0;
    if (count && (!references || !values))
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < count; i++) {
        if (find(instance, references[i], type) != fmi2OK)
            return fmi2Error;
        needs |= group_of(references[i]);
    }
    return refresh(instance, needs);
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    Instance *instance = component;
    if (!instance || ready(instance, references, count, values, REAL) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < count; i++)
        values[i] = instance->now.v[references[i]];
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference references[], size_t count,
                          fmi2Integer values[])
{
    Instance *instance = component;
    if (!instance || ready(instance, references, count, values, INTEGER) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < count; i++) {
        const double value = instance->now.v[references[i]];
        if (!is_int32(value))
            return refuse(instance, "%s.%s = %s does not fit into an integer", instance->name,
                          VARIABLE[references[i]].name, written(value).digits);
        values[i] = (fmi2Integer)value;
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t count,
                          fmi2Boolean values[])
{
    Instance *instance = component;
    if (!instance || ready(instance, references, count, values, BOOLEAN) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < count; i++)
        values[i] = instance->now.v[references[i]] != 0.0;
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2String values[])
{
    Instance *instance = component;
    (void)values;
    if (!instance)
        return fmi2Error;
    if (count == 0)
        return fmi2OK;
    if (!references)
        return refuse(instance, NO_ARRAY, instance->name);
    if (!exists(references[0]))
        return refuse(instance, NO_VARIABLE, instance->name, references[0]);
    return refuse(instance, OTHER_TYPE, instance->name, VARIABLE[references[0]].name,
                  TYPE_NAME[VARIABLE[references[0]].type], "String");
}

static const char *fault_of_value(fmi2ValueReference reference, double value)
{
    const Settable *settable = &SETTABLE[reference];
    if (!isfinite(value))
        return "not a finite number";
    if (settable->low <= value && value <= settable->high)
        return NULL;
    if (VARIABLE[reference].type == ENUMERATION)
        return "no such choice";
    if (value > settable->high)
        return "too large";
    return strcmp(settable->unit, "K") ? "too small" : "too small, kelvin wanted";
}

static fmi2Status check_causality(Instance *instance, fmi2ValueReference reference)
{
    if (reference < OUTPUTS_AT)
        return fmi2OK;
    return refuse(instance, "%s: %s cannot be set: its causality is %s", instance->name, VARIABLE[reference].name,
                  reference < COEFFICIENTS_AT || reference == REFUSED_AT ? "output"
                  : reference < STATE_AT                                 ? "calculatedParameter"
                                                                         : "local");
}

static fmi2Status check_value(Instance *instance, fmi2ValueReference reference, double value)
{
    const char *fault = fault_of_value(reference, value);
    return fault ? refuse_value(instance, reference, value, fault) : fmi2OK;
}

/* Whether the variable may still be set at this stage. */
static fmi2Status check_variability(Instance *instance, fmi2ValueReference reference, double value)
{
    if (instance->now.stage < STEPPING || reference >= INPUTS_AT || SETTABLE[reference].is_tunable)
        return fmi2OK;
    return refuse_value(instance, reference, value, "fixed, can be set only before the end of initialisation");
}

static void store(Instance *instance, fmi2ValueReference reference, double value)
{
    instance->now.v[reference] = value;
    if (instance->now.stage < STEPPING)
        instance->now.stale = EVERYTHING_STALE; /* initial state and outputs follow from all that is set */
    else if (reference < INPUTS_AT)
        instance->now.stale |= COEFFICIENTS_STALE | OUTPUTS_STALE;
}

/* The i-th of the values that a host sets. */
typedef double Element(const void *values, size_t i);

static double real_at(const void *values, size_t i) { return ((const fmi2Real *)values)[i]; }
static double integer_at(const void *values, size_t i) { return ((const fmi2Integer *)values)[i]; }
static double boolean_at(const void *values, size_t i) { return ((const fmi2Boolean *)values)[i] ? 1.0 : 0.0; }

/* Nothing is stored unless everything may be; of several faults, that one is told which the Python kind tells. */
static fmi2Status set(Instance *instance, const fmi2ValueReference references[], size_t count, const void *values,
                      Type type, Element *at)
{
    if (!instance)
        return fmi2Error;
    if (count && (!references || !values))
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < count; i++)
        if (find(instance, references[i], type) != fmi2OK)
            return fmi2Error;
    for (size_t i = 0; i < count; i++)
        if (check_causality(instance, references[i]) != fmi2OK)
            return fmi2Error;
    for (size_t i = 0; i < count; i++)
        if (check_value(instance, references[i], at(values, i)) != fmi2OK)
            return fmi2Error;
    if (require(instance, "setting values", INSTANTIATED, STEPPING) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < count; i++)
        if (check_variability(instance, references[i], at(values, i)) != fmi2OK)
            return fmi2Error;
    for (size_t i = 0; i < count; i++)
        store(instance, references[i], at(values, i));
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[])
{
    return set(component, references, count, values, REAL, real_at);
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference references[], size_t count,
                          const fmi2Integer values[])
{
    return set(component, references, count, values, INTEGER, integer_at);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t count,
                          const fmi2Boolean values[])
{
    return set(component, references, count, values, BOOLEAN, boolean_at);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[])
{
    (void)values;
    return fmi2GetString(component, references, count, NULL);
}

/* --- states ------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    if (!component || !state)
        return fmi2Error;
    if (!*state)
        *state = malloc(sizeof(SavedState));
    if (!*state)
        return refuse(component, "%s: no memory to save the state", ((Instance *)component)->name);
    save(component, *state);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    Instance *instance = component;
    const char *fault;
    if (!instance)
        return fmi2Error;
    fault = restore(instance, state);
    if (fault)
        return refuse(instance, "%s: saved state refused: %s", instance->name, fault);
    log_event(instance, "%s: state restored, t = %s s", instance->name, written(instance->now.time).digits);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    if (!component)
        return fmi2Error;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    if (!component || !state || !size)
        return fmi2Error;
    *size = sizeof(SavedState) + sizeof(uint64_t);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    uint64_t checksum;
    if (!component || !state)
        return fmi2Error;
    if (!bytes || size < sizeof(SavedState) + sizeof checksum)
        return refuse(component, "%s: %u bytes are too few for the saved state", ((Instance *)component)->name,
                      (unsigned)size);
    checksum = checksum_of(state, sizeof(SavedState));
    memcpy(bytes, state, sizeof(SavedState));
    memcpy(bytes + sizeof(SavedState), &checksum, sizeof checksum);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    Instance *instance = component;
    SavedState *saved, head;
    uint64_t checksum;
    const char *fault;
    if (!instance || !state)
        return fmi2Error;
    if (!bytes || size != sizeof *saved + sizeof checksum)
        return refuse(instance, "%s: saved state refused: these are %u bytes, not the %u of one of this FMU",
                      instance->name, (unsigned)size, (unsigned)(sizeof *saved + sizeof checksum));
    memcpy(&checksum, bytes + sizeof *saved, sizeof checksum);
    if (checksum != checksum_of((const unsigned char *)bytes, sizeof *saved))
        return refuse(instance, "%s: saved state refused: the bytes are damaged (checksum)", instance->name);
    memcpy(&head, bytes, sizeof head);
    fault = foreignness(&head);
    if (fault)
        return refuse(instance, "%s: saved state refused: %s", instance->name, fault);
    saved = *state ? *state : malloc(sizeof *saved);
    if (!saved)
        return refuse(instance, "%s: no memory for the saved state", instance->name);
    *saved = head;
    *state = saved;
    return fmi2OK;
}

/* --- derivatives -------------------------------------------------------------------------------------------------- */

static fmi2Status check_known(Instance *instance, fmi2ValueReference reference)
{
    const int is_initialising = instance->now.stage < STEPPING;
    if (find(instance, reference, REAL) != fmi2OK)
        return fmi2Error;
    if (reference < OUTPUTS_AT || (!is_initialising && reference >= STATE_AT))
        return fmi2OK;
    return refuse(instance, "%s: no derivative with respect to %s is offered: inputs, parameters and, after "
                  "initialisation, states are", instance->name, VARIABLE[reference].name);
}

static fmi2Status check_unknown(Instance *instance, fmi2ValueReference reference)
{
    if (find(instance, reference, REAL) != fmi2OK)
        return fmi2Error;
    if (reference >= OUTPUTS_AT && reference < STATE_AT)
        return fmi2OK;
    return refuse(instance, "%s: no derivative of %s is offered: those of outputs and calculated parameters are",
                  instance->name, VARIABLE[reference].name);
}

/* Before the end of initialisation outputs follow from parameters and inputs through the initial state, later from
   parameters and the state alone. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seeds[],
                                        fmi2Real derivatives[])
{
    Instance *instance = component;
    double tangent[VARIABLES] = {0};
    if (!instance)
        return fmi2Error;
    if ((unknown_count && (!unknowns || !derivatives)) || (known_count && (!knowns || !seeds)))
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < unknown_count; i++)
        if (check_unknown(instance, unknowns[i]) != fmi2OK)
            return fmi2Error;
    for (size_t i = 0; i < known_count; i++) {
        if (check_known(instance, knowns[i]) != fmi2OK)
            return fmi2Error;
        tangent[knowns[i]] += seeds[i];
    }
    if (refresh(instance, EVERYTHING_STALE) != fmi2OK)
        return fmi2Error;
    coefficients_derivative(instance->now.v, tangent);
    if (instance->now.stage < STEPPING)
        initial_state_derivative(instance->now.v, tangent);
    outputs_derivative(instance->now.v, tangent);
    for (size_t i = 0; i < unknown_count; i++)
        if (!isfinite(tangent[unknowns[i]]))
            return refuse(instance, "%s: the derivative of %s is %s here", instance->name, VARIABLE[unknowns[i]].name,
                          written(tangent[unknowns[i]]).digits);
    for (size_t i = 0; i < unknown_count; i++)
        derivatives[i] = tangent[unknowns[i]];
    return fmi2OK;
}

/* Slopes of inputs hold from the beginning to the end of the next step. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    Instance *instance = component;
    if (!instance || require(instance, "setting input derivatives", INSTANTIATED, STEPPING) != fmi2OK)
        return fmi2Error;
    if (count && (!references || !orders || !values))
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < count; i++) {
        if (find(instance, references[i], REAL) != fmi2OK)
            return fmi2Error;
        if (references[i] < INPUTS_AT || references[i] >= OUTPUTS_AT)
            return refuse(instance, "%s: %s is no input", instance->name, VARIABLE[references[i]].name);
        if (orders[i] != 1)
            return refuse(instance, "%s: derivative of order %d of %s refused: only the first is used", instance->name,
                          orders[i], VARIABLE[references[i]].name);
        if (!isfinite(values[i]))
            return refuse(instance, "%s: the derivative of %s is %s", instance->name, VARIABLE[references[i]].name,
                          written(values[i]).digits);
    }
    for (size_t i = 0; i < count; i++) {
        instance->now.slope[references[i] - INPUTS_AT] = values[i];
        if (values[i] != 0.0)
            instance->now.is_sloped = 1;
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    (void)references;
    (void)orders;
    (void)values;
    if (!component)
        return fmi2Error;
    return count ? refuse(component, "%s: derivatives of outputs are not offered", ((Instance *)component)->name) : fmi2OK;
}

/* Whether inputs that follow a slope stay in their range until the end of a step. */
static fmi2Status check_slopes(Instance *instance, double size)
{
    for (int i = 0; instance->now.is_sloped && i < INPUTS; i++) {
        const double end = instance->now.v[INPUTS_AT + i] + instance->now.slope[i] * size;
        if (instance->now.slope[i] != 0.0 && check_value(instance, (unsigned)(INPUTS_AT + i), end) != fmi2OK)
            return fmi2Error;
    }
    return fmi2OK;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real size, fmi2Boolean no_return)
{
    Instance *instance = component;
    (void)no_return;
    if (!instance || require(instance, "fmi2DoStep", STEPPING, STEPPING) != fmi2OK)
        return fmi2Error;
    if (!(size >= 0.0 && time + size <= LATEST_TIME))
        return refuse(instance, "%s: a step of %s s from t = %s s (allowed: forwards, up to %s s)", instance->name,
                      written(size).digits, written(time).digits, written(LATEST_TIME).digits);
    if (!(fabs(time - instance->now.time) <= TIME_SLACK * fmin(size, 1.0) + TIME_ROUNDING))
        return refuse(instance, "%s: a step from t = %s s, but the FMU stands at t = %s s", instance->name,
                      written(time).digits, written(instance->now.time).digits);
    if (check_slopes(instance, size) != fmi2OK || refresh(instance, COEFFICIENTS_STALE) != fmi2OK)
        return fmi2Error;
    return take_step(instance, time + size);
}

fmi2Status fmi2CancelStep(fmi2Component component)
{
    return component ? refuse(component, "%s: no step is pending", ((Instance *)component)->name) : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    if (!component || !value)
        return fmi2Error;
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((Instance *)component)->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!component || !value)
        return fmi2Error;
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = fmi2False; /* it never wants to end by itself */
    return fmi2OK;
}

/* Steps are never pending, so there is nothing more to tell. */
fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind;
    (void)value;
    return component ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind;
    (void)value;
    return component ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind;
    (void)value;
    return component ? fmi2Discard : fmi2Error;
}
