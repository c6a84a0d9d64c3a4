/* Strict reading and plain writing of fields: decimal numbers with one space between. */
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stdint.h>

/* Read " 1500" at *text: one space and one to five digits up to 65535. Moves *text behind it. */
bool text_number(const char **text, uint16_t *number);

/* Write a line: begin, its parts, end. The checksum is added where checksums are in use. */
void text_begin(void);
void text_put(const char *text);
void text_put_number(uint16_t number);
void text_end(bool checksum);

/* Whether the line ends in "*" and the right CRC-16 of what is before; if so, it is cut off. */
enum checksum { CHECKSUM_NONE, CHECKSUM_RIGHT, CHECKSUM_WRONG };
enum checksum text_checksum(char *line, uint8_t length);

#endif
