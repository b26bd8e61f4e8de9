// Milliseconds, from Timer 0.
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

void clock_init(void);

// Before clock_init: whether the main loop had stopped when the board was reset.
bool clock_was_late(void);

// Milliseconds that have passed since the last call, at most 255.
uint8_t clock_elapsed(void);

#endif
