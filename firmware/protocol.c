#include "protocol.h"

#include <string.h>

enum {
    HELLO = 0x01,
    SET_PULSES = 0x02,
    HOLD = 0x03,
    RELEASE = 0x04,
    DESCRIBE_CHANNEL = 0x05,
    SET_CHANNELS = 0x06,
    HOME_CHANNEL = 0x07,
    GET_CHANNELS = 0x08,
    FROM_BOARD = 0x80,
    HELLO_REPLY = 0x81,
    ACKNOWLEDGEMENT = 0x82,
    ERROR = 0x83,
    IMU_LINE = 0x84,
    CHANNEL_DESCRIPTION = 0x85,
    CHANNEL_STATES = 0x86,
};

enum { ERROR_VERSION = 1, ERROR_TYPE, ERROR_LENGTH, ERROR_PULSE, ERROR_CHANNEL, ERROR_PLACE };

enum { FLAG_RESTARTED = 1, FLAG_WATCHDOG = 2, FLAG_SEQUENCE_GAP = 4, FLAG_OVERRUN = 8 };

enum {
    HEADER_SIZE = 3,
    PULSES_SIZE = 2 * SERVO_COUNT,
    LEGACY_HEADER = 255,
    LEGACY_MAX = 180,     // [degree]
    LEGACY_NEAR = 10,     // packets that differ by more do not agree [degree]
    LEGACY_ROW = 3,       // packets in a row that agree, the last of which counts
    LEGACY_NONE = 255,
};

_Static_assert(HEADER_SIZE + 15 + PULSES_SIZE + CRC_SIZE <= BODY_MAX, "a hello reply fits into a frame");

void protocol_init(struct protocol *p, uint8_t reset, const uint16_t emitted[SERVO_COUNT])
{
    memset(p, 0, sizeof *p);
    p->reset = reset;
    memcpy(p->emitted, emitted, sizeof p->emitted);
    p->flags = FLAG_RESTARTED;
    p->legacy_count = LEGACY_NONE;
#if HAS_CHANNELS
    p->since_channels = UINT16_MAX;
    channels_init(p->channels);
#endif
}

static uint8_t *put16(uint8_t *at, uint16_t value)
{
    *at++ = (uint8_t)value;
    *at++ = value >> 8;
    return at;
}

static uint8_t *put_state(struct protocol *p, uint8_t *at)
{
    *at++ = p->state;
    *at++ = p->flags;
    p->flags = 0;
    for (uint8_t i = 0; i < SERVO_COUNT; i++)
        at = put16(at, protocol_emits_pulses(p) ? p->pulses[i] : p->emitted[i]);
    return at;
}

// Set the pulses of the next period: as near to the target as SLEW allows, the target itself where nobody knows how
// the servo stands.
static void approach(struct protocol *p)
{
    for (uint8_t i = 0; i < SERVO_COUNT; i++) {
        uint16_t from = p->emitted[i], to = p->target[i];
        if (from && to > from + SLEW)
            to = from + SLEW;
        else if (from && from > to + SLEW)
            to = from - SLEW;
        p->pulses[i] = to;
    }
}

static void command(struct protocol *p, enum state state)
{
    p->since_command = 0;
    p->state = state;
    if (state == STATE_HOLDING)
        memcpy(p->target, p->pulses, sizeof p->target);
    approach(p);
}

static uint8_t *error(uint8_t *at, uint8_t *type, uint8_t code, uint16_t detail)
{
    *at++ = code;
    *at++ = *type;
    *type = ERROR;
    return put16(at, detail);
}

static uint16_t get16(const uint8_t *at)
{
    return at[0] | (uint16_t)at[1] << 8;
}

// The first servo whose pulse is out of range, or SERVO_COUNT.
static uint8_t first_wrong(const uint8_t *pulses)
{
    uint8_t i = 0;
    while (i < SERVO_COUNT && get16(pulses + 2 * i) >= PULSE_MIN && get16(pulses + 2 * i) <= PULSE_MAX)
        i++;
    return i;
}

#if HAS_CHANNELS
_Static_assert(HEADER_SIZE + 5 * CHANNEL_COUNT + CRC_SIZE <= BODY_MAX, "the states of all channels fit into a frame");

