/*
 * Start-up and main loop: the tick does the work; here is time for a console.
 *
 *   d  disable    h  hold    r  run    s  stack used so far [byte]
 *   any other key goes to hal_provoke
 */

#include "app.h"
#include "cores/core.h"
#include "hal.h"
#include "report.h"
#include "runtime/stack.h"

static app application;

void core_tick(void)
{
    app_tick(&application);
}

void core_panic(void)
{
    hal_emergency_stop();
    for (;;) {
    }
}

static void obey(char key)
{
    switch (key) {
    case 'd':
        app_ask(&application, APP_DISABLE);
        break;
    case 'h':
        app_ask(&application, APP_HOLD);
        break;
    case 'r':
        app_ask(&application, APP_RUN);
        break;
    case 's':
        report_number("# stack", stack_used());
        break;
    default:
        hal_provoke(key);
        break;
    }
}

static void serve_console(void)
{
    telemetry_record record;
    while (app_take_telemetry(&application, &record)) {
        report_record(&record);
    }
    const int key = hal_console_read();
    if (key >= 0) {
        obey((char)key);
    }
}

int main(void)
{
    stack_paint();
    hal_init();
    if (app_init(&application, &app_default_config) != TDC_OK) {
        core_panic();
    }
    report_header();
    hal_start_ticks();
    for (;;) {
        serve_console();
        hal_idle();
    }
}
