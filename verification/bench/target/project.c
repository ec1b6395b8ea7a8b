/* This project's step, as generated: only its arguments are put together here. */

#include "verification/bench/target/bench.h"

static controller_state state;

void bench_reset(const int32_t counts[JOINTS], const bench_torque holding_torque[JOINTS])
{
    (void)controller_init(&controller_default_config, &state, counts, holding_torque);
}

void bench_step(const controller_input *input, bench_torque torque[JOINTS])
{
    (void)controller_step(&controller_default_config, &state, input, torque);
}
