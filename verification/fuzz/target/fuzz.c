/*
 * The fuzzer's target: bytes become configurations, states and ticks of a generated controller,
 * and what comes back is held to the contract in its header. An input is a programme: a byte says
 * what to do, the next ones with which numbers. Most of the ticks are drawn in bursts from a
 * seed in the input, so that a short input takes thousands of them.
 *
 * Besides the sanitizers these judge, each by a sentence of the header:
 *   - the status is one that tdc.h names; good is zero or more
 *   - good: every torque is finite and within its limit
 *   - a lost tick: it is counted, the torque is the last good one or zero, as on_error says, and
 *     the law's memory of the last good tick is as it was
 *   - another error: the torque is zero, and the state is as it was in every bit
 *   - the same state, configuration and input give the same bits, whatever is in scratch memory
 *   - check_config takes what its rules allow and nothing else; init refuses what it refuses
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_stub/controller.h"
#include "verification/fuzz/target/scalars.h"

#define MOST_STATUSES 16u

/* NOLINTBEGIN(misc-use-internal-linkage): libFuzzer calls these two. */
int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
/* NOLINTEND(misc-use-internal-linkage) */
/* NOLINTBEGIN(readability-implicit-bool-conversion): what && and || give is a truth value. */

/* --- What was done ----------------------------------------------------------------------------- */

static uint64_t steps_by_status[MOST_STATUSES];
static uint64_t inits_by_status[MOST_STATUSES];
static uint64_t configurations[2]; /* refused, taken */

/* Leaves the counts where the caller asked for them. */
static void leave_counts(void)
{
    const char *const path = getenv("FUZZ_COUNTS");
    FILE *const file = (path != NULL) ? fopen(path, "w") : NULL;
    if (file == NULL) {
        return;
    }
    for (size_t i = 0u; i < status_count; ++i) {
        (void)fprintf(file, "%d %llu %llu\n", (int)statuses[i],
                      (unsigned long long)steps_by_status[i],
                      (unsigned long long)inits_by_status[i]);
    }
    (void)fprintf(file, "configurations %llu %llu\n", (unsigned long long)configurations[0],
                  (unsigned long long)configurations[1]);
    (void)fclose(file);
}

static void require(const bool holds, const char *const contract)
{
    if (!holds) {
        (void)fprintf(stderr, "CONTRACT BROKEN: %s\n", contract);
        abort();
    }
}

/* Bits are what is compared: a NaN is as good as any. */
static bool same_bytes(const void *const a, const void *const b, const size_t size)
{
    return memcmp(a, b, size) == 0;
}

static size_t status_index(const tdc_status status)
{
    size_t i = 0u;
    while ((i < status_count) && (statuses[i] != (int32_t)status)) {
        ++i;
    }
    require(i < status_count, "the status is one of tdc.h");
    return i;
}

/* --- Bytes of the input ------------------------------------------------------------------------ */

typedef struct {
    const uint8_t *bytes;
    size_t left;
} reader;

/* The next bytes; zeros behind the end. */
static void read_bytes(reader *const from, void *const to, const size_t size)
{
    const size_t taken = (size < from->left) ? size : from->left;
    (void)memset(to, 0, size);
    if (taken > 0u) {
        (void)memcpy(to, from->bytes, taken);
        from->bytes += taken;
        from->left -= taken;
    }
}

static uint32_t read_byte(reader *const from)
{
    uint8_t byte;
    read_bytes(from, &byte, sizeof byte);
    return byte;
}

static uint32_t read_word(reader *const from)
{
    uint32_t word;
    read_bytes(from, &word, sizeof word);
    return word;
}

/* Which number of a structure. */
static const scalar *read_scalar(reader *const from, const structure *const of)
{
    const size_t place = read_byte(from);
    return &of->scalars[(of->count > 0u) ? (place % of->count) : 0u];
}

