/* Servo pulses: three channels, one after the other, every 20 ms. */
#ifndef SERVO_H
#define SERVO_H

#include <stdint.h>

enum channel { DRIVE, FRONT, REAR, CHANNELS };

#define NEUTRAL_US 1500
#define TICKS_PER_US 2 /* timer 1 at 16 MHz / 8 */
#define FRAME_TICKS 40000u
#define FRAME_MS 20

/* Pulse widths in ticks. Version 1 reads each when its pulse begins, version 2 all three when a frame begins. */
extern volatile uint16_t wanted_ticks[CHANNELS];

void servo_begin(void);

/* Called in the interrupt that begins a frame, before pulses are latched. The user of this module defines it. */
void servo_on_frame(void);

/* Ticks since the frame began; interrupts must be off. */
uint16_t servo_frame_age(void);

#endif
