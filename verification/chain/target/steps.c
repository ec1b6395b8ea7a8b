#include "verification/chain/target/steps.h"

#include <stdbool.h>
#include <string.h>

#include "verification/chain/target/draw.h"

/* Steps from one switch-on to the next, with the same gains. */
#define EPISODE_STEPS 25u

#define FNV_OFFSET 0xCBF29CE484222325u
#define FNV_PRIME 0x100000001B3u

/* --- Memory ---------------------------------------------------------------------------------- */

controller_joint_state *step_last_memory(controller_state *const state, const uint32_t j)
{
    return &state->joint[j].tick[state->phase & 1u];
}

static controller_joint_state *scratch_memory(controller_state *const state, const uint32_t j)
{
    return &state->joint[j].tick[(state->phase & 1u) ^ 1u];
}

static bool is_running(const controller_state *const state)
{
    return (state->phase - TDC_PHASE_RUNNING) <= 1u;
}

int32_t step_latest_counts(controller_state *const state, const uint32_t j)
{
    return is_running(state) ? step_last_memory(state, j)->counts
                             : scratch_memory(state, j)->counts;
}

/*
 * Puts what a tick takes from the memory of another state into one; the first tick, and one after
 * lost ones, find out the rest from their own input.
 */
static void take_over(controller_state *const state, controller_state *const from, const uint32_t j)
{
    controller_joint_state *const to = step_last_memory(state, j);
    const controller_joint_state *const last = step_last_memory(from, j);
    if (is_running(from)) {
        *to = *last;
    } else {
        to->counts = last->counts;
        to->APPLIED_TORQUE = last->APPLIED_TORQUE;
        scratch_memory(state, j)->counts = scratch_memory(from, j)->counts;
        if (from->phase != TDC_PHASE_START) {
            to->SLIDING_INTEGRAL = last->SLIDING_INTEGRAL;
        }
    }
}

/*
 * Zeros all of a good state that no tick reads. A failed tick may leave a NaN there, whose payload
 * processors choose differently.
 */
static void clear_scratch(controller_state *const state)
{
    controller_state all = *state;
    static const controller_joint_state nothing = {0};
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        state->joint[j].tick[0] = nothing;
        state->joint[j].tick[1] = nothing;
        take_over(state, &all, j);
    }
}

/* --- One step -------------------------------------------------------------------------------- */

/* Whether no step was taken, so that the state must be as it was in every bit. */
static bool is_refused(const step_result *const result)
{
    bool refused = false;
    if ((result->status == TDC_BAD_ARGUMENT) || (result->status == TDC_NOT_INITIALISED) ||
        (result->status == TDC_STOPPED)) {
        refused = true;
    }
    return refused;
}

void step_take(const step_case *const step, step_result *const result)
{
    result->state = step->state;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        result->torque[j] = STEP_UNWRITTEN;
    }
    const uint32_t missing = step->missing;
    result->status =
        controller_step(((missing & STEP_WITHOUT_CONFIG) != 0u) ? NULL : &step->config,
                        ((missing & STEP_WITHOUT_STATE) != 0u) ? NULL : &result->state,
                        ((missing & STEP_WITHOUT_INPUT) != 0u) ? NULL : &step->input,
                        ((missing & STEP_WITHOUT_TORQUE) != 0u) ? NULL : result->torque);
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

/* One word of a good configuration becomes another: most of these break a rule of the header. */
static void spoil_config(generator *const g, controller_config *const config)
{
    const uint32_t word = draw_word(g);
    const uint32_t place = (draw_word(g) >> 5u) % ((uint32_t)(sizeof *config / sizeof word));
    (void)memcpy((unsigned char *)config + (place * sizeof word), &word, sizeof word);
}

/* Positions lie anywhere, often where they wrap, and at zero. */
static int32_t draw_position(generator *const g)
{
    uint32_t word = draw_word(g);
    const uint32_t kind = draw_word(g) >> 30u;
    if (kind == 0u) {
        word = 0x7FFFFF00u + (word & 0x1FFu);
    } else if (kind == 1u) {
        word = (word & 0x1FFu) - 0x100u;
    } else {
        /* as it is */
    }
    return tdc_signed(word);
}

static void draw_bits(generator *const g, controller_joint_state *const memory)
{
    uint32_t words[sizeof *memory / sizeof(uint32_t)];
    for (uint32_t i = 0u; i < (sizeof words / sizeof words[0]); ++i) {
        words[i] = draw_word(g);
    }
    (void)memcpy(memory, words, sizeof words);
}

/* Any bits at all where a step must not look. */
static void fill_scratch(generator *const g, controller_state *const state)
{
    controller_state all = *state;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        draw_bits(g, &state->joint[j].tick[0]);
        draw_bits(g, &state->joint[j].tick[1]);
        take_over(state, &all, j);
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
    controller_number holding_torque[JOINTS];
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        counts[j] = draw_position(g);
    }
    draw_holding_torque(g, holding_torque);
    const regime far = draw_config(g, &step->config);
    controller_config spoilt = step->config;
    spoil_config(g, &spoilt);
    const int32_t answers[3] = {
        controller_check_config(&spoilt),
        controller_init(&spoilt, &step->state, counts, holding_torque),
        controller_init(&step->config, &step->state, counts, holding_torque),
    };
    if (answers[2] != TDC_OK) {
        ++summary->refused_torques;
        /* No state of other gains goes on: what these may come to follows from them. */
        static const controller_number nothing[JOINTS] = {(controller_number)0};
        (void)controller_init(&step->config, &step->state, counts, nothing);
    }
    summary->hash = folded(summary->hash, &spoilt, sizeof spoilt);
    summary->hash = folded(summary->hash, answers, sizeof answers);
    summary->refused += (answers[1] != TDC_OK) ? 1u : 0u;
    return far;
}

static void draw_step(generator *const g, const regime of_gains, step_case *const step)
{
    /* Everyday gains seldom survive more than everyday signals: most of these would be errors. */
    regime far = draw_regime(g);
    if ((far > of_gains) && !draw_once_in(g, 16u)) {
        far = of_gains;
    }
    if (draw_once_in(g, 16u)) {
        draw_memory(g, far, step);
    }
    draw_input(g, far, step);
    if (draw_once_in(g, 64u)) {
        draw_bad_input(g, &step->input);
    }
    fill_scratch(g, &step->state);
    step->missing = draw_once_in(g, 256u) ? (draw_word(g) >> 28u) : 0u;
    if ((step->missing == 0u) && draw_once_in(g, 256u)) {
        step->state.phase = draw_word(g); /* memory that nobody filled */
    }
}

void block_take(const uint32_t block, const uint32_t steps, block_summary *const summary,
                block_observer *const observer, void *const context)
{
    const block_summary empty = {.hash = FNV_OFFSET};
    *summary = empty;
    generator g = draw_seeded(block);
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
        const uint32_t status = (uint32_t)(result.status - TDC_STOPPED);
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
