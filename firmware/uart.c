#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

enum { RING = 64, BAUD_RATE = 115200 };  // a ring is a power of two
_Static_assert((RING & (RING - 1)) == 0, "RING must be a power of two");

// head: next to fill, tail: next to take; both count on and are cut to the ring where they index it.
static volatile uint8_t in[RING], in_head, in_tail;
static volatile uint8_t out[RING], out_head, out_tail;
static volatile bool lost;

void uart_init(void)
{
    UCSR0A = _BV(U2X0);  // before the rate: simulators read it then
    UBRR0 = (F_CPU + BAUD_RATE * 4UL) / (BAUD_RATE * 8UL) - 1;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect)
{
    uint8_t status = UCSR0A, byte = UDR0, head = in_head;
    bool refused = status & _BV(FE0) || (uint8_t)(head - in_tail) == RING;
    if (refused || status & _BV(DOR0))
        lost = true;  // this byte, or one before it
    if (refused)
        return;
    in[head % RING] = byte;
    in_head = head + 1;
}

ISR(USART_UDRE_vect)
{
    uint8_t tail = out_tail;
    UDR0 = out[tail % RING];
    out_tail = ++tail;
    if (tail == out_head)
        UCSR0B &= ~_BV(UDRIE0);
}

bool uart_waiting(void)
{
    return in_head != in_tail;
}

bool uart_receive(uint8_t *byte)
{
    uint8_t tail = in_tail;
    if (tail == in_head)
        return false;
    *byte = in[tail % RING];
    in_tail = tail + 1;
    return true;
}

bool uart_lost(void)
{
    bool result = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        result = lost;
        lost = false;
    }
    return result;
}

bool uart_send(const uint8_t *data, uint8_t length)
{
    uint8_t head = out_head;
    if (length > (uint8_t)(RING - (uint8_t)(head - out_tail)))
        return false;
    for (uint8_t i = 0; i < length; i++)
        out[head++ % RING] = data[i];
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        out_head = head;
        UCSR0B |= _BV(UDRIE0);
    }
    return true;
}
