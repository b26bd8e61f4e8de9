#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

enum { LATE = 100 };  // [ms]; the main loop takes less than 5

static volatile uint8_t elapsed __attribute__((section(".noinit")));  // how late the main loop was outlives a reset

void clock_init(void)
{
    elapsed = 0;
    TCCR0A = _BV(WGM01);             // count to OCR0A
    OCR0A = F_CPU / 64 / 1000 - 1;
    TIMSK0 = _BV(OCIE0A);
    TCCR0B = _BV(CS01) | _BV(CS00);  // F_CPU / 64
}

ISR(TIMER0_COMPA_vect)
{
    if (elapsed < UINT8_MAX)
        elapsed++;
}

bool clock_was_late(void)
{
    return elapsed >= LATE;
}

uint8_t clock_elapsed(void)
{
    uint8_t result;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        result = elapsed;
        elapsed = 0;
    }
    return result;
}
