/* What a model is to the runtime. model.c, written from the model's records and functions, gives the sizes and defines
   the tables and functions declared here. */

/* Every number of an instance lies in one array: parameters, inputs, outputs, coefficients, state, refused calls.
   A variable's place in it is its value reference. */
enum {
    INPUTS_AT = PARAMETERS,
    OUTPUTS_AT = INPUTS_AT + INPUTS,
    COEFFICIENTS_AT = OUTPUTS_AT + OUTPUTS,
    STATE_AT = COEFFICIENTS_AT + COEFFICIENTS,
    REFUSED_AT = STATE_AT + STATES,
    VARIABLES
};

/* Reads and writes some of an instance's numbers; z are standard normal draws. */
typedef void Routine(double *v, const double *z);

/* Reads an instance's numbers and answers. */
typedef void Query(const double *v, double *answer);

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION, HIDDEN } Type;

typedef struct {
    const char *name;
    Type type;
} Variable;

/* Parameters and inputs. */
typedef struct {
    double start, low, high;
    const char *unit, *allowed;
    int is_tunable;
} Settable;

/* A parameter's limits follow from others. */
typedef struct {
    unsigned parameter;
    const char *why;
} Rule;

/* A clock runs its tasks one after the other. */
typedef struct {
    const char *name;
    int first_task, tasks;
} Clock;

typedef struct {
    const char *name;
    uint64_t stream;
    int normals;
    int first_way, ways;
} Task;

/* One step of a task, for one value of the parameter that chooses; at other values the task rests. */
typedef struct {
    double value;
    Routine *step;
} Way;

/* What `schedule` answers. */
typedef struct {
    double seed, period[CLOCKS], every[TASKS], choice[TASKS];
} Schedule;

/* The tables are VARIABLE[VARIABLES], SETTABLE[OUTPUTS_AT], CLOCK[CLOCKS], TASK[TASKS], WAY[], RULE[]. */

static Routine coefficients, initial_state, outputs;
static Query schedule; /* a Schedule, from parameters and coefficients */
static Query limits;   /* low and high of each rule, from the parameters */

/* Directional derivatives: tangents lie where their variables do in v. */
static Query coefficients_derivative, initial_state_derivative, outputs_derivative;
