/*
 * The closed loop in C: a sampled controller drives a robot with friction, drives and encoders.
 * Its meaning is that of plant/closed_loop.py, statement by statement.
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef LOOP_H
#define LOOP_H

#include <stdint.h>

/** The memory of a run is on the stack. */
#define LOOP_MAX_JOINTS 32

/** Equal substeps that fill a part of a tick. */
typedef struct {
    int64_t count;
    double step_s; /* h; not used where the count is 0 */
} loop_part;

/** The plant; arrays have one element a joint, but for the numbers. */
typedef struct {
    int64_t joints;
    double delay;                  /* until a command acts, as a fraction of a tick */
    loop_part before;              /* the old torque acts */
    loop_part after;               /* the new torque acts */
    const double *torque_limit_Nm; /* > 0 */
    const double *counts_per_rad;
    const double *phase; /* where between two edges joint position 0 is [count] */
    const int64_t *offset_counts;
    const double *numbers; /* of bodies and friction, see dynamics.py */
} loop_plant;

/** The state of the plant between two ticks; arrays have one element a joint. */
typedef struct {
    double *q;         /* [rad] */
    double *qd;        /* [rad/s] */
    double *friction;  /* internal state of the friction */
    double *torque_Nm; /* what the drives apply */
} loop_state;

/** What happened; arrays have one row a tick, with one element a joint. */
typedef struct {
    double *q;
    double *qd;
    int32_t *counts;
    void *torque_commanded; /* as the controller answers */
    double *torque_applied_Nm;
    double *friction_Nm;
    int64_t *status; /* one a tick */
} loop_record;

/** The controller's own memory, and what it is given; types are those of its header. */
typedef struct {
    const void *config;
    void *state;
    void *input;                /* one structure a tick, filled but for its counts */
    const void *holding_torque; /* for its init; NULL: it goes on from its state */
} loop_controller;

/** How a run ended. */
typedef enum {
    LOOP_DONE = 0,
    LOOP_CONTROLLER_ERROR = 1, /* the controller's status is negative */
    LOOP_NOT_FINITE = 2,       /* the motion became non-finite */
} loop_end;

/**
 * Runs so many ticks, from the given states on, which are left at those of the end.
 * There is no other memory: runs whose arguments differ may go on at the same time.
 * Writes the number of the last tick that was begun, -1 if it was the controller's init, and the
 * controller's last status. Records of ticks that were not completed are undefined.
 */
loop_end loop_run(const loop_plant *plant, loop_state *state, const loop_controller *controller,
                  const loop_record *record, int64_t ticks, int64_t *last_tick, int64_t *status);

/* Made for each controller, see adapter.py. */

/** Calls the controller's init. */
int loop_controller_init(const loop_controller *controller, const int32_t *counts);
/** Calls its step; the answer goes into row tick of the commanded torque, and in SI units [N m]. */
int loop_controller_step(const loop_controller *controller, int64_t tick, const int32_t *counts,
                         void *commanded, double *torque_Nm);

/* Made for each structure of a plant by CasADi, see dynamics.py. */

/** (q, qd, friction, torque, h, numbers) to (q, qd, friction, friction torque); no overlap. */
int loop_substep(const double **arguments, double **results, long long *iw, double *w, int memory);

#endif
