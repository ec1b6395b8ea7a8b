#ifndef STACK_H
#define STACK_H

/* How deep the stack was used: its free part is painted, and the paint that is left is counted. */

#include <stdint.h>

/** Paints the stack from its bottom up to here. */
void stack_paint(void);

/** The lowest address that lost its paint. */
uintptr_t stack_deepest(void);

/** Bytes between the top of the stack and the deepest address. */
uint32_t stack_used(void);

#endif
