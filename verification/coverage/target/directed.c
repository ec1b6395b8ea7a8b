/*
 * Directed tests of a generated controller through its header: together they take every branch, and
 * show of every condition in every decision that it alone can change the outcome. They are run on
 * C that counts both; what they miss, `python -m verification coverage` names by its line.
 *
 * A test here is a case of the contract, not a number of the law: that has its own checks.
 */

#include <stdio.h>
#include <string.h>

#include "firmware_stub/controller.h"
#include "verification/fuzz/target/scalars.h"

/* --- What every test uses ---------------------------------------------------------------------- */

static uint32_t checks;
static uint32_t failures;

#define CHECK(holds) check((holds) ? 1u : 0u, __LINE__, #holds)

static void check(const uint32_t holds, const int line, const char *const says)
{
    ++checks;
    if (holds == 0u) {
        ++failures;
        (void)fprintf(stderr, "directed.c:%d: %s\n", line, says);
    }
}

#ifdef TDC_FIXED_H
#define FIXED 1
#define APPLIED_TORQUE applied_torque_q
#define REFUSED TDC_OUT_OF_RANGE
#define REFUSED_NUMBER INT32_MIN
#else
#define FIXED 0
#define APPLIED_TORQUE applied_torque_Nm
#define REFUSED TDC_NOT_FINITE
#define REFUSED_NUMBER ((controller_number)NAN_OF_ZERO)
#endif

static volatile const float zero = 0.0f;
#define NAN_OF_ZERO (zero / zero)

/* A controller between its arguments. */
typedef struct {
    controller_config config;
    controller_state state;
    controller_input input;
    int32_t counts[JOINTS];
    controller_number holding[JOINTS];
    controller_number torque[JOINTS];
} bench;

/* Initialised at standstill without torque; after `ticks` good ticks there. */
static bench standing(const uint32_t ticks)
{
    bench b;
    (void)memset(&b, 0, sizeof b);
    b.config = controller_default_config;
    CHECK(controller_init(&b.config, &b.state, b.counts, b.holding) == TDC_OK);
    for (uint32_t i = 0u; i < ticks; ++i) {
        CHECK(controller_step(&b.config, &b.state, &b.input, b.torque) == TDC_OK);
    }
    return b;
}

static tdc_status tick(bench *const b)
{
    return controller_step(&b->config, &b->state, &b->input, b->torque);
}

static uint32_t has_torques(const bench *const b, const controller_number torque)
{
    uint32_t all = 1u;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        all &= ((b->torque[j] >= torque) && (b->torque[j] <= torque)) ? 1u : 0u;
    }
    return all;
}

/* An acceleration that a limit of a tenth of the default cuts, in every controller. */
static void demand(bench *const b, const uint32_t j, const int32_t sign)
{
#if FIXED
    b->config.joint[j].torque_limit_q = b->config.joint[j].torque_limit_q / 10;
    b->input.reference_acceleration_q[j] =
        sign * (b->config.joint[j].max_displacement / 2) * MOTION_UNITS;
#else
    b->config.joint[j].torque_limit_Nm = b->config.joint[j].torque_limit_Nm / 10;
    b->input.reference_acceleration_rad_per_s2[j] = (controller_number)(sign * 100000);
#endif
}

/* --- Arguments and memory ---------------------------------------------------------------------- */

static void steps_without_arguments(void)
{
    for (uint32_t missing = 1u; missing < 16u; ++missing) {
        bench b = standing(missing % 3u);
        const controller_state before = b.state;
        const tdc_status status = controller_step(
            ((missing & 1u) != 0u) ? NULL : &b.config, ((missing & 2u) != 0u) ? NULL : &b.state,
            ((missing & 4u) != 0u) ? NULL : &b.input, ((missing & 8u) != 0u) ? NULL : b.torque);
        CHECK(status == TDC_BAD_ARGUMENT);
        CHECK(((missing & 8u) != 0u) || (has_torques(&b, (controller_number)0) != 0u));
        CHECK(before.phase == b.state.phase);
    }
}