/* --- Drawing (Marsaglia's xorshift, 64 bits, upper half) --------------------------------------- */

typedef struct {
    uint64_t state;
} generator;

/* Seeds that differ in a bit give unlike sequences (the finalizer of SplitMix64); never zero. */
static generator seeded(const uint32_t seed)
{
    uint64_t x = seed + UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30u)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27u)) * UINT64_C(0x94D049BB133111EB);
    const generator g = {(x ^ (x >> 31u)) | 1u};
    return g;
}

static uint32_t draw(generator *const g)
{
    g->state ^= g->state << 13u;
    g->state ^= g->state >> 7u;
    g->state ^= g->state << 17u;
    return (uint32_t)(g->state >> 32u);
}

static bool once_in(generator *const g, const uint32_t times)
{
    return (draw(g) % times) == 0u;
}

static uint64_t draw_64(generator *const g)
{
    const uint64_t high = draw(g);
    return (high << 32u) | draw(g);
}

/* --- Numbers of a structure -------------------------------------------------------------------- */

/* A real number of magnitude 2^(from - bias), from in the exponent field, up to 2^span more. */
static uint64_t real_in(generator *const g, const scalar_type type, const int32_t from,
                        const uint32_t span)
{
    const real_format format = scalar_format(type);
    const uint64_t mask = (UINT64_C(1) << format.mantissa_bits) - 1u;
    const uint32_t bias = format.exponent_ones >> 1u;
    const uint64_t field = (uint64_t)((int64_t)bias + from + (int64_t)(draw(g) % span));
    const uint64_t sign = once_in(g, 2u) ? scalar_format(type).sign : 0u;
    return sign | (field << format.mantissa_bits) | (draw_64(g) & mask);
}

/* An integer of either sign, of a magnitude below 2^(32 - least_shift), all magnitudes alike. */
static uint32_t integer_below(generator *const g, const uint32_t least_shift)
{
    const uint32_t magnitude = (draw(g) >> 1u) >> (least_shift + (draw(g) % (31u - least_shift)));
    return once_in(g, 2u) ? (0u - magnitude) : magnitude;
}

/* How far a tick's numbers go. */
typedef enum { CALM, NEAR, WIDE, SPECIAL, RAW } regime;

/* Powers of two of a real number, and the shortest shift of an integer. */
typedef struct {
    int32_t from;
    uint32_t span, shift;
} reach;

static const reach REACHES[] = {
    [CALM] = {-24, 12u, 20u},
    [NEAR] = {-24, 27u, 12u},
    [WIDE] = {-120, 240u, 0u},
};

static uint64_t drawn(generator *const g, const scalar_type type, const regime far)
{
    if (far == RAW) {
        return draw_64(g);
    }
    if (far == SPECIAL) {
        return scalar_special(type, draw(g) % SPECIALS);
    }
    const reach *const to = &REACHES[far];
    return scalar_is_real(type) ? real_in(g, type, to->from, to->span)
                                : integer_below(g, to->shift);
}

/* --- Configurations ---------------------------------------------------------------------------- */

/* A number that keeps the rule, near the one that is there. */
static uint64_t mended(const scalar *const s, const uint64_t bits)
{
    const real_format format = scalar_format(s->type);
    const uint64_t smallest_above_one = (uint64_t)(format.exponent_ones >> 1u)
                                        << format.mantissa_bits;
    switch (s->rule) {
    case RULE_POSITIVE:
    case RULE_NOT_NEGATIVE:
        return bits & ~scalar_format(s->type).sign;
    case RULE_RATIO:
        return (bits & (scalar_format(s->type).sign - 1u)) % smallest_above_one;
    case RULE_DISPLACEMENT:
        return (bits & 0x3FFFFFFFu) | 1u;
    case RULE_LOST_TICKS:
        return 1u + (bits % most_lost_ticks);
    case RULE_SWITCH:
    case RULE_ON_ERROR:
        return bits & 1u;
    case RULE_IDENTITY:
        return scalar_bits(&controller_default_config, s);
    case RULE_ANY:
    case RULE_ABOVE_MINUS_1:
    case RULE_ELSEWHERE:
    default:
        return bits;
    }
}

