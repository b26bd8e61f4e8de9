#include "servo.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "protocol.h"

// Timer 1 counts half microseconds, freely from 0 to 65535; edges are set modulo 65536.
#define PERIOD (20000U * TICKS_PER_US)
enum {
    LEAD = 100 * TICKS_PER_US,   // from the start of a period to the pulses of D9 and D10: time to prepare them
    SECOND = 3000 * TICKS_PER_US,  // from the start of a period to the pulse of D11, after that of D9
    AHEAD = 25 * TICKS_PER_US,   // how early the interrupt for an edge of D11 comes: more than others can delay it
};
_Static_assert(F_CPU == 8000000UL * TICKS_PER_US, "the timer's divisor of 8 needs 16 MHz");
_Static_assert(PULSE_STEP * TICKS_PER_US == 10, "PULSE_STEP is one tick");
_Static_assert(LEAD + PULSE_MAX / PULSE_STEP + 4 * AHEAD < SECOND, "D11 begins after D9 has ended");
_Static_assert(SECOND + PULSE_MAX / PULSE_STEP + 4 * AHEAD < PERIOD, "all pulses end within a period");

enum step { START, RISE, FALL, SOFT_RISE, SOFT_FALL };

static volatile bool wanted;
static volatile uint16_t wanted_ticks[3];
static volatile uint16_t ticks[3];  // of this period
static uint16_t start;              // of this period
static volatile uint8_t periods;    // with pulses, modulo 256
static volatile uint8_t wanted_in;  // the period that the main loop knew when it wanted this
static uint8_t known;               // the newest period that the main loop knows
static enum step step_a;
static bool fall_b;

static void connect_a(uint8_t bits)
{
    TCCR1A = (TCCR1A & ~(_BV(COM1A1) | _BV(COM1A0))) | bits;
}

static void connect_b(uint8_t bits)
{
    TCCR1A = (TCCR1A & ~(_BV(COM1B1) | _BV(COM1B0))) | bits;
}

// The outputs follow the timer only from COM1x = 3 (set on match) until the pulse has ended; otherwise they are
// those of PORTB, low. In each interrupt the time of the next match is set before its action: an old time may be near.
static void start_period(void)
{
    start = OCR1A;
    if (!wanted) {
        OCR1A = start + PERIOD;
        return;
    }
    if (wanted_in == periods)  // else it was not made for what this period follows: once more the same
        for (uint8_t i = 0; i < 3; i++)
            ticks[i] = wanted_ticks[i];
    periods++;
    OCR1A = OCR1B = start + LEAD;
    connect_a(_BV(COM1A1) | _BV(COM1A0));
    connect_b(_BV(COM1B1) | _BV(COM1B0));
    fall_b = false;
    step_a = RISE;
    TIFR1 = _BV(OCF1B);
    TIMSK1 |= _BV(OCIE1B);
}

// Wait for a time at most AHEAD away and drive D11 then; return the time it was.
static uint16_t drive(uint16_t time, bool high)
{
    while ((int16_t)(TCNT1 - time) < 0)
        ;
    if (high)
        PORTB |= _BV(PB3);
    else
        PORTB &= ~_BV(PB3);
    return TCNT1;
}

ISR(TIMER1_COMPA_vect)
{
    switch (step_a) {
    case START:
        start_period();
        break;
    case RISE:
        OCR1A += ticks[0];
        connect_a(_BV(COM1A1));
        step_a = FALL;
        break;
    case FALL:
        connect_a(0);
        OCR1A = start + SECOND - AHEAD;
        step_a = SOFT_RISE;
        break;
    case SOFT_RISE:
        OCR1A = drive(OCR1A + AHEAD, true) + ticks[2] - AHEAD;
        step_a = SOFT_FALL;
        break;
    case SOFT_FALL:
        drive(OCR1A + AHEAD, false);
        OCR1A = start + PERIOD;
        step_a = START;
        break;
    }
}

ISR(TIMER1_COMPB_vect)
{
    if (fall_b) {
        connect_b(0);
        TIMSK1 &= ~_BV(OCIE1B);
        return;
    }
    OCR1B += ticks[1];
    connect_b(_BV(COM1B1));
    fall_b = true;
}

void servo_init(void)
{
    PORTB &= ~(_BV(PB1) | _BV(PB2) | _BV(PB3));
    DDRB |= _BV(PB1) | _BV(PB2) | _BV(PB3);
    OCR1A = PERIOD;
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(CS11);  // F_CPU / 8
}

void servo_set(bool on, const uint16_t pulses[3])
{
    uint16_t converted[3];  // divisions are slow: not while interrupts are off, see AHEAD
    for (uint8_t i = 0; i < 3; i++)
        converted[i] = pulses[i] / PULSE_STEP;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        for (uint8_t i = 0; i < 3; i++)
            wanted_ticks[i] = converted[i];
        wanted = on;
        wanted_in = known;
    }
}

bool servo_period(uint16_t pulses[3])
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (known == periods)
            return false;
        known = periods;
        for (uint8_t i = 0; i < 3; i++)
            pulses[i] = ticks[i];
    }
    for (uint8_t i = 0; i < 3; i++)
        pulses[i] *= PULSE_STEP;
    return true;
}
