/* No step at all: what a program weighs without one. */

#include "verification/bench/target/bench.h"

/* NOLINTNEXTLINE(readability-non-const-parameter): it has the type of every step. */
void bench_step(const controller_input *input, bench_torque torque[JOINTS])
{
    (void)input;
    (void)torque;
}
