#include "verification/chain/target/draw.h"

#ifdef TDC_FIXED_H

/* Where the integral part of the sliding variable stops. */
#define SLIDING_INTEGRAL_BITS 30u

/* The largest displacement that any gains take [count], and that motion. */
#define MOST_COUNTS ((uint32_t)CONTROLLER_PASTE(TDC_, CONTROLLER_UPPER, _MAX_DISPLACEMENT))
#define MOST_MOTION (MOST_COUNTS * (uint32_t)MOTION_UNITS)

/* From 0 to the largest of an integer, all powers of two alike. */
static uint32_t magnitude_up_to(generator *const g, const uint32_t largest)
{
    const uint32_t word = draw_word(g);
    const uint32_t shift = draw_word(g) >> 27u;
    return (word >> shift) % (largest + 1u);
}

/* Of either sign. */
static int32_t signed_up_to(generator *const g, const uint32_t largest)
{
    const uint32_t magnitude = magnitude_up_to(g, largest);
    return draw_once_in(g, 2u) ? tdc_signed(0u - magnitude) : tdc_signed(magnitude);
}

/* --- Gains ----------------------------------------------------------------------------------- */

/* How many bits the drawn numbers lose, so that they stay near the shipped ones. */
static const uint32_t SCALE_BITS_LOST[3] = {[RIG] = 8u, [WIDE] = 5u, [EXTREME] = 0u};

static uint32_t draw_exponent(generator *const g, const uint32_t shipped)
{
    static const uint32_t special[4] = {1u, 0x3FFFFFFFu, 0x80000000u, 0xFFFFFFFFu};
    const uint32_t kind = draw_word(g) >> 29u;
    uint32_t exponent = shipped;
    if (kind < 2u) {
        exponent = special[draw_word(g) >> 30u];
    } else if (kind < 5u) {
        exponent = draw_word(g) | 1u;
    } else {
        /* as it ships */
    }
    return exponent;
}

static void draw_power(generator *const g, const regime far, tdc_fixed_power *const power)
{
    const uint32_t lost = SCALE_BITS_LOST[far];
    power->exponent_q31 = draw_exponent(g, power->exponent_q31);
    power->scale_q24 =
        tdc_signed((uint32_t)power->scale_q24 + draw_integer_below(g, (lost > 0u) ? lost : 1u));
    if (draw_once_in(g, 16u)) {
        power->scale_q24 = TDC_FIXED_ZERO_GAIN;
    }
}

static void draw_joint(generator *const g, const regime far, controller_joint_config *const gains)
{
    draw_power(g, far, &gains->damping);
    draw_power(g, far, &gains->stiffness);
    draw_power(g, far, &gains->correction);
    if (draw_once_in(g, 16u)) {
        gains->correction.exponent_q31 = 0u; /* sliding mode, sgn(s) */
    }
    if (far != RIG) {
        gains->inertia_factor = signed_up_to(g, (uint32_t)INT32_MAX);
        gains->torque_limit_q = tdc_signed(1u + magnitude_up_to(g, (uint32_t)INT32_MAX - 1u));
        gains->max_displacement = tdc_signed(1u + magnitude_up_to(g, MOST_COUNTS - 1u));
        gains->max_displacement_change =
            tdc_signed(1u + magnitude_up_to(g, (2u * MOST_COUNTS) - 1u));
    }
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
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        /* A step trusts the rules of its gains: of those that keep them, the first one. */
        const controller_joint_config shipped = config->joint[j];
        bool good = false;
        for (uint32_t attempts = 0u; !good && (attempts < 8u); ++attempts) {
            config->joint[j] = shipped;
            draw_joint(g, far, &config->joint[j]);
            good = controller_check_config(config) == TDC_OK;
        }
        if (!good) {
            config->joint[j] = shipped;
        }
    }
    return far;
}

void draw_holding_torque(generator *const g, controller_number torque[JOINTS])
{
    const bool anywhere = draw_once_in(g, 8u);
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        const uint32_t largest = (uint32_t)controller_default_config.joint[j].torque_limit_q;
        torque[j] = signed_up_to(g, anywhere ? (uint32_t)INT32_MAX : largest);
    }
}

/* --- Signals --------------------------------------------------------------------------------- */

/* Mostly one that the gains take: further is an error of the whole step. */
static int32_t draw_displacement(generator *const g, const regime far, const step_case *const step,
                                 const controller_joint_state *const last, const uint32_t j)
{
    const int32_t most = step->config.joint[j].max_displacement;
    if (draw_once_in(g, 64u)) {
        return tdc_signed(draw_integer_below(g, 0u));
    }
    if ((far == RIG) && (step->state.phase != TDC_PHASE_START)) {
        const int32_t moved = last->displacement + signed_up_to(g, 3u);
        return tdc_greater(-most, tdc_lesser(most, moved));
    }
    return signed_up_to(g, (uint32_t)most);
}

static int32_t draw_motion(generator *const g, const step_case *const step, const uint32_t j)
{
    const int32_t most = step->config.joint[j].max_displacement;
    return signed_up_to(g, (uint32_t)most * (uint32_t)MOTION_UNITS);
}

void draw_input(generator *const g, const regime far, step_case *const step)
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_input *const input = &step->input;
        const controller_joint_state *const last = step_last_memory(&step->state, j);
        const int32_t moved = draw_displacement(g, far, step, last, j);
        const int32_t most = step->config.joint[j].max_displacement;
        const uint32_t counts = (uint32_t)step_latest_counts(&step->state, j) + (uint32_t)moved;
        const uint32_t error = draw_integer_below(g, (far == RIG) ? 17u : 0u);
        input->counts[j] = tdc_signed(counts);
        input->reference_position_q8[j] = tdc_signed((counts * 256u) + error);
        input->reference_velocity_q[j] = draw_motion(g, step, j);
        if ((far == RIG) && (moved > -most) && (moved < most)) {
            /* Near the robot's own: s is small then, where sig(s)^gamma is steepest. */
            input->reference_velocity_q[j] =
                (moved * MOTION_UNITS) + signed_up_to(g, (uint32_t)MOTION_UNITS);
        }
        input->reference_acceleration_q[j] =
            (far == RIG) ? signed_up_to(g, (uint32_t)most * (uint32_t)(MOTION_UNITS / 64))
                         : draw_motion(g, step, j);
    }
}

void draw_memory(generator *const g, const regime far, step_case *const step)
{
    (void)far;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_joint_state *const last = step_last_memory(&step->state, j);
        last->sliding_integral_q = signed_up_to(g, (UINT32_C(1) << SLIDING_INTEGRAL_BITS) - 1u);
        last->applied_torque_q = signed_up_to(g, (uint32_t)step->config.joint[j].torque_limit_q);
    }
    step->state.saturated_joints = draw_word(g);
}

void draw_bad_input(generator *const g, controller_input *const input)
{
    const uint32_t beyond = MOST_MOTION + 1u + magnitude_up_to(g, SIGN_BIT - MOST_MOTION - 1u);
    const int32_t value = tdc_signed(draw_once_in(g, 2u) ? beyond : (0u - beyond));
    const uint32_t j = (draw_word(g) >> 5u) % JOINTS;
    if (draw_once_in(g, 2u)) {
        input->reference_velocity_q[j] = value;
    } else {
        input->reference_acceleration_q[j] = value;
    }
}

#endif
