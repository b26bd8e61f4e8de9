// A simulated ATmega328P for the tests, in virtual time: bytes in and out as on a 115200 baud line, edges of the
// servo pins. Links libsimavr (GPL-3), so it is built for tests only and never shipped.
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdlib.h>
#include <string.h>

enum { FREQUENCY = 16000000, SERVOS = 6, INPUT = 1 << 16, OUTPUT = 1 << 16, EDGES = 1 << 16 };
enum { MCUSR = 0x54, PORF = 0, EXTRF = 1, MEMORY = 0x100 };
enum { TCCR1A = 0x80, UCSR0A = 0xC0, U2X0 = 2, UBRR0L = 0xC4, UBRR0H = 0xC5 };

struct edge {
    uint64_t cycle;
    uint32_t servo, high;
};

struct board {
    avr_t *avr;
    avr_uart_t *uart;
    elf_firmware_t firmware;
    avr_cycle_count_t per_byte;    // what the firmware's rate gives for ten bits
    avr_cycle_count_t line_byte;   // what the host's rate gives
    uint64_t line_free, out_free;  // when the line is free again, each way
    uint32_t in_head, in_tail, out_head, out_tail, edge_count, lost;
    uint8_t level[SERVOS];
    avr_irq_t *soft[SERVOS - 2];   // of the pins that software drives
    void (*reset_processor)(struct avr_t *);
    int was_reset;
    struct { uint8_t mask, value; } driven[4];  // pins that somebody outside drives, of ports A to D
    struct { uint64_t cycle; uint16_t value; } in[INPUT];
    struct { uint64_t cycle; uint8_t value; } out[OUTPUT];
    struct edge edges[EDGES];
};

static void add_edge(struct board *b, uint32_t servo, uint32_t value)
{
    uint8_t high = value & 1;
    if (high == b->level[servo])
        return;
    b->level[servo] = high;
    if (b->edge_count == EDGES)
        b->lost++;
    else
        b->edges[b->edge_count++] = (struct edge){b->avr->cycle, servo, high};
}

// simavr drives a compare output also when the timer overflows or is set again, as the fast PWM modes do: high if it is to
// be cleared on a match, low if it is to be set. In the normal mode, which the firmware uses, only matches count.
static void on_match(struct board *b, uint32_t servo, uint32_t value, int shift)
{
    uint8_t mode = b->avr->data[TCCR1A] >> shift & 3;
    if (mode == (value & 1 ? avr_timer_com_set : avr_timer_com_clear))
        add_edge(b, servo, value);
}

static void on_d9(struct avr_irq_t *irq, uint32_t value, void *b)
{
    (void)irq;
    on_match(b, 0, value, 6);
}

static void on_d10(struct avr_irq_t *irq, uint32_t value, void *b)
{
    (void)irq;
    on_match(b, 1, value, 4);
}

// D11, D5, D6, D7: the pins that software drives.
static void on_soft(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct board *b = param;
    uint32_t servo = 2;
    while (b->soft[servo - 2] != irq)
        servo++;
    add_edge(b, servo, value);
}

// D9 and D10 as bits of their port, of a firmware that leaves the compare outputs alone.
static void on_pin(struct board *b, uint32_t servo, uint32_t value, int shift)
{
    if (!(b->avr->data[TCCR1A] >> shift & 3))
        add_edge(b, servo, value);
}

static void on_pin_d9(struct avr_irq_t *irq, uint32_t value, void *b)
{
    (void)irq;
    on_pin(b, 0, value, 6);
}

static void on_pin_d10(struct avr_irq_t *irq, uint32_t value, void *b)
{
    (void)irq;
    on_pin(b, 1, value, 4);
}

// simavr reports a byte when the firmware writes it; it has arrived when the line has carried its ten bits.
static void on_output(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct board *b = param;
    (void)irq;
    uint64_t begin = b->avr->cycle > b->out_free ? b->avr->cycle : b->out_free;
    b->out_free = begin + b->per_byte;
    if (b->out_head - b->out_tail == OUTPUT) {
        b->lost++;
        return;
    }
    b->out[b->out_head % OUTPUT].cycle = b->out_free;
    b->out[b->out_head++ % OUTPUT].value = value;
}

