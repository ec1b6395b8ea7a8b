#ifndef CONTROLLER_H
#define CONTROLLER_H

/*
 * Which generated controller this firmware runs, under names that do not change with it. The build
 * defines CONTROLLER=NAME and CONTROLLER_UPPER=NAME in capitals; everything else follows.
 */

#ifndef CONTROLLER
#define CONTROLLER puma3
#define CONTROLLER_UPPER PUMA3
#endif

#define CONTROLLER_PASTE_(a, b, c) a##b##c
#define CONTROLLER_PASTE(a, b, c) CONTROLLER_PASTE_(a, b, c)
#define CONTROLLER_TEXT_(...) #__VA_ARGS__
#define CONTROLLER_TEXT(...) CONTROLLER_TEXT_(__VA_ARGS__)

#include CONTROLLER_TEXT(CONTROLLER_PASTE(tdc_, CONTROLLER, ).h)

#define JOINTS CONTROLLER_PASTE(TDC_, CONTROLLER_UPPER, _JOINTS)
#define SAMPLE_TIME_S ((float)CONTROLLER_PASTE(TDC_, CONTROLLER_UPPER, _SAMPLE_TIME_S))

typedef CONTROLLER_PASTE(tdc_, CONTROLLER, _config) controller_config;
typedef CONTROLLER_PASTE(tdc_, CONTROLLER, _state) controller_state;
typedef CONTROLLER_PASTE(tdc_, CONTROLLER, _joint_config) controller_joint_config;
typedef CONTROLLER_PASTE(tdc_, CONTROLLER, _joint_state) controller_joint_state;
typedef CONTROLLER_PASTE(tdc_, CONTROLLER, _input) controller_input;

#define controller_default_config CONTROLLER_PASTE(tdc_, CONTROLLER, _default_config)
#define controller_counts_per_rad CONTROLLER_PASTE(tdc_, CONTROLLER, _counts_per_rad)
#define controller_check_config CONTROLLER_PASTE(tdc_, CONTROLLER, _check_config)
#define controller_init CONTROLLER_PASTE(tdc_, CONTROLLER, _init)
#define controller_step CONTROLLER_PASTE(tdc_, CONTROLLER, _step)

/*
 * The numbers of the interface: controller_number, and what makes them of physical units. A
 * fixed-point controller has included tdc_fixed.h above, so that no build has to say which it is.
 */
#ifdef TDC_FIXED_H
#include "controller_fixed_point.h"
#else
#include "controller_floating_point.h"
#endif

#endif
