/* Timer 1 counts half microseconds and never stops. Its compare interrupt comes EARLY_TICKS before each edge and then
 * spins: whatever delays the interrupt (another interrupt, waking up) is absorbed, and every edge is late by the same
 * few cycles. Pulses follow each other, so one edge ends a pulse and begins the next. */
#include "servo.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "config.h"

#define EARLY_TICKS 36 /* 18 us: two serial interrupts and the way in take 12 */
#define ALL_PINS (_BV(PORTB0) | _BV(PORTB1) | _BV(PORTB2))

volatile uint16_t wanted_ticks[CHANNELS];

static uint16_t edge, frame_began;
static uint8_t next_edge;
#if LATCHED
static uint16_t latched_ticks[CHANNELS];
#endif

void servo_begin(void) {
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        wanted_ticks[channel] = NEUTRAL_US * TICKS_PER_US;
    DDRB |= ALL_PINS;
    edge = FRAME_TICKS / 10;
    OCR1A = edge - EARLY_TICKS;
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(CS11);
}

uint16_t servo_frame_age(void) { return TCNT1 - frame_began; }

static void begin_frame(void) {
    frame_began = edge;
    servo_on_frame();
#if LATCHED
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        latched_ticks[channel] = wanted_ticks[channel];
#endif
}

static uint16_t width_ticks(uint8_t channel) {
#if LATCHED
    return latched_ticks[channel];
#else
    return wanted_ticks[channel];
#endif
}

ISR(TIMER1_COMPA_vect) {
    uint8_t pins = next_edge < CHANNELS ? _BV(next_edge) : 0;
    uint8_t low = (uint8_t)edge;
    while ((int8_t)(TCNT1L - low) < 0) /* six cycles a turn */
        ;
    PORTB = pins;
    if (next_edge == 0)
        begin_frame();
    if (next_edge < CHANNELS) {
        edge += width_ticks(next_edge);
        next_edge++;
    } else {
        edge = frame_began + FRAME_TICKS;
        next_edge = 0;
    }
    OCR1A = edge - EARLY_TICKS;
}