static avr_cycle_count_t deliver(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct board *b = param;
    (void)when;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), b->in[b->in_tail % INPUT].value);
    b->in_tail++;
    return b->in_tail == b->in_head ? 0 : b->in[b->in_tail % INPUT].cycle;
}

static void do_not_wait(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

static avr_cycle_count_t nothing(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr;
    (void)when;
    (void)param;
    return 0;
}

static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    (void)level;
    (void)format;
    (void)arguments;
}

static void on_reset(struct avr_t *avr)
{
    struct board *b = avr->custom.data;
    if (b->reset_processor)
        b->reset_processor(avr);
    b->was_reset = 1;
    b->per_byte = 0;
    for (uint32_t i = 0; i < SERVOS; i++)
        add_edge(b, i, 0);  // all pins become inputs
}

void board_free(struct board *b)
{
    if (b->avr) {
        avr_terminate(b->avr);
        free(b->avr);
    }
    free(b->firmware.flash);
    free(b);
}

struct board *board_new(const char *elf, double host_baud)
{
    struct board *b = calloc(1, sizeof *b);
    if (!b)
        return NULL;
    avr_global_logger_set(quiet);
    if (elf_read_firmware(elf, &b->firmware) != 0 || !(b->avr = avr_make_mcu_by_name("atmega328p"))) {
        free(b);
        return NULL;
    }
    avr_init(b->avr);
    b->firmware.frequency = FREQUENCY;
    avr_load_firmware(b->avr, &b->firmware);
    b->avr->frequency = FREQUENCY;
    b->avr->custom.data = b;
    b->reset_processor = b->avr->reset;
    b->avr->reset = on_reset;
    b->avr->sleep = do_not_wait;
    b->line_byte = 10 * FREQUENCY / host_baud + 0.5;
    uint32_t flags = 0;
    avr_ioctl(b->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    for (avr_io_t *io = b->avr->io_port; io; io = io->next)
        if (!strcmp(io->kind, "uart"))
            b->uart = (avr_uart_t *)io;
    // A write to PORTB would cut the pulses of the compare outputs in the trace of the pins, so those are asked.
    avr_irq_t *timer = avr_io_getirq(b->avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_OUT_COMP);
    avr_irq_register_notify(timer, on_d9, b);
    avr_irq_register_notify(timer + 1, on_d10, b);
    avr_irq_t *port = avr_io_getirq(b->avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0);
    avr_irq_register_notify(port + 1, on_pin_d9, b);
    avr_irq_register_notify(port + 2, on_pin_d10, b);
    avr_irq_t *port_d = avr_io_getirq(b->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 0);
    avr_irq_t *soft[SERVOS - 2] = {port + 3, port_d + 5, port_d + 6, port_d + 7};
    for (uint32_t i = 0; i < SERVOS - 2; i++)
        avr_irq_register_notify(b->soft[i] = soft[i], on_soft, b);
    avr_irq_register_notify(avr_io_getirq(b->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_output, b);
    return b;
}

uint64_t board_cycle(const struct board *b)
{
    return b->avr->cycle;
}

// Cycles that ten bits take at the rate which the firmware has set.
static avr_cycle_count_t ten_bits(const uint8_t *data)
{
    return 10 * ((data[UBRR0H] << 8 | data[UBRR0L]) + 1) * (data[UCSR0A] & U2X0 ? 8 : 16);
}

// Run until a cycle; returns 0, or 1 if the processor has stopped or crashed.
int board_run(struct board *b, uint64_t until)
{
    if (until <= b->avr->cycle)
        return 0;
    // A sleeping core jumps to its next timer, so there must be one.
    avr_cycle_timer_register(b->avr, until - b->avr->cycle, nothing, b);
    while (b->avr->cycle < until) {
        int state = avr_run(b->avr);
        if (state == cpu_Done || state == cpu_Crashed)
            return 1;
        if (b->was_reset) {  // by the watchdog: simavr has forgotten its timers
            b->was_reset = 0;
            avr_cycle_timer_register(b->avr, until > b->avr->cycle ? until - b->avr->cycle : 1, nothing, b);
            if (b->in_tail != b->in_head)
                avr_cycle_timer_register(b->avr, 1, deliver, b);
        }
        // simavr counts a parity bit that is not there
        if (b->uart->cycles_per_byte != b->per_byte)
            b->uart->cycles_per_byte = b->per_byte = ten_bits(b->avr->data);
    }
    return 0;
}

// Send bytes as soon as the line is free, but not before `from`; 0x8000 in a value: its stop bit is wrong.
int board_send(struct board *b, const uint16_t *values, uint32_t count, uint64_t from)
{
    if (count > INPUT - (b->in_head - b->in_tail))
        return 1;
    int idle = b->in_head == b->in_tail;
    for (uint32_t i = 0; i < count; i++) {
        if (b->line_free < from)
            b->line_free = from;
        b->in[b->in_head % INPUT].cycle = b->line_free;
        b->in[b->in_head++ % INPUT].value = values[i];
        b->line_free += b->line_byte;
    }
    if (count && idle) {
        uint64_t first = b->in[b->in_tail % INPUT].cycle, now = b->avr->cycle;
        avr_cycle_timer_register(b->avr, first > now ? first - now : 1, deliver, b);
    }
    return 0;
}

// Bytes not yet sent are taken back, as when the host dies.
void board_cut(struct board *b)
{
    avr_cycle_timer_cancel(b->avr, deliver, b);
    b->in_tail = b->in_head;
    b->line_free = 0;
}

// Take the bytes that have arrived at the host, each with the cycle of its arrival.
uint32_t board_receive(struct board *b, uint8_t *values, uint64_t *cycles, uint32_t room)
{
    uint32_t n = 0;
    while (n < room && b->out_tail != b->out_head && b->out[b->out_tail % OUTPUT].cycle <= b->avr->cycle) {
        values[n] = b->out[b->out_tail % OUTPUT].value;
        cycles[n++] = b->out[b->out_tail++ % OUTPUT].cycle;
    }
    return n;
}

// When the next byte on its way to the host arrives; 0 if none is.
uint64_t board_next_arrival(const struct board *b)
{
    return b->out_tail == b->out_head ? 0 : b->out[b->out_tail % OUTPUT].cycle;
}

uint32_t board_edges(struct board *b, struct edge *edges)
{
    uint32_t n = b->edge_count;
    memcpy(edges, b->edges, n * sizeof *edges);
    b->edge_count = 0;
    return n;
}

uint32_t board_lost(const struct board *b)
{
    return b->lost;
}

// Reset by the button; the memory keeps what it has.
void board_reset(struct board *b)
{
    board_cut(b);
    avr_reset(b->avr);
    b->avr->state = cpu_Running;
    b->avr->data[MCUSR] = 1 << EXTRF;
    b->was_reset = 0;
}

// Switched on: the memory has anything in it.
void board_power(struct board *b, uint32_t seed)
{
    board_reset(b);
    b->avr->data[MCUSR] = 1 << PORF;
    for (uint32_t i = MEMORY; i <= b->avr->ramend; i++)
        b->avr->data[i] = (seed = seed * 1664525 + 1013904223) >> 24;
}

uint16_t board_word(const struct board *b, uint32_t address)
{
    return b->avr->flash[address] | b->avr->flash[address + 1] << 8;
}

// Change an instruction.
void board_set_word(struct board *b, uint32_t address, uint16_t word)
{
    b->avr->flash[address] = word & 0xFF;
    b->avr->flash[address + 1] = word >> 8;
}

uint8_t board_memory(const struct board *b, uint16_t address)
{
    return b->avr->data[address];
}

void board_set_memory(struct board *b, uint16_t address, uint8_t value)
{
    b->avr->data[address] = value;
}

void board_set_pin(struct board *b, char port, int pin, int high)
{
    // A write to the port's register brings this level back, not that of the pull-up.
    uint8_t *mask = &b->driven[port - 'A'].mask, *value = &b->driven[port - 'A'].value;
    *mask |= 1 << pin;
    *value = (*value & ~(1 << pin)) | high << pin;
    avr_ioport_external_t level = {.name = port, .mask = *mask, .value = *value};
    avr_ioctl(b->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &level);
    avr_raise_irq(avr_io_getirq(b->avr, AVR_IOCTL_IOPORT_GETIRQ(port), pin), high);
}
