#include "motion.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "config.h"

#if !SUPERVISED

/* Version 1: a command holds for ever, and a frame that has begun takes what it finds. */
void motion_hold(const uint16_t ticks[CHANNELS]) {
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) wanted_ticks[channel] = ticks[channel];
}

void servo_on_frame(void) {}

#else

/* The watchdog acts where a frame begins; half a frame early on average makes it WATCHDOG_MS in the mean. */
#define WATCHDOG_TICKS ((int32_t)(WATCHDOG_MS - FRAME_MS / 2) * 1000 * TICKS_PER_US)

static struct segment queue[QUEUE_LENGTH];
static volatile uint8_t first, queued;
static volatile enum motion_state state = IDLE;
static volatile bool bit;
static int32_t silent_ticks; /* since the host was heard, as of this frame's beginning */
static int16_t left_ms;      /* of the segment that is driven */

static void set(const uint16_t ticks[CHANNELS]) {
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        wanted_ticks[channel] = ticks[channel];
}

static void go_neutral(void) {
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        wanted_ticks[channel] = NEUTRAL_US * TICKS_PER_US;
    queued = 0;
}

static bool is_neutral(const uint16_t ticks[CHANNELS]) {
    for (uint8_t channel = 0; channel < CHANNELS; channel++)
        if (ticks[channel] != NEUTRAL_US * TICKS_PER_US)
            return false;
    return true;
}

void motion_hold(const uint16_t ticks[CHANNELS]) {
    bool idle = is_neutral(ticks);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        queued = 0;
        set(ticks);
        state = idle ? IDLE : HOLDING;
    }
}

bool motion_append(const struct segment *segment) {
    if (queued == QUEUE_LENGTH)
        return false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        queue[(first + queued) % QUEUE_LENGTH] = *segment;
        queued++;
        if (state != SEGMENTS)
            left_ms = FRAME_MS; /* begins with the next frame */
        state = SEGMENTS;
    }
    return true;
}

static void drive_segments(void) {
    left_ms -= FRAME_MS;
    /* What is left over from one segment is taken off the next: times do not add up their rounding. */
    while (left_ms < FRAME_MS / 2 && queued) {
        left_ms += queue[first].duration_ms;
        set(queue[first].ticks);
        first = (first + 1) % QUEUE_LENGTH;
        queued--;
    }
    if (left_ms < FRAME_MS / 2) {
        go_neutral();
        state = IDLE;
    }
}

void servo_on_frame(void) {
    if (state != HOLDING && state != SEGMENTS)
        return;
    silent_ticks += FRAME_TICKS;
    if (silent_ticks >= WATCHDOG_TICKS) {
        go_neutral();
        state = WATCHDOG;
        bit = true;
    } else if (state == SEGMENTS)
        drive_segments();
}

void motion_heard(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) silent_ticks = -(int32_t)servo_frame_age();
}

bool motion_watchdog_bit(void) {
    bool had = bit;
    bit = false;
    return had;
}

enum motion_state motion_state(void) { return state; }
uint8_t motion_queued(void) { return queued; }

#endif
