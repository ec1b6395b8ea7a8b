/* SPDX-License-Identifier: Apache-2.0 */
#include "loop.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/** The state of motion; the integrator goes to and fro between two copies of it. */
typedef struct {
    double q[2][LOOP_MAX_COORDINATES];
    double qd[2][LOOP_MAX_COORDINATES];
    double friction[2][LOOP_MAX_JOINTS];
    int now;
} motion;

/** What the drives are told, and what they give. */
typedef struct {
    double command[LOOP_MAX_JOINTS];
    double torque[LOOP_MAX_JOINTS];
} drives;

/** The encoders' counters: what faults leave behind. */
typedef struct {
    uint64_t lost[LOOP_MAX_JOINTS]; /* pulses that they missed */
    uint64_t last[LOOP_MAX_JOINTS]; /* reading that is shown again where one is stuck */
} counters;

/** All that changes in a run. */
typedef struct {
    motion motion;
    drives drives;
    counters counters;
} world;

static void copy(double *to, const double *from, int64_t elements)
{
    (void)memcpy(to, from, (size_t)elements * sizeof *to);
}

/** Where the encoders' angles stand. */
static const double *seen(const loop_plant *plant, const motion *m)
{
    return &m->q[m->now][plant->read_from];
}

/** Counts of an encoder that isn't wrapped yet: floor(counts_per_rad q + phase + noise). */
static double edges(const loop_plant *plant, int64_t joint, double position, double noise)
{
    return floor(((plant->counts_per_rad[joint] * position) + plant->phase[joint]) + noise);
}

/** Whether all joints are where an encoder can be read. */
static bool countable(const loop_plant *plant, const motion *m)
{
    for (int64_t i = 0; i < plant->joints; ++i) {
        /* NaN, or beyond the range of int64_t, to which a conversion would be undefined. */
        if (!(fabs(edges(plant, i, seen(plant, m)[i], 0.0)) < 0x1p61)) {
            return false;
        }
    }
    return true;
}

/** A counter's value before it is wrapped, modulo 2^64. */
static uint64_t exact(const loop_plant *plant, const motion *m, int64_t joint, double noise)
{
    const double counted = edges(plant, joint, seen(plant, m)[joint], noise);
    return (uint64_t)(int64_t)counted + (uint64_t)plant->offset_counts[joint];
}

static int32_t wrapped(uint64_t count)
{
    const uint32_t low = (uint32_t)count;
    int32_t value;
    (void)memcpy(&value, &low, sizeof value);
    return value;
}

/** Reads all encoders before the first tick. */
static void first_counts(const loop_plant *plant, const loop_script *script, world *w,
                         int64_t ticks, int32_t *counts)
{
    for (int64_t i = 0; i < plant->joints; ++i) {
        const uint64_t shift = ticks > 0 ? (uint64_t)script->shift_counts[i] : 0U;
        w->counters.lost[i] = 0U;
        w->counters.last[i] = exact(plant, &w->motion, i, 0.0) + shift;
        counts[i] = wrapped(w->counters.last[i]);
    }
}

