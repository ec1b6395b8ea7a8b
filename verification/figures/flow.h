/* The desired error dynamics (17) of one joint, with the powers of a generated controller. */
#ifndef FLOW_H
#define FLOW_H

#include <stdint.h>

typedef struct {
    double kd; /* KD, with |velocity error|^alpha an acceleration [rad/s^2] */
    double kp; /* KP, with |error|^beta an acceleration [rad/s^2] */
    int32_t alpha_minus_one_q31;
    int32_t beta_minus_one_q31;
} flow_gains;

/*
 * Fills rows 1 to rows - 1 of the states, each an error [rad] and its rate [rad/s], from row 0 on:
 * so many Runge-Kutta steps of step_s from one row to the next.
 */
void flow_run(const flow_gains *gains, double step_s, int64_t steps, int64_t rows, double *states);

#endif