static void steps_of_memory_that_nobody_filled(void)
{
    const uint32_t phases[] = {0u, TDC_PHASE_START - 1u, first_phase - 1u, last_phase + 1u, ~0u};
    for (uint32_t i = 0u; i < (sizeof phases / sizeof phases[0]); ++i) {
        bench b = standing(1u);
        b.state.phase = phases[i];
        b.torque[0] = (controller_number)1;
        CHECK(tick(&b) == TDC_NOT_INITIALISED);
        CHECK(has_torques(&b, (controller_number)0) != 0u);
        CHECK(b.state.phase == phases[i]);
    }
}

static void starts(void)
{
    for (uint32_t missing = 1u; missing < 16u; ++missing) {
        bench b = standing(1u);
        const uint32_t phase = b.state.phase;
        const tdc_status status = controller_init(
            ((missing & 1u) != 0u) ? NULL : &b.config, ((missing & 2u) != 0u) ? NULL : &b.state,
            ((missing & 4u) != 0u) ? NULL : b.counts, ((missing & 8u) != 0u) ? NULL : b.holding);
        CHECK(status == TDC_BAD_ARGUMENT);
        CHECK(b.state.phase == phase);
    }
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        bench b = standing(1u);
        const uint32_t phase = b.state.phase;
        b.holding[j] = REFUSED_NUMBER;
        CHECK(controller_init(&b.config, &b.state, b.counts, b.holding) == REFUSED);
        b.holding[j] = (controller_number)0;
        b.config.specification ^= 1u;
        CHECK(controller_init(&b.config, &b.state, b.counts, b.holding) == TDC_BAD_CONFIG);
        CHECK(b.state.phase == phase);
    }
}

/* --- Configurations ---------------------------------------------------------------------------- */

static void configurations(void)
{
    CHECK(controller_check_config(NULL) == TDC_BAD_ARGUMENT);
    CHECK(controller_check_config(&controller_default_config) == TDC_OK);
    for (size_t i = 0u; i < config_table.count; ++i) {
        const scalar *const s = &config_table.scalars[i];
        for (uint32_t special = 0u; special < SPECIALS; ++special) {
            controller_config config = controller_default_config;
            const uint64_t bits = scalar_special(s->type, special);
            scalar_set_bits(&config, s, bits);
            const tdc_status status = controller_check_config(&config);
            const tdc_status wanted = scalar_rule_holds(s, bits) ? TDC_OK : TDC_BAD_CONFIG;
            if ((s->rule == RULE_ELSEWHERE) || (s->rule == RULE_ANY)) {
                /* The tables know of nothing against it; a rule about several numbers may be. */
                CHECK((status == TDC_OK) || (status == TDC_BAD_CONFIG));
            } else {
                CHECK(status == wanted);
            }
        }
    }
}

/* --- Ticks ------------------------------------------------------------------------------------- */

static void torques_are_limited(void)
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        for (int32_t sign = -1; sign <= 1; sign += 2) {
            bench b = standing(j % 2u);
            demand(&b, j, sign);
            const controller_number limit = b.config.joint[j].TORQUE_LIMIT;
            CHECK(tick(&b) == TDC_SATURATED);
            CHECK((b.torque[j] * (controller_number)sign) >= limit);
            CHECK((b.torque[j] * (controller_number)sign) <= limit);
            CHECK(b.state.saturated_joints == ((uint32_t)1u << j));
        }
    }
}

/* The memory of the last good tick is where it was, and one more tick is lost. */
static void check_lost(const bench *const b, const uint32_t phase, const uint32_t ticks)
{
    CHECK((b->state.phase & 1u) == (phase & 1u));
    CHECK((phase == TDC_PHASE_START) == (b->state.phase == TDC_PHASE_START));
    CHECK(b->state.lost_ticks == ticks);
    CHECK(has_torques(b, (controller_number)0) != 0u);
}

static void jumps_are_lost_ticks(void)
{
    for (uint32_t i = 0u; i < (8u * JOINTS); ++i) {
        const uint32_t j = i / 8u;
        bench b = standing(((i & 1u) != 0u) ? 2u : 0u);
        b.config.on_error = ((i & 2u) != 0u) ? TDC_ZERO_TORQUE : TDC_HOLD_TORQUE;
        const int32_t too_far = b.config.joint[j].max_displacement + 1;
        const uint32_t phase = b.state.phase;
        b.input.counts[j] = ((i & 4u) != 0u) ? too_far : -too_far;
        CHECK(tick(&b) == TDC_ENCODER_JUMP);
        check_lost(&b, phase, 1u);
        /* Back again is as far from the latest reading; the law goes on where two agree. */
        b.input.counts[j] = 0;
        CHECK(tick(&b) == TDC_ENCODER_JUMP);
        check_lost(&b, phase, 2u);
        CHECK(tick(&b) == TDC_OK);
        CHECK(has_torques(&b, (controller_number)0) != 0u);
    }
}

