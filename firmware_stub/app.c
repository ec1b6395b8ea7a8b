#include "app.h"

#include "hal.h"

/* What the board says at the beginning of a tick. */
typedef struct {
    bool encoders_good;
    bool reference_good;
    controller_input input;
} reading;

static reading read_board(void)
{
    reading now = {.encoders_good = false};
    now.encoders_good = hal_read_encoders(now.input.counts);
    now.reference_good = hal_read_reference(&now.input);
    return now;
}

static void copy_torque(controller_number to[JOINTS], const controller_number from[JOINTS])
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        to[i] = from[i];
    }
}

static void clear_torque(app *self)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        self->torque[i] = (controller_number)0;
    }
}

static app_request asked(const app *self)
{
    return (app_request)__atomic_load_n(&self->request, __ATOMIC_RELAXED);
}

/* --- Changes of mode ------------------------------------------------------------------------- */

static void engage_brakes(app *self)
{
    hal_set_brakes(true);
    self->brake_countdown = self->config.brake_ticks;
}

static void enter_disabled(app *self)
{
    /* Out of FAULT the brakes are engaged already, and their countdown goes on. */
    if (self->mode != APP_FAULT) {
        engage_brakes(self);
    }
    hal_set_fault(false);
    self->mode = APP_DISABLED;
}

static void enter_holding_from_disabled(app *self)
{
    hal_read_holding_torque(self->torque);
    hal_set_brakes(false);
    self->brake_countdown = self->config.brake_ticks;
    self->recent_overruns = 0u;
    self->fault = APP_NO_FAULT;
    self->status = TDC_OK;
    self->mode = APP_HOLDING;
}

/* The torque of this tick is the caller's to leave in self->torque. */
static void enter_fault(app *self, app_fault fault)
{
    hal_set_fault(true);
    engage_brakes(self);
    if (self->config.controller->on_error == TDC_ZERO_TORQUE) {
        self->brake_countdown = 0u;
    }
    self->fault = fault;
    self->mode = APP_FAULT;
}

/*
 * Bumpless: the torque that holds the robot now stays for this tick, and becomes the controller's
 * torque of the last tick, tau(t-L). The first step comes one tick after init, as init asks.
 */
static void enter_running(app *self, const reading *now)
{
    self->status = controller_init(self->config.controller, &self->controller, now->input.counts,
                                   self->torque);
    if (self->status < TDC_OK) {
        enter_fault(self, APP_CONTROLLER_FAULT);
    } else {
        self->lost_ticks = 0u;
        self->mode = APP_RUNNING;
    }
}

static bool reference_rests(const controller_input *input)
{
    bool rests = true;
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        /* Exactly zero: a reference that rests says so. */
        rests = rests && (input->REFERENCE_VELOCITY[i] == (controller_number)0) &&
                (input->REFERENCE_ACCELERATION[i] == (controller_number)0);
    }
    return rests;
}

static bool reference_is_near(const controller_input *input, int32_t tolerance_counts)
{
    const int32_t tolerance_q8 = tolerance_counts * 256;
    bool near = true;
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        /* Modulo 2^32, as both positions wrap. */
        const int32_t error_q8 = tdc_signed((uint32_t)input->reference_position_q8[i] -
                                            ((uint32_t)input->counts[i] * 256u));
        near = near && (error_q8 <= tolerance_q8) && (error_q8 >= -tolerance_q8);
    }
    return near;
}

static bool may_run(const app *self, const reading *now)
{
    /* Against a closed brake the controller would wind up. */
    return (self->brake_countdown == 0u) && now->reference_good && reference_rests(&now->input) &&
           reference_is_near(&now->input, self->config.entry_tolerance_counts);
}

/* --- One tick in each mode: sets the torque and, where due, the next mode --------------------- */

/* With the brakes about to engage, the torque stays until they hold. */
static void release_torque(app *self)
{
    if (self->brake_countdown == 0u) {
        clear_torque(self);
    }
}

static void tick_disabled(app *self)
{
    release_torque(self);
    if ((self->brake_countdown == 0u) && (asked(self) != APP_DISABLE)) {
        enter_holding_from_disabled(self);
    }
}

static void tick_holding(app *self, const reading *now)
{
    if (!now->encoders_good) {
        enter_fault(self, APP_ENCODER_FAULT);
        release_torque(self);
    } else if (asked(self) == APP_DISABLE) {
        enter_disabled(self);
    } else if ((asked(self) == APP_RUN) && may_run(self, now)) {
        enter_running(self, now);
    } else {
        /* The torque that holds the robot stays. */
    }
}

