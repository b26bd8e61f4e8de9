// What outlives a reset: why it came, and the pulses before it.
#ifndef RESET_H
#define RESET_H

#include <stdint.h>

#include "protocol.h"

// Return why the board was reset: bits of RESET_POWER_ON and the like, 0 if nobody tells; and put the pulses that were
// kept before it into `pulses`, 0 if none were or the memory has lost them. To be called once, before clock_init.
uint8_t reset_begin(uint16_t pulses[SERVO_COUNT]);

// Keep these pulses for the time after a reset.
void reset_keep(const uint16_t pulses[SERVO_COUNT]);

#endif
