#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

static volatile uint8_t elapsed;

void clock_init(void)
{
    TCCR0A = _BV(WGM01);             // count to OCR0A
    OCR0A = F_CPU / 64 / 1000 - 1;
    TIMSK0 = _BV(OCIE0A);
    TCCR0B = _BV(CS01) | _BV(CS00);  // F_CPU / 64
}

ISR(TIMER0_COMPA_vect)
{
    elapsed++;
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
