/* What the pulses should be: a command that holds, segments that are timed on board, or neutral. */
#ifndef MOTION_H
#define MOTION_H

#include <stdbool.h>
#include <stdint.h>

#include "servo.h"

enum motion_state { IDLE, HOLDING, SEGMENTS, WATCHDOG };

struct segment {
    uint16_t ticks[CHANNELS];
    uint16_t duration_ms;
};

#define QUEUE_LENGTH 8
#define WATCHDOG_MS 250

/* Hold these pulses until another command; what was queued is dropped. */
void motion_hold(const uint16_t ticks[CHANNELS]);

/* Drive this after what is queued already; false if the queue is full. */
bool motion_append(const struct segment *segment);

/* The host lives: it said something that made sense. */
void motion_heard(void);

/* Whether the watchdog has bitten since this was asked last. */
bool motion_watchdog_bit(void);

enum motion_state motion_state(void);
uint8_t motion_queued(void);

#endif