/* A number of the default configuration becomes another one. */
static uint64_t mutated(reader *const from, const scalar *const s, const uint64_t bits)
{
    const uint32_t how = read_byte(from);
    generator g = seeded(read_word(from));
    const real_format format = scalar_format(s->type);
    const uint64_t step = UINT64_C(1)
                          << (draw(&g) % (scalar_is_real(s->type) ? format.mantissa_bits : 31u));
    switch (how % 8u) {
    case 0u:
        return draw_64(&g);
    case 1u:
        return drawn(&g, s->type, SPECIAL);
    case 2u:
        return drawn(&g, s->type, WIDE);
    case 3u:
        return bits + step;
    case 4u:
        return bits - step;
    case 5u: /* some powers of two more, or less */
        return scalar_is_real(s->type)
                   ? (bits + ((uint64_t)(draw(&g) % 64u) << format.mantissa_bits) -
                      (UINT64_C(32) << format.mantissa_bits))
                   : ((uint64_t)(uint32_t)bits >> (draw(&g) % 31u));
    case 6u:
        return scalar_is_real(s->type) ? (bits ^ scalar_format(s->type).sign) : (0u - bits);
    default:
        return mended(s, draw_64(&g));
    }
}

static void read_config(reader *const from, controller_config *const config)
{
    const uint32_t how = read_byte(from);
    *config = controller_default_config;
    config->on_error = how & 1u;
    if ((how & 2u) != 0u) {
        for (size_t i = 0u; i < config_table.count; ++i) {
            const scalar *const s = &config_table.scalars[i];
            uint64_t bits = read_word(from);
            if (s->type == SCALAR_DOUBLE) {
                bits |= (uint64_t)read_word(from) << 32u;
            }
            scalar_set_bits(config, s, ((how & 12u) != 0u) ? mended(s, bits) : bits);
        }
    }
    for (uint32_t mutations = how >> 4u; mutations > 0u; --mutations) {
        const scalar *const s = read_scalar(from, &config_table);
        const uint64_t bits = mutated(from, s, scalar_bits(config, s));
        scalar_set_bits(config, s, ((how & 12u) != 0u) ? mended(s, bits) : bits);
    }
}

/* Whether check_config takes it, which must be so if and only if every rule holds. */
static bool is_taken(const controller_config *const config)
{
    bool holds = true;
    bool known = true;
    for (size_t i = 0u; i < config_table.count; ++i) {
        const scalar *const s = &config_table.scalars[i];
        known = known && (s->rule != RULE_ELSEWHERE);
        holds = holds && scalar_rule_holds(s, scalar_bits(config, s));
    }
    const tdc_status status = controller_check_config(config);
    require((status == TDC_OK) || (status == TDC_BAD_CONFIG), "check_config answers yes or no");
    const bool taken = status == TDC_OK;
    require(!taken || holds, "a configuration that check_config takes keeps every rule");
    require(!known || taken || !holds, "check_config takes what keeps every rule");
    ++configurations[taken ? 1 : 0];
    return taken;
}

/* --- States ------------------------------------------------------------------------------------ */

typedef struct {
    controller_config config;
    controller_state state;
    bool config_is_good;  /* check_config takes it */
    bool torque_is_known; /* held is what on_error holds */
    controller_number held[JOINTS];
    controller_input last;
} rig;

static bool is_running(const uint32_t phase)
{
    return (phase - TDC_PHASE_RUNNING) <= 1u;
}

