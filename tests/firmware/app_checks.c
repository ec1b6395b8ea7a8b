/*
 * Checks of the application on a fake board. `app_checks` lists them; `app_checks NAME` runs one
 * and returns 0, or prints what did not hold and returns 1.
 */

#include <stdio.h>
#include <string.h>

#include "firmware_stub/app.h"
#include "tests/firmware/fake_hal.h"

#define BRAKE_TICKS 5u

/* A reference that no controller takes, and what it says of it. */
#ifdef TDC_FIXED_H
#define IMPOSSIBLE_VELOCITY INT32_MIN
#define IMPOSSIBLE TDC_OUT_OF_RANGE
#else
#define IMPOSSIBLE_VELOCITY (FLT_MAX * 2.0f)
#define IMPOSSIBLE TDC_NOT_FINITE
#endif

static app application;
static controller_config gains;
static app_config configuration;
static int failures;

static void expect(int holds, const char *what, int line)
{
    if (holds == 0) {
        (void)fprintf(stderr, "line %d: %s does not hold\n", line, what);
        ++failures;
    }
}

#define EXPECT(condition) expect((condition) ? 1 : 0, #condition, __LINE__)

/* --- Steps of a check ------------------------------------------------------------------------ */

static void start(void)
{
    fake_reset();
    gains = controller_default_config;
    configuration = app_default_config;
    configuration.controller = &gains;
    configuration.brake_ticks = BRAKE_TICKS;
    configuration.telemetry_ticks = 1000000u;
    EXPECT(app_init(&application, &configuration) == TDC_OK);
}

static void ticks(uint32_t count)
{
    for (uint32_t k = 0u; k < count; ++k) {
        app_tick(&application);
    }
}

static void ask_and_tick(app_request request)
{
    app_ask(&application, request);
    ticks(1u);
}

static void start_holding(void)
{
    start();
    ask_and_tick(APP_HOLD);
    ticks(BRAKE_TICKS);
    EXPECT(application.mode == APP_HOLDING);
}

/* The controller has taken its first step. */
static void start_running(void)
{
    start_holding();
    ask_and_tick(APP_RUN);
    ticks(1u);
    EXPECT(application.mode == APP_RUNNING);
}

static int same_bits(const void *one, const void *other, size_t size)
{
    return (memcmp(one, other, size) == 0) ? 1 : 0;
}

static int torque_is(const controller_number torque[JOINTS])
{
    return same_bits(fake.torque, torque, sizeof fake.torque);
}

static int torque_is_zero(void)
{
    static const controller_number zeros[JOINTS] = {(controller_number)0};
    return torque_is(zeros);
}

static void move_all(int32_t counts)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.counts[i] = tdc_signed((uint32_t)fake.counts[i] + (uint32_t)counts);
    }
}

/* So far in a tick that the controller takes it for an encoder's failure. */
static void encoder_jumps(void)
{
    fake.counts[JOINTS - 1u] += 1000000;
}

/* --- Disabled and holding -------------------------------------------------------------------- */

static void starts_disabled_with_brakes_and_without_torque(void)
{
    start();
    EXPECT(fake.brakes_engaged);
    EXPECT(!fake.fault_output);
    EXPECT(fake.torque_writes == 1u);
    EXPECT(torque_is_zero());
    ticks(10u);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(fake.brakes_engaged);
    EXPECT(torque_is_zero());
}

