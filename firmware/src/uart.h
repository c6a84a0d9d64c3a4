/* Serial port 0, 8N1 at 117647 baud: what 16 MHz makes of 115200, 2.1 % fast, within what receivers accept. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_begin(void);

/* Take one received byte; false if there is none. */
bool uart_take(uint8_t *byte);

/* Whether bytes were lost or garbled since this was asked last. */
bool uart_lost(void);

bool uart_waiting(void);

void uart_put(uint8_t byte);

#endif
