#include "flow.h"

#include "tdc_sig_pow.h"

typedef struct {
    double error;
    double rate;
} state;

/* The right-hand side of (17); the powers are the controller's, in its own floats. */
static state derivative(const flow_gains *const gains, const state at)
{
    const tdc_exponent alpha = {gains->alpha_minus_one_q31};
    const tdc_exponent beta = {gains->beta_minus_one_q31};
    const double damper = gains->kd * (double)tdc_sig_pow((float)at.rate, alpha);
    const double spring = gains->kp * (double)tdc_sig_pow((float)at.error, beta);
    const state slope = {at.rate, -damper - spring};
    return slope;
}

static state moved(const state from, const double step, const state slope)
{
    const state to = {from.error + (step * slope.error), from.rate + (step * slope.rate)};
    return to;
}

/* One step of the classical Runge-Kutta method of order four. */
static state stepped(const flow_gains *const gains, const double step, const state from)
{
    const state a = derivative(gains, from);
    const state b = derivative(gains, moved(from, step / 2.0, a));
    const state c = derivative(gains, moved(from, step / 2.0, b));
    const state d = derivative(gains, moved(from, step, c));
    const state mean = {
        (a.error + (2.0 * b.error) + (2.0 * c.error) + d.error) / 6.0,
        (a.rate + (2.0 * b.rate) + (2.0 * c.rate) + d.rate) / 6.0,
    };
    return moved(from, step, mean);
}

void flow_run(const flow_gains *const gains, const double step_s, const int64_t steps,
              const int64_t rows, double *const states)
{
    state now = {states[0], states[1]};
    for (int64_t row = 1; row < rows; row++) {
        for (int64_t k = 0; k < steps; k++) {
            now = stepped(gains, step_s, now);
        }
        states[2 * row] = now.error;
        states[(2 * row) + 1] = now.rate;
    }
}
