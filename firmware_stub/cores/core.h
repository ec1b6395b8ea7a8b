#ifndef CORE_H
#define CORE_H

/*
 * What a core has to provide: cores/NAME/core.c and start-up. The board's code and the application
 * see no register of the processor.
 */

#include <stdint.h>

/** Lowest and highest address of the stack, and where variables lie; from cores/sections.ld. */
extern uint32_t stack_bottom[], stack_top[];
extern uint32_t data_load[], data_start[], data_end[], bss_start[], bss_end[];

/** Copies .data, clears .bss, and runs main; the start-up calls it with a stack and an FPU. */
void core_run(void);

/** Calls core_tick every so many counts of the tick clock; TICK_CLOCK_HZ is the board's. */
void core_start_ticks(uint32_t period);

/** Counts since the tick began; the period or more once the next tick is due. */
uint32_t core_tick_elapsed(void);

/** Sleeps until an interrupt. */
void core_idle(void);

/** What the timer calls in its interrupt; the application defines it. */
void core_tick(void);

/** What a processor exception ends in; the application defines it. */
void core_panic(void);

/** The value of the stack pointer. */
uintptr_t core_stack_pointer(void);

/** Asks the debugger or emulator for a service (ARM's semihosting numbers on every core). */
int32_t core_semihosting(int32_t operation, const void *argument);

#endif
