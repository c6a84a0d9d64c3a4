#include "protocol.h"

#include <stdbool.h>
#include <util/atomic.h>

#include "config.h"
#include "motion.h"
#include "text.h"
#include "uart.h"

#define STRING(x) #x
#define NUMBER(x) STRING(x)
#define LINE_LENGTH 48

#if VERSION == 1
#define LOWEST 30 /* degrees: 700 us */
#define HIGHEST 150
static uint16_t to_ticks(uint16_t degrees) { /* 40/3 us a degree about 90 */
    return (uint16_t)(NEUTRAL_US * TICKS_PER_US + ((int16_t)degrees - 90) * (40 * TICKS_PER_US) / 3);
}
#else
#define LOWEST 600
#define HIGHEST 2400
#define SHORTEST_MS FRAME_MS
#define LONGEST_MS 10000
static uint16_t to_ticks(uint16_t microseconds) { return microseconds * TICKS_PER_US; }
#endif

static char line[LINE_LENGTH + 1];
static uint8_t length;
static enum error broken; /* what is wrong with the line that is being received, if anything */
static bool checksums;    /* in use since the first line that carried one */

void protocol_greet(void) {
    text_begin();
    text_put("V agvbench " NUMBER(VERSION) " " NUMBER(PROTOCOL_VERSION) " " UNIT " " CALIBRATION_HASH);
    text_end(checksums);
}

static void answer(const char *word, uint16_t sequence, enum error error) {
    text_begin();
    text_put(word);
    text_put_number(sequence);
    if (error) {
        text_put(" ");
        text_put_number(error);
    }
    text_end(checksums);
}

/* Read sequence number, three pulses and, for a segment, its duration. */
static enum error read_command(const char *at, uint16_t *sequence, struct segment *segment, bool timed) {
    uint16_t number;
    bool in_range = true;
    if (!text_number(&at, sequence))
        return ERROR_SYNTAX;
    for (uint8_t channel = 0; channel < CHANNELS; channel++) {
        if (!text_number(&at, &number))
            return ERROR_SYNTAX;
        in_range &= number >= LOWEST && number <= HIGHEST;
        segment->ticks[channel] = to_ticks(number);
    }
#if SUPERVISED
    if (timed) {
        if (!text_number(&at, &segment->duration_ms))
            return ERROR_SYNTAX;
        in_range &= segment->duration_ms >= SHORTEST_MS && segment->duration_ms <= LONGEST_MS;
    }
#else
    (void)timed;
#endif
    if (*at)
        return ERROR_SYNTAX;
    return in_range ? 0 : ERROR_RANGE;
}

static void take_command(bool timed) {
    struct segment segment;
    uint16_t sequence = 0;
    enum error error = read_command(line + 1, &sequence, &segment, timed);
#if SUPERVISED
    if (!error)
        motion_heard(); /* first: the watchdog must not bite a command that has just come */
    if (!error && timed && !motion_append(&segment))
        error = ERROR_FULL;
#endif
    if (!error && !timed)
        motion_hold(segment.ticks);
    answer(error ? "err " : "ok ", sequence, error);
}

#if SUPERVISED
static void tell_status(void) {
    motion_heard();
    text_begin();
    text_put("Q");
    for (uint8_t channel = 0; channel < CHANNELS; channel++) {
        uint16_t ticks;
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) ticks = wanted_ticks[channel];
        text_put(" ");
        text_put_number(ticks / TICKS_PER_US);
    }
    text_put(" ");
    text_put_number(motion_queued());
    text_put(" ");
    text_put_number(motion_state());
    text_end(checksums);
}
#endif

/* Return what is wrong with the line before anything in it is understood. */
static enum error check_line(void) {
    if (broken)
        return broken;
#if SUPERVISED
    switch (text_checksum(line, length)) {
    case CHECKSUM_WRONG:
        return ERROR_CHECKSUM;
    case CHECKSUM_NONE:
        return checksums ? ERROR_CHECKSUM : 0;
    case CHECKSUM_RIGHT:
        checksums = true;
    }
#endif
    return 0;
}

static void take_line(void) {
    enum error error = check_line();
    if (error)
        return answer("err ", 0, error);
    bool alone = line[0] && !line[1];
    if (line[0] == 'S')
        take_command(false);
    else if (alone && line[0] == 'V')
        protocol_greet();
#if SUPERVISED
    else if (line[0] == 'M')
        take_command(true);
    else if (alone && line[0] == 'Q')
        tell_status();
#endif
    else
        answer("err ", 0, ERROR_COMMAND);
}

void protocol_receive(uint8_t byte) {
    if (uart_lost())
        broken = ERROR_BYTES;
    if (byte == '\n') {
        line[length] = '\0';
        take_line();
        length = 0;
        broken = 0;
    } else if (byte < ' ' || byte > '~') {
        broken = ERROR_BYTES;
    } else if (length == LINE_LENGTH) {
        if (!broken)
            broken = ERROR_LENGTH;
    } else {
        line[length++] = (char)byte;
    }
}

void protocol_report(void) {
#if SUPERVISED
    if (!motion_watchdog_bit())
        return;
    text_begin();
    text_put("W");
    text_end(checksums);
#endif
}
