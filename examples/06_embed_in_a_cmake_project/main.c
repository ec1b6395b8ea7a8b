/*
 * A control loop as firmware has it, with an encoder that fails for a moment: what step returns,
 * what the loop does then, and which torque goes to the drives.
 *
 * The robot stands still on its holding torque; the waist is told to move.
 */
#include "tdc_puma3.h"

#include <stdio.h>

#define TICKS 100u
#define FIRST_BAD_TICK 40u
#define BAD_TICKS 10u
#define LOST_TICK_LIMIT 15u

/* What your board does: here counts that follow the reference, but for a dropout to zero. */
static void read_board(const uint32_t tick, tdc_puma3_input *const input)
{
    const int32_t here[TDC_PUMA3_JOINTS] = {100000, -50000, 20000};
    const int32_t moved = 2 * (int32_t)tick;
    const uint32_t dropout = (tick >= FIRST_BAD_TICK) && (tick < FIRST_BAD_TICK + BAD_TICKS);
    for (uint32_t i = 0u; i < TDC_PUMA3_JOINTS; ++i) {
        const int32_t way = (i == 0u) ? moved : 0;
        input->counts[i] = ((dropout != 0u) && (i == 0u)) ? 0 : here[i] + way;
        /* The waist lags by five counts: friction that the torque has to grow against. */
        input->reference_position_q8[i] = 256 * (here[i] + way + ((i == 0u) ? 5 : 0));
        input->reference_velocity_rad_per_s[i] = 0.0f;
        input->reference_acceleration_rad_per_s2[i] = 0.0f;
    }
    input->reference_velocity_rad_per_s[0] =
        2.0f / (tdc_puma3_counts_per_rad[0] * TDC_PUMA3_SAMPLE_TIME_S);
}

int main(void)
{
    static tdc_puma3_config config;
    static tdc_puma3_state state;
    const int32_t start[TDC_PUMA3_JOINTS] = {99998, -50000, 20000};
    const float holding_torque_Nm[TDC_PUMA3_JOINTS] = {0.0f, -20.0f, 5.0f};
    uint32_t lost = 0u;

    config = tdc_puma3_default_config; /* in RAM, where a rig may tune it */
    if (tdc_puma3_init(&config, &state, start, holding_torque_Nm) != TDC_OK) {
        return 1;
    }
    puts("tick,status,waist_Nm,shoulder_Nm,elbow_Nm");
    for (uint32_t tick = 0u; tick < TICKS; ++tick) {
        float torque_Nm[TDC_PUMA3_JOINTS];
        tdc_puma3_input input;

        read_board(tick, &input);
        const tdc_status status = tdc_puma3_step(&config, &state, &input, torque_Nm);
        lost = (tdc_is_lost(status) != 0u) ? lost + 1u : 0u;
        if ((lost > LOST_TICK_LIMIT) || ((status < TDC_OK) && (lost == 0u))) {
            return 2; /* engage the brakes */
        }
        /* The torque is defined whatever the status says: write it to the drives. */
        printf("%lu,%d,%.9g,%.9g,%.9g\n", (unsigned long)tick, (int)status, (double)torque_Nm[0],
               (double)torque_Nm[1], (double)torque_Nm[2]);
    }
    return 0;
}