static void every_tick_writes_the_torque_once(void)
{
    start();
    fake.torque_writes = 0u;
    ticks(3u);
    ask_and_tick(APP_RUN);
    ticks(20u);
    EXPECT(application.mode == APP_RUNNING);
    encoder_jumps();
    ticks(10u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(fake.torque_writes == 34u);
}

static void holding_opens_the_brakes_on_the_holding_torque(void)
{
    start();
    ask_and_tick(APP_HOLD);
    EXPECT(application.mode == APP_HOLDING);
    EXPECT(!fake.brakes_engaged);
    EXPECT(torque_is(fake.holding_torque));
    const fake_board before = fake;
    fake.holding_torque[0] = controller_torque(50.0f); /* is asked for once only */
    ticks(100u);
    EXPECT(application.mode == APP_HOLDING);
    EXPECT(torque_is(before.torque));
}

static void holding_needs_no_reference(void)
{
    start();
    fake.reference_good = false;
    ask_and_tick(APP_HOLD);
    ticks(100u);
    EXPECT(application.mode == APP_HOLDING);
}

static void disabled_ignores_encoders_and_reference(void)
{
    start();
    fake.encoders_good = false;
    fake.reference_good = false;
    ticks(100u);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(!fake.fault_output);
}

static void disabling_keeps_the_torque_until_the_brakes_hold(void)
{
    start_holding();
    ask_and_tick(APP_DISABLE);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(fake.brakes_engaged);
    EXPECT(torque_is(fake.holding_torque));
    ticks(BRAKE_TICKS - 1u);
    EXPECT(torque_is(fake.holding_torque));
    ticks(1u);
    EXPECT(torque_is_zero());
}

static void brakes_open_again_only_after_they_held(void)
{
    start_holding();
    ask_and_tick(APP_DISABLE);
    ask_and_tick(APP_HOLD);
    ticks(BRAKE_TICKS - 2u);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(fake.brakes_engaged);
    ticks(1u);
    EXPECT(application.mode == APP_HOLDING);
}

/* --- Into RUNNING and out of it -------------------------------------------------------------- */

static void running_waits_for_the_brakes_to_open(void)
{
    start();
    ask_and_tick(APP_RUN);
    EXPECT(application.mode == APP_HOLDING);
    ticks(BRAKE_TICKS - 1u);
    EXPECT(application.mode == APP_HOLDING);
    ticks(1u);
    EXPECT(application.mode == APP_RUNNING);
}

static void entry_is_bumpless_where_the_reference_is_the_position(void)
{
    start_holding();
    ask_and_tick(APP_RUN);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(torque_is(fake.holding_torque));
    ticks(50u);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(torque_is(fake.holding_torque));
}

/* init sees the tick of the switch, and the torque that holds now; the next tick is the first. */
static void init_comes_one_tick_before_the_first_step(void)
{
    start_holding();
    controller_state expected_state;
    controller_number expected[JOINTS];
    EXPECT(controller_init(&gains, &expected_state, fake.counts, fake.holding_torque) == TDC_OK);
    ask_and_tick(APP_RUN);
    EXPECT(application.controller.phase == TDC_PHASE_START);
    move_all(3);
    controller_input input = fake.reference;
    (void)memcpy(input.counts, fake.counts, sizeof input.counts);
    EXPECT(controller_step(&gains, &expected_state, &input, expected) >= TDC_OK);
    EXPECT(!torque_is(expected));
    ticks(1u);
    EXPECT((application.controller.phase - TDC_PHASE_RUNNING) <= 1u);
    EXPECT(application.controller.phase == expected_state.phase);
    EXPECT(torque_is(expected));
}

static void running_waits_for_a_reference(void)
{
    start_holding();
    fake.reference_good = false;
    ask_and_tick(APP_RUN);
    ticks(10u);
    EXPECT(application.mode == APP_HOLDING);
    fake.reference_good = true;
    ticks(1u);
    EXPECT(application.mode == APP_RUNNING);
}

static void running_waits_for_a_near_reference(void)
{
    const int32_t tolerance_q8 = 256 * app_default_config.entry_tolerance_counts;
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        start_holding();
        const int32_t at_robot = fake.reference.reference_position_q8[i];
        fake.reference.reference_position_q8[i] = at_robot + tolerance_q8 + 1;
        ask_and_tick(APP_RUN);
        EXPECT(application.mode == APP_HOLDING);
        fake.reference.reference_position_q8[i] = at_robot - tolerance_q8 - 1;
        ticks(1u);
        EXPECT(application.mode == APP_HOLDING);
        fake.reference.reference_position_q8[i] = at_robot - tolerance_q8;
        ticks(1u);
        EXPECT(application.mode == APP_RUNNING);
    }
}

static void near_is_meant_modulo_the_wrap(void)
{
    start_holding();
    fake_place(8388607); /* 256 times as much is just below 2^31 */
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        fake.reference.reference_position_q8[i] = INT32_MIN; /* a count further */
    }
    ask_and_tick(APP_RUN);
    EXPECT(application.mode == APP_RUNNING);
}

