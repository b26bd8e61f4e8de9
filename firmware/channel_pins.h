// Pins of the channels (docs/protocol.md). Empty in a build of servos only.
#ifndef CHANNEL_PINS_H
#define CHANNEL_PINS_H

#include "channels.h"

#ifndef WINCH_REVERSED
#define WINCH_REVERSED 0  // bit i: the motor of winch i is to turn the other way
#endif
#ifndef PRESSURE_ZERO
#define PRESSURE_ZERO 41  // of the ADC at ambient pressure: 0.2 V
#endif

#if HAS_CHANNELS
void channel_pins_init(void);

// Some milliseconds have passed, at least one: make a step of each winch that has steps to make and, every 20 ms,
// measure, let the channels go on and set the valves.
void channel_pins_elapsed(struct channel channels[CHANNEL_COUNT], uint8_t ms);
#endif

#endif
