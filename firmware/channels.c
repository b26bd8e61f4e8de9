#include "channels.h"

#include <string.h>

void channels_init(struct channel channels[CHANNEL_COUNT])
{
    memset(channels, 0, CHANNEL_COUNT * sizeof *channels);
    for (int i = WINCH_COUNT; i < CHANNEL_COUNT; i++)
        channels[i].flags = CHANNEL_KNOWN;
}

void channel_home(struct channel *c)
{
    if (c->flags & CHANNEL_HOMING)
        return;
    c->flags = CHANNEL_HOMING;
    c->set = HOMING_LIMIT;
    c->target = 0;
}

void channel_set(struct channel *c, uint16_t target)
{
    if (target < c->set) {
        c->flags &= ~(CHANNEL_SLACK | CHANNEL_LEAK);
        c->low_for = 0;
    }
    c->target = target;
}

void channels_hold(struct channel channels[CHANNEL_COUNT])
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (!(channels[i].flags & CHANNEL_KNOWN))
            channels[i].set = 0;
        channels[i].target = channels[i].set;
        channels[i].flags &= ~CHANNEL_HOMING;
    }
}

void channels_vent(struct channel channels[CHANNEL_COUNT])
{
    channels_hold(channels);
    for (int i = WINCH_COUNT; i < CHANNEL_COUNT; i++)
        channels[i].set = channels[i].target = 0;
}

static uint16_t nearer(uint16_t from, uint16_t to, uint16_t slew)
{
    if (to > from + slew)
        return from + slew;
    if (from > to + slew)
        return from - slew;
    return to;
}

static void home(struct channel *c)
{
    if (c->measured & WINCH_AT_HOME) {
        c->set = c->target = 0;
        c->flags = CHANNEL_KNOWN;
    } else if (c->set < HOMING_SLEW) {
        c->set = c->target = 0;
        c->flags = CHANNEL_HOME_FAILED;
    } else {
        c->set -= HOMING_SLEW;
        c->motion = -HOMING_SLEW;
    }
}

void channels_period(struct channel channels[CHANNEL_COUNT], const uint16_t measured[CHANNEL_COUNT])
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        struct channel *c = &channels[i];
        uint16_t before = c->set;
        c->measured = measured[i];
        c->motion = 0;
        if (c->flags & CHANNEL_HOMING) {
            home(c);
            continue;
        }
        if (!(c->flags & CHANNEL_KNOWN))
            continue;
        if (channel_kind(i) == CHANNEL_WINCH) {
            if (c->measured & WINCH_IS_SLACK && c->target > c->set)
                c->flags |= CHANNEL_SLACK;
        } else if (c->set > c->measured + LEAK_MARGIN) {
            c->low_for += CHANNEL_PERIOD;
            if (c->low_for > LEAK_MS) {
                c->low_for = LEAK_MS;
                c->flags |= CHANNEL_LEAK;
            }
        } else {
            c->low_for = 0;
        }
        if (c->flags & (CHANNEL_SLACK | CHANNEL_LEAK) && c->target > c->set)
            c->target = c->set;
        c->set = nearer(c->set, c->target, channel_slew(i));
        if (channel_kind(i) == CHANNEL_WINCH)
            c->motion = (int8_t)((int16_t)c->set - (int16_t)before);
    }
}
