/*
 * The floor: linear time delay control, (39) of the paper, as one writes it by hand in an hour.
 *
 *     tau = Mbar (qdd_d + KD ed + KP e + lambda s) + tau(t-L) - Mbar qdd(t-L)
 *
 * The law with all exponents 1, in float, on encoder counts, with saturation: no power of anything
 * and no check of anything. What the project's step costs beyond it is the price of the powers,
 * of the checks, and of committing all joints or none.
 */

#include "verification/bench/target/linear.h"

typedef struct {
    int32_t counts;
    int32_t displacement;
    float sliding_integral;
    float torque;
} memory;

static memory memories[JOINTS];
static uint32_t running;

void bench_reset(const int32_t counts[JOINTS], const bench_torque holding_torque[JOINTS])
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        const memory start = {.counts = counts[j], .torque = holding_torque[j]};
        memories[j] = start;
    }
    running = 0u;
}

void bench_step(const controller_input *input, bench_torque torque[JOINTS])
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        const linear_joint *const joint = &linear_joints[j];
        memory *const last = &memories[j];
        const uint32_t counts = (uint32_t)input->counts[j];
        const int32_t displacement = (int32_t)(counts - (uint32_t)last->counts);
        const float error =
            (float)(int32_t)((uint32_t)input->reference_position_q8[j] - (counts << 8u));
        const float velocity_error =
            input->reference_velocity_rad_per_s[j] - ((float)displacement * joint->velocity);
        float acceleration = 0.0f;
        if (running != 0u) {
            const uint32_t change = (uint32_t)displacement - (uint32_t)last->displacement;
            acceleration = (float)(int32_t)change * joint->acceleration;
        } else {
            last->sliding_integral = -velocity_error;
        }

        const float restoring = (joint->kd * velocity_error) + (joint->kp * error);
        const float sliding = velocity_error + last->sliding_integral;
        const float demand = input->reference_acceleration_rad_per_s2[j] + restoring +
                             (joint->lambda * sliding) - acceleration;
        float applied = last->torque + (joint->inertia * demand);
        applied = (applied < joint->torque_limit) ? applied : joint->torque_limit;
        applied = (applied > -joint->torque_limit) ? applied : -joint->torque_limit;

        last->counts = (int32_t)counts;
        last->displacement = displacement;
        last->sliding_integral += linear_sample_time * restoring;
        last->torque = applied;
        torque[j] = applied;
    }
    running = 1u;
}