/* Whether a step reads a number of the state: not what the tick writes, or works out itself. */
static bool is_read(const scalar *const s, const uint32_t phase)
{
    if (s->memory == MEMORY_COMMON) {
        return !(s->counter && is_running(phase));
    }
    if ((uint32_t)s->memory != (phase & 1u)) {
        return s->latest && !is_running(phase);
    }
    return is_running(phase) || ((phase == TDC_PHASE_START) ? s->starts : s->resumes);
}

static bool keeps(const controller_state *const before, const controller_state *const after)
{
    bool same = before->phase == after->phase;
    for (size_t i = 0u; same && (i < state_table.count); ++i) {
        const scalar *const s = &state_table.scalars[i];
        same = !is_read(s, before->phase) || (scalar_bits(before, s) == scalar_bits(after, s));
    }
    return same;
}

/* What is left of a state by a lost tick: the last good memory, and one more of them. */
static void judge_loss(const controller_state *const before, const controller_state *const after,
                       const controller_input *const input)
{
    const uint32_t last = before->phase & 1u;
    const uint32_t lost = is_running(before->phase) ? 0u : before->lost_ticks;
    require(after->lost_ticks == (lost + 1u), "a lost tick is counted");
    require(!is_running(after->phase) && ((after->phase & 1u) == last), "a lost tick is told");
    require(before->saturated_joints == after->saturated_joints, "a lost tick saturates nothing");
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        require(after->joint[j].tick[last ^ 1u].counts == input->counts[j],
                "the latest reading is remembered");
    }
    for (size_t i = 0u; i < state_table.count; ++i) {
        const scalar *const s = &state_table.scalars[i];
        /* The counts are those of the latest reading where a tick was tried and failed after others. */
        const bool is_law = ((uint32_t)s->memory == last) && is_read(s, after->phase) && !s->latest;
        require(!is_law || (scalar_bits(before, s) == scalar_bits(after, s)),
                "an error leaves the law's memory as it was");
    }
}

static void fill_scratch(generator *const g, controller_state *const state)
{
    for (size_t i = 0u; i < state_table.count; ++i) {
        const scalar *const s = &state_table.scalars[i];
        if (!is_read(s, state->phase)) {
            scalar_set_bits(state, s, draw_64(g));
        }
    }
}

static void run_init(rig *const r, reader *const from)
{
    int32_t counts[JOINTS];
    controller_number torque[JOINTS];
    const uint32_t how = read_byte(from);
    generator g = seeded(read_word(from));
    const bool near = (how & 3u) != 0u;
    bool finite = true;
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        counts[j] = tdc_signed((uint32_t)drawn(&g, SCALAR_INT32, near ? WIDE : SPECIAL));
        const uint64_t bits = drawn(&g, number_type, near ? NEAR : SPECIAL);
        (void)memcpy(&torque[j], &bits, sizeof torque[j]);
        finite =
            finite && (!scalar_is_real(number_type) || isfinite(scalar_real(bits, number_type)));
    }
    const uint32_t missing = ((how >> 2u) < 16u) ? (how >> 2u) : 0u;
    const controller_state before = r->state;
    const tdc_status status = controller_init(
        ((missing & 1u) != 0u) ? NULL : &r->config, ((missing & 2u) != 0u) ? NULL : &r->state,
        ((missing & 4u) != 0u) ? NULL : counts, ((missing & 8u) != 0u) ? NULL : torque);
    ++inits_by_status[status_index(status)];
    require((missing == 0u) == (status != TDC_BAD_ARGUMENT), "init sees NULL, and only NULL");
    if (status != TDC_OK) {
        require(status < 0, "init answers TDC_OK or an error");
        require(same_bytes(&before, &r->state, sizeof before), "a failed init changes nothing");
        require((missing != 0u) || r->config_is_good || (status == TDC_BAD_CONFIG),
                "init refuses a bad configuration as such");
        return;
    }
    require(r->config_is_good && finite, "init takes good configurations and finite torques only");
    r->torque_is_known = true;
    (void)memcpy(r->held, torque, sizeof torque);
    (void)memcpy(r->last.counts, counts, sizeof counts);
}

