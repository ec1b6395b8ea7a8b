/* The UART of ARM's Cortex-M System Design Kit, as on the MPS2 boards. */

#include "drivers/uart.h"

#define REGISTER(offset) (*(volatile uint32_t *)(UART_ADDRESS + (offset)))
#define DATA REGISTER(0x00u)
#define STATE REGISTER(0x04u)
#define CTRL REGISTER(0x08u)
#define BAUDDIV REGISTER(0x10u)

#define STATE_TX_FULL 1u
#define STATE_RX_FULL 2u
#define CTRL_TX_RX_ENABLE 3u

void uart_start(void)
{
    BAUDDIV = 16u; /* the fastest */
    CTRL = CTRL_TX_RX_ENABLE;
}

void uart_write(uint8_t byte)
{
    while ((STATE & STATE_TX_FULL) != 0u) {
    }
    DATA = byte;
}

int uart_read(void)
{
    return ((STATE & STATE_RX_FULL) != 0u) ? (int)(DATA & 0xFFu) : -1;
}
