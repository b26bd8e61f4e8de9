// The serial line, 115200 baud, 8N1, through two ring buffers.
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_init(void);

// Take the next byte received; false if there is none.
bool uart_receive(uint8_t *byte);

// True if a byte came and none was taken: to be asked with interrupts off, before sleeping.
bool uart_waiting(void);

// True once after bytes were lost or came damaged.
bool uart_lost(void);

// Queue all of `data`, or nothing and return false if there is no room.
bool uart_send(const uint8_t *data, uint8_t length);

#endif
