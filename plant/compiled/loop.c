/* SPDX-License-Identifier: Apache-2.0 */
#include "loop.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/** The state of motion; the integrator goes to and fro between two copies of it. */
typedef struct {
    double q[2][LOOP_MAX_JOINTS];
    double qd[2][LOOP_MAX_JOINTS];
    double friction[2][LOOP_MAX_JOINTS];
    int now;
} motion;

static void copy(double *to, const double *from, int64_t joints)
{
    (void)memcpy(to, from, (size_t)joints * sizeof *to);
}

/** Counts of an encoder that isn't wrapped yet: floor(counts_per_rad q + phase). */
static double edges(const loop_plant *plant, int64_t joint, double position)
{
    return floor((plant->counts_per_rad[joint] * position) + plant->phase[joint]);
}

/** Whether all joints are where an encoder can be read. */
static bool countable(const loop_plant *plant, const double *q)
{
    for (int64_t i = 0; i < plant->joints; ++i) {
        /* NaN, or beyond the range of int64_t, to which a conversion would be undefined. */
        if (!(fabs(edges(plant, i, q[i])) < 0x1p62)) {
            return false;
        }
    }
    return true;
}

/** Reads all encoders: edges and offset, wrapped to 32 bits. */
static void read_counts(const loop_plant *plant, const double *q, int32_t *counts)
{
    for (int64_t i = 0; i < plant->joints; ++i) {
        const uint64_t exact = (uint64_t)(int64_t)edges(plant, i, q[i]);
        const uint32_t wrapped = (uint32_t)(exact + (uint64_t)plant->offset_counts[i]);
        (void)memcpy(&counts[i], &wrapped, sizeof wrapped);
    }
}

/** A NaN passes, as it does in numpy, and ends the run. */
static double limited(double torque, double limit)
{
    if (torque > limit) {
        return limit;
    }
    return torque < -limit ? -limit : torque;
}

/** Holds a torque; the friction torque of the first substep goes to first, unless it is NULL. */
static void advance(motion *m, const loop_plant *plant, const loop_part *part, const double *torque,
                    double *first)
{
    double unused[LOOP_MAX_JOINTS];
    for (int64_t k = 0; k < part->count; ++k) {
        const int now = m->now;
        const int next = 1 - now;
        const double *arguments[] = {
            m->q[now], m->qd[now], m->friction[now], torque, &part->step_s, plant->numbers,
        };
        double *results[] = {
            m->q[next],
            m->qd[next],
            m->friction[next],
            (k == 0 && first != NULL) ? first : unused,
        };
        (void)loop_substep(arguments, results, NULL, NULL, 0);
        m->now = next;
    }
}

/** One tick, recorded in row k; returns the controller's status. */
static int tick(const loop_plant *plant, motion *m, double *torque_Nm,
                const loop_controller *controller, const loop_record *record, int64_t k)
{
    const int64_t n = plant->joints;
    const int64_t row = k * n;
    double old[LOOP_MAX_JOINTS];
    double commanded[LOOP_MAX_JOINTS];
    double *friction = &record->friction_Nm[row];
    copy(&record->q[row], m->q[m->now], n);
    copy(&record->qd[row], m->qd[m->now], n);
    read_counts(plant, m->q[m->now], &record->counts[row]);
    const int status = loop_controller_step(controller, k, &record->counts[row],
                                            record->torque_commanded, commanded);
    record->status[k] = status;
    if (status < 0) {
        return status;
    }
    copy(old, torque_Nm, n);
    for (int64_t i = 0; i < n; ++i) {
        torque_Nm[i] = limited(commanded[i], plant->torque_limit_Nm[i]);
        record->torque_applied_Nm[row + i] =
            (plant->delay * old[i]) + ((1.0 - plant->delay) * torque_Nm[i]);
    }
    advance(m, plant, &plant->before, old, friction);
    advance(m, plant, &plant->after, torque_Nm, plant->before.count == 0 ? friction : NULL);
    return status;
}

/** Switches the controller on, where that is asked for; returns its status. */
static int reset(const loop_plant *plant, const motion *m, const loop_controller *controller)
{
    int32_t counts[LOOP_MAX_JOINTS];
    if (controller->holding_torque == NULL) {
        return 0;
    }
    read_counts(plant, m->q[m->now], counts);
    return loop_controller_init(controller, counts);
}

static loop_end run(const loop_plant *plant, motion *m, double *torque_Nm,
                    const loop_controller *controller, const loop_record *record, int64_t ticks,
                    int64_t *last_tick, int64_t *status)
{
    *last_tick = -1;
    *status = 0;
    if (!countable(plant, m->q[m->now])) {
        return LOOP_NOT_FINITE;
    }
    *status = reset(plant, m, controller);
    while (*status >= 0) {
        if (*last_tick == ticks - 1) {
            return LOOP_DONE;
        }
        ++*last_tick;
        *status = tick(plant, m, torque_Nm, controller, record, *last_tick);
        if (*status >= 0 && !countable(plant, m->q[m->now])) {
            return LOOP_NOT_FINITE;
        }
    }
    return LOOP_CONTROLLER_ERROR;
}

loop_end loop_run(const loop_plant *plant, loop_state *state, const loop_controller *controller,
                  const loop_record *record, int64_t ticks, int64_t *last_tick, int64_t *status)
{
    const int64_t n = plant->joints;
    motion m = {.now = 0};
    copy(m.q[0], state->q, n);
    copy(m.qd[0], state->qd, n);
    copy(m.friction[0], state->friction, n);
    const loop_end end =
        run(plant, &m, state->torque_Nm, controller, record, ticks, last_tick, status);
    copy(state->q, m.q[m.now], n);
    copy(state->qd, m.qd[m.now], n);
    copy(state->friction, m.friction[m.now], n);
    return end;
}