/** Reads all encoders in tick k. */
static void read_counts(const loop_plant *plant, const loop_script *script, world *w, int64_t k,
                        int32_t *counts)
{
    counters *c = &w->counters;
    for (int64_t i = 0; i < plant->joints; ++i) {
        const int64_t at = (k * plant->joints) + i;
        const uint64_t count = (exact(plant, &w->motion, i, script->noise_counts[at]) +
                                (uint64_t)script->shift_counts[at]) -
                               c->lost[i];
        switch ((loop_reading)script->reading[at]) {
        case LOOP_ZERO:
            counts[i] = 0;
            continue;
        case LOOP_LOST:
            c->lost[i] += count - c->last[i];
            break;
        case LOOP_STUCK:
            break;
        case LOOP_COUNTS:
        default:
            c->last[i] = count;
            break;
        }
        counts[i] = wrapped(c->last[i]);
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

/** What a tick is made of, for its parts. */
typedef struct {
    int64_t joints;
    const double *external;
    const double *numbers;
    double *friction; /* of the first substep */
    double *applied;  /* mean torque of the drives */
    bool begun;
} tick_work;

/** Holds a command for a part of the tick. */
static void hold(world *w, tick_work *t, const loop_part *part, const double *command)
{
    motion *m = &w->motion;
    double torque[LOOP_MAX_JOINTS];
    double unused[LOOP_MAX_JOINTS];
    double *given = w->drives.torque;
    if (part->share == 0.0) {
        return;
    }
    for (int64_t i = 0; i < t->joints; ++i) {
        const double mean = command[i] + ((given[i] - command[i]) * part->mean_of_all[i]);
        t->applied[i] = t->applied[i] + (part->share * mean);
    }
    for (int64_t k = 0; k < part->count; ++k) {
        const int now = m->now;
        const int next = 1 - now;
        const double *arguments[] = {
            m->q[now], m->qd[now], m->friction[now], torque, t->external, &part->step_s, t->numbers,
        };
        double *results[] = {
            m->q[next],
            m->qd[next],
            m->friction[next],
            t->begun ? unused : t->friction,
        };
        for (int64_t i = 0; i < t->joints; ++i) {
            const double deviation = given[i] - command[i];
            torque[i] = command[i] + (deviation * part->mean[i]);
            given[i] = command[i] + (deviation * part->decay[i]);
        }
        (void)loop_substep(arguments, results, NULL, NULL, 0);
        m->now = next;
        t->begun = true;
    }
}

/** Whether a run goes on after a status of the controller. */
static int goes_on(const loop_controller *controller, int64_t status)
{
    int64_t i = 0;
    while (i < controller->ends_count && controller->ends[i] != status) {
        ++i;
    }
    return i == controller->ends_count;
}

/** One tick, recorded in row k; returns the controller's status. */
static int tick(const loop_plant *plant, const loop_script *script, world *w,
                const loop_controller *controller, const loop_record *record, int64_t k)
{
    const int64_t n = plant->joints;
    const int64_t row = k * n;
    const loop_timing *timing = &script->timings[script->timing[k]];
    double command[LOOP_MAX_JOINTS];
    int status = 0;
    tick_work work = {
        .joints = n,
        .external = &script->external_Nm[row],
        .numbers = &script->numbers[script->model[k] * script->numbers_count],
        .friction = &record->friction_Nm[row],
        .applied = &record->torque_applied_Nm[row],
    };
    copy(&record->q[k * plant->coordinates], w->motion.q[w->motion.now], plant->coordinates);
    copy(&record->qd[k * plant->coordinates], w->motion.qd[w->motion.now], plant->coordinates);
    hold(w, &work, &timing->late, w->drives.command);
    if (!countable(plant, &w->motion)) {
        return status; /* the motion has become non-finite, which ends the run */
    }
    read_counts(plant, script, w, k, &record->counts[row]);
    copy(command, w->drives.command, n);
    if (script->called[k] != 0U) {
        status = loop_controller_step(controller, k, &record->counts[row], record->torque_commanded,
                                      command);
        record->status[k] = status;
        if (!goes_on(controller, status)) {
            return status;
        }
    }
    hold(w, &work, &timing->delayed, w->drives.command);
    for (int64_t i = 0; i < n; ++i) {
        w->drives.command[i] =
            limited(script->torque_share[row + i] * command[i], script->torque_limit_Nm[row + i]);
    }
    hold(w, &work, &timing->prompt, w->drives.command);
    return status;
}

static loop_end run(const loop_plant *plant, const loop_script *script, world *w,
                    const loop_controller *controller, const loop_record *record, int64_t ticks,
                    int64_t *last_tick, int64_t *status)
{
    int32_t counts[LOOP_MAX_JOINTS];
    *last_tick = -1;
    *status = 0;
    if (!countable(plant, &w->motion)) {
        return LOOP_NOT_FINITE;
    }
    first_counts(plant, script, w, ticks, counts);
    if (controller->holding_torque != NULL) {
        *status = loop_controller_init(controller, counts);
    }
    while (goes_on(controller, *status)) {
        if (*last_tick == ticks - 1) {
            return LOOP_DONE;
        }
        ++*last_tick;
        *status = tick(plant, script, w, controller, record, *last_tick);
        if (goes_on(controller, *status) && !countable(plant, &w->motion)) {
            return LOOP_NOT_FINITE;
        }
    }
    return LOOP_CONTROLLER_ERROR;
}

loop_end loop_run(const loop_plant *plant, const loop_script *script, loop_state *state,
                  const loop_controller *controller, const loop_record *record, int64_t ticks,
                  int64_t *last_tick, int64_t *status)
{
    const int64_t n = plant->joints;
    const int64_t m = plant->coordinates;
    world w = {.motion = {.now = 0}};
    copy(w.motion.q[0], state->q, m);
    copy(w.motion.qd[0], state->qd, m);
    copy(w.motion.friction[0], state->friction, n);
    copy(w.drives.command, state->command_Nm, n);
    copy(w.drives.torque, state->torque_Nm, n);
    const loop_end end = run(plant, script, &w, controller, record, ticks, last_tick, status);
    copy(state->q, w.motion.q[w.motion.now], m);
    copy(state->qd, w.motion.qd[w.motion.now], m);
    copy(state->friction, w.motion.friction[w.motion.now], n);
    copy(state->command_Nm, w.drives.command, n);
    copy(state->torque_Nm, w.drives.torque, n);
    return end;
}
