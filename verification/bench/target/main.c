/* Replays the recorded inputs twice, timed and on a painted stack, and writes out the results. */

#include "verification/bench/target/bench.h"

#include "firmware_stub/cores/core.h"

/* ARM's semihosting, which QEMU offers on RISC-V as well. */
#define SYS_OPEN 0x01
#define SYS_WRITE 0x05
#define SYS_EXIT 0x18
#define OPEN_MODE_WRITE_BINARY 5u
#define STOPPED_BY_APPLICATION 0x20026u
#define STOPPED_BY_ERROR 0x20023u

static void stop(uintptr_t reason)
{
    /* NOLINTNEXTLINE(performance-no-int-to-ptr): semihosting takes a number for a pointer here. */
    (void)core_semihosting(SYS_EXIT, (const void *)reason);
    for (;;) {
    }
}

/* The timer's interrupt stays off. */
void core_tick(void)
{
}

void core_panic(void)
{
    stop(STOPPED_BY_ERROR);
}

/* What is left of a measured call if the step does nothing: the call and the return. */
/* NOLINTNEXTLINE(readability-non-const-parameter): it has to be a bench_function. */
static void empty_step(const controller_input *input, bench_torque torque[JOINTS])
{
    (void)input;
    (void)torque;
}

static void copy_torque(bench_torque target[JOINTS], const bench_torque source[JOINTS])
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        target[j] = source[j];
    }
}

static void time_all(void)
{
    bench_torque torque[JOINTS] = {0};
    bench_results[0].timer = bench_timed_call(empty_step, &bench_inputs[0], torque);
    uint32_t tick = 0u;
    for (uint32_t s = 0u; s < bench_sequence_count; ++s) {
        const bench_sequence *const sequence = &bench_sequences[s];
        bench_reset(sequence->counts, sequence->holding_torque);
        for (uint32_t k = 0u; k < sequence->ticks; ++k) {
            const controller_input *const input = &bench_inputs[tick];
            ++tick;
            bench_results[tick].timer = bench_timed_call(bench_step, input, torque);
            copy_torque(bench_results[tick].torque, torque);
        }
    }
}

static void paint_all(void)
{
    bench_torque torque[JOINTS] = {0};
    bench_results[0].stack = bench_painted_call(empty_step, &bench_inputs[0], torque);
    uint32_t tick = 0u;
    for (uint32_t s = 0u; s < bench_sequence_count; ++s) {
        const bench_sequence *const sequence = &bench_sequences[s];
        bench_reset(sequence->counts, sequence->holding_torque);
        for (uint32_t k = 0u; k < sequence->ticks; ++k) {
            const controller_input *const input = &bench_inputs[tick];
            ++tick;
            bench_results[tick].stack = bench_painted_call(bench_step, input, torque);
        }
    }
}

/* To standard output; returns what the host says, 0 if all was written. */
static int32_t write_results(void)
{
    static const char console[] = ":tt";
    const uintptr_t open[] = {(uintptr_t)console, OPEN_MODE_WRITE_BINARY, sizeof console - 1u};
    const int32_t handle = core_semihosting(SYS_OPEN, open);
    const uintptr_t write[] = {(uintptr_t)handle, (uintptr_t)bench_results, bench_results_bytes};
    return core_semihosting(SYS_WRITE, write);
}

int main(void)
{
    bench_prepare();
    time_all();
    paint_all();
    stop((write_results() == 0) ? STOPPED_BY_APPLICATION : STOPPED_BY_ERROR);
    return 0;
}
