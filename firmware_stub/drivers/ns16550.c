/* The 16550 UART with registers a byte apart, as on QEMU's virt machine. */

#include "drivers/uart.h"

#define REGISTER(offset) (*(volatile uint8_t *)(UART_ADDRESS + (offset)))
#define DATA REGISTER(0u)
#define FIFO_CONTROL REGISTER(2u)
#define LINE_STATUS REGISTER(5u)

#define FIFO_ENABLE 1u
#define LINE_STATUS_RX_READY 0x01u
#define LINE_STATUS_TX_EMPTY 0x20u

void uart_start(void)
{
    FIFO_CONTROL = FIFO_ENABLE;
}

void uart_write(uint8_t byte)
{
    while ((LINE_STATUS & LINE_STATUS_TX_EMPTY) == 0u) {
    }
    DATA = byte;
}

int uart_read(void)
{
    return ((LINE_STATUS & LINE_STATUS_RX_READY) != 0u) ? (int)DATA : -1;
}
