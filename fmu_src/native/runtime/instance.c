/* An instance, its log, and its scheduler: the twin of models/system.py. */

/* All that decides how an instance goes on; 8 bytes each, so that there is no padding. */
typedef struct {
    double v[VARIABLES];
    double slope[INPUTS + 1]; /* of the real inputs, for the next step */
    int64_t ticks[CLOCKS];
    double start_time, time;
    int64_t stage;
    int64_t is_sloped; /* some slope is not zero */
    int64_t stale;
} Moment;

/* `stale`: which of the calculated numbers wait to be calculated. */
enum { OUTPUTS_STALE = 1, COEFFICIENTS_STALE = 2, STATE_STALE = 4, EVERYTHING_STALE = 7 };

typedef struct {
    Moment now;
    /* what follows from the coefficients */
    uint64_t seed;
    double period[CLOCKS], due[CLOCKS];
    int64_t every[TASKS];
    Routine *step[TASKS];
    /* the host */
    char *name;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    int logs_events, logs_errors;
} Instance;

/* Text that was cut must not end within a character of UTF-8. */
static void drop_last_character(char *text)
{
    size_t end = strlen(text);
    while (end > 0 && ((unsigned char)text[end - 1] & 0xC0u) == 0x80u)
        end--;
    text[end > 0 ? end - 1 : 0] = '\0';
}

static void log_text(Instance *instance, fmi2Status status, const char *category, const char *format, va_list values)
{
    char text[1024];
    if (!instance->logger)
        return;
    if (vsnprintf(text, sizeof text, format, values) >= (int)sizeof text)
        drop_last_character(text);
    instance->logger(instance->environment, instance->name, status, category, "%s", text);
}

static void log_event(Instance *instance, const char *format, ...)
{
    va_list values;
    if (!instance->logs_events)
        return;
    va_start(values, format);
    log_text(instance, fmi2OK, "logEvents", format, values);
    va_end(values);
}

/* Count and log a refused call. */
static fmi2Status refuse(Instance *instance, const char *format, ...)
{
    va_list values;
    if (instance->now.v[REFUSED_AT] < 2147483647.0)
        instance->now.v[REFUSED_AT] += 1.0;
    if (instance->logs_errors) {
        va_start(values, format);
        log_text(instance, fmi2Error, "logStatusError", format, values);
        va_end(values);
    }
    return fmi2Error;
}

/* The unit as it follows a number. */
static const char *space(const char *unit) { return strcmp(unit, "1") ? " " : ""; }
static const char *shown(const char *unit) { return strcmp(unit, "1") ? unit : ""; }

/* A number as messages show it, the same on every platform and in every locale. */
typedef struct {
    char digits[32];
} Written;

static Written written(double value)
{
    Written text;
    if (isnan(value))
        strcpy(text.digits, "nan");
    else if (isinf(value))
        strcpy(text.digits, value > 0.0 ? "inf" : "-inf");
    else
        snprintf(text.digits, sizeof text.digits, "%.15g", value);
    for (char *c = text.digits; *c; c++)
        if (*c == ',')
            *c = '.';
    return text;
}

/* Whether a number can be an FMI integer. */
static int is_int32(double value)
{
    return value == floor(value) && -2147483648.0 <= value && value <= 2147483647.0;
}

static fmi2Status refuse_value(Instance *instance, unsigned reference, double value, const char *why)
{
    const Settable *settable = &SETTABLE[reference];
    return refuse(instance, "%s.%s = %s%s%s: %s (allowed: %s)", instance->name, VARIABLE[reference].name,
                  written(value).digits, space(settable->unit), shown(settable->unit), why, settable->allowed);
}

static int are_finite(const double *values, int count)
{
    double sum[8] = {0.0}; /* so that no addition waits for the one before */
    int i = 0;
    for (; i + 8 <= count; i += 8)
        for (int j = 0; j < 8; j++)
            sum[j] += values[i + j] - values[i + j]; /* 0 or NaN */
    for (; i < count; i++)
        sum[0] += values[i] - values[i];
    return sum[0] + sum[1] + sum[2] + sum[3] + sum[4] + sum[5] + sum[6] + sum[7] == 0.0;
}

