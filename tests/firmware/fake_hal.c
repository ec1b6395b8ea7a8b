#include "tests/firmware/fake_hal.h"

#include <string.h>

fake_board fake;

void fake_reset(void)
{
    static const fake_board fresh = {.encoders_good = true, .reference_good = true};
    fake = fresh;
    fake_place(12345);
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.holding_torque[i] = controller_torque(3.25f + (float)i);
    }
}

void fake_place(int32_t counts)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.counts[i] = counts;
        fake.reference.reference_position_q8[i] = tdc_signed((uint32_t)counts * 256u);
        fake.reference.REFERENCE_VELOCITY[i] = (controller_number)0;
        fake.reference.REFERENCE_ACCELERATION[i] = (controller_number)0;
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
        input->REFERENCE_VELOCITY[i] = fake.reference.REFERENCE_VELOCITY[i];
        input->REFERENCE_ACCELERATION[i] = fake.reference.REFERENCE_ACCELERATION[i];
    }
    return fake.reference_good;
}

void hal_read_holding_torque(controller_number torque[JOINTS])
{
    (void)memcpy(torque, fake.holding_torque, sizeof fake.holding_torque);
}

void hal_write_torque(const controller_number torque[JOINTS])
{
    (void)memcpy(fake.torque, torque, sizeof fake.torque);
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
