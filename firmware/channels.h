// Channels beside the servos (docs/protocol.md): winches, then pressures. Portable C, no I/O: measured values go in every
// 20 ms, set-points and the motion of winches come out.
#ifndef CHANNELS_H
#define CHANNELS_H

#include <stdbool.h>
#include <stdint.h>

#ifndef WINCH_COUNT
#define WINCH_COUNT 0
#endif
#ifndef PRESSURE_COUNT
#define PRESSURE_COUNT 0
#endif
#define HAS_CHANNELS (WINCH_COUNT + PRESSURE_COUNT > 0)  // a board of servos only has nothing of this
#ifndef WINCH_MAX
#define WINCH_MAX 6000  // longest pull from home [steps]
#endif
#ifndef WINCH_SLEW
#define WINCH_SLEW 10  // [steps in 20 ms]
#endif
#ifndef PRESSURE_MAX
#define PRESSURE_MAX 800  // largest set-point [counts of the ADC above its value at ambient pressure]
#endif
#ifndef PRESSURE_SLEW
#define PRESSURE_SLEW 16  // [counts in 20 ms]
#endif
#ifndef LEAK_MARGIN
#define LEAK_MARGIN 60  // a measured pressure may be so much below its set-point [counts]
#endif
#ifndef LEAK_MS
#define LEAK_MS 1000  // before it counts as a leak
#endif

enum {
    CHANNEL_COUNT = WINCH_COUNT + PRESSURE_COUNT,
    CHANNEL_PERIOD = 20,                       // [ms]
    HOMING_SLEW = 1,                           // [steps in 20 ms]
    HOMING_LIMIT = WINCH_MAX + WINCH_MAX / 4,  // without the switch after so many steps, homing has failed
};

_Static_assert(0 <= WINCH_COUNT && WINCH_COUNT <= 2 && 0 <= PRESSURE_COUNT && PRESSURE_COUNT <= 1,
               "WINCH_COUNT: 0 to 2, PRESSURE_COUNT: 0 or 1");
_Static_assert(1 <= WINCH_MAX && WINCH_MAX <= 40000, "1 <= WINCH_MAX <= 40000");
_Static_assert(1 <= WINCH_SLEW && WINCH_SLEW <= 20, "1 <= WINCH_SLEW <= 20: a step takes a millisecond");
_Static_assert(1 <= PRESSURE_MAX && PRESSURE_MAX <= 1023, "1 <= PRESSURE_MAX <= 1023");
_Static_assert(1 <= PRESSURE_SLEW && PRESSURE_SLEW <= 1023, "1 <= PRESSURE_SLEW <= 1023");

enum channel_kind { CHANNEL_WINCH = 1, CHANNEL_PRESSURE = 2 };

enum {
    CHANNEL_KNOWN = 1,        // its place is known: a winch is homed; always of a pressure
    CHANNEL_HOMING = 2,
    CHANNEL_HOME_FAILED = 4,  // the switch never closed
    CHANNEL_SLACK = 8,        // the cable of a winch
    CHANNEL_LEAK = 16,        // a pressure stays below its set-point
};

// Of a winch: bits of `measured`.
enum { WINCH_AT_HOME = 1, WINCH_IS_SLACK = 2 };

struct channel {
    uint16_t set;       // set-point now
    uint16_t target;
    uint16_t measured;
    int8_t motion;      // of a winch in this period [steps]
    uint8_t flags;
    uint16_t low_for;   // how long a pressure has been too low [ms]
};

static inline enum channel_kind channel_kind(int i)
{
    return i < WINCH_COUNT ? CHANNEL_WINCH : CHANNEL_PRESSURE;
}

static inline uint16_t channel_max(int i)
{
    return i < WINCH_COUNT ? WINCH_MAX : PRESSURE_MAX;
}

static inline uint16_t channel_slew(int i)
{
    return i < WINCH_COUNT ? WINCH_SLEW : PRESSURE_SLEW;
}

void channels_init(struct channel channels[CHANNEL_COUNT]);

// Begin homing of winch `i`, or let it continue.
void channel_home(struct channel *channel);

// Take a target. One below the set-point ends slack and leak; until then the set-point does not rise.
void channel_set(struct channel *channel, uint16_t target);

// Stop all channels where they are; homing ends.
void channels_hold(struct channel channels[CHANNEL_COUNT]);

// As `channels_hold`, and vent: pressures go to 0 at once.
void channels_vent(struct channel channels[CHANNEL_COUNT]);

// Another 20 ms, with what is measured in each channel.
void channels_period(struct channel channels[CHANNEL_COUNT], const uint16_t measured[CHANNEL_COUNT]);

#endif
