#include "frame.h"

uint16_t crc16(uint16_t crc, uint8_t byte)
{
    uint8_t x = (uint8_t)(crc >> 8) ^ byte;
    x ^= x >> 4;
    return (uint16_t)((crc << 8) ^ ((uint16_t)x << 12) ^ ((uint16_t)x << 5) ^ x);
}

// Undo COBS in place. Returns the new length, or 0 if the bytes cannot be COBS; they contain no zero.
static uint8_t unstuff(uint8_t *bytes, uint8_t length)
{
    uint8_t from = 0, to = 0;
    while (from < length) {
        uint8_t run = bytes[from++];
        if (run > length - from + 1)
            return 0;
        while (--run)
            bytes[to++] = bytes[from++];
        if (from < length)
            bytes[to++] = 0;
    }
    return to;
}

static bool sound(struct frame_receiver *r)
{
    uint8_t length = r->lost ? 0 : unstuff(r->bytes, r->length);
    if (length < CRC_SIZE)
        return false;
    length -= CRC_SIZE;
    uint16_t crc = 0xFFFF;
    for (uint8_t i = 0; i < length; i++)
        crc = crc16(crc, r->bytes[i]);
    r->length = length;
    return r->bytes[length] == (uint8_t)crc && r->bytes[length + 1] == crc >> 8;
}

enum frame_result frame_receive(struct frame_receiver *r, uint8_t byte)
{
    if (r->complete) {
        r->complete = false;
        r->length = 0;
    }
    if (byte) {
        if (r->length == sizeof r->bytes)
            r->lost = true;
        else
            r->bytes[r->length++] = byte;
        return FRAME_UNFINISHED;
    }
    if (r->length == 0 && !r->lost)
        return FRAME_UNFINISHED;  // an empty frame means nothing
    r->complete = sound(r);
    r->lost = false;
    if (r->complete)
        return FRAME_COMPLETE;
    r->length = 0;
    return FRAME_DAMAGED;
}

uint8_t frame_encode(const uint8_t *body, uint8_t length, uint8_t frame[FRAME_MAX])
{
    uint16_t crc = 0xFFFF;
    uint8_t at = 0, code = 1;  // of the byte that will hold the distance to the next zero
    frame[at++] = 0;
    frame[at++] = 0;
    for (uint8_t i = 0; i < length + CRC_SIZE; i++) {
        uint8_t byte;
        if (i < length) {
            byte = body[i];
            crc = crc16(crc, byte);
        } else {
            byte = (uint8_t)(i == length ? crc : crc >> 8);
        }
        if (byte == 0) {
            frame[code] = at - code;
            code = at;
        }
        frame[at++] = byte;
    }
    frame[code] = at - code;
    frame[at++] = 0;
    return at;
}