// Carry out a message on channels, as `carry_out`.
static uint8_t *carry_out_channels(struct protocol *p, const uint8_t *payload, uint8_t size, uint8_t *type, uint8_t *at)
{
    int first = payload[0];
    if (size != (*type == SET_CHANNELS ? 2 * CHANNEL_COUNT : *type == GET_CHANNELS ? 0 : 1))
        return error(at, type, ERROR_LENGTH, size);
    if (*type == SET_CHANNELS) {
        for (int i = 0; i < CHANNEL_COUNT; i++) {
            if (get16(payload + 2 * i) > channel_max(i))
                return error(at, type, ERROR_CHANNEL, (uint16_t)i);
            if (!(p->channels[i].flags & CHANNEL_KNOWN) && get16(payload + 2 * i) != p->channels[i].target)
                return error(at, type, ERROR_PLACE, (uint16_t)i);
        }
        for (int i = 0; i < CHANNEL_COUNT; i++)
            channel_set(&p->channels[i], get16(payload + 2 * i));
        p->since_channels = 0;
    } else if (*type == GET_CHANNELS) {
        // changes nothing, keeps nothing
    } else if (first >= (*type == HOME_CHANNEL ? WINCH_COUNT : CHANNEL_COUNT)) {
        return error(at, type, ERROR_CHANNEL, (uint16_t)first);
    } else if (*type == DESCRIBE_CHANNEL) {
        *type = CHANNEL_DESCRIPTION;
        *at++ = CHANNEL_COUNT;
        *at++ = (uint8_t)first;
        *at++ = channel_kind(first);
        at = put16(at, channel_max(first));
        return put16(at, channel_slew(first));
    } else {
        channel_home(&p->channels[first]);
        p->since_channels = 0;
    }
    *type = CHANNEL_STATES;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        *at++ = p->channels[i].flags;
        at = put16(put16(at, p->channels[i].set), p->channels[i].measured);
    }
    return at;
}
#endif

// Carry out the message in `body` and append the payload of the reply at `at`, its type at `type`.
static uint8_t *carry_out(struct protocol *p, const uint8_t *body, uint8_t length, uint8_t *type, uint8_t *at)
{
    const uint8_t *payload = body + HEADER_SIZE;
    uint8_t size = length - HEADER_SIZE;
    if (body[0] != PROTOCOL_VERSION)
        return error(at, type, ERROR_VERSION, PROTOCOL_VERSION);
#if HAS_CHANNELS
    if (*type >= DESCRIBE_CHANNEL && *type <= GET_CHANNELS)
        return carry_out_channels(p, payload, size, type, at);
#endif
    if (*type < HELLO || *type > RELEASE)
        return error(at, type, ERROR_TYPE, *type);
    if (size != (*type == SET_PULSES ? PULSES_SIZE : 0))
        return error(at, type, ERROR_LENGTH, size);
    if (*type == HELLO) {
        *type = HELLO_REPLY;
        *at++ = FIRMWARE_MAJOR;
        *at++ = FIRMWARE_MINOR;
        *at++ = PROTOCOL_VERSION;
        *at++ = SERVO_COUNT;
        at = put16(at, PULSE_MIN);
        at = put16(at, PULSE_MAX);
        at = put16(at, WATCHDOG_MS);
        at = put16(at, SLEW);
        *at++ = p->reset;
        return put_state(p, at);
    }
    if (*type == SET_PULSES) {
        uint8_t wrong = first_wrong(payload);
        if (wrong < SERVO_COUNT)
            return error(at, type, ERROR_PULSE, wrong);
        for (uint8_t i = 0; i < SERVO_COUNT; i++)
            p->target[i] = (get16(payload + 2 * i) + PULSE_STEP / 2) / PULSE_STEP * PULSE_STEP;
        command(p, STATE_ACTIVE);
    } else if (*type == RELEASE) {
        command(p, STATE_RELEASED);
#if HAS_CHANNELS
        channels_vent(p->channels);
#endif
    } else {
        command(p, protocol_emits_pulses(p) ? STATE_HOLDING : p->state);
#if HAS_CHANNELS
        channels_hold(p->channels);
        p->since_channels = 0;
#endif
    }
    *type = ACKNOWLEDGEMENT;
    return put16(put_state(p, at), p->dropped);
}

