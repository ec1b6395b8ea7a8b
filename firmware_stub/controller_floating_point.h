#ifndef CONTROLLER_FLOATING_POINT_H
#define CONTROLLER_FLOATING_POINT_H

/* The numbers of a floating-point controller, which are in SI units; included by controller.h. */

#include <stdint.h>

/** A velocity [rad/s], an acceleration [rad/s^2] or a torque [N m]. */
#ifdef TDC64_H
typedef double controller_number;
#else
typedef float controller_number;
#endif

/* Fields of the input and of a joint's gains. */
#define REFERENCE_VELOCITY reference_velocity_rad_per_s
#define REFERENCE_ACCELERATION reference_acceleration_rad_per_s2
#define TORQUE_LIMIT torque_limit_Nm

/** The velocity of joint i for the controller. */
static inline controller_number controller_velocity(float velocity_rad_per_s, uint32_t i)
{
    (void)i;
    return (controller_number)velocity_rad_per_s;
}

/** The acceleration of joint i for the controller. */
static inline controller_number controller_acceleration(float acceleration_rad_per_s2, uint32_t i)
{
    (void)i;
    return (controller_number)acceleration_rad_per_s2;
}

/** A torque for the controller. */
static inline controller_number controller_torque(float torque_Nm)
{
    return (controller_number)torque_Nm;
}

/** A torque of the controller [N m]. */
static inline float controller_torque_Nm(controller_number torque)
{
    return (float)torque;
}

/** A torque of the controller [mN m], rounded towards zero, for people; at most 2^31. */
static inline int32_t controller_torque_mNm(controller_number torque)
{
    const float torque_mNm = (float)torque * 1000.0f;
    return (int32_t)tdc_max(-2147483648.0f, tdc_min(torque_mNm, 2147483520.0f));
}

/** Mbar of joint i in the configuration of the specification [kg m^2]. */
static inline float controller_inertia_kgm2(uint32_t i)
{
    return (float)controller_default_config.joint[i].inertia_kgm2;
}

#endif
