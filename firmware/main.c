// Firmware of the Tripod's board, ATmega328P at 16 MHz (Arduino Uno, Nano): docs/protocol.md.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "channel_pins.h"
#include "clock.h"
#include "imu.h"
#include "protocol.h"
#include "reset.h"
#include "servo.h"
#include "uart.h"

static struct protocol protocol;

static void send(const uint8_t *data, uint8_t length)
{
    if (!uart_send(data, length))
        protocol_lost_output(&protocol);
}

static void receive(void)
{
    uint8_t byte, reply[FRAME_MAX];
    if (uart_lost())
        protocol_lost_input(&protocol);
    while (uart_receive(&byte)) {
        uint8_t length = protocol_receive(&protocol, byte, reply);
        if (length)
            send(reply, length);
    }
}

#ifdef IMU_BAUD
static void pass_imu_line(void)
{
    char text[TEXT_MAX];
    uint8_t frame[FRAME_MAX], length = imu_line(text);
    if (length)
        send(frame, protocol_imu_line(&protocol, text, length, frame));
}
#endif

int main(void)
{
    uint16_t pulses[SERVO_COUNT];
    uint8_t cause = reset_begin(pulses);
    protocol_init(&protocol, cause, pulses);
    servo_init();
    clock_init();
    uart_init();
#ifdef IMU_BAUD
    imu_init();
#endif
#if HAS_CHANNELS
    channel_pins_init();
#endif
    set_sleep_mode(SLEEP_MODE_IDLE);
    wdt_enable(WDTO_250MS);  // a board whose loop stops is reset, which ends the pulses
    sei();
    for (;;) {
        wdt_reset();
        if (servo_period(pulses)) {
            protocol_period(&protocol, pulses);
            reset_keep(pulses);
        }
        receive();
#if HAS_CHANNELS
        uint8_t passed = clock_elapsed();
        for (uint8_t ms = passed; ms; ms--)
            protocol_tick(&protocol);
        if (passed)
            channel_pins_elapsed(protocol.channels, passed);
#else
        for (uint8_t ms = clock_elapsed(); ms; ms--)
            protocol_tick(&protocol);
#endif
#ifdef IMU_BAUD
        pass_imu_line();
#endif
        servo_set(protocol_emits_pulses(&protocol), protocol.pulses);
        cli();
        if (!uart_waiting()) {
            sleep_enable();
            sei();  // takes effect after the next instruction: no interrupt comes in between
            sleep_cpu();
            sleep_disable();
        }
        sei();
    }
}
