#ifndef FAKE_HAL_H
#define FAKE_HAL_H

/* A board without hardware: what the application reads is set here, what it writes is kept here. */

#include "firmware_stub/hal.h"

#define FAKE_PERIOD 1000u

typedef struct {
    /* set by the test */
    bool encoders_good;
    bool reference_good;
    int32_t counts[JOINTS];
    controller_input reference;
    controller_number holding_torque[JOINTS];
    uint32_t elapsed;
    /* written by the application */
    controller_number torque[JOINTS];
    uint32_t torque_writes;
    bool brakes_engaged;
    bool fault_output;
} fake_board;

extern fake_board fake;

/* A robot at rest somewhere, with a reference that rests there too. */
void fake_reset(void);

/* Moves the robot and the reference, at rest, to a position of all joints [count]. */
void fake_place(int32_t counts);

#endif
