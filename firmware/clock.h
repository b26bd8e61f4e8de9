// Milliseconds, from Timer 0.
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_init(void);

// Milliseconds that have passed since the last call.
uint8_t clock_elapsed(void);

#endif