/* Plausible beside each other, but too far from where the robot was. */
static void the_law_does_not_go_on_too_far_away(void)
{
    bench b = standing(2u);
    b.input.counts[0] = 3 * b.config.joint[0].max_displacement;
    CHECK(tick(&b) == TDC_ENCODER_JUMP);
    CHECK(tick(&b) == TDC_ENCODER_JUMP);
    CHECK(tick(&b) >= TDC_OK);
}

static void abrupt_changes_are_lost_ticks(void)
{
    for (int32_t sign = -1; sign <= 1; sign += 2) {
        bench b = standing(2u);
        b.input.counts[0] = sign * (b.config.joint[0].max_displacement_change + 1);
        CHECK(tick(&b) == TDC_ENCODER_JUMP);
        b = standing(2u);
        b.input.counts[0] = sign * b.config.joint[0].max_displacement_change;
        b.input.reference_position_q8[0] = b.input.counts[0] * 256;
        CHECK(tick(&b) >= TDC_OK);
    }
}

static void too_many_lost_ticks_stop_it(void)
{
    for (uint32_t ticks = 0u; ticks < 3u; ++ticks) {
        bench b = standing(ticks);
        b.config.max_lost_ticks = 2u;
        b.input.REFERENCE_VELOCITY[0] = REFUSED_NUMBER;
        CHECK(tick(&b) == REFUSED);
        CHECK(tick(&b) == REFUSED);
        CHECK(tick(&b) == TDC_STOPPED);
        b.input.REFERENCE_VELOCITY[0] = (controller_number)0;
        CHECK(tick(&b) == TDC_STOPPED);
        CHECK(has_torques(&b, (controller_number)0) != 0u);
        CHECK(controller_init(&b.config, &b.state, b.counts, b.holding) == TDC_OK);
        CHECK(tick(&b) == TDC_OK);
    }
}

/*
 * Where the limit is so wide that no multiple of it is one. In fixed-point no configuration that
 * check_config takes goes there: what the step does with this one is defined, that is all.
 */
static void the_widest_limits_have_no_multiple(void)
{
    bench b = standing(0u);
    b.config.joint[0].max_displacement = 0x100000;
    b.input.counts[0] = 0x100001;
    CHECK(tick(&b) == TDC_ENCODER_JUMP);
}

/* A jump beside a torque at its limit, beside a torque within it, and beside what is refused. */
static void a_jump_comes_before_other_errors(void)
{
    for (uint32_t i = 0u; i < 4u; ++i) {
        bench b = standing(1u);
        b.config.joint[0].TORQUE_LIMIT = controller_default_config.joint[0].TORQUE_LIMIT;
        b.input.counts[0] = b.config.joint[0].max_displacement + 1;
        b.input.reference_position_q8[0] = b.input.counts[0] * 256;
        if ((i & 1u) != 0u) {
            demand(&b, JOINTS - 1u, 1);
        }
        if ((i & 2u) != 0u) {
            b.input.REFERENCE_VELOCITY[JOINTS - 1u] = REFUSED_NUMBER;
        }
        CHECK(tick(&b) == TDC_ENCODER_JUMP);
    }
#if !FIXED
    /* No torque is beyond its limit: the jump alone makes the tick unusual. */
    bench b = standing(1u);
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        b.config.joint[j].torque_limit_Nm = (controller_number)1e30f;
    }
    b.input.counts[0] = b.config.joint[0].max_displacement + 1;
    CHECK(tick(&b) == TDC_ENCODER_JUMP);
#endif
}