static void run_controller(app *self, const reading *now)
{
    controller_number torque[JOINTS];
    self->status = controller_step(self->config.controller, &self->controller, &now->input, torque);
    /* Also after an error: step has written the torque that goes with it. */
    copy_torque(self->torque, torque);
    self->lost_ticks = (tdc_is_lost(self->status) != 0u) ? (self->lost_ticks + 1u) : 0u;
    const bool goes_on =
        (self->lost_ticks > 0u) && (self->lost_ticks <= self->config.lost_tick_limit);
    if ((self->status < TDC_OK) && !goes_on) {
        enter_fault(self, APP_CONTROLLER_FAULT);
    } else if ((asked(self) == APP_HOLD) && reference_rests(&now->input)) {
        self->mode = APP_HOLDING;
    } else {
        /* On to the next tick. */
    }
}

static void tick_running(app *self, const reading *now)
{
    if (asked(self) == APP_DISABLE) {
        enter_disabled(self);
    } else if (!now->encoders_good) {
        enter_fault(self, APP_ENCODER_FAULT);
        release_torque(self);
    } else if (!now->reference_good) {
        enter_fault(self, APP_REFERENCE_FAULT);
        release_torque(self);
    } else {
        run_controller(self, now);
    }
}

static void tick_fault(app *self)
{
    release_torque(self);
    if (asked(self) == APP_DISABLE) {
        enter_disabled(self);
    }
}

static void tick_mode(app *self, const reading *now)
{
    switch (self->mode) {
    case APP_HOLDING:
        tick_holding(self, now);
        break;
    case APP_RUNNING:
        tick_running(self, now);
        break;
    case APP_FAULT:
        tick_fault(self);
        break;
    case APP_DISABLED:
    default:
        tick_disabled(self);
        break;
    }
}

/* --- Around it ------------------------------------------------------------------------------- */

/*
 * The law takes the time between two ticks for L. A single late tick is a small error; overruns
 * that come faster than they are forgotten are a firmware that does not fit its sample time.
 */
static void watch_overruns(app *self)
{
    const uint32_t elapsed = hal_tick_elapsed();
    if (elapsed > self->slowest_tick) {
        self->slowest_tick = elapsed;
    }
    if (elapsed >= hal_tick_period()) {
        ++self->overruns;
        ++self->recent_overruns;
        self->memory_countdown = self->config.overrun_memory_ticks;
    } else if (self->recent_overruns > 0u) {
        --self->memory_countdown;
        if (self->memory_countdown == 0u) {
            --self->recent_overruns;
            self->memory_countdown = self->config.overrun_memory_ticks;
        }
    } else {
        /* Nothing to forget. */
    }
    const bool driven = (self->mode == APP_HOLDING) || (self->mode == APP_RUNNING);
    if (driven && (self->recent_overruns >= self->config.overrun_limit)) {
        enter_fault(self, APP_OVERRUN_FAULT);
    }
}

static void put_telemetry(app *self, const reading *now)
{
    telemetry_record record = {
        .tick = self->tick,
        .mode = (uint32_t)self->mode,
        .fault = (uint32_t)self->fault,
        .status = (int32_t)self->status,
        .overruns = self->overruns,
        .elapsed = self->slowest_tick,
    };
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        record.counts[i] = now->input.counts[i];
        record.torque_mNm[i] = controller_torque_mNm(self->torque[i]);
    }
    telemetry_put(&self->telemetry, &record);
}

void app_tick(app *self)
{
    const app_mode before = self->mode;
    const reading now = read_board();
    if (self->brake_countdown > 0u) {
        --self->brake_countdown;
    }
    tick_mode(self, &now);
    hal_write_torque(self->torque);
    watch_overruns(self);
    if ((self->mode != before) || (self->tick % self->config.telemetry_ticks == 0u)) {
        put_telemetry(self, &now);
    }
    ++self->tick;
}

const app_config app_default_config = {
    .controller = &controller_default_config,
    .brake_ticks = 100u,
    .overrun_limit = 3u,
    .lost_tick_limit = 3u,
    .overrun_memory_ticks = 1000u,
    .entry_tolerance_counts = 8,
    .telemetry_ticks = 100u,
};

static bool config_is_good(const app_config *config)
{
    return (config->overrun_limit > 0u) && (config->overrun_memory_ticks > 0u) &&
           (config->telemetry_ticks > 0u) && (config->entry_tolerance_counts >= 0) &&
           (config->entry_tolerance_counts <= APP_LARGEST_TOLERANCE_COUNTS) &&
           (controller_check_config(config->controller) == TDC_OK);
}

tdc_status app_init(app *self, const app_config *config)
{
    if (!config_is_good(config)) {
        return TDC_BAD_CONFIG;
    }
    static const app blank = {.mode = APP_DISABLED, .request = APP_DISABLE};
    *self = blank;
    self->config = *config;
    hal_set_brakes(true);
    hal_set_fault(false);
    hal_write_torque(self->torque);
    return TDC_OK;
}

void app_ask(app *self, app_request request)
{
    __atomic_store_n(&self->request, (uint32_t)request, __ATOMIC_RELAXED);
}

bool app_take_telemetry(app *self, telemetry_record *record)
{
    return telemetry_take(&self->telemetry, record);
}