static void running_waits_for_a_reference_at_rest(void)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        start_holding();
        fake.reference.REFERENCE_VELOCITY[i] = controller_velocity(1e-6f, i);
        ask_and_tick(APP_RUN);
        EXPECT(application.mode == APP_HOLDING);
        fake.reference.REFERENCE_VELOCITY[i] = (controller_number)0;
        fake.reference.REFERENCE_ACCELERATION[i] = controller_acceleration(-1e-4f, i);
        ticks(1u);
        EXPECT(application.mode == APP_HOLDING);
        fake.reference.REFERENCE_ACCELERATION[i] = controller_acceleration(-0.0f, i);
        ticks(1u);
        EXPECT(application.mode == APP_RUNNING);
    }
}

static void holding_after_running_keeps_the_last_torque(void)
{
    start_running();
    move_all(2);
    ask_and_tick(APP_HOLD);
    EXPECT(application.mode == APP_HOLDING);
    EXPECT(!torque_is(fake.holding_torque));
    EXPECT(!fake.brakes_engaged);
    const fake_board before = fake;
    move_all(2);
    ticks(10u);
    EXPECT(torque_is(before.torque));
}

static void running_again_starts_from_the_torque_that_holds(void)
{
    start_running();
    move_all(2);
    ask_and_tick(APP_HOLD);
    const fake_board held = fake;
    fake_place(fake.counts[0]);
    ask_and_tick(APP_RUN);
    ticks(20u);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(torque_is(held.torque));
}

static void holding_waits_until_the_reference_rests(void)
{
    start_running();
    fake.reference.REFERENCE_VELOCITY[0] = controller_velocity(0.01f, 0u);
    ask_and_tick(APP_HOLD);
    ticks(5u);
    EXPECT(application.mode == APP_RUNNING);
    fake.reference.REFERENCE_VELOCITY[0] = (controller_number)0;
    ticks(1u);
    EXPECT(application.mode == APP_HOLDING);
}

static void disabling_while_running_engages_the_brakes_at_once(void)
{
    start_running();
    fake.reference.REFERENCE_VELOCITY[0] = controller_velocity(0.01f, 0u);
    const fake_board before = fake;
    ask_and_tick(APP_DISABLE);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(fake.brakes_engaged);
    EXPECT(torque_is(before.torque));
    ticks(BRAKE_TICKS);
    EXPECT(torque_is_zero());
}

static void saturation_is_no_fault(void)
{
    start_running();
    const float limit_Nm = controller_torque_Nm(gains.joint[0].TORQUE_LIMIT);
    fake.reference.REFERENCE_ACCELERATION[0] =
        controller_acceleration(2.0f * limit_Nm / controller_inertia_kgm2(0u), 0u);
    ticks(1u);
    EXPECT(application.status == TDC_SATURATED);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(fake.torque[0] == gains.joint[0].TORQUE_LIMIT);
}

/* --- Faults ---------------------------------------------------------------------------------- */

static void a_controller_error_holds_the_torque_until_the_brakes_do(void)
{
    start_running();
    move_all(2);
    ticks(1u);
    const fake_board before = fake;
    encoder_jumps();
    ticks(app_default_config.lost_tick_limit);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(application.status == TDC_ENCODER_JUMP);
    EXPECT(torque_is(before.torque));
    ticks(1u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_CONTROLLER_FAULT);
    EXPECT(application.status == TDC_ENCODER_JUMP);
    EXPECT(fake.fault_output);
    EXPECT(fake.brakes_engaged);
    EXPECT(!torque_is_zero());
    EXPECT(torque_is(before.torque));
    ticks(BRAKE_TICKS - 1u);
    EXPECT(torque_is(before.torque));
    ticks(1u);
    EXPECT(torque_is_zero());
}