static void refused_numbers_change_nothing(void)
{
    for (uint32_t i = 0u; i < (8u * JOINTS); ++i) {
        const uint32_t j = i / 8u;
        bench b = standing(((i & 1u) != 0u) ? 2u : 0u);
        b.config.on_error = ((i & 2u) != 0u) ? TDC_ZERO_TORQUE : TDC_HOLD_TORQUE;
        controller_number *const number =
            ((i & 4u) != 0u) ? &b.input.REFERENCE_VELOCITY[j] : &b.input.REFERENCE_ACCELERATION[j];
        *number = REFUSED_NUMBER;
        CHECK(tick(&b) == REFUSED);
        CHECK(has_torques(&b, (controller_number)0) != 0u);
        *number = (controller_number)0;
        CHECK(tick(&b) == TDC_OK);
        CHECK(has_torques(&b, (controller_number)0) != 0u);
    }
}

static void the_last_torque_is_held(void)
{
    for (uint32_t ticks = 0u; ticks < 3u; ++ticks) {
        bench b = standing(0u);
        for (uint32_t j = 0u; j < JOINTS; ++j) {
            b.holding[j] = (controller_number)1;
        }
        CHECK(controller_init(&b.config, &b.state, b.counts, b.holding) == TDC_OK);
        for (uint32_t i = 0u; i < ticks; ++i) {
            CHECK(tick(&b) == TDC_OK);
        }
        b.input.REFERENCE_VELOCITY[0] = REFUSED_NUMBER;
        CHECK(tick(&b) == REFUSED);
        CHECK(has_torques(&b, (controller_number)1) != 0u);
    }
}

/* --- Small functions of the shared headers ----------------------------------------------------- */

static void shared_functions(void)
{
    const float not_a_number = NAN_OF_ZERO;
    const float infinity = 1.0f / zero;
    CHECK((tdc_min(1.0f, 2.0f) < 1.5f) && (tdc_min(2.0f, 1.0f) < 1.5f));
    CHECK((tdc_max(1.0f, 2.0f) > 1.5f) && (tdc_max(2.0f, 1.0f) > 1.5f));
    CHECK((tdc_shift_right(-5, 1u) == -3) && (tdc_shift_right(5, 1u) == 2));
    CHECK(tdc_in_order(7u) == 7u);
    CHECK((tdc_is_finite(1.0f) == 1u) && (tdc_is_finite(infinity) == 0u));
    CHECK(((tdc_beyond(1.0f, 2.0f) >> 31u) == 1u) && ((tdc_beyond(1.0f, -1.0f) >> 31u) == 0u));
    CHECK(tdc_difference(INT32_MIN, INT32_MAX) == 1);
    CHECK((tdc_is_lost(TDC_ENCODER_JUMP) & tdc_is_lost(TDC_NOT_FINITE)) == 1u);
    CHECK((tdc_is_lost(TDC_OUT_OF_RANGE) == 1u) && (tdc_is_lost(TDC_STOPPED) == 0u));

    tdc_exponent exponent = {77};
    CHECK(tdc_exponent_set(NULL, 1.0f) == TDC_BAD_CONFIG);
    CHECK(tdc_exponent_set(&exponent, -1.0f) == TDC_BAD_CONFIG);
    CHECK(tdc_exponent_set(&exponent, 2.0f) == TDC_BAD_CONFIG);
    CHECK(tdc_exponent_set(&exponent, not_a_number) == TDC_BAD_CONFIG);
    CHECK(exponent.minus_one_q31 == 77);
    CHECK((tdc_exponent_set(&exponent, 1.0f) == TDC_OK) && (exponent.minus_one_q31 == 0));
}

