#include "reset.h"

#include <avr/io.h>
#include <avr/wdt.h>
#include <string.h>

#include "clock.h"
#include "frame.h"

// The memory keeps its content through a reset unless the supply failed; neither the start-up code nor a boot loader
// touches this part of it (Makefile).
#define KEPT __attribute__((section(".noinit")))

static uint8_t flags KEPT;
static struct {
    uint16_t pulses[SERVO_COUNT];
    uint16_t crc;
} kept KEPT;

// Before anything else, as the watchdog runs on after it has reset the board, at its shortest time of 16 ms, and cannot be
// switched off while its flag is set.
__attribute__((naked, used, section(".init3"))) static void stop_watchdog(void)
{
    flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

static uint16_t crc_of_kept(void)
{
    const uint8_t *bytes = (const uint8_t *)kept.pulses;
    uint16_t crc = 0xFFFF;
    for (uint8_t i = 0; i < sizeof kept.pulses; i++)
        crc = crc16(crc, bytes[i]);
    return crc;
}

uint8_t reset_begin(uint16_t pulses[SERVO_COUNT])
{
    uint8_t cause = flags & (RESET_POWER_ON | RESET_EXTERNAL | RESET_BROWN_OUT | RESET_WATCHDOG);
    bool sound = !(cause & RESET_POWER_ON) && kept.crc == crc_of_kept();
    if (cause == 0 && sound && clock_was_late())
        cause = RESET_WATCHDOG;  // a boot loader has cleared the flags, but the main loop had stopped
    for (uint8_t i = 0; i < SERVO_COUNT; i++) {
        uint16_t pulse = kept.pulses[i];
        pulses[i] = sound && pulse >= PULSE_MIN && pulse <= PULSE_MAX ? pulse : 0;
    }
    reset_keep(pulses);
    return cause;
}

void reset_keep(const uint16_t pulses[SERVO_COUNT])
{
    memcpy(kept.pulses, pulses, sizeof kept.pulses);
    kept.crc = crc_of_kept();
}
