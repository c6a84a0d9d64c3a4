#include "text.h"

#include <util/crc16.h>

#include "uart.h"

static uint16_t crc;

bool text_number(const char **text, uint16_t *number) {
    const char *at = *text;
    if (*at++ != ' ')
        return false;
    uint32_t value = 0;
    uint8_t digits = 0;
    for (; *at >= '0' && *at <= '9'; at++) {
        if (++digits > 5)
            return false;
        value = 10 * value + (uint8_t)(*at - '0');
    }
    if (digits == 0 || value > UINT16_MAX)
        return false;
    *text = at;
    *number = (uint16_t)value;
    return true;
}

static void put(char byte) {
    crc = _crc_xmodem_update(crc, (uint8_t)byte);
    uart_put((uint8_t)byte);
}

void text_begin(void) { crc = 0; }

void text_put(const char *text) {
    while (*text)
        put(*text++);
}

void text_put_number(uint16_t number) {
    char digits[5];
    uint8_t count = 0;
    do
        digits[count++] = (char)('0' + number % 10);
    while (number /= 10);
    while (count)
        put(digits[--count]);
}

static char hexadecimal(uint8_t value) { return (char)(value < 10 ? '0' + value : 'A' + value - 10); }

void text_end(bool checksum) {
    uint16_t sum = crc;
    if (checksum) {
        uart_put('*');
        for (int8_t shift = 12; shift >= 0; shift -= 4)
            uart_put((uint8_t)hexadecimal((sum >> shift) & 15));
    }
    uart_put('\n');
}

enum checksum text_checksum(char *line, uint8_t length) {
    uint8_t star = 0;
    while (star < length && line[star] != '*')
        star++;
    if (star == length)
        return CHECKSUM_NONE;
    uint16_t sum = 0;
    for (uint8_t at = 0; at < star; at++)
        sum = _crc_xmodem_update(sum, (uint8_t)line[at]);
    if (length - star != 5)
        return CHECKSUM_WRONG;
    for (uint8_t at = 0; at < 4; at++)
        if (line[star + 1 + at] != hexadecimal((sum >> (12 - 4 * at)) & 15))
            return CHECKSUM_WRONG;
    line[star] = '\0';
    return CHECKSUM_RIGHT;
}
