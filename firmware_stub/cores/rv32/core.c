/* RV32 in machine mode: traps, the timer of the CLINT, semihosting. */

#include "cores/core.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
/* Where SiFive's CLINT lies on every board that has one, QEMU's virt machine among them. */
#define MTIMECMP_LOW REGISTER(0x02004000u)
#define MTIMECMP_HIGH REGISTER(0x02004004u)
#define MTIME_LOW REGISTER(0x0200BFF8u)
#define MTIME_HIGH REGISTER(0x0200BFFCu)

#define MCAUSE_MACHINE_TIMER 0x80000007u
#define MIE_MACHINE_TIMER 0x80u
#define MSTATUS_MIE 0x8u

static uint32_t tick_period;
static uint64_t tick_start; /* of the running tick */

void trap_handler(void);

static uint64_t time_now(void)
{
    uint32_t high;
    uint32_t low;
    /* The low half may carry over between the two reads. */
    do {
        high = MTIME_HIGH;
        low = MTIME_LOW;
    } while (high != MTIME_HIGH);
    return ((uint64_t)high << 32) | low;
}

static void interrupt_at(uint64_t time)
{
    MTIMECMP_HIGH = UINT32_MAX; /* no early interrupt while the halves do not match */
    MTIMECMP_LOW = (uint32_t)time;
    MTIMECMP_HIGH = (uint32_t)(time >> 32);
}

void core_start_ticks(uint32_t period)
{
    tick_period = period;
    tick_start = time_now();
    interrupt_at(tick_start + period);
    __asm volatile("csrs mie, %0" ::"r"(MIE_MACHINE_TIMER));
    __asm volatile("csrs mstatus, %0" ::"r"(MSTATUS_MIE));
}

uint32_t core_tick_elapsed(void)
{
    return (uint32_t)(time_now() - tick_start);
}

/* A missed tick is lost, not made up for: two ticks in a row would see no motion between them. */
static void begin_tick(void)
{
    tick_start += tick_period;
    const uint32_t late = core_tick_elapsed();
    if (late >= tick_period) {
        tick_start += late - (late % tick_period);
    }
    interrupt_at(tick_start + tick_period);
}

__attribute__((interrupt("machine"), aligned(4))) void trap_handler(void)
{
    uint32_t cause;
    __asm volatile("csrr %0, mcause" : "=r"(cause));
    if (cause != MCAUSE_MACHINE_TIMER) {
        core_panic();
        for (;;) {
        }
    }
    begin_tick();
    core_tick();
}

void core_idle(void)
{
    __asm volatile("wfi" ::: "memory");
}

uintptr_t core_stack_pointer(void)
{
    uintptr_t pointer;
    __asm volatile("mv %0, sp" : "=r"(pointer));
    return pointer;
}

/* The three instructions are the call's signature: uncompressed and within one page. */
__attribute__((aligned(16))) int32_t core_semihosting(int32_t operation, const void *argument)
{
    register int32_t a0 __asm("a0") = operation;
    register const void *a1 __asm("a1") = argument;
    __asm volatile(".balign 16\n"
                   ".option push\n"
                   ".option norvc\n"
                   "slli x0, x0, 0x1f\n"
                   "ebreak\n"
                   "srai x0, x0, 7\n"
                   ".option pop\n"
                   : "+r"(a0)
                   : "r"(a1)
                   : "memory");
    return a0;
}
