#ifndef TABLES_H
#define TABLES_H

/*
 * What the fuzzer knows of a controller's structures: every number in them by its place, type and
 * rule. `verification/fuzz/tables.py` writes the tables from the generator's own description.
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum { SCALAR_FLOAT, SCALAR_DOUBLE, SCALAR_INT32, SCALAR_UINT32 } scalar_type;

/** Which values the header allows in a configuration; RULE_ANY where it can't be said of one. */
typedef enum {
    RULE_ANY,
    RULE_POSITIVE,      /* finite, > 0 */
    RULE_NOT_NEGATIVE,  /* finite, >= 0 */
    RULE_RATIO,         /* > 0, <= 1 */
    RULE_ABOVE_MINUS_1, /* a - 1 in Q31, above -1 */
    RULE_DISPLACEMENT,  /* 1 to 2^30 - 1 */
    RULE_LOST_TICKS,    /* 1 to most_lost_ticks */
    RULE_SWITCH,        /* 0 or 1 */
    RULE_ON_ERROR,      /* TDC_HOLD_TORQUE or TDC_ZERO_TORQUE */
    RULE_IDENTITY,      /* as in the default configuration */
    RULE_ELSEWHERE,     /* one that these tables don't know */
} scalar_rule;

/** Whose a number of the state is. */
typedef enum {
    MEMORY_COMMON = -1, /* no memory of one tick: read by every step */
    MEMORY_EVEN = 0,    /* in the memory of index 0 */
    MEMORY_ODD = 1,     /* in that of index 1 */
} scalar_memory;

/** One number of a structure. */
typedef struct {
    size_t offset;
    scalar_type type;
    scalar_rule rule;
    scalar_memory memory;
    bool starts;  /* of the last good tick's memory: the first tick reads it */
    bool resumes; /* likewise: a tick after lost ones reads it */
    bool latest;  /* of the other memory: the reading at the last tick, where that was lost */
    bool counter; /* of lost ticks: read where the last one was lost, or there was none */
} scalar;

/** The numbers of a structure, and its size as the description has it. */
typedef struct {
    const scalar *scalars;
    size_t count;
    size_t size;
} structure;

extern const structure config_table;
extern const structure state_table;
extern const structure input_table;

/** Every status that the header names. */
extern const int32_t statuses[];
extern const size_t status_count;

/** The smallest and the largest phase that init and step set. */
extern const uint32_t first_phase;
extern const uint32_t last_phase;

/** How many lost ticks in a row a configuration may allow. */
extern const uint32_t most_lost_ticks;

/** Any bits may stand in state and configuration: no operation on them is undefined in C. */
extern const bool takes_any_bits;

/** The type of a torque. */
extern const scalar_type number_type;

#endif
