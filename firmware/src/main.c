/* Firmware of a model AGV with an ATmega328P at 16 MHz: servo pulses on PB0 (drive), PB1 (front), PB2 (rear). */
#include <avr/interrupt.h>
#include <avr/sleep.h>

#include "protocol.h"
#include "servo.h"
#include "uart.h"

/* Sleep until an interrupt; one that comes after the question and before the sleep wakes all the same. */
static void rest(void) {
    cli();
    if (uart_waiting()) {
        sei();
        return;
    }
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
}

int main(void) {
    uint8_t byte;
    set_sleep_mode(SLEEP_MODE_IDLE);
    servo_begin();
    uart_begin();
    sei();
    protocol_greet();
    for (;;) {
        while (uart_take(&byte))
            protocol_receive(byte);
        protocol_report();
        rest();
    }
}
