#ifndef APP_H
#define APP_H

/*
 * The application: one tick of it reads the encoders and the reference, runs the controller and
 * drives the motors. It is portable C that knows the board by hal.h only.
 *
 *                  hold, run                  run, and the reference
 *                                             rests where the robot is
 *     DISABLED ----------------> HOLDING --------------------------------> RUNNING
 *        ^   ^                   |  |   ^                                  |  |  |
 *        |   +----- disable -----+  |   +--- hold, once the reference -----+  |  |
 *        |   +--------------------- | -------- disable   rests ---------------+  |
 *        |                          v                                            |
 *        +------- disable ------- FAULT <----------------------------------------+
 *
 * DISABLED  brakes engaged, torque zero
 * HOLDING   brakes open, a constant torque: what holds the robot, or the controller's last
 * RUNNING   the controller follows the reference
 * FAULT     fault output on, brakes engaged; left by a request to disable and by nothing else
 *
 * Whoever engages the brakes keeps the torque until they hold (brake_ticks), then takes it away;
 * with on_error = TDC_ZERO_TORQUE a fault takes it away at once.
 */

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "telemetry.h"

typedef enum { APP_DISABLED, APP_HOLDING, APP_RUNNING, APP_FAULT } app_mode;

typedef enum { APP_DISABLE, APP_HOLD, APP_RUN } app_request;

typedef enum {
    APP_NO_FAULT,
    APP_CONTROLLER_FAULT, /* init or step reported an error: see the status */
    APP_OVERRUN_FAULT,    /* ticks took longer than the sample time */
    APP_ENCODER_FAULT,    /* an encoder reported an error */
    APP_REFERENCE_FAULT,  /* no reference while running */
} app_fault;

/* Far more than any robot's encoder makes of a tolerance; 256 times as much fits an int32_t. */
#define APP_LARGEST_TOLERANCE_COUNTS 4194304

/** What the firmware engineer sets. */
typedef struct {
    /** gains of the controller, and the torque after an error; the caller's own, and it stays */
    const controller_config *controller;
    /** how long the brakes take to open or to engage [ticks] */
    uint32_t brake_ticks;
    /** so many overruns are a fault; 1 or greater */
    uint32_t overrun_limit;
    /** so many lost ticks in a row the controller may have; 0 or greater */
    uint32_t lost_tick_limit;
    /** one overrun is forgotten after so many good ticks; 1 or greater */
    uint32_t overrun_memory_ticks;
    /** how far from the robot the reference may be at the switch to RUNNING [count];
     *  0 to APP_LARGEST_TOLERANCE_COUNTS */
    int32_t entry_tolerance_counts;
    /** every so many ticks, and at every change of mode, a telemetry record; 1 or greater */
    uint32_t telemetry_ticks;
} app_config;

/** The configuration that the stub starts with. */
extern const app_config app_default_config;

/** The application's memory; only request and telemetry are touched outside of the tick. */
typedef struct {
    app_config config;
    controller_state controller;
    controller_number torque[JOINTS]; /* as written to the drives */
    app_mode mode;
    app_fault fault;   /* the last one; stays readable until the next start */
    tdc_status status; /* of the controller's last call */
    uint32_t tick;
    uint32_t brake_countdown; /* ticks until the brakes have opened or engaged */
    uint32_t lost_ticks;      /* of the controller, in a row */
    uint32_t overruns;        /* all of them */
    uint32_t recent_overruns; /* those not yet forgotten */
    uint32_t memory_countdown;
    uint32_t slowest_tick; /* most timer counts that a tick took */
    uint32_t request;      /* an app_request, written by app_ask */
    telemetry_ring telemetry;
} app;

/**
 * Prepares the application in the mode DISABLED; before the first tick.
 * Returns TDC_OK, or TDC_BAD_CONFIG where a field of either configuration breaks its rule: then
 * nothing is prepared, and the ticks must not be started.
 */
tdc_status app_init(app *self, const app_config *config);

/** One tick; the timer's interrupt calls it every SAMPLE_TIME_S. */
void app_tick(app *self);

/** Asks for a mode; from the main loop, at any time. The tick takes it up when it may. */
void app_ask(app *self, app_request request);

/** Takes the oldest telemetry record, from the main loop; false if there is none. */
bool app_take_telemetry(app *self, telemetry_record *record);

#endif
