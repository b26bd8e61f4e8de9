#include "channel_pins.h"

#if HAS_CHANNELS
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>

#if PRESSURE_COUNT && defined IMU_BAUD
#error "D8 is the valve of the pressure or the line of the IMU: leave out IMU_BAUD or PRESSURE_COUNT"
#endif

// A pressure: sensor at A0, inlet valve at A5 (high: open), outlet valve at D8 (high: closed, so that a board without
// power lets the pressure go).
enum {
    INLET = _BV(PC5),
    OUTLET = _BV(PB0),
    DEAD_BAND = 2,  // both valves stay closed so near to the set-point [counts]
};

#if WINCH_COUNT
// Winch 0: step D2, direction D3, home A1, cable A2; winch 1: step D4, direction D12, home A3, cable A4. Both switches
// are to ground, with pull-ups: that of home closes at home, that of the cable opens when it is slack, so that a torn
// wire stops the winch.
static const struct {
    uint8_t step, home, taut;     // PORTD; PINC
    volatile uint8_t *direction;  // its port; the register of the direction of the pin is the one below
    uint8_t mask;
} WINCHES[2] = {
    {_BV(PD2), _BV(PC1), _BV(PC2), &PORTD, _BV(PD3)},
    {_BV(PD4), _BV(PC3), _BV(PC4), &PORTB, _BV(PB4)},
};
static int16_t steps[WINCH_COUNT];  // still to be made
#endif

static uint8_t elapsed;

// Interrupts of the servos change other pins of the same ports.
static void set_pin(volatile uint8_t *port, uint8_t mask, bool high)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        *port = high ? *port | mask : *port & ~mask;
    }
}

void channel_pins_init(void)
{
#if WINCH_COUNT
    for (uint8_t i = 0; i < WINCH_COUNT; i++) {
        DDRD |= WINCHES[i].step;
        *(WINCHES[i].direction - 1) |= WINCHES[i].mask;
        PORTC |= WINCHES[i].home | WINCHES[i].taut;
    }
#endif
#if PRESSURE_COUNT
    DDRC |= INLET;
    DDRB |= OUTLET;
    ADMUX = _BV(REFS0);  // A0 against the supply
    ADCSRA = _BV(ADEN) | _BV(ADSC) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
#endif
}

static void measure(uint16_t measured[CHANNEL_COUNT])
{
#if WINCH_COUNT
    uint8_t pins = PINC;
    for (uint8_t i = 0; i < WINCH_COUNT; i++)
        measured[i] = (pins & WINCHES[i].home ? 0 : WINCH_AT_HOME) | (pins & WINCHES[i].taut ? WINCH_IS_SLACK : 0);
#endif
#if PRESSURE_COUNT
    uint16_t found = ADC;  // of the conversion that was started 20 ms ago
    ADCSRA |= _BV(ADSC);
    measured[WINCH_COUNT] = found > PRESSURE_ZERO ? found - PRESSURE_ZERO : 0;
#endif
}

static void set_valves(const struct channel *c)
{
#if PRESSURE_COUNT
    bool rise = c->set > c->measured + DEAD_BAND, fall = !c->set || c->measured > c->set + DEAD_BAND;
    set_pin(&PORTC, INLET, rise);
    set_pin(&PORTB, OUTLET, !fall);
#else
    (void)c;
#endif
}

// A step is short against a millisecond; a winch that is late makes up for it, one step at a time.
static void make_steps(void)
{
#if WINCH_COUNT
    for (uint8_t i = 0; i < WINCH_COUNT; i++) {
        if (!steps[i])
            continue;
        bool in = steps[i] > 0;
        set_pin(WINCHES[i].direction, WINCHES[i].mask, in != !!(WINCH_REVERSED & 1 << i));
        _delay_us(1);
        set_pin(&PORTD, WINCHES[i].step, true);
        _delay_us(3);
        set_pin(&PORTD, WINCHES[i].step, false);
        steps[i] += in ? -1 : 1;
    }
#endif
}

void channel_pins_elapsed(struct channel channels[CHANNEL_COUNT], uint8_t ms)
{
    make_steps();
    elapsed += ms;
    if (elapsed < CHANNEL_PERIOD)
        return;
    elapsed -= CHANNEL_PERIOD;
    uint16_t measured[CHANNEL_COUNT];
    measure(measured);
    channels_period(channels, measured);
#if WINCH_COUNT
    for (uint8_t i = 0; i < WINCH_COUNT; i++)
        steps[i] += channels[i].motion;
#endif
    set_valves(&channels[WINCH_COUNT]);
}
#endif
