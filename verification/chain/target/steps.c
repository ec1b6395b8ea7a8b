#include "verification/chain/target/steps.h"

#include <stdbool.h>
#include <string.h>

/* Steps from one switch-on to the next, with the same gains. */
#define EPISODE_STEPS 25u

#define FNV_OFFSET 0xCBF29CE484222325u
#define FNV_PRIME 0x100000001B3u

#define QUIET_NAN 0x7FC00000u
#define INFINITY_BITS 0x7F800000u
#define SIGN_BIT 0x80000000u

/* --- Memory ---------------------------------------------------------------------------------- */

/* The last tick's memory of a joint: its index is the lowest bit of the phase. */
static controller_joint_state *last_memory(controller_state *const state, const uint32_t j)
{
    return &state->joint[j].tick[state->phase & 1u];
}

static controller_joint_state *scratch_memory(controller_state *const state, const uint32_t j)
{
    return &state->joint[j].tick[(state->phase & 1u) ^ 1u];
}

/* What the first tick takes from a memory; it finds out the rest from its own input. */
static controller_joint_state started_from(const controller_joint_state *const memory)
{
    const controller_joint_state start = {
        .counts = memory->counts,
        .applied_torque_Nm = memory->applied_torque_Nm,
    };
    return start;
}

/*
 * Zeros all of a good state that no tick reads. A failed tick may leave a NaN there, whose payload
 * processors choose differently.
 */
static void clear_scratch(controller_state *const state)
{
    static const controller_joint_state nothing = {0};
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        *scratch_memory(state, j) = nothing;
        if (state->phase == TDC_PHASE_START) {
            *last_memory(state, j) = started_from(last_memory(state, j));
        }
    }
}

/* --- One step -------------------------------------------------------------------------------- */

/* Whether no step was taken, so that the state must be as it was in every bit. */
static bool is_refused(const step_result *const result)
{
    bool refused = false;
    if ((result->status == TDC_BAD_ARGUMENT) || (result->status == TDC_NOT_INITIALISED)) {
        refused = true;
    }
    return refused;
}

void step_take(const step_case *const step, step_result *const result)
{
    result->state = step->state;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        result->torque_Nm[j] = STEP_UNWRITTEN_NM;
    }
    const uint32_t missing = step->missing;
    result->status =
        controller_step(((missing & STEP_WITHOUT_CONFIG) != 0u) ? NULL : &step->config,
                        ((missing & STEP_WITHOUT_STATE) != 0u) ? NULL : &result->state,
                        ((missing & STEP_WITHOUT_INPUT) != 0u) ? NULL : &step->input,
                        ((missing & STEP_WITHOUT_TORQUE) != 0u) ? NULL : result->torque_Nm);
    if (!is_refused(result)) {
        clear_scratch(&result->state);
    }
}

void step_take_all(const step_case *const steps, step_result *const results, const uint32_t count)
{
    for (uint32_t i = 0u; i < count; ++i) {
        step_take(&steps[i], &results[i]);
    }
}

/* --- Random words ---------------------------------------------------------------------------- */

/* Bob Jenkins's small fast generator, 32 bits: any seed is a good one. */
typedef struct {
    uint32_t a, b, c, d;
} generator;

static uint32_t rotated(const uint32_t x, const uint32_t by)
{
    return (x << by) | (x >> (32u - by));
}

static uint32_t next(generator *const g)
{
    const uint32_t e = g->a - rotated(g->b, 27u);
    g->a = g->b ^ rotated(g->c, 17u);
    g->b = g->c + g->d;
    g->c = g->d + e;
    g->d = e + g->a;
    return g->d;
}

static generator seeded(const uint32_t seed)
{
    generator g = {0xF1EA5EEDu, seed, seed, seed};
    for (uint32_t i = 0u; i < 20u; ++i) {
        (void)next(&g);
    }
    return g;
}

/* Whether something happens that does so once in `times`, a power of two. */
static bool once_in(generator *const g, const uint32_t times)
{
    return (next(g) >> 7u & (times - 1u)) == 0u;
}

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
    const uint32_t word = next(g);
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

/* An integer of either sign, its magnitude below 2^(31 - from), all powers of two alike. */
static uint32_t integer_below(generator *const g, const uint32_t from)
{
    const uint32_t word = next(g);
    const uint32_t shift = from + ((next(g) >> 9u) % (32u - from));
    const uint32_t magnitude = (word >> 1u) >> shift;
    return ((word & 1u) != 0u) ? (0u - magnitude) : magnitude;
}

/* --- Drawing --------------------------------------------------------------------------------- */

/* How far from an everyday tick the drawn numbers go. */
typedef enum { RIG, WIDE, EXTREME } regime;