static fmi2Status refuse_runaway(Instance *instance, int first, int count)
{
    int i = first;
    while (i < first + count - 1 && isfinite(instance->now.v[i]))
        i++;
    return refuse(instance, "%s.%s = %s: the numbers ran away; look for parameters or inputs far from what the model "
                  "is made for", instance->name, VARIABLE[i].name, written(instance->now.v[i]).digits);
}

/* --- parameters: rules, coefficients, clocks ---------------------------------------------------------------------- */

/* "0 to 1 m", "0 m or more" or "1 m or less". */
static void write_range(double low, double high, const char *unit, char *range, size_t size)
{
    if (high == HUGE_VAL)
        snprintf(range, size, "%s%s%s or more", written(low).digits, space(unit), shown(unit));
    else if (low == -HUGE_VAL)
        snprintf(range, size, "%s%s%s or less", written(high).digits, space(unit), shown(unit));
    else
        snprintf(range, size, "%s to %s%s%s", written(low).digits, written(high).digits, space(unit), shown(unit));
}

static fmi2Status check_rules(Instance *instance)
{
    double limit[2 * RULES + 1];
    limits(instance->now.v, limit);
    for (int i = 0; i < RULES; i++) {
        const unsigned reference = RULE[i].parameter;
        const double value = instance->now.v[reference], low = limit[2 * i], high = limit[2 * i + 1];
        const char *unit = SETTABLE[reference].unit;
        char range[160];
        if (low <= value && value <= high)
            continue;
        write_range(low, high, unit, range, sizeof range);
        return refuse(instance, "%s.%s = %s%s%s: %s (allowed: %s)", instance->name, VARIABLE[reference].name,
                      written(value).digits, space(unit), shown(unit), RULE[i].why, range);
    }
    return fmi2OK;
}

static Routine *chosen(const Task *task, double value)
{
    for (int i = task->first_way; i < task->first_way + task->ways; i++)
        if (WAY[i].value == value)
            return WAY[i].step;
    return NULL;
}

static double due_time(const Instance *instance, int clock)
{
    return instance->now.start_time + (double)(instance->now.ticks[clock] + 1) * instance->period[clock];
}

/* Plan the tasks; the clocks' periods are those of the beginning. */
static void plan(Instance *instance, const Schedule *found, int is_beginning)
{
    instance->seed = (uint64_t)(int64_t)found->seed;
    for (int i = 0; i < TASKS; i++) {
        instance->every[i] = found->every[i] >= 1.0 ? (int64_t)fmin(found->every[i], 9007199254740992.0) : 1;
        instance->step[i] = chosen(&TASK[i], found->choice[i]);
    }
    for (int i = 0; i < CLOCKS; i++) {
        if (is_beginning)
            instance->period[i] = found->period[i];
        instance->due[i] = due_time(instance, i);
    }
}

/* Coefficients and clocks of the parameters as they are; on an error nothing is changed but the coefficients. */
static fmi2Status prepare(Instance *instance, int is_beginning)
{
    Schedule found;
    double *v = instance->now.v;
    if (check_rules(instance) != fmi2OK)
        return fmi2Error;
    coefficients(v, NULL);
    if (!are_finite(v + COEFFICIENTS_AT, COEFFICIENTS))
        return refuse_runaway(instance, COEFFICIENTS_AT, COEFFICIENTS);
    schedule(v, (double *)&found);
    for (int i = 0; i < CLOCKS; i++)
        if (!(found.period[i] >= SHORTEST_PERIOD))
            return refuse(instance, "%s.%s clock's period = %s s: the parameters give too short a period "
                          "(allowed: %s s or more)", instance->name, CLOCK[i].name, written(found.period[i]).digits,
                          written(SHORTEST_PERIOD).digits);
    plan(instance, &found, is_beginning);
    instance->now.stale &= ~COEFFICIENTS_STALE;
    return fmi2OK;
}