static void a_few_lost_ticks_are_ridden_through(void)
{
    start_running();
    ticks(2u);
    for (uint32_t k = 0u; k < 5u; ++k) {
        /* There, back, and the first reading that is a tick's way from the one before. */
        fake.counts[JOINTS - 1u] += 1000000;
        ticks(1u);
        EXPECT(application.status == TDC_ENCODER_JUMP);
        fake.counts[JOINTS - 1u] -= 1000000;
        ticks(1u);
        EXPECT(application.status == TDC_ENCODER_JUMP);
        ticks(1u);
        EXPECT(application.status == TDC_OK);
        EXPECT(application.mode == APP_RUNNING);
    }
}

static void a_controller_error_takes_the_torque_away_if_so_configured(void)
{
    start_running();
    gains.on_error = TDC_ZERO_TORQUE;
    fake.reference.REFERENCE_VELOCITY[0] = IMPOSSIBLE_VELOCITY;
    ticks(1u);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(torque_is_zero());
    ticks(app_default_config.lost_tick_limit);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.status == IMPOSSIBLE);
    EXPECT(torque_is_zero());
}

static void an_init_error_is_a_fault(void)
{
    start_holding();
    gains.joint[0].TORQUE_LIMIT = (controller_number)-1;
    ask_and_tick(APP_RUN);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_CONTROLLER_FAULT);
    EXPECT(application.status == TDC_BAD_CONFIG);
    EXPECT(torque_is(fake.holding_torque));
}

static void an_encoder_error_is_a_fault(void)
{
    start_holding();
    fake.encoders_good = false;
    ticks(1u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_ENCODER_FAULT);
    EXPECT(torque_is(fake.holding_torque));

    start_running();
    gains.on_error = TDC_ZERO_TORQUE;
    fake.encoders_good = false;
    ticks(1u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_ENCODER_FAULT);
    EXPECT(torque_is_zero());
}

static void a_lost_reference_is_a_fault(void)
{
    start_running();
    fake.reference_good = false;
    ticks(1u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_REFERENCE_FAULT);
    EXPECT(fake.fault_output);
    EXPECT(torque_is(fake.holding_torque));
}

