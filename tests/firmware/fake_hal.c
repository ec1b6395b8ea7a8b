#include "tests/firmware/fake_hal.h"

#include <string.h>

fake_board fake;

void fake_reset(void)
{
    static const fake_board fresh = {.encoders_good = true, .reference_good = true};
    fake = fresh;
    fake_place(12345);
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.holding_torque_Nm[i] = 3.25f + (float)i;
    }
}

void fake_place(int32_t counts)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.counts[i] = counts;
        fake.reference.reference_position_q8[i] = tdc_signed((uint32_t)counts * 256u);
        fake.reference.reference_velocity_rad_per_s[i] = 0.0f;
        fake.reference.reference_acceleration_rad_per_s2[i] = 0.0f;
    }
}

bool hal_read_encoders(int32_t counts[JOINTS])
{
    (void)memcpy(counts, fake.counts, sizeof fake.counts);
    return fake.encoders_good;
}

bool hal_read_reference(controller_input *input)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        input->reference_position_q8[i] = fake.reference.reference_position_q8[i];
        input->reference_velocity_rad_per_s[i] = fake.reference.reference_velocity_rad_per_s[i];
        input->reference_acceleration_rad_per_s2[i] =
            fake.reference.reference_acceleration_rad_per_s2[i];
    }
    return fake.reference_good;
}

void hal_read_holding_torque(float torque_Nm[JOINTS])
{
    (void)memcpy(torque_Nm, fake.holding_torque_Nm, sizeof fake.holding_torque_Nm);
}

void hal_write_torque(const float torque_Nm[JOINTS])
{
    (void)memcpy(fake.torque_Nm, torque_Nm, sizeof fake.torque_Nm);
    ++fake.torque_writes;
}

void hal_set_brakes(bool engaged)
{
    fake.brakes_engaged = engaged;
}

void hal_set_fault(bool on)
{
    fake.fault_output = on;
}

uint32_t hal_tick_period(void)
{
    return FAKE_PERIOD;
}

uint32_t hal_tick_elapsed(void)
{
    return fake.elapsed;
}
