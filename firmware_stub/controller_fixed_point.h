#ifndef CONTROLLER_FIXED_POINT_H
#define CONTROLLER_FIXED_POINT_H

/*
 * The numbers of a fixed-point controller, which are integers; included by controller.h. What
 * takes or gives a float here is for a robot that is simulated, and for tests: a tick between
 * encoders and drives needs none of it.
 */

#include <stdint.h>

/** A velocity [2^-F count/tick], an acceleration [2^-F count/tick^2] or a torque [2^-T N m]. */
typedef int32_t controller_number;

/* Fields of the input and of a joint's gains. */
#define REFERENCE_VELOCITY reference_velocity_q
#define REFERENCE_ACCELERATION reference_acceleration_q
#define TORQUE_LIMIT torque_limit_q

/* 2^F and 2^T. */
#define MOTION_UNITS                                                                               \
    ((int32_t)(UINT32_C(1) << (uint32_t)CONTROLLER_PASTE(TDC_, CONTROLLER_UPPER, _FRACTION_BITS)))
#define TORQUE_UNITS                                                                               \
    ((int32_t)(UINT32_C(1) << (uint32_t)CONTROLLER_PASTE(TDC_, CONTROLLER_UPPER, _TORQUE_BITS)))

/** x to nearest, ties away from zero; an integer's ends stand for what is beyond them. */
static inline int32_t controller_rounded(float x)
{
    const float limited = tdc_max(-2147483648.0f, tdc_min(x, 2147483520.0f));
    return (int32_t)(limited + ((limited < 0.0f) ? -0.5f : 0.5f));
}

/** Units of velocity in one rad/s of joint i. */
static inline float controller_velocity_units(uint32_t i)
{
    return controller_counts_per_rad[i] * SAMPLE_TIME_S * (float)MOTION_UNITS;
}

/** The velocity of joint i for the controller. */
static inline controller_number controller_velocity(float velocity_rad_per_s, uint32_t i)
{
    return controller_rounded(velocity_rad_per_s * controller_velocity_units(i));
}

/** The acceleration of joint i for the controller. */
static inline controller_number controller_acceleration(float acceleration_rad_per_s2, uint32_t i)
{
    return controller_velocity(acceleration_rad_per_s2 * SAMPLE_TIME_S, i);
}

/** A torque for the controller. */
static inline controller_number controller_torque(float torque_Nm)
{
    return controller_rounded(torque_Nm * (float)TORQUE_UNITS);
}

/** A torque of the controller [N m]. */
static inline float controller_torque_Nm(controller_number torque)
{
    return (float)torque / (float)TORQUE_UNITS;
}

/** A torque of the controller [mN m], rounded towards zero, for people; without a float. */
static inline int32_t controller_torque_mNm(controller_number torque)
{
    return (int32_t)((INT64_C(1000) * torque) / TORQUE_UNITS);
}

/** Mbar of joint i in the configuration of the specification [kg m^2]. */
static inline float controller_inertia_kgm2(uint32_t i)
{
    /* Units of torque for 2^32 units of acceleration. */
    const float factor = (float)controller_default_config.joint[i].inertia_factor / 4294967296.0f;
    return factor * controller_velocity_units(i) * SAMPLE_TIME_S / (float)TORQUE_UNITS;
}

#endif
