#ifndef DRAW_H
#define DRAW_H

/*
 * What random steps are made of. The numbers of a controller, floats or integers, are drawn by
 * draw_floating_point.c or by draw_fixed_point.c; neither takes a floating-point operation.
 */

#include <stdbool.h>
#include <stdint.h>

#include "verification/chain/target/steps.h"

#define SIGN_BIT 0x80000000u

/* Fields of a joint's memory. */
#ifdef TDC_FIXED_H
#define SLIDING_INTEGRAL sliding_integral_q
#define APPLIED_TORQUE applied_torque_q
#define SLIDING_INTEGRAL sliding_integral_q
#else
#define SLIDING_INTEGRAL sliding_integral_rad_per_s
#define APPLIED_TORQUE applied_torque_Nm
#define SLIDING_INTEGRAL sliding_integral_rad_per_s
#endif

/** Bob Jenkins's small fast generator, 32 bits: any seed is a good one. */
typedef struct {
    uint32_t a, b, c, d;
} generator;

generator draw_seeded(uint32_t seed);

uint32_t draw_word(generator *g);

/** Whether something happens that does so once in `times`, a power of two. */
bool draw_once_in(generator *g, uint32_t times);

/** An integer of either sign, its magnitude below 2^(31 - from), all powers of two alike. */
uint32_t draw_integer_below(generator *g, uint32_t from);

/** How far from an everyday tick the drawn numbers go. */
typedef enum { RIG, WIDE, EXTREME } regime;

regime draw_regime(generator *g);

/* --- Of a controller's own numbers ----------------------------------------------------------- */

/** Gains that keep the rules of the header; returns how far they go. */
regime draw_config(generator *g, controller_config *config);

/** Not always within a limit. */
void draw_holding_torque(generator *g, controller_number torque[JOINTS]);

void draw_input(generator *g, regime far, step_case *step);

/** Memory that no tick has left behind, but might have. */
void draw_memory(generator *g, regime far, step_case *step);

/** Makes one number one that most steps refuse. */
void draw_bad_input(generator *g, controller_input *input);

#endif
