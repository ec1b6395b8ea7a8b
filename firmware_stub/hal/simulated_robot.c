#include "hal/simulated_robot.h"

/* Of the torque limit. */
#define LOAD 0.2f
/* Torque of the friction for a unit of inertia and velocity [1/s]. */
#define FRICTION 5.0f
/* Times Mbar: the law is stable while Mbar is less than twice the true inertia. */
#define INERTIA 1.5f

/* The reference moves in MOVE_TICKS, rests as long, moves back, rests. */
#define MOVE_TICKS 1000u
#define STROKE_RAD 0.25f

typedef struct {
    int32_t position_q8; /* [count/256], wraps */
    float velocity_rad_per_s;
} joint;

static joint joints[JOINTS];
static uint32_t reference_tick;

static int32_t q8_of(float angle_rad, uint32_t i)
{
    const float q8 = angle_rad * (float)controller_counts_per_rad[i] * 256.0f;
    return (int32_t)(q8 + ((q8 < 0.0f) ? -0.5f : 0.5f));
}

void simulated_robot_read_encoders(int32_t counts[JOINTS])
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        const int32_t position_q8 = joints[i].position_q8;
        /* Rounds down, as an encoder does, without shifting a negative number. */
        counts[i] = (position_q8 >= 0) ? (position_q8 / 256) : -((255 - position_q8) / 256);
    }
}

typedef struct {
    float position;     /* of the stroke */
    float velocity;     /* strokes a second */
    float acceleration; /* strokes a second a second */
} motion;

/* 10 r^3 - 15 r^4 + 6 r^5 and its derivatives: at rest at both ends. */
static motion quintic(uint32_t tick)
{
    const float rate = 1.0f / ((float)MOVE_TICKS * SAMPLE_TIME_S);
    const float r = (float)tick / (float)MOVE_TICKS;
    const float left = 1.0f - r;
    const motion at = {
        .position = r * r * r * (10.0f - (15.0f * r) + (6.0f * r * r)),
        .velocity = 30.0f * r * r * left * left * rate,
        .acceleration = 60.0f * r * left * (1.0f - (2.0f * r)) * rate * rate,
    };
    return at;
}

static motion reference_motion(uint32_t tick)
{
    const uint32_t phase = tick / MOVE_TICKS % 4u;
    const bool rests = (phase % 2u) == 0u;
    const bool back = phase >= 2u;
    motion at = {.position = 0.0f};
    if (!rests) {
        at = quintic(tick % MOVE_TICKS);
    }
    if (back) {
        at.position = 1.0f - at.position;
        at.velocity = -at.velocity;
        at.acceleration = -at.acceleration;
    }
    return at;
}

void simulated_robot_reference(controller_input *input)
{
    const motion at = reference_motion(reference_tick);
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        input->reference_position_q8[i] = q8_of(STROKE_RAD * at.position, i);
        input->REFERENCE_VELOCITY[i] = controller_velocity(STROKE_RAD * at.velocity, i);
        input->REFERENCE_ACCELERATION[i] = controller_acceleration(STROKE_RAD * at.acceleration, i);
    }
    ++reference_tick;
}

static float load_Nm(uint32_t i)
{
    return LOAD * controller_torque_Nm(controller_default_config.joint[i].TORQUE_LIMIT);
}

void simulated_robot_holding_torque(controller_number torque[JOINTS])
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        torque[i] = controller_torque(load_Nm(i));
    }
}

void simulated_robot_advance(const controller_number torque[JOINTS], bool braked)
{
    for (uint32_t i = 0u; i < JOINTS; ++i) {
        const float inertia_kgm2 = INERTIA * controller_inertia_kgm2(i);
        joint *const moved = &joints[i];
        const float acceleration = ((controller_torque_Nm(torque[i]) - load_Nm(i)) / inertia_kgm2) -
                                   (FRICTION * moved->velocity_rad_per_s);
        moved->velocity_rad_per_s += acceleration * SAMPLE_TIME_S;
        if (braked) {
            moved->velocity_rad_per_s = 0.0f;
        }
        const int32_t change_q8 = q8_of(moved->velocity_rad_per_s * SAMPLE_TIME_S, i);
        moved->position_q8 = tdc_signed((uint32_t)moved->position_q8 + (uint32_t)change_q8);
    }
}
