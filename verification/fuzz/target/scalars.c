#include "verification/fuzz/target/scalars.h"

#include <math.h>
#include <string.h>

/* NOLINTBEGIN(readability-implicit-bool-conversion): what && and || give is a truth value. */

uint64_t scalar_bits(const void *const structure, const scalar *const s)
{
    uint64_t wide = 0u;
    uint32_t narrow = 0u;
    const unsigned char *const place = (const unsigned char *)structure + s->offset;
    if (s->type == SCALAR_DOUBLE) {
        (void)memcpy(&wide, place, sizeof wide);
        return wide;
    }
    (void)memcpy(&narrow, place, sizeof narrow);
    return narrow;
}

void scalar_set_bits(void *const structure, const scalar *const s, const uint64_t bits)
{
    unsigned char *const place = (unsigned char *)structure + s->offset;
    if (s->type == SCALAR_DOUBLE) {
        (void)memcpy(place, &bits, sizeof bits);
    } else {
        const uint32_t narrow = (uint32_t)(bits & 0xFFFFFFFFu);
        (void)memcpy(place, &narrow, sizeof narrow);
    }
}

bool scalar_is_real(const scalar_type type)
{
    return (type == SCALAR_FLOAT) || (type == SCALAR_DOUBLE);
}

double scalar_real(const uint64_t bits, const scalar_type type)
{
    double wide;
    float narrow;
    const uint32_t low = (uint32_t)(bits & 0xFFFFFFFFu);
    if (type == SCALAR_DOUBLE) {
        (void)memcpy(&wide, &bits, sizeof wide);
        return wide;
    }
    (void)memcpy(&narrow, &low, sizeof narrow);
    return (double)narrow;
}

real_format scalar_format(const scalar_type type)
{
    static const real_format formats[2] = {
        {23u, 0xFFu, UINT64_C(1) << 31u},
        {52u, 0x7FFu, UINT64_C(1) << 63u},
    };
    return formats[(type == SCALAR_DOUBLE) ? 1 : 0];
}

bool scalar_rule_holds(const scalar *const s, const uint64_t bits)
{
    const double real = scalar_is_real(s->type) ? scalar_real(bits, s->type) : 0.0;
    const int32_t integer = tdc_signed((uint32_t)(bits & 0xFFFFFFFFu));
    switch (s->rule) {
    case RULE_POSITIVE:
        return isfinite(real) && (real > 0.0);
    case RULE_NOT_NEGATIVE:
        return isfinite(real) && (real >= 0.0);
    case RULE_RATIO:
        return (real > 0.0) && (real <= 1.0);
    case RULE_ABOVE_MINUS_1:
        return integer != INT32_MIN;
    case RULE_DISPLACEMENT:
        return (integer >= 1) && (integer < 0x40000000);
    case RULE_LOST_TICKS:
        return (bits >= 1u) && (bits <= most_lost_ticks);
    case RULE_SWITCH:
        return bits <= 1u;
    case RULE_ON_ERROR:
        return (bits == TDC_HOLD_TORQUE) || (bits == TDC_ZERO_TORQUE);
    case RULE_IDENTITY:
        return bits == scalar_bits(&controller_default_config, s);
    case RULE_ANY:
    case RULE_ELSEWHERE:
    default:
        return true;
    }
}

static uint64_t special_real(const scalar_type type, const uint32_t i)
{
    const real_format format = scalar_format(type);
    const uint64_t step = UINT64_C(1) << format.mantissa_bits;
    const uint64_t infinity = format.exponent_ones * step;
    const uint64_t one = (format.exponent_ones >> 1u) * step;
    const uint64_t each[SPECIALS / 2u] = {
        0u,
        1u,
        step - 1u,
        step,
        step + 1u,
        one - 1u,
        one,
        one + 1u,
        one + step,
        infinity - 1u,
        infinity,
        infinity + 1u,
        infinity | (step >> 1u),
        infinity | (step - 1u),
    };
    return each[(i / 2u) % (SPECIALS / 2u)] | (((i % 2u) != 0u) ? format.sign : 0u);
}

static uint64_t special_integer(const uint32_t i)
{
    static const uint32_t each[SPECIALS / 2u] = {
        0u,       1u,          2u,          3u,          0xFFu,       0x100u,      0xFFFFu,
        0x10000u, 0x3FFFFFFFu, 0x40000000u, 0x40000001u, 0x7FFFFFFEu, 0x7FFFFFFFu, 0x80000000u,
    };
    const uint32_t magnitude = each[(i / 2u) % (SPECIALS / 2u)];
    return ((i % 2u) != 0u) ? (0u - magnitude) : magnitude;
}

uint64_t scalar_special(const scalar_type type, const uint32_t i)
{
    return scalar_is_real(type) ? special_real(type, i) : special_integer(i);
}
/* NOLINTEND(readability-implicit-bool-conversion) */
