/* The firmware's protocol without a microcontroller: what reads lines is as it is flashed, what it moves is counted. */
#include <stddef.h>

#include "protocol.c"
#include "text.c"

static uint8_t said[1 << 16];
static size_t said_bytes;
static unsigned held, queued, wild;
volatile uint16_t wanted_ticks[CHANNELS];

bool uart_lost(void) { return false; }
void uart_put(uint8_t byte) {
    if (said_bytes < sizeof said)
        said[said_bytes++] = byte;
}
void motion_heard(void) {}
bool motion_watchdog_bit(void) { return false; }
enum motion_state motion_state(void) { return HOLDING; }
uint8_t motion_queued(void) { return (uint8_t)queued; }

static void see(const uint16_t ticks[CHANNELS]) {
    for (int channel = 0; channel < CHANNELS; channel++) {
        wild += ticks[channel] < to_ticks(LOWEST) || ticks[channel] > to_ticks(HIGHEST);
        wanted_ticks[channel] = ticks[channel];
    }
}
void motion_hold(const uint16_t ticks[CHANNELS]) {
    held++;
    see(ticks);
}
bool motion_append(const struct segment *segment) {
    if (queued == QUEUE_LENGTH)
        return false;
    queued++;
    see(segment->ticks);
    return true;
}

/* Begin anew, take bytes, and leave what was said at *answers; results: commands held, segments queued, wild pulses. */
size_t feed(const uint8_t *data, size_t size, const uint8_t **answers, unsigned results[3]) {
    length = 0, broken = 0, checksums = false, said_bytes = 0;
    held = queued = wild = 0;
    for (size_t at = 0; at < size; at++)
        protocol_receive(data[at]);
    *answers = said;
    results[0] = held, results[1] = queued, results[2] = wild;
    return said_bytes;
}
