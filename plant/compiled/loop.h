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
/** Links, and motors where joints are flexible. */
#define LOOP_MAX_COORDINATES (2 * LOOP_MAX_JOINTS)

/** Equal substeps that fill a part of a tick, and the current loop's lag over them. */
typedef struct {
    double share; /* of the tick; nothing else is used where it is 0 */
    int64_t count;
    double step_s;             /* h */
    const double *decay;       /* one element a joint, like the following; see plant/drive.py */
    const double *mean;        /* over a substep */
    const double *mean_of_all; /* over all of them */
} loop_part;

/** When things happen in a tick. */
typedef struct {
    loop_part late;    /* until the encoders are read and the controller is called */
    loop_part delayed; /* until the new command acts */
    loop_part prompt;  /* the new command acts */
} loop_timing;

/** The plant; arrays have one element a joint. */
typedef struct {
    int64_t joints;
    int64_t coordinates; /* joints, or twice as many: all links, then all motors */
    int64_t read_from;   /* the first coordinate that the encoders see */
    const double *counts_per_rad;
    const double *phase; /* where between two edges joint position 0 is [count] */
    const int64_t *offset_counts;
} loop_plant;

/** What a reading of an encoder gives, see plant/script.py. */
typedef enum {
    LOOP_COUNTS = 0, /* the counter's value */
    LOOP_ZERO = 1,   /* 0 */
    LOOP_STUCK = 2,  /* the last value again, while the counter goes on */
    LOOP_LOST = 3,   /* the last value again: the counter gets no pulses */
} loop_reading;

/** What happens; arrays have one row a tick, those marked with one element a joint. */
typedef struct {
    const loop_timing *timings;
    const int64_t *timing;         /* index into them */
    const uint8_t *called;         /* whether the controller is called */
    const uint8_t *reading;        /* a loop_reading; by joint */
    const double *noise_counts;    /* by joint */
    const int64_t *shift_counts;   /* by joint */
    const double *torque_limit_Nm; /* by joint */
    const double *external_Nm;     /* by joint */
    const double *numbers;         /* of bodies, friction and springs: rows, see dynamics.py */
    int64_t numbers_count;         /* elements a row */
    const int64_t *model;          /* row of the numbers */
} loop_script;

/** The state of the plant between two ticks. */
typedef struct {
    double *q;          /* [rad], one element a coordinate */
    double *qd;         /* [rad/s], one element a coordinate */
    double *friction;   /* internal state of the friction, one element a joint */
    double *command_Nm; /* what the drives are told, one element a joint */
    double *torque_Nm;  /* what they give, one element a joint */
} loop_state;

/** What happened; arrays have one row a tick, with one element a joint. */
typedef struct {
    double *q;  /* one element a coordinate */
    double *qd; /* one element a coordinate */
    int32_t *counts;
    void *torque_commanded; /* as the controller answers; left as it is without a call */
    double *torque_applied_Nm;
    double *friction_Nm;
    int64_t *status; /* one a tick; left as it is without a call */
} loop_record;

/** The controller's own memory, and what it is given; types are those of its header. */
typedef struct {
    const void *config;
    void *state;
    void *input;                /* one structure a tick, filled but for its counts */
    const void *holding_torque; /* for its init; NULL: it goes on from its state */
    const int64_t *ends;        /* statuses that end the run */
    int64_t ends_count;
} loop_controller;

/** How a run ended. */
typedef enum {
    LOOP_DONE = 0,
    LOOP_CONTROLLER_ERROR = 1, /* the controller's status is one that ends the run */
    LOOP_NOT_FINITE = 2,       /* the motion became non-finite */
} loop_end;

/**
 * Runs so many ticks, from the given states on, which are left at those of the end.
 * There is no other memory: runs whose arguments differ may go on at the same time.
 * Writes the number of the last tick that was begun, -1 if it was the controller's init, and the
 * controller's last status. Records of ticks that were not completed are undefined.
 */
loop_end loop_run(const loop_plant *plant, const loop_script *script, loop_state *state,
                  const loop_controller *controller, const loop_record *record, int64_t ticks,
                  int64_t *last_tick, int64_t *status);

/* Made for each controller, see adapter.py. */

/** Calls the controller's init. */
int loop_controller_init(const loop_controller *controller, const int32_t *counts);
/** Calls its step; the answer goes into row tick of the commanded torque, and in SI units [N m]. */
int loop_controller_step(const loop_controller *controller, int64_t tick, const int32_t *counts,
                         void *commanded, double *torque_Nm);

/* Made for each structure of a plant by CasADi, see dynamics.py. */

/**
 * (q, qd, friction, torque, external torque, h, numbers) to (q, qd, friction, friction torque);
 * no overlap.
 */
int loop_substep(const double **arguments, double **results, long long *iw, double *w, int memory);

#endif
