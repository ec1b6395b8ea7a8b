/*
 * hal.h for boards that exist in an emulator only: the robot is simulated, the console is a UART.
 * A port replaces this file: the functions for the robot become registers of timers and drives.
 */

#include "hal.h"

#include "cores/core.h"
#include "drivers/uart.h"
#include "hal/simulated_robot.h"

#define JUMP_COUNTS 1000000

static bool braked = true;
static volatile uint32_t late_ticks;    /* so many ticks more than the sample time allows */
static volatile uint32_t encoder_jumps; /* so many readings more, beyond what is ridden through */
static volatile bool encoder_fails;

void hal_init(void)
{
    uart_start();
}

/* --- The robot ------------------------------------------------------------------------------- */

static void waste_a_period(void)
{
    while (hal_tick_elapsed() < hal_tick_period()) {
    }
}

bool hal_read_encoders(int32_t counts[JOINTS])
{
    simulated_robot_read_encoders(counts);
    if (late_ticks > 0u) {
        --late_ticks;
        waste_a_period();
    }
    if (encoder_jumps > 0u) {
        --encoder_jumps;
        counts[0] += JUMP_COUNTS;
    }
    const bool good = !encoder_fails;
    encoder_fails = false;
    return good;
}

bool hal_read_reference(controller_input *input)
{
    simulated_robot_reference(input);
    return true;
}

void hal_read_holding_torque(controller_number torque[JOINTS])
{
    simulated_robot_holding_torque(torque);
}

void hal_write_torque(const controller_number torque[JOINTS])
{
    simulated_robot_advance(torque, braked);
}

void hal_set_brakes(bool engaged)
{
    braked = engaged;
}

void hal_set_fault(bool on)
{
    (void)on; /* the telemetry shows it */
}

void hal_emergency_stop(void)
{
    static const char message[] = "EMERGENCY STOP\n";
    braked = true;
    for (uint32_t i = 0u; message[i] != '\0'; ++i) {
        hal_console_write(message[i]);
    }
}

/* --- Time ------------------------------------------------------------------------------------ */

#define TICK_PERIOD ((uint32_t)(((float)TICK_CLOCK_HZ * SAMPLE_TIME_S) + 0.5f))

void hal_start_ticks(void)
{
    core_start_ticks(TICK_PERIOD);
}

uint32_t hal_tick_period(void)
{
    return TICK_PERIOD;
}

uint32_t hal_tick_elapsed(void)
{
    return core_tick_elapsed();
}

/* --- The main loop --------------------------------------------------------------------------- */

void hal_idle(void)
{
    core_idle();
}

int hal_console_read(void)
{
    return uart_read();
}

void hal_console_write(char character)
{
    uart_write((uint8_t)character);
}

void hal_provoke(char key)
{
    switch (key) {
    case 'o':
        late_ticks = 5u;
        break;
    case 'j':
        encoder_jumps = 10u;
        break;
    case 'e':
        encoder_fails = true;
        break;
    case 'x':
        /* No instruction of any processor here. */
        __asm volatile(".word 0xFFFFFFFF");
        break;
    default:
        break;
    }
}
