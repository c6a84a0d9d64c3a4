#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

/* Lengths are powers of two that divide 256, so that 8-bit indices wrap by themselves. */
#define RECEIVE_LENGTH 128
#define TRANSMIT_LENGTH 64

static volatile uint8_t received[RECEIVE_LENGTH], transmitted[TRANSMIT_LENGTH];
static volatile uint8_t receive_in, receive_out, transmit_in, transmit_out;
static volatile bool lost;

void uart_begin(void) {
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect) {
    uint8_t status = UCSR0A, byte = UDR0;
    if ((status & (_BV(FE0) | _BV(DOR0))) || (uint8_t)(receive_in - receive_out) == RECEIVE_LENGTH)
        lost = true;
    else
        received[receive_in++ % RECEIVE_LENGTH] = byte;
}

ISR(USART_UDRE_vect) {
    if (transmit_in == transmit_out)
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    else
        UDR0 = transmitted[transmit_out++ % TRANSMIT_LENGTH];
}

bool uart_take(uint8_t *byte) {
    if (!uart_waiting())
        return false;
    *byte = received[receive_out % RECEIVE_LENGTH];
    receive_out++;
    return true;
}

bool uart_lost(void) {
    bool was = lost;
    if (was)
        lost = false;
    return was;
}

bool uart_waiting(void) { return receive_in != receive_out; }

void uart_put(uint8_t byte) {
    while ((uint8_t)(transmit_in - transmit_out) == TRANSMIT_LENGTH)
        ;
    transmitted[transmit_in % TRANSMIT_LENGTH] = byte;
    transmit_in++;
    cli();
    UCSR0B |= _BV(UDRIE0);
    sei();
}
