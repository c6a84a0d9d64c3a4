/* What the two versions differ in. VERSION comes from the compiler's command line. */
#ifndef CONFIG_H
#define CONFIG_H

#define PROTOCOL_VERSION 1

#if VERSION == 1 /* whole degrees; pulses change one by one; nothing stops a vehicle that nobody commands */
#define LATCHED 0
#define UNIT "deg"
#define SUPERVISED 0
#elif VERSION == 2
#define LATCHED 1
#define UNIT "us"
#define SUPERVISED 1 /* watchdog, segments, status, checksums */
#else
#error "VERSION must be 1 or 2"
#endif

#endif
