/* Cortex-M, ARMv6-M to ARMv7E-M, with or without an FPU: vectors, start-up, SysTick, semihosting. */

#include "cores/core.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYST_CSR REGISTER(0xE000E010u)
#define SYST_RVR REGISTER(0xE000E014u)
#define SYST_CVR REGISTER(0xE000E018u)
#define ICSR REGISTER(0xE000ED04u)
#define CCR REGISTER(0xE000ED14u)
#define CPACR REGISTER(0xE000ED88u)

#define SYST_CSR_ENABLE_INTERRUPT_PROCESSOR_CLOCK 7u
#define ICSR_PENDSTSET ((uint32_t)1u << 26)
#define CCR_UNALIGN_TRP 8u
#define CPACR_CP10_CP11_FULL ((uint32_t)0xFu << 20)

void reset_handler(void);
void exception_handler(void);
void systick_handler(void);

/* Separate from reset_handler: no floating-point instruction may come before the FPU is on. */
__attribute__((noinline, noreturn)) static void run(void)
{
    core_run();
    for (;;) {
    }
}

void reset_handler(void)
{
#ifdef __ARM_FP
    CPACR |= CPACR_CP10_CP11_FULL;
    /* FPSCR starts at 0: round to nearest, subnormals kept (FZ = 0), NaN kept (DN = 0). */
#endif
#ifndef __ARM_FEATURE_UNALIGNED
    /* ARMv6-M faults at every unaligned access; an ARMv7-M that stands in for it has to as well. */
    CCR |= CCR_UNALIGN_TRP;
#endif
    __asm volatile("dsb\n isb" ::: "memory");
    run();
}

void exception_handler(void)
{
    core_panic();
    for (;;) {
    }
}

void systick_handler(void)
{
    core_tick();
}

typedef void (*handler)(void);

typedef struct {
    uint32_t *initial_stack;
    handler handlers[15];
} vector_table;

/* External interrupts are not used; a board that does appends its own section .vectors.board. */
__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    .initial_stack = stack_top,
    .handlers =
        {
            reset_handler,
            exception_handler, /* NMI */
            exception_handler, /* HardFault; the next three are reserved in ARMv6-M */
            exception_handler, /* MemManage */
            exception_handler, /* BusFault */
            exception_handler, /* UsageFault */
            0,
            0,
            0,
            0,
            exception_handler, /* SVCall */
            exception_handler, /* DebugMonitor */
            0,
            exception_handler, /* PendSV */
            systick_handler,
        },
};

void core_start_ticks(uint32_t period)
{
    SYST_RVR = period - 1u;
    SYST_CVR = 0u;
    SYST_CSR = SYST_CSR_ENABLE_INTERRUPT_PROCESSOR_CLOCK;
}

uint32_t core_tick_elapsed(void)
{
    const uint32_t period = SYST_RVR + 1u;
    const uint32_t elapsed = period - 1u - SYST_CVR;
    /* The handler runs with SysTick no longer pending; if it pends again, the next tick is due. */
    return ((ICSR & ICSR_PENDSTSET) != 0u) ? (period + elapsed) : elapsed;
}

void core_idle(void)
{
    __asm volatile("wfi" ::: "memory");
}

uintptr_t core_stack_pointer(void)
{
    uintptr_t pointer;
    __asm volatile("mov %0, sp" : "=r"(pointer));
    return pointer;
}

int32_t core_semihosting(int32_t operation, const void *argument)
{
    register int32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}
