#include "verification/chain/target/draw.h"

static uint32_t rotated(const uint32_t x, const uint32_t by)
{
    return (x << by) | (x >> (32u - by));
}

uint32_t draw_word(generator *const g)
{
    const uint32_t e = g->a - rotated(g->b, 27u);
    g->a = g->b ^ rotated(g->c, 17u);
    g->b = g->c + g->d;
    g->c = g->d + e;
    g->d = e + g->a;
    return g->d;
}

generator draw_seeded(const uint32_t seed)
{
    generator g = {0xF1EA5EEDu, seed, seed, seed};
    for (uint32_t i = 0u; i < 20u; ++i) {
        (void)draw_word(&g);
    }
    return g;
}

bool draw_once_in(generator *const g, const uint32_t times)
{
    return (draw_word(g) >> 7u & (times - 1u)) == 0u;
}

uint32_t draw_integer_below(generator *const g, const uint32_t from)
{
    const uint32_t word = draw_word(g);
    const uint32_t shift = from + ((draw_word(g) >> 9u) % (32u - from));
    const uint32_t magnitude = (word >> 1u) >> shift;
    return ((word & 1u) != 0u) ? (0u - magnitude) : magnitude;
}

regime draw_regime(generator *const g)
{
    static const regime each[8] = {RIG, RIG, RIG, RIG, WIDE, WIDE, WIDE, EXTREME};
    return each[(draw_word(g) >> 11u) & 7u];
}
