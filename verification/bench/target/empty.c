/* No step at all: what a program weighs without one. */

#include "verification/bench/target/bench.h"

/* NOLINTNEXTLINE(readability-non-const-parameter): it has the type of every step. */
void bench_step(const controller_input *input, float torque_Nm[JOINTS])
{
    (void)input;
    (void)torque_Nm;
}
