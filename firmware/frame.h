// Frames of the framed protocol (docs/protocol.md): COBS and CRC-16. Portable C, no I/O.
#ifndef FRAME_H
#define FRAME_H

#include <stdbool.h>
#include <stdint.h>

enum {
    CRC_SIZE = 2,
    BODY_MAX = 40,             // bytes from the version to the CRC
    FRAME_MAX = BODY_MAX + 3,  // one byte of COBS, two delimiters
};

enum frame_result {
    FRAME_UNFINISHED,
    FRAME_DAMAGED,
    FRAME_COMPLETE,
};

struct frame_receiver {
    uint8_t length;            // of `bytes`: as received, and once complete that of the body without CRC
    bool lost;                 // more came than fits, or bytes went missing
    bool complete;             // `bytes` holds a body
    uint8_t bytes[BODY_MAX + 1];
};

// CRC-16 of one more byte: polynomial 0x1021, not reflected. Begin with 0xFFFF.
uint16_t crc16(uint16_t crc, uint8_t byte);

// Take the next byte of the line. FRAME_COMPLETE: the body is in `bytes` until the next call.
enum frame_result frame_receive(struct frame_receiver *receiver, uint8_t byte);

// Write the frame of a body of `length` bytes, at most BODY_MAX - CRC_SIZE, and return its length.
uint8_t frame_encode(const uint8_t *body, uint8_t length, uint8_t frame[FRAME_MAX]);

#endif
