#ifndef STEPS_H
#define STEPS_H

/*
 * Steps of the shipped controller, the same on the host and on every target: single ones that the
 * host wrote down, and random ones that this C draws for itself, so that a million of them need
 * no transfer. The drawing takes no floating-point operation; only the controller computes.
 */

#include <stdint.h>

#include "firmware_stub/controller.h"

/** Which arguments of the step are NULL. */
#define STEP_WITHOUT_CONFIG 1u
#define STEP_WITHOUT_STATE 2u
#define STEP_WITHOUT_INPUT 4u
#define STEP_WITHOUT_TORQUE 8u

/** One step before it is taken. All words are 32 bits, without padding: no controller in double. */
typedef struct {
    uint32_t missing;
    controller_config config;
    controller_state state;
    controller_input input;
} step_case;

/**
 * What became of it; torque holds STEP_UNWRITTEN where the step wrote nothing. What no later
 * step reads of the state is zero, unless the step was refused: then all is as it was.
 */
typedef struct {
    int32_t status;
    controller_number torque[JOINTS];
    controller_state state;
} step_result;

#define STEP_UNWRITTEN ((controller_number) - 12345)

/** Statuses from TDC_STOPPED to TDC_SATURATED, counted by status - TDC_STOPPED. */
#define STATUSES 9u

/** What is left of a block of random steps. */
typedef struct {
    uint64_t hash; /* FNV-1a, 64 bits, over the words of all cases and results */
    uint32_t statuses[STATUSES];
    uint32_t refused;         /* configurations that check_config and init did not take */
    uint32_t refused_torques; /* holding torques that init did not take */
    uint32_t nothing;         /* so that there is no padding */
} block_summary;

/** What is told of each step of a block. */
typedef void block_observer(void *context, const step_case *step, const step_result *result);

/** The last good tick's memory of a joint: its index is the lowest bit of the phase. */
controller_joint_state *step_last_memory(controller_state *state, uint32_t j);

/** The position of a joint at the last tick, which may be a lost one. */
int32_t step_latest_counts(controller_state *state, uint32_t j);

/** Takes a step from a copy of its state. */
void step_take(const step_case *step, step_result *result);

/** Takes steps one after the other. */
void step_take_all(const step_case *steps, step_result *results, uint32_t count);

/** Takes the random steps of a block, which follow from its number alone; observer may be NULL. */
void block_take(uint32_t block, uint32_t steps, block_summary *summary, block_observer *observer,
                void *context);

/** Takes the random steps of a block, and writes all of them down. */
void block_record(uint32_t block, uint32_t steps, step_case *cases, step_result *results);

#endif
