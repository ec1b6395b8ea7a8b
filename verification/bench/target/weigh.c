/*
 * A program of nothing but one step, to be linked and weighed, never run. The linker drops what
 * the step does not reach; the same program around an empty step is subtracted.
 */

#include "verification/bench/target/bench.h"

static controller_input input;
static bench_torque torque[JOINTS];

int main(void)
{
    bench_step(&input, torque);
    return 0;
}
