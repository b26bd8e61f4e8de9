// The firmware's protocol on the machine that runs the tests: operations on standard input, results on standard output.
// Operation: letter, count (u16, low byte first), for R and I that many bytes.
//   Z begin again   R receive bytes   T ticks   P periods with pulses   L input lost   O output lost   I line of an IMU
//   M the measured value of channel 0, 1, ... from here on: letter, value   C periods of the channels
// Result: length of what was sent (u16), those bytes, state (u8), emits pulses (u8), the pulses (u16).
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "protocol.h"

static uint8_t get8(void)
{
    int c = getchar();
    if (c == EOF)
        exit(0);
    return c;
}

static uint16_t get16(void)
{
    uint8_t low = get8();
    return low | get8() << 8;
}

static void put16(uint16_t value)
{
    putchar(value & 0xFF);
    putchar(value >> 8);
}

static void check(const struct protocol *p)
{
    for (int i = 0; i < SERVO_COUNT; i++)
        if (protocol_emits_pulses(p) && (p->pulses[i] < PULSE_MIN || p->pulses[i] > PULSE_MAX))
            abort();
}

static uint8_t out[1 << 20];

_Static_assert(offsetof(struct protocol, frames) + offsetof(struct frame_receiver, bytes) + BODY_MAX + 1
                   == sizeof(struct protocol),
               "the receiver's bytes end where the protocol's memory ends, so that ASan sees a step beyond");

int main(void)
{
    struct protocol *p = malloc(sizeof *p);
    static const uint16_t unknown[SERVO_COUNT];
#if HAS_CHANNELS
    uint16_t measured[CHANNEL_COUNT] = {0}, channel = 0;
#endif
    protocol_init(p, RESET_POWER_ON, unknown);
    for (;;) {
        uint8_t operation = get8();
        uint16_t count = get16();
        size_t sent = 0;
        if (operation == 'Z')
            protocol_init(p, RESET_POWER_ON, unknown);
        if (operation == 'L')
            protocol_lost_input(p);
        if (operation == 'O')
            protocol_lost_output(p);
#if HAS_CHANNELS
        if (operation == 'M') {
            measured[channel] = count;
            channel = (channel + 1) % CHANNEL_COUNT;
        }
        for (uint16_t i = 0; i < count && operation == 'C'; i++)
            channels_period(p->channels, measured);
#endif
        if (operation == 'I') {
            uint8_t *frame = malloc(FRAME_MAX);
            char *text = malloc(count + 1);
            for (uint16_t i = 0; i < count; i++)
                text[i] = get8();
            sent = protocol_imu_line(p, text, count, frame);
            memcpy(out, frame, sent);
            free(text);
            free(frame);
        }
        for (uint16_t i = 0; i < count && (operation == 'R' || operation == 'T' || operation == 'P'); i++) {
            if (operation == 'T') {
                protocol_tick(p);
            } else if (operation == 'P') {
                uint16_t emitted[SERVO_COUNT];
                memcpy(emitted, p->pulses, sizeof emitted);
                if (protocol_emits_pulses(p))
                    protocol_period(p, emitted);
            } else {
                uint8_t *reply = malloc(FRAME_MAX);
                uint8_t length = protocol_receive(p, get8(), reply);
                memcpy(out + sent, reply, length);
                sent += length;
                free(reply);
            }
            check(p);
        }
        put16(sent);
        fwrite(out, 1, sent, stdout);
        putchar(p->state);
        putchar(protocol_emits_pulses(p));
        for (int i = 0; i < SERVO_COUNT; i++)
            put16(p->pulses[i]);
        fflush(stdout);
    }
}