#ifdef TDC64_H
static void numbers_in_double(void)
{
    const tdc_exponent64 wanted[] = {{0.0, 0.0}, {1.0, 0.0}, {-1.0, 0.0}};
    CHECK(tdc_sig_pow64(3.0, wanted[0]) > 2.9);
    CHECK(tdc_sig_pow64(1e300, wanted[1]) > 1e300);
    CHECK(tdc_sig_pow64(1e-300, wanted[1]) < 1e-300);
    CHECK(tdc_sig_pow64(-3.0, wanted[2]) < -0.9);

    tdc_exponent64 exponent = {77.0, 0.0};
    CHECK(tdc_exponent64_set(NULL, 1.0) == TDC_BAD_CONFIG);
    CHECK(tdc_exponent64_set(&exponent, -1.0) == TDC_BAD_CONFIG);
    CHECK(tdc_exponent64_set(&exponent, 2.0) == TDC_BAD_CONFIG);
    CHECK(exponent.high > 76.0);
    CHECK((tdc_exponent64_set(&exponent, 1.5) == TDC_OK) && (exponent.high < 0.6));

    CHECK((tdc_min64(1.0, 2.0) < 1.5) && (tdc_min64(2.0, 1.0) < 1.5));
    CHECK((tdc_max64(1.0, 2.0) > 1.5) && (tdc_max64(2.0, 1.0) > 1.5));
    CHECK((tdc_is_finite64(1.0) == 1u) && (tdc_is_finite64((double)(1.0f / zero)) == 0u));
    CHECK(tdc_is_finite64((double)(-1.0f / zero)) == 0u);
    CHECK((tdc_beyond64(1.0, 2.0) >> 31u) == 1u);
    CHECK((tdc_beyond64(1.0, -2.0) >> 31u) == 1u);
    CHECK((tdc_beyond64(1.0, -1.0) >> 31u) == 0u);

    /* An exponent of zero is good for gamma alone, and none of the two parts decides by itself. */
    controller_config config = controller_default_config;
    config.joint[0].gamma = wanted[2];
    CHECK(controller_check_config(&config) == TDC_OK);
    config.joint[0].alpha = wanted[2];
    CHECK(controller_check_config(&config) == TDC_BAD_CONFIG);
    config = controller_default_config;
    config.joint[0].gamma.high = -1.5;
    CHECK(controller_check_config(&config) == TDC_BAD_CONFIG);
}
#endif

#if FIXED
/* One in Q30. */
#define ONE_Q30 1073741824

static void numbers_in_fixed_point(void)
{
    const tdc_fixed_power unity = {UINT32_C(1) << 31u, 0};
    const tdc_fixed_power huge = {UINT32_C(1) << 31u, 0x7FFFFFFF};
    const tdc_fixed_power none = {UINT32_C(1) << 31u, TDC_FIXED_ZERO_GAIN};
    CHECK(tdc_fixed_sig_pow(-1000, unity) == -1000);
    CHECK(tdc_fixed_sig_pow(1000, huge) == INT32_MAX);
    CHECK((tdc_fixed_sig_pow(1000, none) == 0) && (tdc_fixed_sig_pow(0, unity) == 0));
    CHECK((tdc_fixed_product(-4, 1073741824) == -1) && (tdc_fixed_product(4, -1073741824) == -1));
    CHECK((tdc_lesser(1, 2) == 1) && (tdc_lesser(2, 1) == 1));
    CHECK((tdc_greater(1, 2) == 2) && (tdc_greater(2, 1) == 2));
    CHECK((tdc_outside(3, 2) == 1u) && (tdc_outside(-2, 2) == 0u));
    CHECK(tdc_fixed_scale(-3, ONE_Q30, 30u) == -3);
    CHECK(tdc_fixed_scale(INT32_MAX, INT32_MAX, 40u) == (INT32_MAX >> 9) + 1);
    CHECK(tdc_fixed_scale(INT32_MAX, INT32_MAX, 1u) == INT32_MAX);
    CHECK(tdc_fixed_scale(INT32_MIN, ONE_Q30, 30u) == -INT32_MAX);
}

/* A gain's logarithm is in units of 2^-24. */
#define OCTAVE 16777216
#define OCTAVE_64TH 262144
#define OCTAVE_256TH 65536

/* The last joint's gains, changed by a number that grows. */
typedef void change(controller_joint_config *gains, int32_t by);

static void more_damping(controller_joint_config *const gains, const int32_t by)
{
    gains->damping.scale_q24 += by;
}

static void more_stiffness(controller_joint_config *const gains, const int32_t by)
{
    gains->stiffness.scale_q24 += by;
}

/* As much of either: their sum is refused before one of them is. */
static void more_of_both(controller_joint_config *const gains, const int32_t by)
{
    gains->damping.scale_q24 += by;
    gains->stiffness.exponent_q31 = gains->damping.exponent_q31;
    gains->stiffness.scale_q24 = gains->damping.scale_q24;
}

static void more_correction(controller_joint_config *const gains, const int32_t by)
{
    gains->correction.scale_q24 += by;
}