/* Any bits where any are defined; else what the memory might hold: the same number, made smaller. */
static void corrupt(rig *const r, reader *const from)
{
    const scalar *const s = read_scalar(from, &state_table);
    generator g = seeded(read_word(from));
    const uint64_t bits = scalar_bits(&r->state, s);
    if (takes_any_bits) {
        scalar_set_bits(&r->state, s,
                        (read_byte(from) & 1u) ? (bits ^ (UINT64_C(1) << (draw(&g) % 64u)))
                                               : drawn(&g, s->type, SPECIAL));
    } else if (s->memory != MEMORY_COMMON) {
        const int32_t value = tdc_signed((uint32_t)bits);
        const int32_t less = value / tdc_signed(UINT32_C(1) << (draw(&g) % 31u));
        scalar_set_bits(&r->state, s, (uint32_t)(once_in(&g, 2u) ? -less : less));
    } else {
        /* A phase is spoilt elsewhere, and what else all memories share is theirs. */
    }
    r->torque_is_known = false;
}

/* --- Ticks ------------------------------------------------------------------------------------- */

static bool is_finite_number(const controller_number x)
{
    return isfinite((double)x);
}

static bool has_zero_torque(const controller_number torque[JOINTS])
{
    static const controller_number zeros[JOINTS] = {(controller_number)0};
    return same_bytes(torque, zeros, sizeof zeros);
}

/* What the header says of the torque that comes with a status. */
static void judge_torque(const rig *const r, const tdc_status status,
                         const controller_number torque[JOINTS])
{
    if ((status < 0) && (tdc_is_lost(status) == 0u)) {
        require(has_zero_torque(torque), "an error that is no lost tick has zero torque");
        return;
    }
    if (!r->config_is_good) {
        return;
    }
    for (uint32_t j = 0u; (status >= 0) && (j < JOINTS); ++j) {
        const controller_number limit = r->config.joint[j].TORQUE_LIMIT;
        require(is_finite_number(torque[j]), "a good torque is finite");
        require((torque[j] <= limit) && (torque[j] >= -limit), "a good torque is within its limit");
    }
    if ((status < 0) && (r->config.on_error == TDC_ZERO_TORQUE)) {
        require(has_zero_torque(torque), "after an error the torque is zero, if that is asked for");
    }
    if ((status < 0) && (r->config.on_error == TDC_HOLD_TORQUE) && r->torque_is_known) {
        require(same_bytes(torque, r->held, sizeof r->held),
                "after an error the torque is the last good one, if that is asked for");
    }
}

/* One tick: taken twice, once with other bits in scratch. */
static tdc_status run_step(rig *const r, const controller_input *const input, generator *const g)
{
    controller_number torque[JOINTS];
    controller_number again[JOINTS];
    const controller_state before = r->state;
    controller_state other = before;
    (void)memset(torque, 0xA5, sizeof torque);
    (void)memset(again, 0x5A, sizeof again);
    const bool filled = (before.phase >= first_phase) && (before.phase <= last_phase);
    if (filled) {
        fill_scratch(g, &other);
    }
    const tdc_status status = controller_step(&r->config, &r->state, input, torque);
    const tdc_status same = controller_step(&r->config, &other, input, again);
    ++steps_by_status[status_index(status)];

    require(status == same, "the status follows from configuration, state and input");
    require(same_bytes(torque, again, sizeof torque), "the same tick gives the same bits");
    require(keeps(&r->state, &other), "the same tick leaves the same state");
    require(filled || (status == TDC_NOT_INITIALISED), "memory that nobody filled is noticed");
    require(status != TDC_BAD_ARGUMENT, "no argument is NULL");
    judge_torque(r, status, torque);
    if (tdc_is_lost(status) != 0u) {
        judge_loss(&before, &r->state, input);
        if (once_in(g, 2u)) {
            r->last = *input;
        }
    } else if (status < 0) {
        require(same_bytes(&before, &r->state, sizeof before), "other errors change nothing");
    } else {
        (void)memcpy(r->held, torque, sizeof torque);
        r->torque_is_known = r->config_is_good;
        r->last = *input;
    }
    return status;
}