/* Bring what is asked for up to date with what was set: coefficients, initial state, outputs. */
static fmi2Status refresh(Instance *instance, int64_t needs)
{
    double *v = instance->now.v;
    needs &= instance->now.stale;
    if (!needs)
        return fmi2OK;
    if (instance->now.stale & COEFFICIENTS_STALE && prepare(instance, instance->now.stage < STEPPING) != fmi2OK)
        return fmi2Error;
    if (instance->now.stale & STATE_STALE) {
        initial_state(v, NULL);
        if (!are_finite(v + STATE_AT, STATES))
            return refuse_runaway(instance, STATE_AT, STATES);
        instance->now.stale &= ~STATE_STALE;
    }
    if (needs & OUTPUTS_STALE) {
        outputs(v, NULL);
        if (!are_finite(v + OUTPUTS_AT, OUTPUTS))
            return refuse_runaway(instance, OUTPUTS_AT, OUTPUTS);
        instance->now.stale &= ~OUTPUTS_STALE;
    }
    return fmi2OK;
}

/* --- time --------------------------------------------------------------------------------------------------------- */

static void run_tasks(Instance *instance, int clock)
{
    double z[MOST_NORMALS + 1];
    const int64_t tick = ++instance->now.ticks[clock];
    const int first = CLOCK[clock].first_task;
    for (int i = first; i < first + CLOCK[clock].tasks; i++) {
        const Task *task = &TASK[i];
        const int64_t every = instance->every[i];
        if (!instance->step[i] || (every > 1 && tick % every))
            continue;
        if (task->normals)
            normals(instance->seed, task->stream, (uint64_t)(tick / every), task->normals, z);
        instance->step[i](instance->now.v, z);
    }
    instance->due[clock] = due_time(instance, clock);
}

static void slope_inputs(Instance *instance, const double *held, double elapsed)
{
    for (int i = 0; i < INPUTS; i++)
        instance->now.v[INPUTS_AT + i] = held[i] + instance->now.slope[i] * elapsed;
}

/* Run every tick due by `until`. Inputs are held, or follow their slopes from the beginning of the step. */
static void advance(Instance *instance, double until)
{
    const double limit = until + TIME_TOLERANCE * fmax(1.0, fabs(until));
    double held[INPUTS + 1];
    memcpy(held, instance->now.v + INPUTS_AT, INPUTS * sizeof(double));
    for (;;) {
        int next = 0;
        for (int i = 1; i < CLOCKS; i++)
            if (instance->due[i] < instance->due[next])
                next = i;
        if (!(instance->due[next] <= limit))
            break;
        if (instance->now.is_sloped)
            slope_inputs(instance, held, instance->due[next] - instance->now.time);
        run_tasks(instance, next);
    }
    memcpy(instance->now.v + INPUTS_AT, held, INPUTS * sizeof(double));
}

static void forget_slopes(Instance *instance)
{
    if (instance->now.is_sloped)
        memset(instance->now.slope, 0, sizeof instance->now.slope);
    instance->now.is_sloped = 0;
}

/* One communication step; if the numbers run away, the state goes back to its beginning. */
static fmi2Status take_step(Instance *instance, double until)
{
    Moment *now = &instance->now;
    double state[STATES + 1];
    int64_t ticks[CLOCKS];
    memcpy(state, now->v + STATE_AT, STATES * sizeof(double));
    memcpy(ticks, now->ticks, sizeof ticks);
    advance(instance, until);
    if (!are_finite(now->v + STATE_AT, STATES)) {
        const fmi2Status status = refuse_runaway(instance, STATE_AT, STATES);
        memcpy(now->v + STATE_AT, state, STATES * sizeof(double));
        memcpy(now->ticks, ticks, sizeof ticks);
        now->stage = STOPPED;
        return status;
    }
    forget_slopes(instance);
    now->time = fmax(until, now->time);
    now->stale |= OUTPUTS_STALE;
    return fmi2OK;
}

/* The instance as it is after fmi2Instantiate. */
static void begin_anew(Instance *instance)
{
    memset(&instance->now, 0, sizeof instance->now);
    for (int i = 0; i < OUTPUTS_AT; i++)
        instance->now.v[i] = SETTABLE[i].start;
    instance->now.stale = EVERYTHING_STALE;
}
