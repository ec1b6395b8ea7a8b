#include "verification/chain/target/draw.h"

#ifndef TDC_FIXED_H

#include <string.h>

#define QUIET_NAN 0x7FC00000u
#define INFINITY_BITS 0x7F800000u

static float float_of(const uint32_t bits)
{
    float value;
    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

/* Floats whose exponent field lies in [first, first + span); 0 is that of the subnormals. */
typedef struct {
    uint32_t first, span;
} binades;

static const binades EVERY_FINITE = {0u, 255u};

static uint32_t bits_in(generator *const g, const binades range)
{
    const uint32_t word = draw_word(g);
    const uint32_t field = range.first + ((((word >> 23u) & 0xFFu) * range.span) >> 8u);
    return (word & (SIGN_BIT | 0x7FFFFFu)) | (field << 23u);
}

static float signed_in(generator *const g, const binades range)
{
    return float_of(bits_in(g, range));
}

static float positive_in(generator *const g, const binades range)
{
    return float_of((bits_in(g, range) & ~SIGN_BIT) | 1u);
}

/* [2^-4, 2), [1, 2^6) and so on; 127 is the exponent field of 1. */
typedef struct {
    binades inertia, gain, torque_limit, velocity, acceleration, torque;
    uint32_t moves_from; /* the largest change of the displacement is below 2^(31 - this) */
} ranges;

static const ranges RANGES[3] = {
    [RIG] = {{123u, 5u}, {127u, 7u}, {133u, 6u}, {101u, 24u}, {113u, 16u}, {117u, 13u}, 30u},
    [WIDE] = {{107u, 40u}, {107u, 40u}, {127u, 60u}, {77u, 70u}, {97u, 60u}, {97u, 60u}, 12u},
    [EXTREME] = {{0u, 255u}, {0u, 255u}, {0u, 255u}, {0u, 255u}, {0u, 255u}, {0u, 255u}, 0u},
};

/* a - 1 in Q31 above -1: anywhere, at the ends, or near 0, 1/2, 1 and 3/2. */
static int32_t draw_exponent(generator *const g)
{
    uint32_t word = draw_word(g);
    const uint32_t kind = draw_word(g) >> 29u;
    if (kind < 2u) {
        word = (word & 1u) + 0x7FFFFFFEu;
    } else if (kind < 4u) {
        word = (word & 0xC0000000u) | (word & 7u);
    } else {
        /* as it is */
    }
    return tdc_signed((word == SIGN_BIT) ? (SIGN_BIT + 1u) : word);
}

static float draw_gain(generator *const g, const binades range)
{
    return draw_once_in(g, 16u) ? 0.0f : positive_in(g, range);
}

regime draw_config(generator *const g, controller_config *const config)
{
    *config = controller_default_config;
    config->on_error = (draw_word(g) >> 13u) & 1u;
    config->anti_windup = (draw_word(g) >> 17u) & 1u;
    if (draw_once_in(g, 4u)) {
        config->max_lost_ticks = 1u + (draw_word(g) >> 30u);
    }
    const regime far = draw_regime(g);
    if ((far == RIG) && draw_once_in(g, 2u)) {
        return far; /* the gains as they ship */
    }
    const ranges *const range = &RANGES[far];
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        config->joint[j].inertia_kgm2 = positive_in(g, range->inertia);
        config->joint[j].kd = draw_gain(g, range->gain);
        config->joint[j].kp = draw_gain(g, range->gain);
        config->joint[j].lambda = draw_gain(g, range->gain);
        config->joint[j].torque_limit_Nm = positive_in(g, range->torque_limit);
        if (far != RIG) {
            config->joint[j].max_displacement = (int32_t)((draw_word(g) >> 3u) + 0x20000000u);
            config->joint[j].max_displacement_change =
                (int32_t)((draw_word(g) >> 3u) + 0x20000000u);
        }
        if (draw_once_in(g, 2u)) {
            config->joint[j].alpha.minus_one_q31 = draw_exponent(g);
            config->joint[j].beta.minus_one_q31 = draw_exponent(g);
            config->joint[j].gamma.minus_one_q31 = draw_exponent(g);
        }
    }
    return far;
}

static uint32_t draw_displacement(generator *const g, step_case *const step, const uint32_t j,
                                  const ranges *const range)
{
    if (step->state.phase == TDC_PHASE_START) {
        /* From standstill to full speed: the first tick takes no second difference of it. */
        return draw_integer_below(g, (range->moves_from > 22u) ? 22u : range->moves_from);
    }
    return (uint32_t)step_last_memory(&step->state, j)->displacement +
           draw_integer_below(g, range->moves_from);
}

void draw_holding_torque(generator *const g, controller_number torque[JOINTS])
{
    const binades torques = draw_once_in(g, 8u) ? EVERY_FINITE : RANGES[RIG].torque;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        torque[j] = signed_in(g, torques);
    }
}

void draw_input(generator *const g, const regime far, step_case *const step)
{
    const ranges *const range = &RANGES[far];
    /* An even motion leaves s near zero, where sig(s)^gamma is steepest. */
    bool even = false;
    if (far == RIG) {
        even = draw_once_in(g, 2u);
    }
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_input *const input = &step->input;
        const controller_joint_state *const last = step_last_memory(&step->state, j);
        const uint32_t moved =
            even ? (uint32_t)last->displacement : draw_displacement(g, step, j, range);
        const uint32_t counts = (uint32_t)step_latest_counts(&step->state, j) + moved;
        const uint32_t error = draw_integer_below(g, (far == RIG) ? 17u : 0u);
        input->counts[j] = tdc_signed(counts);
        input->reference_position_q8[j] = tdc_signed((counts * 256u) + error);
        if (!even) {
            input->reference_velocity_rad_per_s[j] = signed_in(g, range->velocity);
        }
        input->reference_acceleration_rad_per_s2[j] = signed_in(g, range->acceleration);
    }
}

/* But no NaN: neither init nor step ever lets one in. */
void draw_memory(generator *const g, const regime far, step_case *const step)
{
    const ranges *const range = &RANGES[far];
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_joint_state *const last = step_last_memory(&step->state, j);
        last->sliding_integral_rad_per_s = signed_in(g, range->velocity);
        last->applied_torque_Nm = signed_in(g, range->torque);
    }
    step->state.saturated_joints = draw_word(g);
}

void draw_bad_input(generator *const g, controller_input *const input)
{
    static const uint32_t not_finite[4] = {
        QUIET_NAN,
        INFINITY_BITS,
        SIGN_BIT | INFINITY_BITS,
        0x7F7FFFFFu,
    };
    const float value = float_of(not_finite[draw_word(g) >> 30u]);
    const uint32_t j = (draw_word(g) >> 5u) % JOINTS;
    if (draw_once_in(g, 2u)) {
        input->reference_velocity_rad_per_s[j] = value;
    } else {
        input->reference_acceleration_rad_per_s2[j] = value;
    }
}

#endif
