/* This project's step, as generated: only its arguments are put together here. */

#include "verification/bench/target/bench.h"

static controller_state state;

void bench_reset(const int32_t counts[JOINTS], const float holding_torque_Nm[JOINTS])
{
    (void)controller_init(&controller_default_config, &state, counts, holding_torque_Nm);
}

void bench_step(const controller_input *input, float torque_Nm[JOINTS])
{
    (void)controller_step(&controller_default_config, &state, input, torque_Nm);
}