/* One tick with NULL among its arguments. */
static void run_step_without(rig *const r, const uint32_t missing)
{
    controller_number torque[JOINTS];
    const controller_state before = r->state;
    (void)memset(torque, 0xA5, sizeof torque);
    const tdc_status status = controller_step(
        ((missing & 1u) != 0u) ? NULL : &r->config, ((missing & 2u) != 0u) ? NULL : &r->state,
        ((missing & 4u) != 0u) ? NULL : &r->last, ((missing & 8u) != 0u) ? NULL : torque);
    ++steps_by_status[status_index(status)];
    require(status == TDC_BAD_ARGUMENT, "NULL is a bad argument");
    require(((missing & 8u) != 0u) || has_zero_torque(torque), "a bad argument gives zero torque");
    require(same_bytes(&before, &r->state, sizeof before), "a bad argument changes nothing");
}

/* How a burst moves: how fast each joint is, and how far the numbers of the reference go. */
typedef struct {
    bool calm;
    int32_t displacement[JOINTS];
} motion;

static motion draw_motion(generator *const g)
{
    motion m = {.calm = once_in(g, 2u)};
    for (uint32_t j = 0u; j < JOINTS; ++j) {
        m.displacement[j] = tdc_signed(once_in(g, 2u) ? 0u : integer_below(g, 22u));
    }
    return m;
}

/* What is at the edge of a limit, one beyond it, or anywhere within; of either sign. */
static uint32_t within(generator *const g, const int32_t limit)
{
    const uint32_t most = (uint32_t)limit;
    const uint32_t inside = (draw(g) >> (1u + (draw(g) % 31u))) % (most | 1u);
    const uint32_t magnitude = once_in(g, 32u) ? (most + (draw(g) & 1u)) : inside;
    return once_in(g, 2u) ? (0u - magnitude) : magnitude;
}

/* How a joint moves in a tick [count]: evenly, or as its limits allow, or just not. */
static uint32_t displaced(generator *const g, const rig *const r, motion *const m, const uint32_t j)
{
    const controller_joint_config *const gains = &r->config.joint[j];
    const uint32_t last = (uint32_t)m->displacement[j];
    if (m->calm) {
        return last + (once_in(g, 32u) ? 1u : 0u);
    }
    const uint32_t now = once_in(g, 32u) ? within(g, gains->max_displacement)
                                         : (last + within(g, gains->max_displacement_change));
    m->displacement[j] = tdc_signed(now);
    return now;
}

static regime draw_regime(generator *const g, const motion *const m)
{
    static const regime each[16] = {
        NEAR, NEAR, NEAR, NEAR, NEAR, NEAR, NEAR,    NEAR,
        NEAR, NEAR, NEAR, WIDE, WIDE, WIDE, SPECIAL, RAW,
    };
    return (m->calm && !once_in(g, 8u)) ? CALM : each[draw(g) % 16u];
}

static void draw_input(generator *const g, const rig *const r, motion *const m,
                       controller_input *const input)
{
    const regime usual = m->calm ? CALM : NEAR;
    const regime far = draw_regime(g, m);
    for (size_t i = 0u; i < input_table.count; ++i) {
        const scalar *const s = &input_table.scalars[i];
        const bool spoilt = (far == RAW) || ((far > NEAR) && once_in(g, 4u));
        scalar_set_bits(input, s, drawn(g, s->type, spoilt ? far : usual));
    }
    const uint32_t widest = once_in(g, 8u) ? 0u : 14u;
    for (uint32_t j = 0u; (far != RAW) && (j < JOINTS); ++j) {
        const uint32_t counts = (uint32_t)r->last.counts[j] + displaced(g, r, m, j);
        const uint32_t error = integer_below(g, m->calm ? 26u : widest);
        input->counts[j] = tdc_signed(counts);
        input->reference_position_q8[j] = tdc_signed((counts * 256u) + error);
    }
}

