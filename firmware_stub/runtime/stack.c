#include "runtime/stack.h"

#include "cores/core.h"

#define PAINT 0xC5A5C5A5u

/* Below the stack pointer of the painting itself, which must not paint its own frame. */
#define MARGIN_BYTES 32u

void stack_paint(void)
{
    volatile uint32_t *const end = (uint32_t *)(core_stack_pointer() - MARGIN_BYTES);
    for (volatile uint32_t *word = stack_bottom; word < end; ++word) {
        *word = PAINT;
    }
}

uintptr_t stack_deepest(void)
{
    const volatile uint32_t *word = stack_bottom;
    while ((word < stack_top) && (*word == PAINT)) {
        ++word;
    }
    return (uintptr_t)word;
}

uint32_t stack_used(void)
{
    return (uint32_t)((uintptr_t)stack_top - stack_deepest());
}