static uint8_t answer(struct protocol *p, uint8_t reply[FRAME_MAX])
{
    const uint8_t *body = p->frames.bytes;
    uint8_t out[BODY_MAX - CRC_SIZE], type, sequence;
    if (p->frames.length < HEADER_SIZE || body[1] >= FROM_BOARD) {
        p->dropped++;  // an echo of the board's own, which an answer would keep alive for ever
        return 0;
    }
    type = body[1];
    sequence = body[2];
    if (p->framed && sequence != p->sequence)
        p->flags |= FLAG_SEQUENCE_GAP;
    p->sequence = sequence + 1;
    p->framed = true;
    uint8_t *end = carry_out(p, body, p->frames.length, &type, out + HEADER_SIZE);
    out[0] = PROTOCOL_VERSION;
    out[1] = type;
    out[2] = sequence;
    return frame_encode(out, (uint8_t)(end - out), reply);
}

// The pulse that the Arduino Servo library makes of whole degrees, within the board's range.
static uint16_t legacy_pulse(uint8_t degrees)
{
    uint16_t pulse = (uint16_t)(544 + degrees * 1856UL / 180) * 10;
    return pulse < PULSE_MIN ? PULSE_MIN : pulse > PULSE_MAX ? PULSE_MAX : pulse;
}

static void legacy_receive(struct protocol *p, uint8_t byte)
{
    if (byte == LEGACY_HEADER) {
        if (p->legacy_count != SERVO_COUNT)
            p->legacy_row = 0;
        p->legacy_count = 0;
        return;
    }
    if (p->legacy_count >= SERVO_COUNT || byte > LEGACY_MAX) {
        p->legacy_count = LEGACY_NONE;
        return;
    }
    uint8_t *last = &p->legacy[p->legacy_count++];
    bool near = byte <= *last + LEGACY_NEAR && *last <= byte + LEGACY_NEAR;
    if (!near && p->legacy_row < LEGACY_ROW)
        p->legacy_row = 0;
    *last = byte;
    if (p->legacy_count < SERVO_COUNT)
        return;
    if (p->legacy_row < LEGACY_ROW)
        p->legacy_row++;
    if (p->legacy_row < LEGACY_ROW)
        return;
    for (uint8_t i = 0; i < SERVO_COUNT; i++)
        p->target[i] = legacy_pulse(p->legacy[i]);
    command(p, STATE_ACTIVE);
}

uint8_t protocol_receive(struct protocol *p, uint8_t byte, uint8_t reply[FRAME_MAX])
{
    if (SERVO_COUNT == LEGACY_SERVOS && !p->framed)
        legacy_receive(p, byte);
    switch (frame_receive(&p->frames, byte)) {
    case FRAME_COMPLETE:
        return answer(p, reply);
    case FRAME_DAMAGED:
        if (p->framed)
            p->dropped++;
        return 0;
    default:
        return 0;
    }
}

void protocol_period(struct protocol *p, const uint16_t emitted[SERVO_COUNT])
{
    memcpy(p->emitted, emitted, sizeof p->emitted);
    approach(p);
}

// No command for the watchdog's time: keep the pulses where they are.
static void hold(struct protocol *p)
{
    if (p->state == STATE_ACTIVE)
        memcpy(p->target, p->pulses, sizeof p->target);
    p->state = STATE_HOLDING;
}

void protocol_tick(struct protocol *p)
{
    if (p->since_command < UINT16_MAX)
        p->since_command++;
#if HAS_CHANNELS
    if (p->since_channels <= WATCHDOG_MS && ++p->since_channels > WATCHDOG_MS) {
        p->flags |= FLAG_WATCHDOG;
        channels_vent(p->channels);
    }
#endif
    if (!protocol_emits_pulses(p) || p->since_command <= WATCHDOG_MS)
        return;
    p->flags |= FLAG_WATCHDOG;
    if (p->since_command <= 2 * WATCHDOG_MS)
        hold(p);
    else
        p->state = STATE_RELEASED;
}

void protocol_lost_input(struct protocol *p)
{
    p->flags |= FLAG_OVERRUN;
    p->frames.lost = true;
    p->legacy_count = LEGACY_NONE;
}

void protocol_lost_output(struct protocol *p)
{
    p->flags |= FLAG_OVERRUN;
}

uint8_t protocol_imu_line(struct protocol *p, const char *text, uint8_t length, uint8_t out[FRAME_MAX])
{
    if (!p->framed) {
        memcpy(out, text, length);
        out[length] = '\n';
        return length + 1;
    }
    uint8_t body[HEADER_SIZE + TEXT_MAX] = {PROTOCOL_VERSION, IMU_LINE, p->imu_sequence++};
    memcpy(body + HEADER_SIZE, text, length);
    return frame_encode(body, HEADER_SIZE + length, out);
}