/* Ticks one after the other; of memory that nobody filled one is enough. */
static void run_burst(rig *const r, reader *const from)
{
    const uint32_t ticks = 1u + (read_byte(from) % 64u);
    generator g = seeded(read_word(from));
    motion m = draw_motion(&g);
    tdc_status status = TDC_OK;
    for (uint32_t t = 0u; (t < ticks) && ((status >= 0) || (tdc_is_lost(status) != 0u)); ++t) {
        controller_input input;
        (void)memset(&input, 0, sizeof input);
        draw_input(&g, r, &m, &input);
        status = run_step(r, &input, &g);
    }
}

static void run_config(rig *const r, reader *const from)
{
    controller_config config;
    read_config(from, &config);
    const bool taken = is_taken(&config);
    if (taken || takes_any_bits) {
        r->config = config;
        r->config_is_good = taken;
        return;
    }
    /* Nothing is promised of a step with it; that init refuses it, is. */
    rig refused = *r;
    refused.config = config;
    refused.config_is_good = false;
    run_init(&refused, from);
    require(same_bytes(&refused.state, &r->state, sizeof refused.state),
            "a bad configuration starts nothing");
}

static void run(rig *const r, reader *const from)
{
    generator g = seeded((uint32_t)from->left);
    controller_input input;
    switch (read_byte(from) % 12u) {
    case 0u:
    case 1u:
        run_config(r, from);
        break;
    case 2u:
    case 3u:
        run_init(r, from);
        break;
    case 4u: /* one tick, its bytes as they come */
        read_bytes(from, &input, sizeof input);
        (void)run_step(r, &input, &g);
        break;
    case 5u:
        corrupt(r, from);
        break;
    case 6u: { /* memory that nobody filled */
        const uint32_t phase = r->state.phase;
        r->state.phase = read_word(from);
        if ((r->state.phase >= first_phase) && (r->state.phase <= last_phase)) {
            r->state.phase = 0u;
        }
        (void)run_step(r, &r->last, &g);
        r->state.phase = phase;
        break;
    }
    case 7u:
        run_step_without(r, 1u + (read_byte(from) % 15u));
        break;
    default:
        run_burst(r, from);
        break;
    }
}

/* NOLINTNEXTLINE(readability-non-const-parameter): its type is libFuzzer's. */
int LLVMFuzzerInitialize(int *const argc, char ***const argv)
{
    (void)argc;
    (void)argv;
    require(config_table.size == sizeof(controller_config),
            "the description has the config's size");
    require(state_table.size == sizeof(controller_state), "the description has the state's size");
    require(input_table.size == sizeof(controller_input), "the description has the input's size");
    require(status_count <= MOST_STATUSES, "there is room to count every status");
    require(controller_check_config(NULL) == TDC_BAD_ARGUMENT, "check_config sees NULL");
    return atexit(leave_counts);
}

int LLVMFuzzerTestOneInput(const uint8_t *const bytes, const size_t size)
{
    reader from = {bytes, size};
    rig r;
    (void)memset(&r, 0, sizeof r);
    r.config = controller_default_config;
    r.config_is_good = true;
    static const controller_number no_torque[JOINTS] = {(controller_number)0};
    if ((size % 8u) != 0u) {
        r.torque_is_known =
            controller_init(&r.config, &r.state, r.last.counts, no_torque) == TDC_OK;
    }
    while (from.left > 0u) {
        run(&r, &from);
    }
    return 0;
}
/* NOLINTEND(readability-implicit-bool-conversion) */
