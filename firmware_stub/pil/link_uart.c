/* The link through the board's serial port: as on real hardware, and as slow. It never ends. */

#include "pil/link.h"

#include <stdint.h>

#include "cores/core.h"
#include "drivers/uart.h"

/*
 * A processor that only ever polls may keep an emulator from bringing the byte that it polls for.
 * So after some polls in vain it sleeps until the timer; a byte takes longer at 115200 baud.
 */
#define WAKEUPS_PER_S 20000u
#define POLLS_BEFORE_SLEEP 20u

bool link_open(void)
{
    uart_start();
    core_start_ticks(TICK_CLOCK_HZ / WAKEUPS_PER_S);
    return true;
}

static uint8_t wait_for_byte(void)
{
    uint32_t polls = 0u;
    int byte = uart_read();
    while (byte < 0) {
        ++polls;
        if (polls % POLLS_BEFORE_SLEEP == 0u) {
            core_idle();
        }
        byte = uart_read();
    }
    return (uint8_t)byte;
}

bool link_read(void *data, size_t size)
{
    uint8_t *bytes = data;
    for (size_t i = 0u; i < size; ++i) {
        bytes[i] = wait_for_byte();
    }
    return true;
}

bool link_write(const void *data, size_t size)
{
    const uint8_t *bytes = data;
    for (size_t i = 0u; i < size; ++i) {
        uart_write(bytes[i]);
    }
    return true;
}

void link_close(bool good)
{
    (void)good;
}
