/* A simulated ATmega328P: its serial port is a pseudo-terminal, its servo pulses go to standard output.
 *
 *   simavr_host FIRMWARE.elf          in lock step: time passes when standard input says so
 *   simavr_host FIRMWARE.elf --live   in real time, until standard input ends
 *
 * Says "port PATH" first. In lock step it understands, a line each:
 *   run CYCLE BYTES   run until CYCLE, having read BYTES bytes from the port in all; answers every pulse that ended,
 *                     "pulse CHANNEL RISE FALL" (cycles), then "at CYCLE BYTES" with the bytes sent in all
 *   reset BYTES       drop what has not been run of the BYTES written so far, and press the reset button; cycles and
 *                     bytes begin at 0 again; answers "at 0 0"
 * Cycles are those of 16 MHz. Ends with standard input.
 */
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "sim_avr.h"
#include "sim_elf.h"
#include "avr_ioport.h"
#include "avr_uart.h"

enum { CHANNELS = 3, MAX_WAITING = 1 << 16, BITS_PER_BYTE = 10, SLICE = 16000, PATIENCE_MS = 5000 };

static FILE *answers; /* the standard output as it was: simavr itself writes to it, too */
static avr_t *avr;
static avr_uart_t *uart;
static avr_irq_t *receive;
static int port = -1;
static avr_cycle_count_t base, rose[CHANNELS], byte_cycles = 1360; /* until the firmware sets its rate */
static uint8_t waiting[MAX_WAITING]; /* read from the port, not yet on the wire */
static unsigned first, last;
static unsigned long long bytes_read, bytes_sent;
static int feeding;

static void fail(const char *what) {
    fprintf(stderr, "simavr_host: %s\n", what);
    exit(2);
}

static void rest(avr_t *avr, avr_cycle_count_t cycles) {
    (void)avr;
    (void)cycles; /* real time is kept elsewhere, if at all */
}

/* Find the model of the serial port: what it charges for a byte cannot be set from outside. */
static avr_uart_t *find_uart(void) {
    for (avr_io_t *io = avr->io_port; io; io = io->next)
        if (!strcmp(io->kind, "uart"))
            return (avr_uart_t *)io;
    fail("microcontroller without a serial port");
    return NULL;
}

/* Set what a byte takes: simavr charges eleven bits, 8N1 has ten. */
static void set_byte_time(void) {
    unsigned divisor = avr->data[uart->r_udr - 2] | (avr->data[uart->r_udr - 1] & 15) << 8;
    byte_cycles = (avr_cycle_count_t)(divisor + 1) * 8 * BITS_PER_BYTE;
    uart->cycles_per_byte = byte_cycles;
}

/* A byte has arrived whole: hand it to the receiver without a further wait, and go on with the next. A receiver that
 * the firmware has not switched on yet hears nothing. */
static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *parameter) {
    (void)parameter;
    uint8_t byte = waiting[first++ % MAX_WAITING];
    if (avr_regbit_get(avr, uart->rxen)) {
        uart->cycles_per_byte = 1;
        avr_raise_irq(receive, byte);
        uart->cycles_per_byte = byte_cycles;
    }
    feeding = first != last;
    return feeding ? when + byte_cycles : 0;
}

static void read_port(void) {
    uint8_t bytes[256];
    ssize_t count = read(port, bytes, sizeof bytes);
    for (ssize_t at = 0; at < count; at++) {
        if (last - first == MAX_WAITING)
            fail("too many bytes are waiting");
        waiting[last++ % MAX_WAITING] = bytes[at];
    }
    if (count > 0)
        bytes_read += (unsigned long long)count;
    if (!feeding && first != last) {
        feeding = 1;
        avr_cycle_timer_register(avr, byte_cycles, feed, NULL);
    }
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq;
    (void)parameter;
    uint8_t byte = (uint8_t)value;
    /* With nobody at the other end the buffer fills: the byte is gone, as on a wire. */
    if (write(port, &byte, 1) == 1)
        bytes_sent++;
}

