// The servo outputs, a pulse each every 20 ms: D9 and D10 from the compare outputs of Timer 1, at the same time; D11, D5,
// D6 and D7 by software, 3 ms after one another.
#ifndef SERVO_H
#define SERVO_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

enum { TICKS_PER_US = 2 };  // of Timer 1, which counts freely

void servo_init(void);

// Whether a period with pulses has begun since the last call, and with which [0.1 us].
bool servo_period(uint16_t pulses[SERVO_COUNT]);

// Emit these pulses [0.1 us], or none, from the next period on: all servos together, never a part of a pulse. Where
// another period began since the last `servo_period`, that one is repeated.
void servo_set(bool on, const uint16_t pulses[SERVO_COUNT]);

#endif