static void only_a_request_to_disable_resets_a_fault(void)
{
    start_running();
    fake.encoders_good = false;
    ticks(1u);
    fake.encoders_good = true;
    ticks(100u);
    EXPECT(application.mode == APP_FAULT);
    ask_and_tick(APP_HOLD);
    ask_and_tick(APP_RUN);
    ticks(100u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(fake.fault_output);
    ask_and_tick(APP_DISABLE);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(!fake.fault_output);
    EXPECT(fake.brakes_engaged);
    EXPECT(application.fault == APP_ENCODER_FAULT);
    ask_and_tick(APP_HOLD);
    EXPECT(application.mode == APP_HOLDING);
    EXPECT(application.fault == APP_NO_FAULT);
}

static void a_quick_reset_still_waits_for_the_brakes(void)
{
    start_running();
    fake.encoders_good = false;
    ticks(1u);
    fake.encoders_good = true;
    ask_and_tick(APP_DISABLE);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(torque_is(fake.holding_torque));
    ask_and_tick(APP_HOLD);
    EXPECT(application.mode == APP_DISABLED);
    ticks(BRAKE_TICKS - 2u);
    EXPECT(application.mode == APP_HOLDING);
}

/* --- Overruns -------------------------------------------------------------------------------- */

static void late_ticks(uint32_t count)
{
    fake.elapsed = FAKE_PERIOD;
    ticks(count);
    fake.elapsed = FAKE_PERIOD - 1u;
}

static void overruns_are_counted_and_become_a_fault(void)
{
    const uint32_t limit = app_default_config.overrun_limit;
    start_running();
    late_ticks(limit - 1u);
    EXPECT(application.overruns == limit - 1u);
    ticks(5u);
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(application.overruns == limit - 1u);
    late_ticks(1u);
    EXPECT(application.mode == APP_FAULT);
    EXPECT(application.fault == APP_OVERRUN_FAULT);
    EXPECT(fake.fault_output);
    EXPECT(fake.brakes_engaged);
    EXPECT(application.slowest_tick == FAKE_PERIOD);
    EXPECT(torque_is(fake.holding_torque));
    ticks(BRAKE_TICKS - 1u);
    EXPECT(torque_is(fake.holding_torque));
    ticks(1u);
    EXPECT(torque_is_zero());
}

static void an_overrun_fault_takes_the_torque_away_if_so_configured(void)
{
    start_holding();
    gains.on_error = TDC_ZERO_TORQUE;
    late_ticks(app_default_config.overrun_limit);
    EXPECT(application.mode == APP_FAULT);
    ticks(1u);
    EXPECT(torque_is_zero());
}

static void rare_overruns_are_forgotten(void)
{
    start_running();
    for (uint32_t k = 0u; k < 10u; ++k) {
        late_ticks(1u);
        ticks(app_default_config.overrun_memory_ticks);
    }
    EXPECT(application.mode == APP_RUNNING);
    EXPECT(application.overruns == 10u);
    late_ticks(app_default_config.overrun_limit - 1u);
    ticks(app_default_config.overrun_memory_ticks - 1u);
    late_ticks(1u);
    EXPECT(application.mode == APP_FAULT);
}

static void overruns_while_disabled_are_no_fault(void)
{
    start();
    late_ticks(50u);
    EXPECT(application.mode == APP_DISABLED);
    EXPECT(application.overruns == 50u);
    ask_and_tick(APP_HOLD);
    late_ticks(app_default_config.overrun_limit - 1u);
    EXPECT(application.mode == APP_HOLDING);
}

/* --- Telemetry and configuration ------------------------------------------------------------- */

static void telemetry_tells_every_change_of_mode(void)
{
    telemetry_record record;
    start();
    ticks(1u);
    EXPECT(app_take_telemetry(&application, &record)); /* tick 0 */
    EXPECT(!app_take_telemetry(&application, &record));
    ticks(2u);
    EXPECT(!app_take_telemetry(&application, &record));
    ask_and_tick(APP_HOLD);
    EXPECT(app_take_telemetry(&application, &record));
    EXPECT(record.tick == 3u);
    EXPECT(record.mode == (uint32_t)APP_HOLDING);
    EXPECT(record.counts[0] == fake.counts[0]);
    EXPECT(record.torque_mNm[0] == 3250);
    late_ticks(app_default_config.overrun_limit);
    EXPECT(app_take_telemetry(&application, &record));
    EXPECT(record.mode == (uint32_t)APP_FAULT);
    EXPECT(record.fault == (uint32_t)APP_OVERRUN_FAULT);
    EXPECT(record.overruns == app_default_config.overrun_limit);
    EXPECT(record.elapsed == FAKE_PERIOD);
    EXPECT(!app_take_telemetry(&application, &record));
}

static void telemetry_comes_every_so_many_ticks(void)
{
    telemetry_record record;
    start();
    configuration.telemetry_ticks = 10u;
    EXPECT(app_init(&application, &configuration) == TDC_OK);
    ticks(35u);
    for (uint32_t k = 0u; k < 4u; ++k) {
        EXPECT(app_take_telemetry(&application, &record));
        EXPECT(record.tick == 10u * k);
    }
    EXPECT(!app_take_telemetry(&application, &record));
}

static void a_full_ring_drops_the_new_records_and_counts_them(void)
{
    telemetry_record record;
    start();
    configuration.telemetry_ticks = 1u;
    EXPECT(app_init(&application, &configuration) == TDC_OK);
    ticks(TELEMETRY_RECORDS + 7u);
    for (uint32_t k = 0u; k < TELEMETRY_RECORDS; ++k) {
        EXPECT(app_take_telemetry(&application, &record));
        EXPECT(record.tick == k);
        EXPECT(record.dropped == 0u);
    }
    EXPECT(!app_take_telemetry(&application, &record));
    ticks(1u);
    EXPECT(app_take_telemetry(&application, &record));
    EXPECT(record.tick == TELEMETRY_RECORDS + 7u);
    EXPECT(record.dropped == 7u);
}

static void the_ring_outlives_the_wrap_of_its_indices(void)
{
    static telemetry_ring ring;
    telemetry_record record = {.tick = 0u};
    ring.written = UINT32_MAX - 1u;
    ring.taken = UINT32_MAX - 1u;
    for (uint32_t k = 0u; k < TELEMETRY_RECORDS + 1u; ++k) {
        record.tick = k;
        telemetry_put(&ring, &record);
    }
    EXPECT(ring.dropped == 1u);
    for (uint32_t k = 0u; k < TELEMETRY_RECORDS; ++k) {
        EXPECT(telemetry_take(&ring, &record));
        EXPECT(record.tick == k);
    }
    EXPECT(!telemetry_take(&ring, &record));
}

static int accepted(void)
{
    return app_init(&application, &configuration) == TDC_OK;
}

static void a_bad_configuration_is_refused(void)
{
    start();
    const app_config good = configuration;
    EXPECT(accepted());
    configuration.overrun_limit = 0u;
    EXPECT(!accepted());
    configuration = good;
    configuration.overrun_memory_ticks = 0u;
    EXPECT(!accepted());
    configuration = good;
    configuration.telemetry_ticks = 0u;
    EXPECT(!accepted());
    configuration = good;
    configuration.entry_tolerance_counts = -1;
    EXPECT(!accepted());
    configuration.entry_tolerance_counts = APP_LARGEST_TOLERANCE_COUNTS + 1;
    EXPECT(!accepted());
    configuration = good;
    configuration.controller = NULL;
    EXPECT(!accepted());
    configuration = good;
    gains.joint[0].TORQUE_LIMIT = (controller_number)0;
    EXPECT(!accepted());
}

/* --- The list -------------------------------------------------------------------------------- */

typedef struct {
    const char *name;
    void (*run)(void);
} check;

#define CHECK(name) {#name, name}

static const check checks[] = {
    CHECK(starts_disabled_with_brakes_and_without_torque),
    CHECK(every_tick_writes_the_torque_once),
    CHECK(holding_opens_the_brakes_on_the_holding_torque),
    CHECK(holding_needs_no_reference),
    CHECK(disabled_ignores_encoders_and_reference),
    CHECK(disabling_keeps_the_torque_until_the_brakes_hold),
    CHECK(brakes_open_again_only_after_they_held),
    CHECK(running_waits_for_the_brakes_to_open),
    CHECK(entry_is_bumpless_where_the_reference_is_the_position),
    CHECK(init_comes_one_tick_before_the_first_step),
    CHECK(running_waits_for_a_reference),
    CHECK(running_waits_for_a_near_reference),
    CHECK(near_is_meant_modulo_the_wrap),
    CHECK(running_waits_for_a_reference_at_rest),
    CHECK(holding_after_running_keeps_the_last_torque),
    CHECK(running_again_starts_from_the_torque_that_holds),
    CHECK(holding_waits_until_the_reference_rests),
    CHECK(disabling_while_running_engages_the_brakes_at_once),
    CHECK(saturation_is_no_fault),
    CHECK(a_controller_error_holds_the_torque_until_the_brakes_do),
    CHECK(a_few_lost_ticks_are_ridden_through),
    CHECK(a_controller_error_takes_the_torque_away_if_so_configured),
    CHECK(an_init_error_is_a_fault),
    CHECK(an_encoder_error_is_a_fault),
    CHECK(a_lost_reference_is_a_fault),
    CHECK(only_a_request_to_disable_resets_a_fault),
    CHECK(a_quick_reset_still_waits_for_the_brakes),
    CHECK(overruns_are_counted_and_become_a_fault),
    CHECK(an_overrun_fault_takes_the_torque_away_if_so_configured),
    CHECK(rare_overruns_are_forgotten),
    CHECK(overruns_while_disabled_are_no_fault),
    CHECK(telemetry_tells_every_change_of_mode),
    CHECK(telemetry_comes_every_so_many_ticks),
    CHECK(a_full_ring_drops_the_new_records_and_counts_them),
    CHECK(the_ring_outlives_the_wrap_of_its_indices),
    CHECK(a_bad_configuration_is_refused),
};

#define CHECKS (sizeof checks / sizeof checks[0])

int main(int count, char **arguments)
{
    for (size_t i = 0u; i < CHECKS; ++i) {
        if (count < 2) {
            (void)printf("%s\n", checks[i].name);
        } else if (strcmp(arguments[1], checks[i].name) == 0) {
            checks[i].run();
            return (failures == 0) ? 0 : 1;
        } else {
            /* Another one. */
        }
    }
    return (count < 2) ? 0 : 2;
}