static void pin_changed(struct avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq;
    long channel = (long)parameter;
    if (value)
        rose[channel] = avr->cycle;
    else if (rose[channel]) {
        fprintf(answers, "pulse %ld %llu %llu\n", channel, (unsigned long long)(rose[channel] - base),
               (unsigned long long)(avr->cycle - base));
        rose[channel] = 0;
    }
}

static avr_cycle_count_t halt(avr_t *avr, avr_cycle_count_t when, void *parameter) {
    (void)avr, (void)when, (void)parameter;
    return 0; /* only to end a slice here */
}

static void run_until(avr_cycle_count_t cycle) {
    if (cycle > avr->cycle)
        avr_cycle_timer_register(avr, cycle - avr->cycle, halt, NULL);
    while (avr->cycle < cycle) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            fail("the firmware crashed");
        if (uart->cycles_per_byte != byte_cycles)
            set_byte_time();
    }
}

static void press_reset(void) {
    avr_cycle_timer_cancel(avr, feed, NULL);
    avr_cycle_timer_cancel(avr, halt, NULL);
    avr_reset(avr);
    first = last = 0;
    feeding = 0;
    bytes_read = bytes_sent = 0;
    memset(rose, 0, sizeof rose);
    base = avr->cycle;
}

static void load(const char *path) {
    elf_firmware_t firmware = {0};
    if (elf_read_firmware(path, &firmware))
        fail("cannot read the firmware");
    avr = avr_make_mcu_by_name("atmega328p");
    if (!avr)
        fail("simavr lacks the ATmega328P");
    avr_init(avr);
    avr->log = LOG_ERROR;
    avr->frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    avr->sleep = rest;
    avr->run_cycle_limit = SLICE;
}

static void connect_pins(void) {
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_POLL_SLEEP | AVR_UART_FLAG_STDIO);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    uart = find_uart();
    receive = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
    for (long channel = 0; channel < CHANNELS; channel++)
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), (int)channel), pin_changed,
                                (void *)channel);
}

static void open_port(void) {
    struct termios settings;
    char path[128];
    int other;
    if (openpty(&port, &other, path, NULL, NULL))
        fail("no pseudo-terminal");
    tcgetattr(other, &settings);
    cfmakeraw(&settings);
    tcsetattr(other, TCSANOW, &settings);
    fcntl(port, F_SETFL, O_NONBLOCK); /* `other` stays open: the port outlives whoever opens it */
    fprintf(answers, "port %s\n", path);
    fflush(answers);
}

static void wait_for_bytes(unsigned long long wanted) {
    struct pollfd there = {.fd = port, .events = POLLIN};
    while (bytes_read < wanted) {
        if (poll(&there, 1, PATIENCE_MS) != 1)
            fail("bytes that were promised did not come");
        read_port();
    }
}

static void lock_step(void) {
    char line[80];
    unsigned long long cycle, bytes;
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "run %llu %llu", &cycle, &bytes) == 2) {
            wait_for_bytes(bytes);
            run_until(base + cycle);
        } else if (sscanf(line, "reset %llu", &bytes) == 1) {
            wait_for_bytes(bytes);
            press_reset();
        } else
            fail("no such order");
        fprintf(answers, "at %llu %llu\n", (unsigned long long)(avr->cycle - base), bytes_sent);
        fflush(answers);
    }
}

static void live(void) {
    struct timespec next;
    struct pollfd there = {.fd = 0, .events = POLLIN};
    char ignored;
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (;;) {
        if (poll(&there, 1, 0) > 0 && read(0, &ignored, 1) <= 0)
            return;
        read_port();
        run_until(avr->cycle + SLICE);
        fflush(answers);
        next.tv_nsec += 1000000;
        if (next.tv_nsec >= 1000000000) {
            next.tv_nsec -= 1000000000;
            next.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
}

int main(int count, char **arguments) {
    if (count < 2 || count > 3 || (count == 3 && strcmp(arguments[2], "--live")))
        fail("usage: simavr_host FIRMWARE.elf [--live]");
    answers = fdopen(dup(STDOUT_FILENO), "w");
    if (!answers || !freopen("/dev/null", "w", stdout))
        fail("no standard output");
    load(arguments[1]);
    connect_pins();
    open_port();
    if (count == 3)
        live();
    else
        lock_step();
    return 0;
}