static regime draw_regime(generator *const g)
{
    static const regime each[8] = {RIG, RIG, RIG, RIG, WIDE, WIDE, WIDE, EXTREME};
    return each[(next(g) >> 11u) & 7u];
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
    uint32_t word = next(g);
    const uint32_t kind = next(g) >> 29u;
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
    return once_in(g, 16u) ? 0.0f : positive_in(g, range);
}

/* Returns how far the gains go. */
static regime draw_config(generator *const g, controller_config *const config)
{
    *config = controller_default_config;
    config->on_error = (next(g) >> 13u) & 1u;
    const regime far = draw_regime(g);
    if ((far == RIG) && once_in(g, 2u)) {
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
            config->joint[j].max_displacement = (int32_t)((next(g) >> 3u) + 0x20000000u);
        }
        if (once_in(g, 2u)) {
            config->joint[j].alpha.minus_one_q31 = draw_exponent(g);
            config->joint[j].beta.minus_one_q31 = draw_exponent(g);
            config->joint[j].gamma.minus_one_q31 = draw_exponent(g);
        }
    }
    return far;
}

/* One word of a good configuration becomes another: most of these break a rule of the header. */
static void spoil_config(generator *const g, controller_config *const config)
{
    const uint32_t word = next(g);
    const uint32_t place = (next(g) >> 5u) % ((uint32_t)(sizeof *config / sizeof word));
    (void)memcpy((unsigned char *)config + (place * sizeof word), &word, sizeof word);
}

/* Positions lie anywhere, often where they wrap, and at zero. */
static int32_t draw_position(generator *const g)
{
    uint32_t word = next(g);
    const uint32_t kind = next(g) >> 30u;
    if (kind == 0u) {
        word = 0x7FFFFF00u + (word & 0x1FFu);
    } else if (kind == 1u) {
        word = (word & 0x1FFu) - 0x100u;
    } else {
        /* as it is */
    }
    return tdc_signed(word);
}

static uint32_t draw_displacement(generator *const g, step_case *const step, const uint32_t j,
                                  const ranges *const range)
{
    if (step->state.phase == TDC_PHASE_START) {
        /* From standstill to full speed: the first tick takes no second difference of it. */
        return integer_below(g, (range->moves_from > 22u) ? 22u : range->moves_from);
    }
    return (uint32_t)last_memory(&step->state, j)->displacement +
           integer_below(g, range->moves_from);
}

static void draw_input(generator *const g, const regime far, step_case *const step)
{
    const ranges *const range = &RANGES[far];
    /* An even motion leaves s near zero, where sig(s)^gamma is steepest. */
    bool even = false;
    if (far == RIG) {
        even = once_in(g, 2u);
    }
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_input *const input = &step->input;
        const controller_joint_state *const last = last_memory(&step->state, j);
        const uint32_t moved =
            even ? (uint32_t)last->displacement : draw_displacement(g, step, j, range);
        const uint32_t counts = (uint32_t)last->counts + moved;
        const uint32_t error = integer_below(g, (far == RIG) ? 17u : 0u);
        input->counts[j] = tdc_signed(counts);
        input->reference_position_q8[j] = tdc_signed((counts * 256u) + error);
        if (!even) {
            input->reference_velocity_rad_per_s[j] = signed_in(g, range->velocity);
        }
        input->reference_acceleration_rad_per_s2[j] = signed_in(g, range->acceleration);
    }
}

/* Memory that no tick has left behind, NaN excepted: neither init nor step ever lets one in. */
static void disturb_state(generator *const g, const regime far, controller_state *const state)
{
    const ranges *const range = &RANGES[far];
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        controller_joint_state *const last = last_memory(state, j);
        last->sliding_integral_rad_per_s = signed_in(g, range->velocity);
        last->applied_torque_Nm = signed_in(g, range->torque);
    }
    state->saturated_joints = next(g);
}

static void draw_bits(generator *const g, controller_joint_state *const memory)
{
    uint32_t words[sizeof *memory / sizeof(uint32_t)];
    for (uint32_t i = 0u; i < (sizeof words / sizeof words[0]); ++i) {
        words[i] = next(g);
    }
    (void)memcpy(memory, words, sizeof words);
}

/* Any bits at all where a step must not look. */
static void fill_scratch(generator *const g, controller_state *const state)
{
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        draw_bits(g, scratch_memory(state, j));
        if (state->phase == TDC_PHASE_START) {
            const controller_joint_state start = started_from(last_memory(state, j));
            draw_bits(g, last_memory(state, j));
            last_memory(state, j)->counts = start.counts;
            last_memory(state, j)->applied_torque_Nm = start.applied_torque_Nm;
        }
    }
}

