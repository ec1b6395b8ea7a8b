#ifndef SIMULATED_ROBOT_H
#define SIMULATED_ROBOT_H

/*
 * A robot for boards that have none: each joint is an inertia with friction and a constant load,
 * behind an encoder. It is there to see the application at work; the robot that the controller is
 * judged on is in plant/. It computes in float whatever the controller does: no real robot does.
 */

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

void simulated_robot_read_encoders(int32_t counts[JOINTS]);

/** To and fro between two postures, with rests, for ever; for the same tick as the encoders. */
void simulated_robot_reference(controller_input *input);

/** What holds the load. */
void simulated_robot_holding_torque(controller_number torque[JOINTS]);

/** Moves the robot by one sample time. */
void simulated_robot_advance(const controller_number torque[JOINTS], bool braked);

#endif
