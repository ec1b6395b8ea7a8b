/*
 * Steps a generated controller against an axis with friction, and prints a row for each tick.
 *
 * Everything that a user of the C has to do is in main: fill an input, call step, apply the torque.
 */
#include "tdc_axis.h"

#include <math.h>
#include <stdio.h>

#define TICKS 2400u
#define SUBSTEPS 20u

static const double pi = 3.14159265358979323846;

/* The axis: an inertia with Coulomb friction, which the controller knows nothing of. */
typedef struct {
    double position_rad;
    double velocity_rad_per_s;
} axis;

static void move(axis *const a, const double torque_Nm, const double duration_s)
{
    const double inertia_kgm2 = 0.5;
    const double friction_Nm = 6.0;
    const double h = duration_s / SUBSTEPS;
    for (unsigned i = 0u; i < SUBSTEPS; ++i) {
        /* Friction stops a motion, and does not turn it round. */
        const double free = a->velocity_rad_per_s + (h * torque_Nm / inertia_kgm2);
        const double brake = h * friction_Nm / inertia_kgm2;
        a->velocity_rad_per_s = (fabs(free) <= brake) ? 0.0 : free - copysign(brake, free);
        a->position_rad += h * a->velocity_rad_per_s;
    }
}

/* The reference: 20 degrees to and fro, 1 s each way, at rest in between. */
static void reference(const double t, double *const q, double *const qd, double *const qdd)
{
    const double back = (t < 1.2) ? 0.0 : 1.0;
    const double u = fmin(fmax(t - (1.2 * back), 0.0), 1.0);
    const double amplitude = (back > 0.0) ? -20.0 * pi / 180.0 : 20.0 * pi / 180.0;
    const double start = (back > 0.0) ? 20.0 * pi / 180.0 : 0.0;
    *q = start + (amplitude * u * u * u * (10.0 + (u * (-15.0 + (6.0 * u)))));
    *qd = amplitude * 30.0 * u * u * (1.0 - u) * (1.0 - u);
    *qdd = amplitude * 60.0 * u * (1.0 - u) * (1.0 - (2.0 * u));
}

int main(void)
{
    static tdc_axis_state state;
    const int32_t start[TDC_AXIS_JOINTS] = {0};
    const float holding_torque_Nm[TDC_AXIS_JOINTS] = {0.0f};
    axis a = {0.0, 0.0};
    tdc_status status = tdc_axis_init(&tdc_axis_default_config, &state, start, holding_torque_Nm);

    puts("time_s,counts,reference_q8,velocity_rad_per_s,acceleration_rad_per_s2,torque_Nm,status");
    for (unsigned k = 0u; (k < TICKS) && (status >= TDC_OK); ++k) {
        double q;
        double qd;
        double qdd;
        float torque_Nm[TDC_AXIS_JOINTS];
        tdc_axis_input input;
        const double counts_per_rad = (double)tdc_axis_counts_per_rad[0];
        const double t = (double)k * (double)TDC_AXIS_SAMPLE_TIME_S;

        reference(t, &q, &qd, &qdd);
        input.counts[0] = (int32_t)floor(a.position_rad * counts_per_rad);
        input.reference_position_q8[0] = (int32_t)lround(q * counts_per_rad * 256.0);
        input.reference_velocity_rad_per_s[0] = (float)qd;
        input.reference_acceleration_rad_per_s2[0] = (float)qdd;
        status = tdc_axis_step(&tdc_axis_default_config, &state, &input, torque_Nm);
        move(&a, (double)torque_Nm[0], (double)TDC_AXIS_SAMPLE_TIME_S);

        printf("%.3f,%ld,%ld,%.9g,%.9g,%.9g,%d\n", t, (long)input.counts[0],
               (long)input.reference_position_q8[0], (double)input.reference_velocity_rad_per_s[0],
               (double)input.reference_acceleration_rad_per_s2[0], (double)torque_Nm[0],
               (int)status);
    }
    return (status >= TDC_OK) ? 0 : 1;
}
