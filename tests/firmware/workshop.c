// What the boards of the workshop do, for tests. Its program attaches three servos of the Arduino Servo library, which
// gives each 1,500 us at once, and then reads packets of 255 and three angles in loops that wait. The library emits the
// pulses one after the other, a row of them every 20 ms, by an interrupt that drives the pins.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>

enum { SERVOS = 3, ATTACHED = 1500, SHORTEST = 544, LONGEST = 2400, ROW = 20000, TICKS_PER_US = 2, BUFFER = 64 };

static volatile uint16_t width[SERVOS] = {ATTACHED, ATTACHED, ATTACHED};  // [us]
static uint8_t servo = SERVOS;
static uint16_t row;
static volatile uint8_t buffer[BUFFER], head, tail;

ISR(TIMER1_COMPA_vect)
{
    if (servo < SERVOS) {
        PORTB &= ~_BV(PB1 + servo);
        servo++;
    } else {
        row = OCR1A;
        servo = 0;
    }
    if (servo < SERVOS) {
        OCR1A += TICKS_PER_US * width[servo];
        PORTB |= _BV(PB1 + servo);
    } else {
        OCR1A = row + (uint16_t)TICKS_PER_US * ROW;
    }
}

ISR(USART_RX_vect)
{
    uint8_t byte = UDR0, next = (head + 1) % BUFFER;
    if (next != tail) {  // else it is lost, as in the Arduino's own buffer
        buffer[head] = byte;
        head = next;
    }
}

static uint8_t read(void)
{
    cli();
    while (head == tail) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
        cli();
    }
    uint8_t byte = buffer[tail];
    tail = (tail + 1) % BUFFER;
    sei();
    return byte;
}

static void write(uint8_t number, uint8_t degrees)
{
    uint16_t us = SHORTEST + (degrees < 180 ? degrees : 180) * (uint32_t)(LONGEST - SHORTEST) / 180;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        width[number] = us;
    }
}

int main(void)
{
    uint8_t angles[SERVOS];
    DDRB |= _BV(PB1) | _BV(PB2) | _BV(PB3);
    OCR1A = TICKS_PER_US * 1000;
    TCCR1B = _BV(CS11);
    TIFR1 = _BV(OCF1A);  // of the time before a reset, in the simulator
    TIMSK1 = _BV(OCIE1A);
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;  // 115,200 baud
    UCSR0B = _BV(RXEN0) | _BV(RXCIE0);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
    for (;;) {
        while (read() != 255)
            ;
        for (uint8_t i = 0; i < SERVOS; i++)
            angles[i] = read();
        for (uint8_t i = 0; i < SERVOS; i++)
            write(i, angles[i]);
    }
}
