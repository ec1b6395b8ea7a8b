#ifndef LINEAR_H
#define LINEAR_H

/* The numbers of one joint of the hand-written linear step, from the same specification. */

#include "verification/bench/target/bench.h"

typedef struct {
    float inertia;      /* Mbar [kg m^2] */
    float kd;           /* [1/s] */
    float kp;           /* [1/s^2] for an error in 1/256 count */
    float lambda;       /* [1/s] */
    float velocity;     /* of one count a tick [rad/s] */
    float acceleration; /* of one count a tick a tick [rad/s^2] */
    float torque_limit; /* [N m] */
} linear_joint;

extern const linear_joint linear_joints[JOINTS];
extern const float linear_sample_time; /* L [s] */

#endif
