#ifndef UART_H
#define UART_H

/* A polled serial port; UART_ADDRESS is the board's. */

#include <stdint.h>

void uart_start(void);
void uart_write(uint8_t byte);

/** The next byte, or -1 if none has arrived. */
int uart_read(void);

#endif
