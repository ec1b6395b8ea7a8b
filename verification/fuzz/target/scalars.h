#ifndef SCALARS_H
#define SCALARS_H

/* The numbers of a structure by their tables: reading, writing, rules, and values worth trying. */

#include "firmware_stub/controller.h"
#include "verification/fuzz/target/tables.h"

/** The bits of a number of a structure; a number of 32 bits is in the low half. */
uint64_t scalar_bits(const void *structure, const scalar *s);

/** Writes a number of a structure. */
void scalar_set_bits(void *structure, const scalar *s, uint64_t bits);

/** Whether it is a float or a double. */
bool scalar_is_real(scalar_type type);

/** A real number's value. */
double scalar_real(uint64_t bits, scalar_type type);

/** How a real number's bits are divided. */
typedef struct {
    uint32_t mantissa_bits;
    uint32_t exponent_ones; /* an exponent field of ones, at the right end */
    uint64_t sign;
} real_format;

/** How the bits of a float or a double are divided; that of a float for integers. */
real_format scalar_format(scalar_type type);

/** Whether the header's rule of a number holds; true where the tables don't know it. */
bool scalar_rule_holds(const scalar *s, uint64_t bits);

/** How many special numbers there are, of either sign, of every type. */
#define SPECIALS 28u

/**
 * Special number i of a type: zeros, ends, neighbours of ends and of one, subnormals, infinities,
 * quiet and signalling NaN; i is taken modulo their number.
 */
uint64_t scalar_special(scalar_type type, uint32_t i);

#endif
