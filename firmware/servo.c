#include "servo.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "protocol.h"

// Timer 1 counts half microseconds, freely from 0 to 65535; edges are set modulo 65536.
#define PERIOD (20000U * TICKS_PER_US)
enum {
    HARDWARE = 2,                // servos whose pulses the compare outputs make, at the same time
    LEAD = 100 * TICKS_PER_US,   // from the start of a period to the pulses of D9 and D10: time to prepare them
    SLOT = 3000 * TICKS_PER_US,  // from the start of a period to the pulse of D11; from there to that of the next pin
    LAST = (SERVO_COUNT > HARDWARE ? SERVO_COUNT - HARDWARE : 0) * SLOT,  // to the pulse of the last pin
    AHEAD = 25 * TICKS_PER_US,   // how early the interrupt for an edge by software comes: more than others delay it
};
_Static_assert(F_CPU == 8000000UL * TICKS_PER_US, "the timer's divisor of 8 needs 16 MHz");
_Static_assert(PULSE_STEP * TICKS_PER_US == 10, "PULSE_STEP is one tick");
_Static_assert(LEAD + PULSE_MAX / PULSE_STEP + 4 * AHEAD < SLOT, "a pin begins after the one before it has ended");
_Static_assert(LAST + PULSE_MAX / PULSE_STEP + 4 * AHEAD < PERIOD, "all pulses end within a period");

// D9, D10, D11, D5, D6, D7. The register of the direction is the one below that of the output.
static const struct {
    volatile uint8_t *port;
    uint8_t mask;
} PINS[SERVO_MAX] = {
    {&PORTB, _BV(PB1)}, {&PORTB, _BV(PB2)}, {&PORTB, _BV(PB3)},
    {&PORTD, _BV(PD5)}, {&PORTD, _BV(PD6)}, {&PORTD, _BV(PD7)},
};

enum step { START, RISE, FALL, SOFT_RISE, SOFT_FALL };

static volatile bool wanted;
static volatile uint16_t wanted_ticks[SERVO_COUNT];
static volatile uint16_t ticks[SERVO_COUNT];  // of this period
static uint16_t start;              // of this period
static uint8_t servo;               // whose pulse software makes next
static volatile uint8_t periods;    // with pulses, modulo 256
static volatile uint8_t wanted_in;  // the period that the main loop knew when it wanted this
static uint8_t known;               // the newest period that the main loop knows
static enum step step_a;

static void connect_a(uint8_t bits)
{
    TCCR1A = (TCCR1A & ~(_BV(COM1A1) | _BV(COM1A0))) | bits;
}

#if SERVO_COUNT > 1
static bool fall_b;

static void connect_b(uint8_t bits)
{
    TCCR1A = (TCCR1A & ~(_BV(COM1B1) | _BV(COM1B0))) | bits;
}
#endif

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
        for (uint8_t i = 0; i < SERVO_COUNT; i++)
            ticks[i] = wanted_ticks[i];
    periods++;
    OCR1A = start + LEAD;
    connect_a(_BV(COM1A1) | _BV(COM1A0));
    step_a = RISE;
#if SERVO_COUNT > 1
    OCR1B = start + LEAD;
    connect_b(_BV(COM1B1) | _BV(COM1B0));
    fall_b = false;
    TIFR1 = _BV(OCF1B);
    TIMSK1 |= _BV(OCIE1B);
#endif
}

// Wait for a time at most AHEAD away and drive the pin of `servo` then; return the time it was.
static uint16_t drive(uint16_t time, bool high)
{
    volatile uint8_t *port = PINS[servo].port;
    uint8_t mask = PINS[servo].mask;
    while ((int16_t)(TCNT1 - time) < 0)
        ;
    if (high)
        *port |= mask;
    else
        *port &= ~mask;
    return TCNT1;
}

// Set the time of the next pulse by software, or of the next period where `servo` has come to the end.
static void next_pulse(void)
{
    if (servo < SERVO_COUNT) {
        OCR1A = start + (servo - 1) * SLOT - AHEAD;
        step_a = SOFT_RISE;
    } else {
        OCR1A = start + PERIOD;
        step_a = START;
    }
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
        servo = HARDWARE;
        next_pulse();
        break;
    case SOFT_RISE:
        OCR1A = drive(OCR1A + AHEAD, true) + ticks[servo] - AHEAD;
        step_a = SOFT_FALL;
        break;
    case SOFT_FALL:
        drive(OCR1A + AHEAD, false);
        servo++;
        next_pulse();
        break;
    }
}

#if SERVO_COUNT > 1
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
#endif

void servo_init(void)
{
    for (uint8_t i = 0; i < SERVO_COUNT; i++) {
        *PINS[i].port &= ~PINS[i].mask;
        *(PINS[i].port - 1) |= PINS[i].mask;
    }
    OCR1A = PERIOD;
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(CS11);  // F_CPU / 8
}

void servo_set(bool on, const uint16_t pulses[SERVO_COUNT])
{
    uint16_t converted[SERVO_COUNT];  // divisions are slow: not while interrupts are off, see AHEAD
    for (uint8_t i = 0; i < SERVO_COUNT; i++)
        converted[i] = pulses[i] / PULSE_STEP;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        for (uint8_t i = 0; i < SERVO_COUNT; i++)
            wanted_ticks[i] = converted[i];
        wanted = on;
        wanted_in = known;
    }
}

bool servo_period(uint16_t pulses[SERVO_COUNT])
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (known == periods)
            return false;
        known = periods;
        for (uint8_t i = 0; i < SERVO_COUNT; i++)
            pulses[i] = ticks[i];
    }
    for (uint8_t i = 0; i < SERVO_COUNT; i++)
        pulses[i] *= PULSE_STEP;
    return true;
}
