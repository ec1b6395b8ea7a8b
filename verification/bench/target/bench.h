#ifndef BENCH_H
#define BENCH_H

/*
 * What the bench's target program is made of. A variant of the control step defines bench_reset
 * and bench_step; main.c replays recorded inputs through them and measures each call.
 */

#include <stdint.h>

#include "firmware_stub/controller.h"

/* The controller's own number for a torque [N m]; in integers, in the controller's own unit. */
#ifndef BENCH_TORQUE
#define BENCH_TORQUE float
#endif
typedef BENCH_TORQUE bench_torque;

/* --- A variant of the step ------------------------------------------------------------------- */

/** Switches the controller on, in standstill at these counts under this torque. */
void bench_reset(const int32_t counts[JOINTS], const bench_torque holding_torque[JOINTS]);

/** One tick: what is measured. Variants of the same numbers take the same input. */
void bench_step(const controller_input *input, bench_torque torque[JOINTS]);

/* --- The data: written by the bench, see data.S ---------------------------------------------- */

/** Consecutive ticks after one switch-on. */
typedef struct {
    uint32_t ticks;
    int32_t counts[JOINTS];
    bench_torque holding_torque[JOINTS];
} bench_sequence;

extern const uint32_t bench_sequence_count;
extern const bench_sequence bench_sequences[];
/** The inputs of all sequences, one after the other. */
extern const controller_input bench_inputs[];

typedef struct {
    uint32_t timer; /* timer counts from before the call to after it */
    uint32_t stack; /* [byte] */
    bench_torque torque[JOINTS];
} bench_result;

/** A result for each input, in the same order, after one for an empty step. */
extern bench_result bench_results[];
extern const uint32_t bench_results_bytes;

/* --- Measured calls: timed_call_CORE.S ------------------------------------------------------- */

typedef void bench_function(const controller_input *input, bench_torque torque[JOINTS]);

/** Starts the timer, and gives the C library what it needs. */
void bench_prepare(void);

/** Calls the function between two readings of the timer; returns the timer counts between. */
uint32_t bench_timed_call(bench_function *function, const controller_input *input,
                          bench_torque torque[JOINTS]);

/** Calls the function on a painted stack; returns the bytes down to the deepest word written. */
uint32_t bench_painted_call(bench_function *function, const controller_input *input,
                            bench_torque torque[JOINTS]);

#endif
