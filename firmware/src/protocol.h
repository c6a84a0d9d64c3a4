/* Lines in, answers out. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdint.h>

enum error {
    ERROR_COMMAND = 1,  /* no such command */
    ERROR_SYNTAX = 2,   /* fields missing, too many, or not numbers */
    ERROR_RANGE = 3,    /* a number is out of its range */
    ERROR_FULL = 4,     /* no room for another segment */
    ERROR_LENGTH = 5,   /* the line is too long */
    ERROR_BYTES = 6,    /* bytes were lost, garbled, or are not printable */
    ERROR_CHECKSUM = 7, /* the checksum is wrong, or missing where one is in use */
};

/* Say who this is. */
void protocol_greet(void);

/* Take one received byte. */
void protocol_receive(uint8_t byte);

/* Say what happened by itself. */
void protocol_report(void);

#endif
