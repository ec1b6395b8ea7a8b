/*
 * Included before CasADi's C, which calls the functions of double precision even with
 * casadi_real=float: this is the repair that its users apply.
 */
#ifndef BENCH_POWF_H
#define BENCH_POWF_H

#include <math.h>

#define pow powf
#define fabs fabsf
#define fmin fminf
#define fmax fmaxf

#endif