/* What grows is taken up to some size, and refused from there on. */
static void gains_that_overflow(void)
{
    change *const changes[] = {
        more_damping,
        more_stiffness,
        more_of_both,
        more_correction,
    };
    for (uint32_t i = 0u; i < (sizeof changes / sizeof changes[0]); ++i) {
        tdc_status last = TDC_OK;
        for (int32_t by = 0; by < (2000 * OCTAVE_64TH); by += OCTAVE_64TH) {
            controller_config config = controller_default_config;
            changes[i](&config.joint[JOINTS - 1u], by);
            const tdc_status status = controller_check_config(&config);
            CHECK((status == last) || (status == TDC_BAD_CONFIG));
            last = status;
        }
        CHECK(last == TDC_BAD_CONFIG);
    }
}
/* Whether the last joint takes these two, with the largest inertia and no damping. */
static uint32_t takes(const int32_t correction_q24, const tdc_fixed_power stiffness)
{
    controller_config config = controller_default_config;
    controller_joint_config *const gains = &config.joint[JOINTS - 1u];
    gains->inertia_factor = INT32_MAX;
    gains->damping.scale_q24 = TDC_FIXED_ZERO_GAIN;
    gains->stiffness = stiffness;
    gains->correction.scale_q24 = correction_q24;
    return (controller_check_config(&config) == TDC_OK) ? 1u : 0u;
}

/*
 * The sum of all motion at the end of an integer: the torque of the largest inertia is one unit too
 * large there, and only there. The correction comes near, the stiffness then goes in single units.
 */
static void the_tightest_sum(void)
{
    tdc_fixed_power stiffness = {1u, TDC_FIXED_ZERO_GAIN};
    int32_t taken = TDC_FIXED_ZERO_GAIN / 2;
    for (int32_t step = ONE_Q30; step > 0; step /= 2) {
        if ((taken < (INT32_MAX - step)) && (takes(taken + step, stiffness) != 0u)) {
            taken += step;
        }
    }
    CHECK(takes(taken, stiffness) != 0u);
    uint32_t last = 1u;
    for (stiffness.scale_q24 = 0; stiffness.scale_q24 < (8 * OCTAVE);
         stiffness.scale_q24 += OCTAVE_256TH) {
        const uint32_t now = takes(taken, stiffness);
        CHECK((now == last) || (now == 0u));
        last = now;
    }
    CHECK(last == 0u);
}
#else
/* The smallest and the largest of all exponents meet the largest signals. */
static void extreme_signals(void)
{
    for (uint32_t i = 0u; i < config_table.count; ++i) {
        const scalar *const s = &config_table.scalars[i];
        for (uint32_t special = 0u; special < SPECIALS; ++special) {
            bench b = standing(1u);
            scalar_set_bits(&b.config, s, scalar_special(s->type, special));
            if (controller_check_config(&b.config) == TDC_OK) {
                const controller_number largest = (sizeof largest == sizeof(float))
                                                      ? (controller_number)FLT_MAX
                                                      : (controller_number)DBL_MAX;
                for (uint32_t j = 0u; j < JOINTS; ++j) {
                    b.input.REFERENCE_VELOCITY[j] = largest;
                }
                const tdc_status status = tick(&b);
                CHECK((status == REFUSED) || (status >= 0));
            }
        }
    }
}
#endif

int main(void)
{
    CHECK(config_table.size == sizeof(controller_config));
    steps_without_arguments();
    steps_of_memory_that_nobody_filled();
    starts();
    configurations();
    torques_are_limited();
    jumps_are_lost_ticks();
    the_law_does_not_go_on_too_far_away();
    abrupt_changes_are_lost_ticks();
    too_many_lost_ticks_stop_it();
    the_widest_limits_have_no_multiple();
    a_jump_comes_before_other_errors();
    refused_numbers_change_nothing();
    the_last_torque_is_held();
    shared_functions();
#ifdef TDC64_H
    numbers_in_double();
#endif
#if FIXED
    numbers_in_fixed_point();
    gains_that_overflow();
    the_tightest_sum();
#else
    extreme_signals();
#endif
    (void)printf("%u checks, %u failures\n", (unsigned)checks, (unsigned)failures);
    return (failures == 0u) ? 0 : 1;
}