static void spoil_input(generator *const g, controller_input *const input)
{
    static const uint32_t not_finite[4] = {
        QUIET_NAN,
        INFINITY_BITS,
        SIGN_BIT | INFINITY_BITS,
        0x7F7FFFFFu,
    };
    const float value = float_of(not_finite[next(g) >> 30u]);
    const uint32_t j = (next(g) >> 5u) % JOINTS;
    if (once_in(g, 2u)) {
        input->reference_velocity_rad_per_s[j] = value;
    } else {
        input->reference_acceleration_rad_per_s2[j] = value;
    }
}

/* --- Blocks ---------------------------------------------------------------------------------- */

/*
 * Each word goes through a bijection of the hash, so that two streams that differ in one word have
 * different hashes for certain; where they differ in more, equal hashes are one in 2^64.
 */
static uint64_t folded(uint64_t hash, const void *const data, const size_t size)
{
    const unsigned char *const bytes = data;
    for (size_t i = 0u; i < size; i += sizeof(uint32_t)) {
        uint32_t word;
        (void)memcpy(&word, bytes + i, sizeof word);
        hash = (hash ^ word) * FNV_PRIME;
    }
    return hash;
}

/* Returns how far the gains go. */
static regime switch_on(generator *const g, step_case *const step, block_summary *const summary)
{
    int32_t counts[JOINTS];
    float holding_torque_Nm[JOINTS];
    const binades torques = once_in(g, 8u) ? EVERY_FINITE : RANGES[RIG].torque;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        counts[j] = draw_position(g);
        holding_torque_Nm[j] = signed_in(g, torques);
    }
    const regime far = draw_config(g, &step->config);
    controller_config spoilt = step->config;
    spoil_config(g, &spoilt);
    const int32_t answers[3] = {
        controller_check_config(&spoilt),
        controller_init(&spoilt, &step->state, counts, holding_torque_Nm),
        controller_init(&step->config, &step->state, counts, holding_torque_Nm),
    };
    summary->hash = folded(summary->hash, &spoilt, sizeof spoilt);
    summary->hash = folded(summary->hash, answers, sizeof answers);
    summary->refused += (answers[1] != TDC_OK) ? 1u : 0u;
    return far;
}

static void draw_step(generator *const g, const regime of_gains, step_case *const step)
{
    /* Everyday gains seldom survive more than everyday signals: most of these would be errors. */
    regime far = draw_regime(g);
    if ((far > of_gains) && !once_in(g, 16u)) {
        far = of_gains;
    }
    if (once_in(g, 16u)) {
        disturb_state(g, far, &step->state);
    }
    draw_input(g, far, step);
    if (once_in(g, 64u)) {
        spoil_input(g, &step->input);
    }
    fill_scratch(g, &step->state);
    step->missing = once_in(g, 256u) ? (next(g) >> 28u) : 0u;
    if ((step->missing == 0u) && once_in(g, 256u)) {
        step->state.phase = next(g); /* memory that nobody filled */
    }
}

void block_take(const uint32_t block, const uint32_t steps, block_summary *const summary,
                block_observer *const observer, void *const context)
{
    const block_summary empty = {.hash = FNV_OFFSET};
    *summary = empty;
    generator g = seeded(block);
    regime of_gains = RIG;
    step_case step;
    step_result result;
    (void)memset(&step, 0, sizeof step);
    for (uint32_t i = 0u; i < steps; ++i) {
        if ((i % EPISODE_STEPS) == 0u) {
            of_gains = switch_on(&g, &step, summary);
        }
        const uint32_t phase = step.state.phase;
        draw_step(&g, of_gains, &step);
        step_take(&step, &result);
        summary->hash = folded(summary->hash, &step, sizeof step);
        summary->hash = folded(summary->hash, &result, sizeof result);
        const uint32_t status = (uint32_t)(result.status - TDC_NOT_FINITE);
        if (status < STATUSES) {
            ++summary->statuses[status];
        }
        if (observer != NULL) {
            observer(context, &step, &result);
        }
        step.state = result.state;
        if (is_refused(&result)) {
            step.state.phase = phase;
            clear_scratch(&step.state);
        }
    }
}

typedef struct {
    step_case *cases;
    step_result *results;
} recording;

static void record(void *const context, const step_case *const step,
                   const step_result *const result)
{
    recording *const to = context;
    *to->cases = *step;
    *to->results = *result;
    ++to->cases;
    ++to->results;
}

void block_record(const uint32_t block, const uint32_t steps, step_case *const cases,
                  step_result *const results)
{
    recording to = {cases, results};
    block_summary summary;
    block_take(block, steps, &summary, record, &to);
}
