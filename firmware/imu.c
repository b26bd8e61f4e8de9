#include "imu.h"

#ifdef IMU_BAUD

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>

#include "servo.h"

// Timer 1 captures the time of a start bit on D8; the second compare unit of Timer 0, which counts 4 us from 0 to 249
// for the clock, samples the bits. A sample may come 40 us late (servo.c waits for its edges with interrupts off), so a
// bit must last 100 us; 1.5 bits must fit into one turn.
_Static_assert(2400 <= IMU_BAUD && IMU_BAUD <= 9600, "2400 <= IMU_BAUD <= 9600");
enum {
    TURN = F_CPU / 64 / 1000,
    BIT = (F_CPU / 64 + IMU_BAUD / 2) / IMU_BAUD,
};

static volatile char line[TEXT_MAX];
static volatile uint8_t ready;  // length of the line in `line`, 0 while it is being received
static uint8_t length, bits, byte;
static bool skip;               // to the end of a line that is too long, not printable, or came too soon

static void sample_after(uint8_t from, uint8_t counts)
{
    uint16_t time = (uint16_t)from + counts;
    OCR0B = time < TURN ? time : time - TURN;
}

ISR(TIMER1_CAPT_vect)
{
    if (PINB & _BV(PB0))
        return;  // an edge within the last byte, captured before this interrupt was enabled again
    uint8_t late = (TCNT1 - ICR1) / (4 * TICKS_PER_US);
    sample_after(TCNT0, BIT + BIT / 2 - late);
    TIFR0 = _BV(OCF0B);
    TIMSK0 |= _BV(OCIE0B);
    TIMSK1 &= ~_BV(ICIE1);
    bits = 0;
}

static void take(uint8_t c)
{
    if (c == '\r')
        return;
    if (c == '\n') {
        if (!skip)
            ready = length;
        skip = false;
        length = 0;
    } else if (skip || ready || c < ' ' || c > '~' || length == TEXT_MAX) {
        skip = true;
    } else {
        line[length++] = c;
    }
}

ISR(TIMER0_COMPB_vect)
{
    bool high = PINB & _BV(PB0);
    if (bits++ < 8) {
        sample_after(OCR0B, BIT);
        byte = byte >> 1 | (high ? 0x80 : 0);
        return;
    }
    TIMSK0 &= ~_BV(OCIE0B);
    TIMSK1 |= _BV(ICIE1);
    if (high)
        take(byte);
    else
        skip = true;  // no stop bit
}

// After servo_init, which sets Timer 1 up.
void imu_init(void)
{
    PORTB |= _BV(PB0);  // pull-up: silence when nothing is connected
    TCCR1B |= _BV(ICNC1);  // of falling edges, against noise
    TIMSK1 |= _BV(ICIE1);
}

uint8_t imu_line(char text[TEXT_MAX])
{
    uint8_t result = ready;
    for (uint8_t i = 0; i < result; i++)
        text[i] = line[i];
    ready = 0;
    return result;
}

#endif
