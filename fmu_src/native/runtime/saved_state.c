/* Saved states: a moment with a head that tells whose it is, and a checksum when it leaves as bytes.

   Every field is 8 bytes long, in the machine's own order: all the platforms that this is built for have the same, and
   another one's is refused by the first field. */

typedef struct {
    uint64_t magic, fingerprint[2], size;
    Moment moment;
} SavedState;

static const uint64_t MAGIC = 0x33554D46746E6F43u;

/* CRC-32 of IEEE 802.3, four bits at a time. */
static uint32_t checksum_of(const unsigned char *bytes, size_t size)
{
    uint32_t table[16], crc = 0xFFFFFFFFu;
    for (uint32_t i = 0; i < 16; i++) {
        table[i] = i;
        for (int bit = 0; bit < 4; bit++)
            table[i] = table[i] >> 1 ^ (0xEDB88320u & (0u - (table[i] & 1u)));
    }
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        crc = crc >> 4 ^ table[crc & 15u];
        crc = crc >> 4 ^ table[crc & 15u];
    }
    return ~crc;
}

static void save(const Instance *instance, SavedState *saved)
{
    saved->magic = MAGIC;
    saved->fingerprint[0] = FINGERPRINT_0;
    saved->fingerprint[1] = FINGERPRINT_1;
    saved->size = sizeof *saved;
    saved->moment = instance->now;
}

/* Whether a number can be the value of a parameter or input. */
static int fits(int reference, double value)
{
    const Settable *settable = &SETTABLE[reference];
    return settable->low <= value && value <= settable->high &&
           (VARIABLE[reference].type == REAL || is_int32(value));
}

static int is_in_range(const Moment *moment)
{
    if (moment->stale & ~(int64_t)EVERYTHING_STALE || (moment->is_sloped != 0 && moment->is_sloped != 1) ||
        (moment->stage >= STEPPING && moment->stage != TERMINATED && moment->stale & STATE_STALE))
        return 0;
    for (int i = 0; i < OUTPUTS_AT; i++)
        if (!fits(i, moment->v[i]))
            return 0;
    for (int i = 0; i < CLOCKS; i++)
        if (moment->ticks[i] < 0 || moment->ticks[i] > (int64_t)1 << 53)
            return 0;
    return INSTANTIATED <= moment->stage && moment->stage <= TERMINATED &&
           (moment->stage >= STEPPING || moment->time == moment->start_time) &&
           (moment->stage < STEPPING || moment->stale & STATE_STALE || are_finite(moment->v + STATE_AT, STATES)) &&
           are_finite(moment->slope, INPUTS) && fabs(moment->start_time) <= LATEST_TIME &&
           fabs(moment->time) <= LATEST_TIME;
}

/* What the clocks and tasks of a moment are; calculates its coefficients anew. A clock that lags behind would keep the
   next step busy for ever. */
static int find_schedule(Moment *moment, Schedule *found)
{
    coefficients(moment->v, NULL);
    schedule(moment->v, (double *)found);
    for (int i = 0; i < CLOCKS; i++)
        if (!(found->period[i] >= SHORTEST_PERIOD &&
              moment->start_time + (double)(moment->ticks[i] + 1) * found->period[i] > moment->time))
            return 0;
    return 1;
}

/* NULL if a saved state is one of this FMU, else what it is. */
static const char *foreignness(const SavedState *saved)
{
    if (!saved || saved->magic != MAGIC)
        return "this is no saved state of this kind of FMU";
    if (saved->fingerprint[0] != FINGERPRINT_0 || saved->fingerprint[1] != FINGERPRINT_1 || saved->size != sizeof *saved)
        return "another FMU or version saved it";
    return NULL;
}

/* Go on from a saved state; calls refused until now stay counted. NULL, or why not: then nothing has changed. */
static const char *restore(Instance *instance, const SavedState *saved)
{
    Schedule found;
    Moment moment;
    if (foreignness(saved))
        return foreignness(saved);
    moment = saved->moment;
    if (!is_in_range(&moment) || (moment.stage == STEPPING && !find_schedule(&moment, &found)))
        return "it is damaged";
    moment.v[REFUSED_AT] = instance->now.v[REFUSED_AT];
    instance->now = moment;
    instance->now.stale |= moment.stage < STEPPING ? EVERYTHING_STALE : COEFFICIENTS_STALE | OUTPUTS_STALE;
    if (moment.stage == STEPPING)
        plan(instance, &found, 1);
    return NULL;
}
