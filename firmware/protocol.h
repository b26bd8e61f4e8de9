// What the board does with what it receives (docs/protocol.md). Portable C, no I/O: bytes and milliseconds go in,
// replies, pulses and the state come out.
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include "channels.h"
#include "frame.h"

// All pulses are in tenths of a microsecond. Override these with -D.
#ifndef PULSE_MIN
#define PULSE_MIN 5440
#endif
#ifndef PULSE_MAX
#define PULSE_MAX 24000
#endif
#ifndef WATCHDOG_MS
#define WATCHDOG_MS 500
#endif
#ifndef SLEW
#define SLEW 475  // largest change from one pulse to the next, 20 ms later: 4 rad/s with the workshop's servos
#endif
#ifndef SERVO_COUNT
#define SERVO_COUNT 3
#endif

enum {
    FIRMWARE_MAJOR = 2,
    FIRMWARE_MINOR = 2,
    PROTOCOL_VERSION = 2,
    SERVO_MAX = 6,
    LEGACY_SERVOS = 3,  // in a legacy packet: a board with another number of servos takes none
    PULSE_STEP = 5,  // of the timer
    TEXT_MAX = 32,   // of an IMU line
};

_Static_assert(1 <= SERVO_COUNT && SERVO_COUNT <= SERVO_MAX, "1 <= SERVO_COUNT <= 6");
_Static_assert(4000 <= PULSE_MIN && PULSE_MIN < PULSE_MAX && PULSE_MAX <= 26000,
               "4000 <= PULSE_MIN < PULSE_MAX <= 26000, in tenths of a microsecond");
_Static_assert(PULSE_MIN % PULSE_STEP == 0 && PULSE_MAX % PULSE_STEP == 0, "PULSE_MIN, PULSE_MAX: multiples of 5");
_Static_assert(PULSE_STEP <= SLEW && SLEW <= 20000 && SLEW % PULSE_STEP == 0, "SLEW: 5 to 20000, multiples of 5");
_Static_assert(100 <= WATCHDOG_MS && WATCHDOG_MS <= 10000, "100 <= WATCHDOG_MS <= 10000");

enum state {
    STATE_IDLE,      // no command yet: no pulses
    STATE_ACTIVE,    // pulses as commanded
    STATE_HOLDING,   // the last pulses
    STATE_RELEASED,  // no pulses
};

// Why the board was reset last: the bits of MCUSR, 0 where the boot loader has cleared them.
enum { RESET_POWER_ON = 1, RESET_EXTERNAL = 2, RESET_BROWN_OUT = 4, RESET_WATCHDOG = 8 };

struct protocol {
    enum state state;
    uint16_t pulses[SERVO_COUNT];  // what to emit in the next period, while active or holding
    // the rest is private but for `channels`
    uint16_t emitted[SERVO_COUNT];  // in the last period that had pulses; 0: nobody knows
    uint16_t target[SERVO_COUNT];
    uint16_t dropped;
    uint16_t since_command;        // [ms], stops counting at its largest value
    uint8_t flags;
    uint8_t reset;
    uint8_t sequence;              // expected next
    uint8_t imu_sequence;
    bool framed;                   // a sound frame came: legacy is over
    uint8_t legacy_count;          // bytes after the 255; more than SERVO_COUNT: not in a packet
    uint8_t legacy_row;            // packets in a row that agree; they count from the third on
    uint8_t legacy[SERVO_COUNT];   // of the newest packet
#if HAS_CHANNELS
    uint16_t since_channels;       // since a message that keeps the channels [ms], stops at its largest value
    struct channel channels[CHANNEL_COUNT];
#endif
    struct frame_receiver frames;  // last, so that the tests see a step beyond its end
};

// Begin after a reset for reasons `reset`; `emitted`: the last pulses before it, 0 where nobody knows.
void protocol_init(struct protocol *protocol, uint8_t reset, const uint16_t emitted[SERVO_COUNT]);

// Take the next byte of the line. Returns the length of the reply put into `reply`, 0 if there is none.
uint8_t protocol_receive(struct protocol *protocol, uint8_t byte, uint8_t reply[FRAME_MAX]);

// A period with these pulses has begun.
void protocol_period(struct protocol *protocol, const uint16_t emitted[SERVO_COUNT]);

// Another millisecond has passed.
void protocol_tick(struct protocol *protocol);

// Bytes were lost on their way in: what is half received is void.
void protocol_lost_input(struct protocol *protocol);

// A reply or a line found no room on its way out.
void protocol_lost_output(struct protocol *protocol);

// Put a line of an IMU, at most TEXT_MAX bytes without its end, into `out` as the host expects it: as a frame once
// it has spoken in frames, before that as it is. Returns the length.
uint8_t protocol_imu_line(struct protocol *protocol, const char *text, uint8_t length, uint8_t out[FRAME_MAX]);

static inline bool protocol_emits_pulses(const struct protocol *protocol)
{
    return protocol->state == STATE_ACTIVE || protocol->state == STATE_HOLDING;
}

#endif
